"""Routes change lanes where others leave a gap; they wait for one, and it is
said where the lane was not reached.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import runner
from runner import RunResult
from tests.conformance.support import track
from tests.conformance.test_facts_of_actions import DELETE, entity_action
from tests.conformance.test_ways import acquire, complaints, route, waypoint
from tests.runner.files import car, place, scenario, speed_action, story


def drive(folder: Path, other: str, events: str = "", action: str = "route") -> RunResult:
    """Ego from s = 100 m of lane -1 at 20 m/s is to be in lane -2 at s = 400 m;
    Other is where it is put.
    """
    goal = waypoint(1, -2, 400)
    body = route(waypoint(1, -1, 100), goal) if action == "route" else acquire(goal)
    way = story("Ego", [(0.0, f"<PrivateAction>{body}</PrivateAction>")])
    path = scenario(
        folder,
        entities=[car("Ego"), car("Other")],
        init=place("Ego", 100, 20) + other,
        stories=way + events,
        stop=20.0,
    )
    return runner.run(path, sut=None, world="kinematic", timestep=0.05, ego="Ego")


def changes(result: RunResult) -> float | None:
    """The s at which Ego leaves the middle of lane -1; None if it never does."""
    ego = track(result, "Ego")
    moved = ego["s"][abs(ego["t"] + 1.75) > 0.01]
    return float(moved[0]) if len(moved) else None


@pytest.mark.parametrize("action", ["route", "position"])
def test_a_car_beside_keeps_it_in_its_lane(action: str, tmp_path: Path) -> None:
    result = drive(tmp_path, place("Other", 102, 20, -2), action=action)
    assert changes(result) is None or changes(result) > 400.0  # type: ignore[operator]
    assert not [event for event in result.events if event.kind == "collision"]
    waits = [event.text for event in result.events if event.kind == "route"]
    assert waits == ["waits for a gap at Other to change to lane -2"]
    said = {"route": "in lane -1, not -2", "position": "its goal is lane -2"}[action]
    assert [said in text for text in result.remarks] == [True]


@pytest.mark.parametrize(
    ("s", "speed", "waits"),
    [
        (150, 20, False),  # 45 m ahead, as fast
        (60, 20, False),  # 35 m behind
        (110, 22, True),  # 5 m ahead, where 12 m are needed
        (160, 5, True),  # reached during the change
        (30, 35, True),  # arrives during the change
        (40, 10, False),  # falls behind
        (200, 30, False),
    ],
)
def test_a_gap_has_to_last_for_the_change(
    s: float, speed: float, waits: bool, tmp_path: Path
) -> None:
    result = drive(tmp_path, place("Other", s, speed, -2))
    begun = changes(result)
    assert begun is not None
    assert (begun > 108.0) == waits
    ego = track(result, "Ego")
    assert int(ego["lane_id"][abs(ego["s"] - 399.0).argmin()]) == -2
    assert complaints(result) == []
    assert not [event for event in result.events if event.kind == "collision"]


@pytest.mark.parametrize("lane", [-1, 1])
def test_cars_of_other_lanes_are_not_in_the_way(lane: int, tmp_path: Path) -> None:
    result = drive(tmp_path, place("Other", 130 if lane < 0 else 102, 20, lane))
    assert changes(result) == pytest.approx(105.0, abs=2.0)


def test_it_changes_as_soon_as_the_other_has_gone(tmp_path: Path) -> None:
    gone = story("Other", [(3.0, entity_action("Other", DELETE))]).replace('"story"', '"gone"')
    result = drive(tmp_path, place("Other", 102, 20, -2), gone)
    assert changes(result) == pytest.approx(161.0, abs=4.0)
    assert complaints(result) == []


def test_it_waits_for_one_that_brakes(tmp_path: Path) -> None:
    brakes = story("Other", [(2.0, speed_action(5))]).replace('"story"', '"brakes"')
    result = drive(tmp_path, place("Other", 100, 20, -2), brakes)
    begun = changes(result)
    assert begun is not None and 140.0 < begun < 170.0
    assert complaints(result) == []
    assert not [event for event in result.events if event.kind == "collision"]


@pytest.mark.parametrize(
    ("lane", "s", "said"),
    [
        (-1, 50, "Ego drives away from its route at s = 100.0 m of road 1"),
        (1, 300, "traffic leads Ego no way along this route"),
        (-1, 300, None),
    ],
)
def test_a_route_that_leads_where_the_car_does_not_drive_is_a_remark(
    lane: int, s: float, said: str | None, tmp_path: Path
) -> None:
    body = f"<PrivateAction>{acquire(waypoint(1, lane, s))}</PrivateAction>"
    path = scenario(
        tmp_path,
        entities=[car("Ego")],
        init=place("Ego", 100, 20),
        stories=story("Ego", [(0.0, body)]),
        stop=2.0,
    )
    found = complaints(runner.run(path, sut=None, world="kinematic", timestep=0.05))
    assert any(said in text for text in found) if said else found == []


def test_a_new_route_turns_a_lane_change_back(tmp_path: Path) -> None:
    """Half way to lane -2 the car is asked to be in lane -1 40 m further on."""
    there = [(0.0, acquire(waypoint(1, -2, 250))), (3.0, acquire(waypoint(1, -1, 200)))]
    path = scenario(
        tmp_path,
        entities=[car("Ego")],
        init=place("Ego", 100, 10),
        stories=story(
            "Ego", [(time, f"<PrivateAction>{body}</PrivateAction>") for time, body in there]
        ),
        stop=14.0,
    )
    result = runner.run(path, sut=None, world="kinematic", timestep=0.05)
    ego = track(result, "Ego")
    assert ego["t"].min() < -2.2 and ego["t"].min() > -5.0
    assert float(ego["t"][abs(ego["s"] - 200.0).argmin()]) == pytest.approx(-1.75, abs=0.1)
    assert not result.remarks
