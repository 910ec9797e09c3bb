"""`adas`: what its radar sees, when it follows, when it brakes fully, and the
limits of what it does.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import runner
from runner.engine.participants.declaration import BoundingBox
from runner.engine.worlds.surroundings import Environment
from runner.systems import Observation, Participant
from runner.systems.kinds.adas import DriverAssistance, RadarTarget
from tests.conformance.support import track

LIBRARY = Path(__file__).parents[3] / "xosc" / "library"
CAR = BoundingBox(0.0, 0.0, 0.75, 4.0, 2.0, 1.5)
DT = 0.05


def entity(
    name: str, x: float, y: float, vx: float, vy: float = 0.0, *, ay: float = 0.0
) -> Participant:
    return Participant(name, "vehicle", "car", CAR, x=x, y=y, speed=vx, vx=vx, vy=vy, ay=ay)


def seen(ego: Participant, *others: Participant, time: float = 0.0) -> Observation:
    return Observation(time, ego, others, ego.speed, None, Environment())


def names(ego: Participant, *others: Participant) -> list[str]:
    return [target.name for target in DriverAssistance().targets(seen(ego, *others))]


def answers(system: DriverAssistance, observation: Observation, steps: int) -> list[float | None]:
    """Accelerations for a situation that stays as it is."""
    system.reset(observation.ego, DT, 0)
    return [
        system.control(observation._replace(time=step * DT), DT).acceleration
        for step in range(steps)
    ]


# the radar ----------------------------------------------------------------------------------


def test_the_far_field_is_long_and_narrow_and_the_near_field_wide() -> None:
    ego = entity("Ego", 0.0, 0.0, 20.0)
    for ahead, aside, expected in [
        (250.0, 0.0, True),
        (250.5, 0.0, False),
        (100.0, 1.0 + 100.0 * math.tan(math.radians(8.9)), True),
        (100.0, 1.0 + 100.0 * math.tan(math.radians(9.1)), False),
        (20.0, 1.0 + 20.0 * math.tan(math.radians(44.0)), True),
        (20.0, 1.0 + 20.0 * math.tan(math.radians(46.0)), False),
    ]:
        for side in (1.0, -1.0):
            other = entity("Other", 4.0 + ahead, side * aside, 20.0)
            assert bool(names(ego, other)) is expected, (ahead, aside)
    assert not names(ego, entity("Behind", -10.0, 0.0, 20.0), entity("Beside", 0.0, 3.5, 20.0))


def test_the_path_bends_with_the_yaw_rate() -> None:
    """In a left curve of 200 m radius a lead on the same circle is in the path,
    oncoming traffic straight ahead is not.
    """
    ego = entity("Ego", 0.0, 0.0, 20.0, ay=20.0**2 / 200.0)
    bearing = 60.0 / 200.0
    x, y = 200.0 * math.sin(bearing), 200.0 * (1.0 - math.cos(bearing))
    lead = entity("Lead", x, y, 10.0 * math.cos(bearing), 10.0 * math.sin(bearing))
    straight = entity("Straight", 60.0, 0.0, -10.0)
    targets = {
        target.name: target for target in DriverAssistance().targets(seen(ego, lead, straight))
    }
    assert targets["Lead"].aside < -1.5 and abs(targets["Lead"].approach) < 0.5
    assert targets["Straight"].aside > 4.0
    assert not targets["Straight"].is_in_way(20.0, 0.2)


# what it needs ------------------------------------------------------------------------------


def test_the_needed_deceleration_is_that_of_kinematics() -> None:
    standing = RadarTarget("Lead", 50.0, -2.0, 4.0, 0.0, 0.0, 0.0)
    assert standing.needed(20.0, 0.0) == pytest.approx(20.0**2 / (2 * 50.0))
    assert standing.needed(20.0, 0.5) == pytest.approx(20.0**2 / (2 * 40.0))
    slower = standing._replace(speed=10.0)
    assert slower.needed(20.0, 0.0) == pytest.approx(10.0**2 / (2 * 50.0))
    assert slower.needed(10.0, 0.0) == 0.0
    braking = slower._replace(speed=20.0, acceleration=-4.0)  # it stands 50 m on
    assert braking.needed(20.0, 0.0) == pytest.approx(20.0**2 / (2 * 100.0))
    oncoming = standing._replace(speed=-10.0)  # they meet after 33.3 m
    assert oncoming.needed(20.0, 0.0) == pytest.approx(20.0**2 / (2 * 50.0 * 20.0 / 30.0))


@pytest.mark.parametrize(
    ("aside", "approach", "expected"),
    [(3.0, 0.0, False), (3.0, 2.0, True), (3.0, 6.0, False), (-1.0, 0.0, True)],
)
def test_crossing_traffic_is_in_the_way_only_when_it_is_reached(
    aside: float, approach: float, expected: bool
) -> None:
    walker = RadarTarget("Walker", 20.0, aside, 2.5, approach, 0.0, 0.0)  # reached after 2 s
    assert walker.is_in_way(10.0, 0.2) is expected


# what it does -------------------------------------------------------------------------------


def test_it_leaves_the_scenario_alone_in_free_traffic() -> None:
    ego = entity("Ego", 0.0, 0.0, 25.0)
    assert set(answers(DriverAssistance(), seen(ego), 20)) == {None}
    assert set(answers(DriverAssistance(), seen(ego, entity("Lead", 34.0, 0.0, 25.0)), 20)) == {
        None
    }  # 1.2 s ahead


def test_it_reacts_after_its_latency_with_the_jerk_of_comfort() -> None:
    ego, lead = entity("Ego", 0.0, 0.0, 25.0), entity("Lead", 84.0, 0.0, 5.0)
    found = answers(DriverAssistance(), seen(ego, lead), 60)
    assert found[:7] == [None] * 7
    assert found[7] == pytest.approx(-2.5 * DT)
    assert np.diff([value for value in found if value is not None]).min() >= -2.5 * DT - 1e-9
    assert min(value for value in found if value is not None) == -3.5


def test_it_brakes_fully_where_comfort_is_not_enough() -> None:
    ego, wall = entity("Ego", 0.0, 0.0, 20.0), entity("Wall", 44.0, 0.0, 0.0)
    system = DriverAssistance()
    found = answers(system, seen(ego, wall), 40)
    braking = [value for value in found if value is not None]
    assert min(braking) == -system.full == pytest.approx(-0.774 * 9.81)
    assert np.diff(braking).min() == pytest.approx(-12.65 * DT)
    assert "emergency braking" in system.control(seen(ego, wall, time=2.0), DT).reason


def test_every_constant_is_a_parameter() -> None:
    ego, wall = entity("Ego", 0.0, 0.0, 20.0), entity("Wall", 44.0, 0.0, 0.0)
    assert (
        min(
            value
            for value in answers(DriverAssistance(full=6.0), seen(ego, wall), 40)
            if value is not None
        )
        == -6.0
    )
    assert set(answers(DriverAssistance(far_range=30.0, near_range=30.0), seen(ego, wall), 40)) == {
        None
    }
    assert answers(DriverAssistance(latency=0.0), seen(ego, wall), 1) != [None]


def test_it_stops_behind_a_standing_truck_and_stays() -> None:
    result = runner.run(LIBRARY / "highway_lead_brake.xosc", sut="adas", world="kinematic")
    assert not result.verdict.failures
    ego = track(result, "Ego")
    jerk = np.diff(ego["acceleration"]) / np.diff(ego["time"])
    assert ego["acceleration"].min() >= -0.774 * 9.81 - 1e-6
    assert jerk.min() >= -12.65 - 1e-6
    assert result.criticality is not None
    assert result.criticality.summary["min_distance"]["value"] > 1.0


def test_the_same_system_runs_again_from_its_beginning() -> None:
    system, prepared = DriverAssistance(), runner.prepare(LIBRARY / "simple_cut_in.xosc")
    first, second = (prepared.run(sut=system, world="kinematic").trajectories for _ in range(2))
    assert first.equals(second)
