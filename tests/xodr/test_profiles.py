"""Piecewise cubics: values, slopes, sums."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from xodr.model.geometry import ZERO, Cubic, Profile, exceeding

coefficient = st.floats(-3, 3)
pieces = st.lists(
    st.builds(Cubic, st.floats(0, 50), coefficient, coefficient, coefficient, coefficient),
    min_size=1,
    max_size=4,
    unique_by=lambda p: p.start,
)
profiles = pieces.map(lambda found: Profile(sorted(found)))


def test_each_record_holds_until_the_next() -> None:
    profile = Profile([Cubic(0.0, 1.0), Cubic(10.0, 2.0, 0.5)])
    assert [profile(s) for s in (0.0, 9.999, 10.0, 14.0)] == [1.0, 1.0, 2.0, 4.0]
    assert profile.slope(5.0) == 0.0
    assert profile.slope(12.0) == 0.5


def test_a_constant_profile_says_so() -> None:
    assert ZERO.constant == 0.0
    assert Profile([Cubic(0.0, 2.0), Cubic(5.0, 2.0)]).constant == 2.0
    assert Profile([Cubic(0.0, 2.0), Cubic(5.0, 2.1)]).constant is None


@given(profiles, profiles, st.floats(-1, 1), st.floats(0, 60))
def test_a_sum_has_the_sum_of_the_values(
    one: Profile, other: Profile, factor: float, s: float
) -> None:
    s = max(s, one.starts[0], other.starts[0])
    expected = one(s) + factor * other(s)
    assert one.plus(other, factor)(s) == pytest.approx(expected, rel=1e-9, abs=1e-6)


@given(profiles, st.floats(0, 20), st.floats(0, 1))
def test_a_part_has_the_same_values(profile: Profile, start: float, share: float) -> None:
    start = max(start, profile.starts[0])
    s = start + share * 20.0
    assert profile.within(start, start + 20.0)(min(s, start + 19.999)) == pytest.approx(
        profile(min(s, start + 19.999)), abs=1e-6
    )


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        ([Cubic(0.0, 3.0)], (-math.inf, math.inf)),
        ([Cubic(0.0, 0.0)], (math.inf, -math.inf)),
        ([Cubic(0.0, 3.0, -0.1)], (-math.inf, 30.0)),
        ([Cubic(0.0, 0.0), Cubic(40.0, 0.0, 0.1)], (40.0, math.inf)),
        (
            [Cubic(0.0, 0.0), Cubic(10.0, 0.0, 0.1), Cubic(30.0, 2.0, -0.2), Cubic(60.0, -1.0)],
            (10.0, 40.0),
        ),
    ],
)
def test_where_a_profile_exceeds_a_level(found: list[Cubic], expected: tuple[float, float]) -> None:
    assert exceeding(Profile(found), 1e-6, 0.0, 100.0) == pytest.approx(expected, abs=1e-4)
