"""Small inputs with one answer by the standard: positions relative to entities that actions have
moved, over joints and on rings.

Lanes of road 1 (`straight`) are 3.5 m wide: -1 has its centre at t = -1.75 m, -2 at -5.25 m.
"""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tests.conformance.scenes import (
    CHANGE,
    HELD_OFFSET,
    LATE,
    TELEPORT,
    lane_position,
    placed_beside,
    play,
    start,
)
from tests.conformance.support import at, track
from tests.runner.files import place, story

RELATIVE = {
    # the offset of a RelativeLanePosition is from the centre of its lane, and absent it is 0
    "lane, absent offset": (
        '<RelativeLanePosition entityRef="Lead" dLane="0" ds="20"/>',
        20,
        -1.75,
    ),
    "lane, own offset": (
        '<RelativeLanePosition entityRef="Lead" dLane="0" ds="20" offset="0.5"/>',
        20,
        -1.25,
    ),
    "next lane": ('<RelativeLanePosition entityRef="Lead" dLane="-1" ds="-20"/>', -20, -5.25),
    "across the centre": ('<RelativeLanePosition entityRef="Lead" dLane="1" ds="5"/>', 5, 1.75),
    # dt counts from the reference point of the entity
    "road": ('<RelativeRoadPosition entityRef="Lead" ds="20" dt="0"/>', 20, -0.75),
    "road, aside": ('<RelativeRoadPosition entityRef="Lead" ds="20" dt="-1"/>', 20, -1.75),
    "object": ('<RelativeObjectPosition entityRef="Lead" dx="20" dy="-3.5"/>', 20, -4.25),
    "world": ('<RelativeWorldPosition entityRef="Lead" dx="-20" dy="1"/>', -20, 0.25),
}


@pytest.mark.parametrize("position", RELATIVE)
def test_positions_relative_to_a_car_beside_the_middle_of_its_lane(
    position: str, tmp_path: Path
) -> None:
    text, ahead, t = RELATIVE[position]
    ego, lead = placed_beside(tmp_path, text, HELD_OFFSET.format(1.0))
    assert at(lead, LATE, "t") == pytest.approx(-0.75, abs=1e-6)
    assert at(ego, LATE, "x") - at(lead, LATE, "x") == pytest.approx(ahead, abs=1e-6)
    assert at(ego, LATE, "y") == pytest.approx(t, abs=1e-6)


@pytest.mark.parametrize(
    ("held", "reference_lane", "steps", "t"),
    [
        # 2 m of 3.5 m to the left: over the border (1.75 m), so in the next lane
        (2.0, -2, 0, -1.75),
        (2.0, -2, -1, -5.25),
        (1.7, -2, 0, -5.25),
        (-2.0, -1, 0, -5.25),
        (3.5, -2, 1, 1.75),
    ],
)
def test_lanes_count_from_the_lane_below_the_reference_point(
    held: float, reference_lane: int, steps: int, t: float, tmp_path: Path
) -> None:
    position = f'<RelativeLanePosition entityRef="Lead" dLane="{steps}" ds="30"/>'
    ego, _ = placed_beside(
        tmp_path, position, HELD_OFFSET.format(held), lane_position(reference_lane, 100)
    )
    assert at(ego, LATE, "y") == pytest.approx(t, abs=1e-6)


def test_a_target_lane_offset_is_kept_by_relative_lanes_and_not_by_others(tmp_path: Path) -> None:
    """A lane change with targetLaneOffset ends beside the middle; a position in
    that lane does not inherit it.
    """
    change = CHANGE.format(' targetLaneOffset="-0.5"', '<AbsoluteTargetLane value="-2"/>')
    position = '<RelativeLanePosition entityRef="Lead" dLane="0" ds="10"/>'
    ego, lead = placed_beside(tmp_path, position, change)
    assert at(lead, LATE, "t") == pytest.approx(-5.75, abs=1e-6)
    assert at(lead, LATE, "lane_offset") == pytest.approx(-0.5, abs=1e-6)
    assert at(ego, LATE, "y") == pytest.approx(-5.25, abs=1e-6)


OVER_THE_JOINT = {
    # road 2 is laid against road 1: x = 300 + (300 - s), its t is mirrored
    "same lane": ('<RelativeLanePosition entityRef="Lead" dLane="0" ds="60"/>', 1, -1.75),
    "next lane": ('<RelativeLanePosition entityRef="Lead" dLane="-1" ds="60"/>', 2, -5.25),
    "oncoming": ('<RelativeLanePosition entityRef="Lead" dLane="1" ds="60"/>', -1, 1.75),
    "offset": (
        '<RelativeLanePosition entityRef="Lead" dLane="0" ds="60" offset="0.5"/>',
        1,
        None,
    ),
    "along the lane": ('<RelativeLanePosition entityRef="Lead" dLane="0" dsLane="60"/>', 1, -1.75),
    "road": ('<RelativeRoadPosition entityRef="Lead" ds="60" dt="-3.5"/>', 2, -5.25),
}


@pytest.mark.parametrize("position", OVER_THE_JOINT)
def test_positions_over_a_joint_with_a_road_that_is_laid_against_it(
    position: str, tmp_path: Path
) -> None:
    text, lane, y = OVER_THE_JOINT[position]
    init = start("Ego", lane_position(1, 200), 0) + start("Lead", lane_position(-1, 270), 0)
    result = play(tmp_path, init, story("Ego", [(LATE, TELEPORT.format(text))]), road="opposed")
    ego = track(result, "Ego")
    last = len(ego["time"]) - 1
    assert (ego["road_id"][last], ego["lane_id"][last]) == ("2", lane)
    assert ego["x"][last] == pytest.approx(330.0, abs=1e-6)
    assert ego["s"][last] == pytest.approx(270.0, abs=1e-6)
    if y is not None:
        assert ego["y"][last] == pytest.approx(y, abs=1e-6)
    # it faces as the entity that the position is relative to
    assert math.cos(ego["h"][last]) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(
    ("rule", "lane", "x_direction"), [("", -1, 1), ("", 1, -1), ("_lht", -1, -1), ("_lht", 1, 1)]
)
def test_offsets_and_lanes_on_roads_of_either_traffic_rule(
    rule: str, lane: int, x_direction: int, tmp_path: Path
) -> None:
    """Offsets are along t of the road; lanes relative to an entity count to the
    left of the entity itself.
    """
    init = start("Ego", lane_position(lane, 500), 10) + start("Lead", lane_position(2, 900), 0)
    change = CHANGE.format("", '<RelativeTargetLane entityRef="Ego" value="{}"/>')
    outwards = math.copysign(1, lane) * x_direction  # the left of an entity is +t where it faces +s
    actions = [(1.0, HELD_OFFSET.format(0.5)), (5.0, change.format(int(outwards)))]
    result = play(tmp_path, init, story("Ego", actions), road=f"straight{rule}")
    ego = track(result, "Ego")
    assert at(ego, 2.0, "x") == pytest.approx(500 + 20 * x_direction, abs=0.5)
    assert at(ego, 4.9, "t") == pytest.approx(lane * 1.75 + 0.5, abs=1e-6)
    assert at(ego, 9.9, "t") == pytest.approx(math.copysign(5.25, lane), abs=1e-6)


def test_a_teleport_is_no_way_driven_and_changes_no_speed(tmp_path: Path) -> None:
    there = lane_position(-2, 700)
    init = place("Ego", 100, 10) + place("Lead", 300, 0, -2)
    result = play(tmp_path, init, story("Ego", [(5.0, TELEPORT.format(there))]))
    ego = track(result, "Ego")
    assert at(ego, 6.0, "x") == pytest.approx(710.0, abs=1e-6)
    assert float(abs(ego["speed"] - 10.0).max()) < 1e-9
    assert float(abs(ego["acceleration"]).max()) < 1e-9
    # nothing between the two places is touched on the way
    assert not [event for event in result.events if event.kind == "collision"]


def test_a_teleport_in_a_lane_change_ends_it_where_it_is_put(tmp_path: Path) -> None:
    """A TeleportAction takes the lateral control, so that the lane change does
    not pull the car back.
    """
    change = CHANGE.format("", '<AbsoluteTargetLane value="-2"/>')
    actions = [(1.0, change), (2.0, TELEPORT.format(lane_position(1, 500)))]
    init = place("Ego", 100, 10) + place("Lead", 300, 0, -2)
    ego = track(play(tmp_path, init, story("Ego", actions)), "Ego")
    assert at(ego, 9.0, "t") == pytest.approx(1.75, abs=1e-6)
    assert at(ego, 9.0, "x") == pytest.approx(500 - 70, abs=1e-6)
