"""Encounters at junctions and roundabouts: which way the ego goes, and whose way it meets there."""

from __future__ import annotations

from dataclasses import dataclass

from generation.logical.courses import Course, Crossing, Lane
from generation.logical.geometries import Limits
from generation.logical.roads import ROADS, LibraryRoad
from recognition.labels import Label

Speeds = tuple[Limits, float]
STRAIGHT_ON: Speeds = ((4.0, 14.0), 11.0)
TURNING: Speeds = ((3.0, 8.0), 6.0)
CIRCULATING: Speeds = ((4.0, 10.0), 7.0)
WALKING: Speeds = ((0.8, 3.0), 1.5)


@dataclass(frozen=True)
class Encounter:
    """An ego that slows down for a junction and takes its course, and another one whose way it meets.

    Attributes:
        description: what happens. situation: the same in a word or two.
        label: its class, None where it is none of the 17.
        file: name of the road's file in `xodr/library`.
        ego: the ego's course.
        other: the other one's name.
        way: the other one's way.
        speeds: limits of the other one's speed, and its default, m/s.
        gap: by default, how long after the ego (before it, where negative) the other one is where their ways meet, s.
    """

    description: str
    situation: str
    label: Label
    file: str
    ego: Course
    other: str
    way: Course | Crossing
    speeds: Speeds
    gap: float

    @property
    def map(self) -> LibraryRoad:
        """The road file."""
        return ROADS[self.file]

    @property
    def walks(self) -> bool:
        """Whether the other one is a pedestrian."""
        return isinstance(self.way, Crossing)


_JUNCTIONS = {
    "four_way_intersection": ("intersection_four_way_two_lanes", "at an intersection without traffic lights"),
    "t_junction": ("t_junction_two_lanes", "at a T junction without traffic lights"),
}


def _course(origin: str, target: str, lane: int = 1) -> Course:
    """From an arm to another one, each in its lane of this number, counted from the middle of the road."""
    return Course(Lane(origin, lane), Lane(target, -lane))


EAST, NORTH, WEST, SOUTH = "1", "2", "3", "4"
"""Road ids of the arms of junctions; those of the roundabout are numbered in the same order, counterclockwise."""


def _at_junctions() -> dict[str, Encounter]:
    """Those that there are at each of the two junctions; straight on, the T junction has one way only."""
    found: dict[str, Encounter] = {}
    for name, (file, where) in _JUNCTIONS.items():
        is_crossroad = name == "four_way_intersection"
        from_side = _course(SOUTH, NORTH), _course(WEST, EAST), STRAIGHT_ON, 2.5
        straight = from_side if is_crossroad else (_course(WEST, EAST), _course(SOUTH, WEST), TURNING, -2.5)
        found |= {
            f"unsignalised_left_turn_{name}": Encounter(
                f"The ego turns left in front of oncoming traffic, {where}", "left turn", Label.LEFT_TURN,
                file, _course(EAST, SOUTH), "Oncoming", _course(WEST, EAST), STRAIGHT_ON, 2.5,
            ),
            f"unsignalised_right_turn_{name}": Encounter(
                f"The ego turns right, a pedestrian crosses the road it turns into, {where}", "right turn", Label.RIGHT_TURN,
                file, _course(SOUTH, EAST, 2), "Pedestrian", Crossing(Lane(EAST, -2), 6.0), WALKING, 2.0,
            ),
            f"unsignalised_straight_cross_{name}": Encounter(
                f"The ego goes straight on and crosses another vehicle's way, {where}", "straight cross", Label.STRAIGHT_CROSS,
                file, straight[0], "Crossing", *straight[1:],
            ),
            f"unsignalised_merging_{name}": Encounter(
                f"The ego turns right behind a vehicle that goes straight on, {where}", "merging", Label.MERGING,
                file, _course(SOUTH, EAST, 2), "Merging", _course(WEST, EAST, 2), STRAIGHT_ON, -1.5,
            ),
        }  # fmt: skip
    return found


ENCOUNTERS = _at_junctions() | {
    "roundabout_entering": Encounter(
        "The ego enters a roundabout in front of a vehicle in it", "roundabout entering", Label.ROUNDABOUT_ENTERING,
        "roundabout", _course("1", "3"), "Circulating", _course("4", "2"), CIRCULATING, 2.5,
    ),
    "roundabout_exiting": Encounter(
        "The ego leaves a roundabout, a pedestrian crosses the exit", "roundabout exiting", Label.ROUNDABOUT_EXITING,
        "roundabout", _course("4", "2"), "Pedestrian", Crossing(Lane("2", -1), 6.0), WALKING, 2.0,
    ),
    "roundabout_circulating": Encounter(
        "The ego goes round in a roundabout, a vehicle enters before it", "roundabout circulating", Label.ROUNDABOUT_CIRCULATING,
        "roundabout", _course("4", "3"), "Entering", _course("1", "3"), CIRCULATING, -1.5,
    ),
}  # fmt: skip
"""By the names of their files."""
