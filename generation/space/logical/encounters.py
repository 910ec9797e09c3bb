"""Encounters at junctions and roundabouts: the ego's course, the course it meets, and the logical
scenario of each."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from generation.space.logical import roads
from generation.space.logical.maneuvers import EGO
from generation.space.logical.roads import (
    ROADS,
    Course,
    Crossing,
    LaneId,
    LibraryRoad,
    Limits,
    Meeting,
    header,
    meeting,
    scenario_tags,
)
from recognition.labels import Label
from xodr.graph.network import RoadNetwork
from xosc.document import Document
from xosc.writing import maneuvers
from xosc.writing.maneuvers import Conditions
from xosc.writing.tags import Tag

Speeds = tuple[Limits, float]
STRAIGHT_ON: Speeds = ((4.0, 14.0), 11.0)
TURNING: Speeds = ((3.0, 8.0), 6.0)
CIRCULATING: Speeds = ((4.0, 10.0), 7.0)
WALKING: Speeds = ((0.8, 3.0), 1.5)


@dataclass(frozen=True)
class Encounter:
    """An ego that slows down for a junction and takes its course, and another one whose way it
    meets.

    Attributes:
        description: what happens. situation: the same in a word or two.
        label: its class, None where it is none of the 17.
        file: name of the road's file in `xodr/library`.
        ego: the ego's course.
        other: the other one's name.
        way: the other one's way.
        speeds: limits of the other one's speed, and its default, m/s.
        gap: by default, how long after the ego (before it, where negative) the other one is where
            their ways meet, s.
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
    "four_way_intersection": (
        "intersection_four_way_two_lanes",
        "at an intersection without traffic lights",
    ),
    "t_junction": ("t_junction_two_lanes", "at a T junction without traffic lights"),
}


def _course(origin: str, target: str, lane: int = 1) -> Course:
    """Route from an arm to another one, each in its lane of this number, counted from the middle of
    the road."""
    return Course(LaneId(origin, lane), LaneId(target, -lane))


EAST, NORTH, WEST, SOUTH = "1", "2", "3", "4"
"""Road ids of the arms of junctions; those of the roundabout are numbered in the same order,
counterclockwise."""


def _at_junctions() -> dict[str, Encounter]:
    """Return the encounters at each of the two junctions; the T junction has one
    way straight on.
    """
    encounters: dict[str, Encounter] = {}
    for name, (file, where) in _JUNCTIONS.items():
        # A T junction has no way from the south straight on: there the other one comes from that
        # arm.
        is_crossroad = name == "four_way_intersection"
        from_side = _course(SOUTH, NORTH), _course(WEST, EAST), STRAIGHT_ON, 2.5
        straight = (
            from_side
            if is_crossroad
            else (_course(WEST, EAST), _course(SOUTH, WEST), TURNING, -2.5)
        )
        encounters |= {
            f"unsignalised_left_turn_{name}": Encounter(
                f"The ego turns left in front of oncoming traffic, {where}", "left turn",
                Label.LEFT_TURN,
                file, _course(EAST, SOUTH), "Oncoming", _course(WEST, EAST), STRAIGHT_ON, 2.5,
            ),
            f"unsignalised_right_turn_{name}": Encounter(
                f"The ego turns right, a pedestrian crosses the road it turns into, {where}",
                "right turn", Label.RIGHT_TURN,
                file, _course(SOUTH, EAST, 2), "Pedestrian", Crossing(LaneId(EAST, -2), 6.0),
                WALKING, 2.0,
            ),
            f"unsignalised_straight_cross_{name}": Encounter(
                f"The ego goes straight on and crosses another vehicle's way, {where}",
                "straight cross", Label.STRAIGHT_CROSS,
                file, straight[0], "Crossing", *straight[1:],
            ),
            f"unsignalised_merging_{name}": Encounter(
                f"The ego turns right behind a vehicle that goes straight on, {where}", "merging",
                Label.MERGING,
                file, _course(SOUTH, EAST, 2), "Merging", _course(WEST, EAST, 2), STRAIGHT_ON, -1.5,
            ),
        }  # fmt: skip
    return encounters


ENCOUNTERS = _at_junctions() | {
    "roundabout_entering": Encounter(
        "The ego enters a roundabout in front of a vehicle in it", "roundabout entering",
        Label.ROUNDABOUT_ENTERING,
        "roundabout", _course("1", "3"), "Circulating", _course("4", "2"), CIRCULATING, 2.5,
    ),
    "roundabout_exiting": Encounter(
        "The ego leaves a roundabout, a pedestrian crosses the exit", "roundabout exiting",
        Label.ROUNDABOUT_EXITING,
        "roundabout", _course("4", "2"), "Pedestrian", Crossing(LaneId("2", -1), 6.0), WALKING, 2.0,
    ),
    "roundabout_circulating": Encounter(
        "The ego goes round in a roundabout, a vehicle enters before it", "roundabout circulating",
        Label.ROUNDABOUT_CIRCULATING,
        "roundabout", _course("4", "3"), "Entering", _course("1", "3"), CIRCULATING, -1.5,
    ),
}  # fmt: skip
"""By the names of their files."""


_LEAST = 1.0
"""Time (s) before the ego slows down, at least"""
_AFTER = 6.0
"""Time (s) of a scenario after both vehicles have passed the conflict point"""
_VEHICLES, _PEDESTRIANS = ("car", "van", "truck", "motorbike"), ("adult", "child")
_ENVIRONMENT = "Environment_Entry"
_START, _ARRIVAL = "Ego_SlowingStart_s", "Ego_ArrivalTime_s"
"""Parameters that follow from others: when the ego begins to slow down, and when it is where the
ways meet"""


@dataclass(frozen=True)
class EncounterScenario:
    """An encounter on a road.

    Attributes:
        name: of the scenario.
        network: the road.
    """

    name: str
    encounter: Encounter
    network: RoadNetwork

    @cached_property
    def meeting(self) -> Meeting:
        """Conflict point of the two ways."""
        return meeting(self.network, self.encounter.ego, self.encounter.way)

    @property
    def tags(self) -> list[Tag]:
        """Tags of the scenario."""
        encounter = self.encounter
        return scenario_tags(
            self.name,
            encounter.situation,
            encounter.label,
            encounter.map.tags,
            ("car", "pedestrian" if encounter.walks else "car"),
        )

    def document(self, path: Path, road: str) -> Document:
        """The scenario.

        Args:
            path: the file that it is to become.
            road: the road file, relative to it.
        """
        other, walks = self.encounter.other, self.encounter.walks
        catalog = roads.PEDESTRIAN if walks else roads.VEHICLE
        kinds = [
            "Vehicle",
            "Controller",
            "Maneuver",
            "Route",
            *(["Pedestrian", "Environment"] if walks else []),
        ]
        return maneuvers.scenario(
            path,
            header(self.encounter.description, self.tags),
            road=road,
            entities={
                EGO: maneuvers.reference(roads.VEHICLE, "car"),
                other: maneuvers.reference(catalog, f"${other}_Model"),
            },
            init={EGO: self._init_ego(), other: self._init_other()},
            maneuvers=self._maneuvers(),
            parameters=self._parameters(),
            catalogs={kind: roads.DIRECTORIES[kind] for kind in sorted(kinds)},
            stop=self._stop(),
            controllers={EGO: roads.SYSTEM},
            environment=maneuvers.reference(roads.ENVIRONMENT, f"${_ENVIRONMENT}")
            if walks
            else None,
        )

    def defaults(self) -> dict[str, float]:
        """Values of the numbers declared."""
        return {name: value for name, value, _ in self._numbers()}

    def _numbers(self) -> list[tuple[str, float, tuple[float, float]]]:
        """Declarations of numbers: name, value, limits."""
        other, (limits, speed) = self.encounter.other, self.encounter.speeds
        return [
            (f"{other}_ArrivalGap_s", self.encounter.gap, (-3.0, 3.0)),
            (f"{other}_Speed_mps", speed, limits),
            (f"{EGO}_Speed_mps", 11.0, (6.0, 14.0)),
            (f"{EGO}_JunctionSpeed_mps", 6.0, (3.0, 8.0)),
            (f"{EGO}_SlowingTime_s", 3.0, (2.0, 5.0)),
        ]

    def _parameters(self) -> list[Any]:
        """Numbers, choices, and what follows from them: when the ego begins to slow down, and is
        where the ways meet."""
        walks, other = self.encounter.walks, self.encounter.other
        # Words are no sides of the box: a search keeps their defaults, unless they are varied by a
        # file.
        choices = {f"{other}_Model": _PEDESTRIANS if walks else _VEHICLES}
        choices |= {_ENVIRONMENT: roads.ENVIRONMENTS} if walks else {}
        numbers = [
            maneuvers.parameter(
                name, "double", value, [[("greaterOrEqual", low), ("lessOrEqual", high)]]
            )
            for name, value, (low, high) in self._numbers()
        ]
        chosen = [
            maneuvers.parameter(
                name, "string", entries[0], [[("equalTo", entry)] for entry in entries]
            )
            for name, entries in choices.items()
        ]
        # From the start of slowing down to the conflict point: the slowing, then the way at
        # constant speed.
        slowing = f"$Ego_SlowingTime_s + {self.meeting.ego} / $Ego_JunctionSpeed_mps"
        # So late that the other one, too, begins within its arm (s ≥ 0).
        start = (
            f"max({_LEAST}, {self.meeting.other} / ${other}_Speed_mps - ${other}_ArrivalGap_s - "
            f"({slowing}))"
        )
        worked_out = {_START: start, _ARRIVAL: f"${_START} + {slowing}"}
        return (
            numbers
            + chosen
            + [
                maneuvers.parameter(name, "double", f"${{{term}}}")
                for name, term in worked_out.items()
            ]
        )

    # parts of the scenario

    def _init_ego(self) -> list[Any]:
        way = (
            f"$Ego_Speed_mps * ${_START} + ($Ego_Speed_mps + $Ego_JunctionSpeed_mps) / 2 * "
            "$Ego_SlowingTime_s"
        )
        return self._on_arm(self.encounter.ego, f"${{{way}}}", f"${EGO}_Speed_mps")

    def _init_other(self) -> list[Any]:
        way, name = self.encounter.way, self.encounter.other
        # Backwards from the arrival: so both meet by the gap, whatever their speeds are.
        speed = f"${name}_Speed_mps"
        length = f"{speed} * (${_ARRIVAL} + ${name}_ArrivalGap_s)"
        if isinstance(way, Course):
            return self._on_arm(way, f"${{max({length} - {self.meeting.other}, 0)}}", speed)
        heading = (
            self.network.pose(self.network.lane_point(*way.lane, way.s)).h + 0.5 * math.pi
        )  # to the left of the lane
        # In the world: a crossing has no lane of its own that a position could name.
        x, y = (
            f"${{{place} - ({round(step, 6)}) * {length}}}"
            for place, step in (
                (self.meeting.x, math.cos(heading)),
                (self.meeting.y, math.sin(heading)),
            )
        )
        return [
            maneuvers.teleport(maneuvers.world_position(x, y, h=round(heading, 6))),
            maneuvers.speed(speed),
        ]

    def _on_arm(self, course: Course, s: str, speed: str) -> list[Any]:
        return [
            maneuvers.teleport(maneuvers.lane_position(*course.origin, s)),
            maneuvers.speed(speed),
        ]

    def _maneuvers(self) -> list[tuple[str, Any]]:
        """Return the routes of the vehicles, and the ego's deceleration."""
        ways = {EGO: self.encounter.ego, self.encounter.other: self.encounter.way}
        routes = [
            roads.take_route(name, self.encounter.file, way)
            for name, way in ways.items()
            if isinstance(way, Course)
        ]
        # The catalogue's manoeuvre counts its delay from the start of the scenario.
        assigned = {
            "Delay_s": f"${_START}",
            "Duration_s": "$Ego_SlowingTime_s",
            "EndSpeed_mps": "$Ego_JunctionSpeed_mps",
        }
        return [*routes, (EGO, maneuvers.reference(roads.MANEUVER, "change_speed", assigned))]

    def _stop(self) -> Conditions:
        """Stop trigger: a collision of the ego, or some time after both should have been where
        their ways meet."""
        other = self.encounter.other
        end = f"${{${_ARRIVAL} + max(${other}_ArrivalGap_s, 0) + {_AFTER}}}"
        return [[maneuvers.collision(EGO, other)], [maneuvers.simulation_time(end)]]
