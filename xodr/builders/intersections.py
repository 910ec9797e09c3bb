"""Four-way intersection and T junction.

Every arm is a road that begins at the junction and leads away from it: its right-hand lanes leave the
junction, its left-hand lanes enter it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from xodr.builders.curves import Pose, line
from xodr.builders.elements import Connection, Controller, Junction, Link, Road, RoadId, RoadMap, Signal
from xodr.builders.roads import connecting_road, for_traffic, require, two_way

JUNCTION = 100
EAST, NORTH, WEST, SOUTH = 1, 2, 3, 4
"""Road ids of the arms; the road's name says where the arm lies as seen from the junction."""

_NAMES = {EAST: "East", NORTH: "North", WEST: "West", SOUTH: "South"}


def four_way_intersection(
    *, lanes: int = 1, lane_width: float = 3.5, arm: float = 150.0, corner_radius: float = 8.0, signals: bool = False,
    speed_limit: float = 50 / 3.6, rule: str = "RHT",
) -> RoadMap:  # fmt: skip
    """An urban intersection of two roads at right angles, centred on the origin.

    Args:
        lanes: driving lanes of each direction of each arm.
        lane_width, arm (length), corner_radius (of the kerb): in m.
        signals: with traffic lights, one for each approach; controller 1 switches east and west, 2 north and south.
        speed_limit: in m/s. rule: RHT or LHT.
    """
    site = _Crossing((EAST, NORTH, WEST, SOUTH), lanes, lane_width, arm, corner_radius, speed_limit, signals)
    return for_traffic(site.build("Four-way intersection"), rule)


def t_junction(
    *, lanes: int = 1, lane_width: float = 3.5, arm: float = 150.0, corner_radius: float = 8.0, signals: bool = False,
    speed_limit: float = 50 / 3.6, rule: str = "RHT",
) -> RoadMap:  # fmt: skip
    """A side road from the south that ends at a main road from west to east, which has the right of way.

    Arguments as those of `four_way_intersection`.
    """
    site = _Crossing((EAST, WEST, SOUTH), lanes, lane_width, arm, corner_radius, speed_limit, signals)
    return for_traffic(site.build("T junction"), rule)


@dataclass(frozen=True)
class _Crossing:
    arms: tuple[int, ...]
    lanes: int
    lane_width: float
    arm_length: float
    corner_radius: float
    speed_limit: float
    signals: bool

    def build(self, name: str) -> RoadMap:
        """The map, with its arms, the ways through the junction, and their rights of way or lights.

        Raises:
            UsageError: a size is out of its limits.
        """
        require("lanes", self.lanes, 1, 4)
        for key in ("lane_width", "arm_length", "speed_limit", "corner_radius"):
            require(key, getattr(self, key), 0.1)
        roads = {arm: self._arm(arm) for arm in self.arms}
        paths = list(self._paths(roads))
        connections = tuple(Connection(arm, path.id, ((lane, -1),)) for arm, lane, path in paths)
        controllers = self._controllers() if self.signals else ()
        priorities = () if self.signals or len(self.arms) == 4 else _main_road_first(paths)
        junction = Junction(JUNCTION, name, connections, priorities, tuple(controller.id for controller in controllers))
        return RoadMap(name, (*roads.values(), *(path for _, _, path in paths)), (junction,), controllers)

    def _arm(self, arm: int) -> Road:
        reach = self.lanes * self.lane_width + self.corner_radius
        heading = (arm - EAST) * math.pi / 2
        start = Pose(round(math.cos(heading)) * reach, round(math.sin(heading)) * reach, heading)
        section = two_way(self.lanes, self.lanes, self.lane_width)
        lights: tuple[Signal, ...] = ()
        if self.signals:
            t = self.lanes * self.lane_width + 1.0
            lights = (Signal(arm, f"Signal {_NAMES[arm]}", 0.5, t, "-", (1, self.lanes)),)
        return Road(
            arm, _NAMES[arm], start, (line(self.arm_length),), (section,), "town", self.speed_limit,
            predecessor=Link("junction", JUNCTION), signals=lights,
        )  # fmt: skip

    def _paths(self, roads: dict[int, Road]) -> Iterator[tuple[int, int, Road]]:
        """(incoming arm, incoming lane, connecting road): left turns from the inner lane, right turns from the outer one."""
        number = JUNCTION + 1
        for here in self.arms:
            for there in self.arms:
                quarter = (there - here) % 4
                turns = {0: (), 1: (self.lanes,), 2: range(1, self.lanes + 1), 3: (1,)}
                for lane in turns[quarter]:
                    path = connecting_road(number, JUNCTION, (roads[here], lane), (roads[there], -lane), self.lane_width)
                    yield here, lane, path
                    number += 1

    def _controllers(self) -> tuple[Controller, ...]:
        main = tuple(arm for arm in self.arms if arm in (EAST, WEST))
        side = tuple(arm for arm in self.arms if arm in (NORTH, SOUTH))
        return Controller(1, "East and west", main), Controller(2, "North and south", side)


def _main_road_first(paths: list[tuple[int, int, Road]]) -> tuple[tuple[RoadId, RoadId], ...]:
    main = [path.id for arm, _, path in paths if arm in (EAST, WEST)]
    side = [path.id for arm, _, path in paths if arm not in (EAST, WEST)]
    return tuple((high, low) for high in main for low in side)
