"""Changes of speed with a limited jerk are those of the interpreter's action."""

from __future__ import annotations

from bisect import bisect_right

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from generation.twin.motion import plan, speeds
from runner.engine.actions.speed import ProfileEntry
from runner.engine.actions.speed import plan as planned
from runner.engine.motion.dynamics import EPSILON, tighter
from runner.engine.participants.declaration import Performance

speed = st.floats(0.0, 42.0)
rates = st.sampled_from([Performance(70.0, 5.0, 9.0), Performance(30.0, 2.0, 6.0, 4.0, 8.0)])


@given(speed, speed, st.floats(0.5, 8.0), st.floats(0.1, 15.0), rates)
def test_a_profile_is_that_of_the_interpreter(
    start: float, target: float, duration: float, jerk: float, limits: Performance
) -> None:
    constraints = Performance(max_acceleration_rate=jerk, max_deceleration_rate=jerk)
    pieces = planned(
        start, [ProfileEntry(duration, target)], tighter(constraints, limits), smooth=True
    )
    profile = plan(*(np.array([value]) for value in (start, target, duration, jerk)), limits)
    begins = [piece.time for piece in pieces]
    for time in np.linspace(0.0, begins[-1] + 1.0, 9):
        found, ended = speeds(profile, np.array([time]))
        piece = pieces[bisect_right(begins, time + EPSILON) - 1]
        assert found[0] == pytest.approx(piece.at(float(time)), abs=1e-6)
        assert ended[0] == (time + EPSILON >= begins[-1]) or abs(time - begins[-1]) < 1e-6


def test_the_change_lasts_longer_where_the_jerk_is_too_small_for_its_time() -> None:
    profile = plan(
        np.full(3, 20.0),
        np.full(3, 12.0),
        np.full(3, 4.0),
        np.array([0.2, 1.0, 15.0]),
        Performance(70.0, 5.0, 9.0),
    )
    ends = [
        next(t for t in np.arange(0.0, 60.0, 0.05) if speeds(profile, np.full(3, t))[1][row])
        for row in range(3)
    ]
    assert ends[:2] == pytest.approx([2.0 * (8.0 / 0.2) ** 0.5, 2.0 * 8.0**0.5], abs=0.06)
    assert ends[2] == pytest.approx(4.0, abs=0.06)
