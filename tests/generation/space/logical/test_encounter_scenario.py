"""Where and when the ego and the other one are in scenarios at junctions, seen
from runs without a system under test.
"""

from __future__ import annotations

from itertools import product
from math import hypot

import numpy as np
import pytest

import runner
from generation.space import SpaceChoice
from generation.space.logical.encounters import EncounterScenario
from generation.space.logical.library import SCENARIOS, encounter_scenarios
from generation.space.space import Space
from runner.recording import Track

APPROACHES = dict(encounter_scenarios())
STEP = 0.05


def tracks(name: str, given: dict[str, float], sut: str | None = None) -> dict[str, Track]:
    parameters = {key: str(value) for key, value in given.items()}
    done = runner.run(
        SCENARIOS / f"{name}.xosc", parameters=parameters, sut=sut, world="kinematic", timestep=STEP
    )
    assert done.status == "completed"
    assert all("system_under_test" in remark for remark in done.remarks), (
        "nothing but who drives the ego"
    )
    return done.recording.locate().tracks


def arrival(track: Track, approach: EncounterScenario) -> float:
    """When a participant is nearest to where the ways meet, within its last
    steps by its speed, s.
    """
    x, y, time = (track.columns[name] for name in ("x", "y", "time"))
    apart = np.hypot(x - approach.meeting.x, y - approach.meeting.y)
    assert apart.min() < 1.0, "it does not come to where the ways meet"
    return float(time[apart.argmin()])


@pytest.mark.parametrize(("gap", "fast"), [(3.0, False), (-3.0, True)])
@pytest.mark.parametrize("name", APPROACHES)
def test_the_two_arrive_as_far_apart_as_asked_for(name: str, gap: float, fast: bool) -> None:
    approach = APPROACHES[name]
    other = approach.encounter.other
    given = {f"{other}_ArrivalGap_s": gap, f"{other}_Speed_mps": approach.encounter.speeds[0][fast]}
    found = tracks(name, given)
    late = arrival(found[other], approach) - arrival(found["Ego"], approach)
    assert late == pytest.approx(gap, abs=0.2)


@pytest.mark.parametrize("name", APPROACHES)
def test_the_ego_is_slow_at_the_end_of_its_arm_and_takes_its_course(name: str) -> None:
    approach = APPROACHES[name]
    (origin, _), (target, lane) = approach.encounter.ego
    columns = tracks(
        name,
        {
            "Ego_Speed_mps": 13.0,
            "Ego_JunctionSpeed_mps": 5.0,
            f"{approach.encounter.other}_ArrivalGap_s": 3.0,
        },
    )["Ego"].columns
    roads = list(dict.fromkeys(columns["road_id"]))
    leaves = int(np.flatnonzero(columns["road_id"] == origin)[-1])
    assert columns["speed"][0] == 13.0
    assert columns["speed"][leaves] == pytest.approx(5.0, abs=0.2)
    assert roads[0] == origin
    if target in roads:
        assert set(columns["lane_id"][columns["road_id"] == target]) == {lane}


@pytest.mark.parametrize("name", APPROACHES)
def test_it_runs_in_the_corners_of_its_box_and_the_other_begins_in_time(name: str) -> None:
    approach, rng = APPROACHES[name], np.random.default_rng(0)
    other = approach.encounter.other
    space = Space.of(
        SCENARIOS / f"{name}.xosc",
        SpaceChoice(free=["Ego_Speed_mps", "Ego_JunctionSpeed_mps", "Ego_SlowingTime_s"]),
    )
    assert {f"{other}_ArrivalGap_s", f"{other}_Speed_mps"} <= set(space.names)
    corners = list(product((0.0, 1.0), repeat=len(space.names)))
    for theta in space.scaled(
        np.array([corners[number] for number in rng.choice(len(corners), 8, replace=False)])
    ):
        values = dict(zip(space.names, theta.tolist(), strict=True))
        found = tracks(name, values)
        if (
            hypot(
                *(found[other].columns[axis][-1] - found["Ego"].columns[axis][-1] for axis in "xy")
            )
            > 6.0
        ):  # else they collided
            late = arrival(found[other], approach) - arrival(found["Ego"], approach)
            assert late == pytest.approx(values[f"{other}_ArrivalGap_s"], abs=0.4)


@pytest.mark.parametrize(
    "name", [name for name, each in APPROACHES.items() if each.encounter.walks]
)
def test_pedestrians_come_from_the_right_and_walk_straight(name: str) -> None:
    columns = tracks(name, {})["Pedestrian"].columns
    x, y = columns["x"], columns["y"]
    assert hypot(x[-1] - x[0], y[-1] - y[0]) == pytest.approx(1.5 * columns["time"][-1], abs=0.1)
    assert hypot(x[0] - APPROACHES[name].meeting.x, y[0] - APPROACHES[name].meeting.y) > 5.0
