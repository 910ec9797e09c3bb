"""How an encounter becomes a scenario.

The ego keeps its speed for a while, slows down evenly to the speed that it has at the end of its arm, and takes its course with
that. The other one keeps its speed throughout. Where it begins follows from when it is to be where their ways meet: so the gap
between the two arrivals is a parameter. The ego's time before it slows down is long enough for the other one to begin on its arm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from generation.logical import catalogs
from generation.logical.courses import Course
from generation.logical.encounters import Encounter
from generation.logical.header import header, scenario_tags
from generation.logical.maneuvers import EGO
from generation.logical.ways import Meeting, meeting
from xodr.network import RoadNetwork
from xosc import maneuvers
from xosc.document import Document
from xosc.maneuvers import Conditions
from xosc.tags import Tag

_LEAST = 1.0
"""Time (s) before the ego slows down, at least"""
_AFTER = 6.0
"""How long (s) a scenario goes on when both have been where their ways meet"""
_VEHICLES, _PEDESTRIANS = ("car", "van", "truck", "motorbike"), ("adult", "child")
_ENVIRONMENT = "Environment_Entry"
_START, _ARRIVAL = "Ego_SlowingStart_s", "Ego_ArrivalTime_s"
"""Parameters that follow from others: when the ego begins to slow down, and when it is where the ways meet"""


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
        """Where the two ways meet."""
        return meeting(self.network, self.encounter.ego, self.encounter.way)

    @property
    def tags(self) -> list[Tag]:
        """Tags of the scenario."""
        each = self.encounter
        return scenario_tags(self.name, each.situation, each.label, each.map.tags, ("car", "pedestrian" if each.walks else "car"))

    def document(self, path: Path, road: str) -> Document:
        """The scenario.

        Args:
            path: the file that it is to become.
            road: the road file, relative to it.
        """
        other, walks = self.encounter.other, self.encounter.walks
        catalog = catalogs.PEDESTRIAN if walks else catalogs.VEHICLE
        kinds = ["Vehicle", "Controller", "Maneuver", "Route", *(["Pedestrian", "Environment"] if walks else [])]
        return maneuvers.scenario(
            path,
            header(self.encounter.description, self.tags),
            road=road,
            entities={
                EGO: maneuvers.reference(catalogs.VEHICLE, "car"),
                other: maneuvers.reference(catalog, f"${other}_Model"),
            },
            init={EGO: self._init_ego(), other: self._init_other()},
            maneuvers=self._maneuvers(),
            parameters=self._parameters(),
            catalogs={kind: catalogs.DIRECTORIES[kind] for kind in sorted(kinds)},
            stop=self._stop(),
            controllers={EGO: catalogs.SYSTEM},
            environment=maneuvers.reference(catalogs.ENVIRONMENT, f"${_ENVIRONMENT}") if walks else None,
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
        """Numbers, choices, and what follows from them: when the ego begins to slow down, and is where the ways meet."""
        walks, other = self.encounter.walks, self.encounter.other
        choices = {f"{other}_Model": _PEDESTRIANS if walks else _VEHICLES}
        choices |= {_ENVIRONMENT: catalogs.ENVIRONMENTS} if walks else {}
        numbers = [
            maneuvers.parameter(name, "double", value, [[("greaterOrEqual", low), ("lessOrEqual", high)]])
            for name, value, (low, high) in self._numbers()
        ]
        chosen = [
            maneuvers.parameter(name, "string", entries[0], [[("equalTo", entry)] for entry in entries])
            for name, entries in choices.items()
        ]
        slowing = f"$Ego_SlowingTime_s + {self.meeting.ego} / $Ego_JunctionSpeed_mps"
        start = f"max({_LEAST}, {self.meeting.other} / ${other}_Speed_mps - ${other}_ArrivalGap_s - ({slowing}))"
        worked_out = {_START: start, _ARRIVAL: f"${_START} + {slowing}"}
        return numbers + chosen + [maneuvers.parameter(name, "double", f"${{{term}}}") for name, term in worked_out.items()]

    # parts of the scenario

    def _init_ego(self) -> list[Any]:
        way = f"$Ego_Speed_mps * ${_START} + ($Ego_Speed_mps + $Ego_JunctionSpeed_mps) / 2 * $Ego_SlowingTime_s"
        return self._on_arm(self.encounter.ego, f"${{{way}}}", f"${EGO}_Speed_mps")

    def _init_other(self) -> list[Any]:
        way, name = self.encounter.way, self.encounter.other
        speed = f"${name}_Speed_mps"
        length = f"{speed} * (${_ARRIVAL} + ${name}_ArrivalGap_s)"
        if isinstance(way, Course):
            return self._on_arm(way, f"${{max({length} - {self.meeting.other}, 0)}}", speed)
        heading = self.network.pose(self.network.lane_point(*way.lane, way.s)).h + 0.5 * math.pi  # to the left of the lane
        x, y = (
            f"${{{place} - ({round(step, 6)}) * {length}}}"
            for place, step in ((self.meeting.x, math.cos(heading)), (self.meeting.y, math.sin(heading)))
        )
        return [maneuvers.teleport(maneuvers.world_position(x, y, h=round(heading, 6))), maneuvers.speed(speed)]

    def _on_arm(self, course: Course, s: str, speed: str) -> list[Any]:
        return [maneuvers.teleport(maneuvers.lane_position(*course.origin, s)), maneuvers.speed(speed)]

    def _maneuvers(self) -> list[tuple[str, Any]]:
        """Who takes which route, and that the ego slows down."""
        ways = {EGO: self.encounter.ego, self.encounter.other: self.encounter.way}
        routes = [catalogs.take_route(name, self.encounter.file, way) for name, way in ways.items() if isinstance(way, Course)]
        assigned = {"Delay_s": f"${_START}", "Duration_s": "$Ego_SlowingTime_s", "EndSpeed_mps": "$Ego_JunctionSpeed_mps"}
        return [*routes, (EGO, maneuvers.reference(catalogs.MANEUVER, "change_speed", assigned))]

    def _stop(self) -> Conditions:
        """At a collision of the ego, or when both should have been where their ways meet for a while."""
        other = self.encounter.other
        end = f"${{${_ARRIVAL} + max(${other}_ArrivalGap_s, 0) + {_AFTER}}}"
        return [[maneuvers.collision(EGO, other)], [maneuvers.simulation_time(end)]]
