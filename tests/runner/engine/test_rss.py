"""RSS distances against numbers worked out by hand from the definitions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from runner.engine.motion.rss import (
    PARAMETERS,
    lateral_distance,
    longitudinal_distance,
    parameter_set,
)
from schemas.common.errors import UsageError

AD, R157 = PARAMETERS["ad-rss"], PARAMETERS["r157"]
speeds = st.floats(0.0, 60.0)


@pytest.mark.parametrize(
    ("rear", "front", "p", "expected"),
    [
        # 30·1 + 3.5/2 + 33.5²/8 − 20²/16 = 30 + 1.75 + 140.28125 − 25
        (30.0, 20.0, AD, 147.03125),
        # 1.75 + 3.5²/8
        (0.0, 0.0, AD, 3.28125),
        # both brake: 10 + 1.75 + 13.5²/8 + 10²/16
        (10.0, -10.0, AD, 40.78125),
        # 30·0.75 + 3·0.75²/2 + 32.25²/12 − 20²/12 = 22.5 + 0.84375 + 86.671875 − 33.333…
        (30.0, 20.0, R157, 76.68229166666667),
    ],
)
def test_longitudinal(rear: float, front: float, p: object, expected: float) -> None:
    assert longitudinal_distance(rear, front, p) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("left", "right", "expected"),
    [
        # left: 0.2 m/s after 1 s: 0.1 m, then 0.04/1.6 = 0.025 m; right: −0.4
        # m/s after 2 s: −0.4 m, then −0.1 m; μ = 0.1
        (0.0, 0.0, 0.1 + 0.1 + 0.025 + 0.4 + 0.1),
        # left drives right at 1 m/s: 1.1 + 1.44/1.6
        (1.0, 0.0, 0.1 + 1.1 + 0.9 + 0.4 + 0.1),
        # left drives left at 1 m/s, and does not come back within its response
        # time: −0.9 + 0.4 + 0.1 is cut off at 0
        (-1.0, 0.0, 0.1),
    ],
)
def test_lateral(left: float, right: float, expected: float) -> None:
    assert lateral_distance(left, right, AD.response, AD.response_other, AD) == pytest.approx(
        expected
    )


@given(speeds, speeds, speeds)
def test_a_faster_rear_or_slower_front_needs_more(rear: float, front: float, more: float) -> None:
    for p in PARAMETERS.values():
        base = longitudinal_distance(rear, front, p)
        assert longitudinal_distance(rear + more, front, p) >= base
        assert longitudinal_distance(rear, front - more, p) >= base


@given(st.floats(-5, 5), st.floats(-5, 5))
def test_lateral_distance_is_mirror_symmetric(left: float, right: float) -> None:
    mirrored = lateral_distance(-right, -left, AD.response_other, AD.response, AD)
    assert lateral_distance(left, right, AD.response, AD.response_other, AD) == pytest.approx(
        mirrored
    )


def test_arrays_give_what_numbers_give() -> None:
    rear, front = np.array([30.0, 0.0]), np.array([20.0, 0.0])
    assert longitudinal_distance(rear, front, AD) == pytest.approx([147.03125, 3.28125])
    lateral = lateral_distance(np.array([0.0, 1.0, -1.0]), np.zeros(3), 1.0, 2.0, AD)
    assert lateral == pytest.approx([0.725, 2.6, 0.1])


def test_parameter_sets_have_names() -> None:
    assert parameter_set("ad-rss") is AD
    with pytest.raises(UsageError, match="'ad_rss'; there are ad-rss, r157"):
        parameter_set("ad_rss")
