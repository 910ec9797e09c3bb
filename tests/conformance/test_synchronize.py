"""SynchronizeAction: both arrive at the same time, 10 s after its start at 1 s;
the master drives 20 m/s.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from runner import RunResult
from runner.engine.actions.synchronize import free_speed, planned_speed
from runner.engine.motion.on_roads import LaneMotion
from runner.engine.motion.placement import Placement
from runner.engine.participants.entity import Entity
from tests.conformance.support import events, run, track

DT = 0.01
ARRIVAL = 10.5
"""When the master, from 190 m at 20 m/s, is at its target at 400 m."""


def synchronize(**parameters: object) -> RunResult:
    return run("SynchronizeAction", world="kinematic", parameters=parameters)


def arrival(columns: dict[str, np.ndarray], s: float = 400.0) -> float:
    return float(np.interp(s, columns["x"], columns["time"]))


@pytest.mark.parametrize("start", (0.0, 5.0, 10.0, 14.0))
@pytest.mark.parametrize("name", ("Free", "Final", "Relative"))
def test_it_arrives_with_the_master(name: str, start: float) -> None:
    columns = track(synchronize(StartSpeed=start), name)
    assert arrival(columns) == pytest.approx(ARRIVAL, abs=0.05)


@pytest.mark.parametrize(("name", "final"), [("Final", 12.0), ("Relative", 15.0)])
@pytest.mark.parametrize("start", (0.0, 10.0))
def test_it_has_the_final_speed_there_and_keeps_it(name: str, final: float, start: float) -> None:
    columns = track(synchronize(StartSpeed=start, FinalSpeed=12.0), name)
    assert np.interp(400.0, columns["x"], columns["speed"]) == pytest.approx(final, abs=0.1)
    assert columns["speed"][-1] == pytest.approx(final, abs=1e-6)


@pytest.mark.parametrize("name", ("Free", "Final", "Relative"))
def test_the_speed_has_no_jump(name: str) -> None:
    columns = track(synchronize(StartSpeed=5.0), name)
    assert np.abs(np.diff(columns["speed"])).max() <= 5.0 * DT + 1e-6


def test_the_free_profile_has_constant_acceleration() -> None:
    columns = track(synchronize(StartSpeed=5.0), "Free")
    moving = (columns["time"] > 1.1) & (columns["time"] < 10.0)
    rates = np.diff(columns["speed"][moving]) / DT
    assert np.ptp(rates) < 0.05


def test_it_holds_the_final_speed_for_the_steady_distance_or_time() -> None:
    result = synchronize(FinalSpeed=12.0, Steady=30.0, SteadyTime=2.0)
    final, relative = track(result, "Final"), track(result, "Relative")
    assert np.allclose(final["speed"][final["x"] > 371.0], 12.0, atol=0.1)
    assert np.allclose(relative["speed"][relative["x"] > 400.0 - 2.0 * 15.0 + 1.0], 15.0, atol=0.1)
    assert arrival(final) == pytest.approx(ARRIVAL, abs=0.05)
    assert arrival(relative) == pytest.approx(ARRIVAL, abs=0.05)


def test_it_waits_where_the_way_is_shorter_than_the_time() -> None:
    columns = track(synchronize(TargetS=310.0, StartSpeed=5.0, FinalSpeed=5.0), "Final")
    assert columns["speed"].min() == pytest.approx(0.0, abs=1e-6)
    assert np.diff(columns["x"]).min() >= 0.0
    assert arrival(columns, 310.0) == pytest.approx(ARRIVAL, abs=0.05)


def test_it_ends_at_the_target() -> None:
    result = synchronize()
    ends = [
        events(result, "endTransition", f"{name}Action")[0].time
        for name in ("Free", "Final", "Relative")
    ]
    assert ends == pytest.approx([ARRIVAL] * 3, abs=0.06)


def drive(speed: float, final: float | None, way: float, time: float) -> tuple[float, float, float]:
    """Way and time left when either has run out, and the speed then."""
    while way > 0.0 and time > DT / 2:
        speed = (
            free_speed(speed, way, time, DT)
            if final is None
            else planned_speed(speed, final, way, time, DT)
        )
        way, time = way - speed * DT, time - DT
    return way, time, speed


@settings(max_examples=200, deadline=None)
@given(st.floats(0.0, 30.0), st.floats(0.5, 30.0), st.floats(5.0, 300.0), st.floats(2.0, 30.0))
def test_any_profile_arrives_in_time_with_its_final_speed(
    speed: float, final: float, way: float, time: float
) -> None:
    left, rest, reached = drive(speed, final, way, time)
    scale = max(speed, final, way / time, 1.0)
    assert abs(left) <= 3 * scale * DT + 0.05 and abs(rest) <= 3 * DT + 0.05 / final
    assert abs(reached - final) <= 0.05 * scale + 0.1


@settings(max_examples=100, deadline=None)
@given(st.floats(0.0, 30.0), st.floats(5.0, 300.0), st.floats(2.0, 30.0))
def test_any_free_profile_never_reverses_and_does_not_come_late(
    speed: float, way: float, time: float
) -> None:
    left, _, reached = drive(speed, None, way, time)
    assert reached >= 0.0
    assert left <= max(speed, way / time) * 3 * DT + 0.05 or speed * time > 2.0 * way


def test_a_target_that_is_not_on_the_way_yet_is_looked_for_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = LaneMotion.distance_to

    def later(motion: LaneMotion, entity: Entity, placement: Placement) -> float | None:
        return found(motion, entity, placement) if entity.odometer > 20.0 else None

    monkeypatch.setattr(LaneMotion, "distance_to", later)
    result = synchronize()
    assert arrival(track(result, "Free")) == pytest.approx(ARRIVAL, abs=0.05)
    assert events(result, "synchronise", "Free")
