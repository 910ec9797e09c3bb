"""Small inputs with one answer by the standard: lanes in conditions, over lane sections, for
drivers, in actions that follow each other.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

import runner
from runner.systems import Control, Observation, Participant
from tests.conformance.scenes import (
    CHANGE,
    HELD_OFFSET,
    TELEPORT,
    lane_position,
    other,
    placed_beside,
    play,
    start,
    triggered,
)
from tests.conformance.support import at, track
from tests.runner.files import ROADS, place, scenario, speed_action, story

CLEARANCE = (
    '<RelativeClearanceCondition freeSpace="false" oppositeLanes="false" distanceForward="50"'
    ' distanceBackward="10"><RelativeLaneRange from="{0}" to="{0}"/></RelativeClearanceCondition>'
)


@pytest.mark.parametrize(
    ("held", "lanes", "clear"),
    [
        # Lead drives 20 m ahead in lane -2; from 4 s on beside its middle, in the lane below it
        (0.0, 0, None),
        (0.0, 1, 0.0),
        (3.5, 0, "later"),
        (3.5, 1, 0.0),
        (1.0, 0, None),
    ],
)
def test_lanes_are_clear_of_a_car_that_an_offset_has_taken_to_the_next_lane(
    held: float, lanes: int, clear: float | str | None, tmp_path: Path
) -> None:
    init = place("Ego", 100, 10, -2) + place("Lead", 120, 10, -2)
    moved = other(story("Lead", [(1.0, HELD_OFFSET.format(held))])) if held else ""
    found = triggered(tmp_path, CLEARANCE.format(lanes), init, moved)
    if clear == "later":
        assert found is not None and 1.5 < found < 4.0
    else:
        assert found == (None if clear is None else pytest.approx(clear, abs=0.051))


@pytest.mark.parametrize(("system", "apart"), [("lane", 4.5), ("road", 4.5), ("entity", 4.5)])
def test_lateral_distances_count_offsets_within_lanes(
    system: str, apart: float, tmp_path: Path
) -> None:
    init = start("Ego", lane_position(-1, 100, 0.5), 10) + start(
        "Lead", lane_position(-2, 100, -0.5), 10
    )
    condition = (
        '<RelativeDistanceCondition entityRef="Lead" freespace="false" '
        'relativeDistanceType="lateral"'
        f' coordinateSystem="{system}" value="{{}}" rule="{{}}"/>'
    )
    for value, rule in ((apart - 0.01, "greaterThan"), (apart + 0.01, "lessThan")):
        assert triggered(tmp_path, condition.format(value, rule), init) == pytest.approx(0.0)


@pytest.mark.parametrize(("held", "off"), [(-1.9, True), (-1.0, False)])
def test_a_car_is_off_the_road_where_its_reference_point_is(
    held: float, off: bool, tmp_path: Path
) -> None:
    """The outermost lane has 2 m and its middle at t = -8 m: beyond t = -9 m there is no lane."""
    init = start("Ego", lane_position(-3, 100), 10) + place("Lead", 300, 0, -1)
    moved = other(story("Ego", [(0.5, HELD_OFFSET.format(held))]))
    found = triggered(tmp_path, '<OffroadCondition duration="1"/>', init, moved)
    assert (found is not None) == off


def sections(
    folder: Path, lanes: tuple[tuple[int, ...], tuple[int, ...]], links: dict[int, int]
) -> None:
    """A straight road whose lanes to the right change their numbers at s = 300 m: a lane is
    inserted or goes away inside.
    """

    def section(s: float, numbers: tuple[int, ...], kind: str, linked: dict[int, int]) -> str:
        inner = "".join(
            f'<lane id="{n}" type="driving" level="false"><link>'
            + (f'<{kind} id="{linked[n]}"/>' if n in linked else "")
            + '</link><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'
            for n in numbers
        )
        return (
            f'<laneSection s="{s}"><center><lane id="0" type="none" level="false"/></center>'
            f"<right>{inner}</right></laneSection>"
        )

    back = {after: before for before, after in links.items()}
    text = (ROADS / "straight.xodr").read_text(encoding="utf-8")
    inner = section(0, lanes[0], "successor", links) + section(300, lanes[1], "predecessor", back)
    text = re.sub(r"<lanes>.*</lanes>", f"<lanes>{inner}</lanes>", text, flags=re.DOTALL)
    (folder / "straight.xodr").write_text(text, encoding="utf-8")


def test_a_lane_keeps_its_car_where_its_number_changes(tmp_path: Path) -> None:
    """Lane -1 goes on as lane -2 beside a new lane: the car follows the link, 3.5 m further out."""
    sections(tmp_path, ((-1,), (-1, -2)), {-1: -2})
    init = start("Ego", lane_position(-1, 200), 20) + start("Lead", lane_position(-1, 900), 0)
    ego = track(play(tmp_path, init), "Ego")
    assert int(ego["lane_id"][-1]) == -2
    assert at(ego, 4.9, "t") == pytest.approx(-1.75, abs=0.02)
    assert at(ego, 9.9, "t") == pytest.approx(-5.25, abs=0.02)


def test_relative_lanes_count_over_a_section_where_numbers_change(tmp_path: Path) -> None:
    """From lane -1, that goes on as -2: 0 lanes on is lane -2, one to the left is lane -1."""
    sections(tmp_path, ((-1,), (-1, -2)), {-1: -2})
    for steps, t in ((0, -5.25), (1, -1.75)):
        position = f'<RelativeLanePosition entityRef="Lead" dLane="{steps}" ds="100"/>'
        init = start("Lead", lane_position(-1, 250), 0) + start("Ego", lane_position(-1, 100), 0)
        ego = track(play(tmp_path, init, story("Ego", [(1.0, TELEPORT.format(position))])), "Ego")
        assert (ego["s"][-1], ego["t"][-1]) == pytest.approx((350.0, t), abs=1e-6), steps


class Witness:
    """A system that answers nothing and keeps what it sees."""

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        self.seen: list[Observation] = []

    def control(self, observation: Observation, dt: float) -> Control:
        self.seen.append(observation)
        return Control()


@pytest.mark.parametrize("world", ["kinematic", "sumo"])
def test_a_driver_sees_the_same_places_as_the_outputs(world: str, tmp_path: Path) -> None:
    witness = Witness()
    init = place("Ego", 100, 10) + place("Lead", 150, 10, -2)
    path = scenario(
        tmp_path,
        init=init,
        stories=other(story("Lead", [(1.0, HELD_OFFSET.format(3.5))])),
        stop=6.0,
    )
    result = runner.run(path, sut=witness, world=world, timestep=0.1)
    lead = track(result, "Lead")
    last = witness.seen[-1].others[0]
    row = int(abs(lead["time"] - witness.seen[-1].time).argmin())
    assert (last.x, last.y, last.h) == pytest.approx(
        (lead["x"][row], lead["y"][row], lead["h"][row]), abs=1e-6
    )
    assert int(lead["lane_id"][row]) == -1
    assert last.y == pytest.approx(-1.75, abs=1e-3)


@pytest.mark.parametrize("speed", [10.0, -10.0])
def test_an_offset_keeps_its_side_in_reverse(speed: float, tmp_path: Path) -> None:
    init = place("Ego", 500, speed) + place("Lead", 900, 0, -2)
    ego = track(play(tmp_path, init, story("Ego", [(1.0, HELD_OFFSET.format(1.0))])), "Ego")
    assert at(ego, 9.0, "t") == pytest.approx(-0.75, abs=1e-6)
    assert at(ego, 9.0, "x") == pytest.approx(500 + 9 * speed, abs=0.01)
    assert math.cos(at(ego, 9.0, "h")) == pytest.approx(1.0)
    assert at(ego, 9.0, "speed") == speed


def test_a_lane_change_from_an_offset_begins_there(tmp_path: Path) -> None:
    """No jump sideways, whatever the offset was; the middle of the new lane is reached."""
    change = CHANGE.format("", '<AbsoluteTargetLane value="-2"/>')
    actions = [(1.0, HELD_OFFSET.format(1.2)), (5.0, change)]
    init = place("Ego", 100, 15) + place("Lead", 900, 0, 2)
    ego = track(play(tmp_path, init, story("Ego", actions)), "Ego")
    assert float(abs(ego["t"][1:] - ego["t"][:-1]).max()) < 0.25
    assert at(ego, 9.0, "t") == pytest.approx(-5.25, abs=1e-6)


def test_a_new_lane_change_takes_over_an_old_one_where_it_is(tmp_path: Path) -> None:
    change = CHANGE.format("", '<AbsoluteTargetLane value="{}"/>')
    actions = [(1.0, change.format(-2)), (2.0, change.format(1))]
    init = place("Ego", 100, 15) + place("Lead", 900, 0, 2)
    ego = track(play(tmp_path, init, story("Ego", actions)), "Ego")
    assert float(abs(ego["t"][1:] - ego["t"][:-1]).max()) < 0.3
    assert at(ego, 9.0, "t") == pytest.approx(1.75, abs=1e-6)


def test_a_relative_lane_counts_from_the_lane_below_in_a_change(tmp_path: Path) -> None:
    """Lead is more than half over to lane -2 when Ego is asked to be in its lane."""
    change = CHANGE.format("", '<AbsoluteTargetLane value="-2"/>')
    relative = CHANGE.format("", '<RelativeTargetLane entityRef="Lead" value="0"/>')
    for time, t in ((1.8, -1.75), (2.2, -5.25)):
        init = place("Ego", 100, 15) + place("Lead", 150, 15)
        stories = other(story("Lead", [(1.0, change)])) + story("Ego", [(time, relative)])
        ego = track(play(tmp_path, init, stories), "Ego")
        assert at(ego, 9.0, "t") == pytest.approx(t, abs=1e-6), time


@pytest.mark.parametrize(
    ("shape", "dimension", "value", "duration"),
    [
        ("linear", "time", 3.0, 3.0),
        ("sinusoidal", "distance", 45.0, 3.0),
        ("cubic", "rate", 1.75, 3.0),
    ],
)
def test_a_lane_change_takes_its_extent(
    shape: str, dimension: str, value: float, duration: float, tmp_path: Path
) -> None:
    change = CHANGE.format("", '<AbsoluteTargetLane value="-2"/>').replace(
        'dynamicsShape="cubic" value="2" dynamicsDimension="time"',
        f'dynamicsShape="{shape}" value="{value}" dynamicsDimension="{dimension}"',
    )
    init = place("Ego", 100, 15) + place("Lead", 900, 0, 2)
    ego = track(play(tmp_path, init, story("Ego", [(1.0, change)])), "Ego")
    moving = ego["time"][(abs(ego["t"] + 1.75) > 1e-3) & (abs(ego["t"] + 5.25) > 1e-3)]
    assert moving[-1] == pytest.approx(1.0 + duration, abs=0.11)


def test_speed_actions_do_not_disturb_a_lane_change(tmp_path: Path) -> None:
    change = CHANGE.format("", '<AbsoluteTargetLane value="-2"/>')
    slower = speed_action(5, 'dynamicsShape="linear" dynamicsDimension="rate" value="5"')
    init = place("Ego", 100, 15) + place("Lead", 900, 0, 2)
    stories = story("Ego", [(1.0, change)]) + other(story("Ego", [(1.5, slower)]))
    ego = track(play(tmp_path, init, stories), "Ego")
    assert at(ego, 3.05, "t") == pytest.approx(-5.25, abs=1e-3)
    assert at(ego, 3.6, "speed") == pytest.approx(5.0, abs=1e-6)


# lane offsets of roads --------------------------------------------------------------------------


def shifted(folder: Path) -> None:
    """The straight road, whose lanes move 2 m to the left from s = 200 m to 300 m."""
    text = (ROADS / "straight.xodr").read_text(encoding="utf-8")
    records = ((0, 0, 0), (200, 0, 0.02), (300, 2, 0))
    offsets = "".join(f'<laneOffset s="{s}" a="{a}" b="{b}" c="0" d="0"/>' for s, a, b in records)
    (folder / "straight.xodr").write_text(
        text.replace("<lanes>", f"<lanes>{offsets}"), encoding="utf-8"
    )


def test_a_car_follows_lanes_that_a_lane_offset_moves(tmp_path: Path) -> None:
    shifted(tmp_path)
    init = start("Ego", lane_position(-1, 150), 20) + start("Lead", lane_position(-2, 400, 0.5), 0)
    result = play(tmp_path, init)
    ego = track(result, "Ego")
    inside = abs(ego["s"] - 250.0).argmin()
    assert ego["y"][inside] == pytest.approx(-1.75 + 0.02 * (ego["s"][inside] - 200.0), abs=1e-6)
    assert ego["h"][inside] == pytest.approx(math.atan(0.02), abs=1e-3)
    assert at(ego, 9.0, "y") == pytest.approx(0.25)
    assert at(track(result, "Lead"), 1.0, "y") == pytest.approx(-2.75)


@pytest.mark.parametrize(
    ("position", "y"),
    [
        ('<RoadPosition roadId="1" s="400" t="-1"/>', -1.0),
        ('<RelativeLanePosition entityRef="Lead" dLane="1" ds="220"/>', 3.75),
        ('<RelativeRoadPosition entityRef="Lead" ds="220" dt="0"/>', -1.75),
    ],
)
def test_t_counts_from_the_reference_line_and_lanes_move(
    position: str, y: float, tmp_path: Path
) -> None:
    """RoadPosition, RelativeRoadPosition: t is that of the reference line,
    whatever the laneOffset.
    """
    shifted(tmp_path)
    ego, _ = placed_beside(tmp_path, position)
    assert (at(ego, 8.0, "x"), at(ego, 8.0, "y")) == pytest.approx((400.0, y))


def test_a_lane_change_ends_in_the_middle_of_a_lane_that_moves(tmp_path: Path) -> None:
    shifted(tmp_path)
    change = CHANGE.format("", '<AbsoluteTargetLane value="-2"/>')
    init = start("Ego", lane_position(-1, 180), 20) + start("Lead", lane_position(2, 400), 0)
    ego = track(play(tmp_path, init, story("Ego", [(1.0, change)])), "Ego")
    assert at(ego, 9.0, "y") == pytest.approx(-3.25, abs=1e-6)
