"""Plans of speeds over time: targets in their times, within the limits of acceleration and jerk."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from runner.engine.motion.speed_plans import ProfileEntry, ProfilePiece, plan
from runner.engine.participants.declaration import Performance

LIMITS = Performance(50.0, 5.0, 10.0, 4.0, 1.0)


def planned(
    speed: float, entries: list[tuple[float | None, float]], limits: Performance = LIMITS
) -> list[ProfilePiece]:
    return plan(speed, [ProfileEntry(*entry) for entry in entries], limits, True)


def at(pieces: list[ProfilePiece], time: float) -> float:
    return [piece for piece in pieces if piece.time <= time + 1e-9][-1].at(time)


@pytest.mark.parametrize(("start", "target"), [(8.0, 15.0), (15.0, 8.0), (2.0, -3.0), (0.0, 5.0)])
def test_a_target_is_reached_in_the_time_asked_for(start: float, target: float) -> None:
    pieces = planned(start, [(6.0, target)])
    assert pieces[-1].time == pytest.approx(6.0)
    assert (pieces[-1].speed, pieces[-1].acceleration) == (target, 0.0)
    assert at(pieces, 5.9) != pytest.approx(target, abs=1e-4)


def test_each_target_of_a_possible_profile_is_reached_in_its_time() -> None:
    pieces = planned(8.0, [(5.0, 15.0), (5.0, 20.0), (8.0, 10.0)])
    assert [at(pieces, time) for time in (5.0, 10.0, 18.0)] == pytest.approx([15.0, 20.0, 10.0])


def test_a_change_that_is_impossible_in_its_time_takes_the_least_time() -> None:
    asked, free = planned(8.0, [(1.0, 15.0)]), planned(8.0, [(None, 15.0)])
    assert asked == free
    assert asked[-1].time == pytest.approx(2.0 * math.sqrt(7.0 * 0.5 * (1.0 / 4.0 + 1.0 / 1.0)))


def test_a_profile_with_an_impossible_target_keeps_the_times_of_its_lines() -> None:
    pieces = planned(
        0.0, [(4.0, 10.0), (4.0, 4.0), (2.0, 8.0)], Performance(50.0, 5.0, 10.0, 4.0, 3.0)
    )
    middle = at(pieces, 6.0)
    assert middle == pytest.approx(7.0), "on the second line, 10 m/s at 4 s to 4 m/s at 8 s"


def test_without_a_jerk_limit_the_speed_changes_in_straight_lines() -> None:
    pieces = planned(0.0, [(4.0, 10.0), (4.0, 4.0)], Performance(50.0, 5.0, 10.0))
    assert [at(pieces, time) for time in (2.0, 4.0, 6.0, 8.0)] == pytest.approx(
        [5.0, 10.0, 7.0, 4.0]
    )


SPEEDS = st.floats(0.0, 40.0)
ENTRIES = st.lists(st.tuples(st.none() | st.floats(0.5, 20.0), SPEEDS), min_size=1, max_size=4)


@given(SPEEDS, ENTRIES, st.floats(1.0, 10.0), st.floats(1.0, 10.0))
def test_any_plan_is_continuous_and_within_its_limits(
    start: float, entries: list[tuple[float | None, float]], up: float, down: float
) -> None:
    steps = [
        abs(b - a)
        for a, b in zip([start, *(v for _, v in entries)], [v for _, v in entries], strict=False)
    ]
    assume(all(step == 0.0 or step > 0.01 for step in steps))
    pieces = planned(start, entries, Performance(50.0, 5.0, 10.0, up, down))
    for before, after in itertools.pairwise(pieces):
        span = after.time - before.time
        assert span >= -1e-9
        assert before.at(after.time) == pytest.approx(after.speed, abs=1e-5)
        assert before.acceleration + before.jerk * span == pytest.approx(
            after.acceleration, abs=1e-5
        )
        assert -down - 1e-6 <= before.jerk <= up + 1e-6
        assert -10.0 - 1e-6 <= before.acceleration <= 10.0 + 1e-6
    assert (
        pieces[-1].speed == pytest.approx(entries[-1][1], abs=1e-5)
        and abs(pieces[-1].acceleration) < 1e-6
    )
    assert np.isfinite([piece.time for piece in pieces]).all()
