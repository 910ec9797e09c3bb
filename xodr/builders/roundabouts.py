"""Roundabout: a ring of road segments, and one junction at each arm.

Right-hand traffic circulates counterclockwise. Ring segment k leads from the junction of arm k to that of
the next arm; its lanes are -1 (inner) to -lanes (outer). Each junction has one connecting road for each lane
that passes, enters and leaves; circulating traffic has priority over entering traffic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from xodr.builders.curves import Pose, arc, line
from xodr.builders.elements import Connection, Junction, Link, Road, RoadMap, Section
from xodr.builders.roads import carriageway, connecting_road, for_traffic, require, two_way

ARM, RING, JUNCTION = 1, 11, 100
"""First ids of the arms (1, 2, …), ring segments (11, 12, …) and junctions (100, 200, …; their roads follow)."""


def roundabout(
    *, arms: int = 4, lanes: int = 1, lane_width: float = 4.0, radius: float = 16.0, arm: float = 120.0, flare: float = 14.0,
    speed_limit: float = 50 / 3.6, ring_speed_limit: float = 30 / 3.6, rule: str = "RHT",
) -> RoadMap:  # fmt: skip
    """A roundabout centred on the origin, its arms evenly spread from the x axis counterclockwise.

    Args:
        arms: number of arms, 3 to 6.
        lanes: lanes of the ring and of each direction of each arm, 1 or 2.
        lane_width: in m.
        radius: of the central island (inner border of the ring), in m.
        arm: length of each arm, in m.
        flare: distance between the ring's outer border and the arms' ends, in m, room for entry and exit curves.
        speed_limit, ring_speed_limit: in m/s. rule: RHT or LHT.
    """
    require("arms", arms, 3, 6)
    require("lanes", lanes, 1, 2)
    sizes = {"lane_width": lane_width, "arm": arm, "speed_limit": speed_limit, "ring_speed_limit": ring_speed_limit}
    for name, value in sizes.items():
        require(name, value, 0.1)
    require("flare", flare, 2.0)
    require("radius", radius, 5.0)
    site = _Roundabout(arms, lanes, lane_width, radius, arm, flare, speed_limit, ring_speed_limit)
    return for_traffic(site.build(), rule)


@dataclass(frozen=True)
class _Roundabout:
    arms: int
    lanes: int
    lane_width: float
    radius: float
    arm_length: float
    flare: float
    speed_limit: float
    ring_speed_limit: float

    @property
    def half_mouth(self) -> float:
        """Half the angle of the ring that belongs to one junction."""
        return 0.32 * 2 * math.pi / self.arms

    def build(self) -> RoadMap:
        outer = [self._arm(number) for number in range(self.arms)]
        ring = [self._segment(number) for number in range(self.arms)]
        built = [self._junction(number, outer[number], ring[number - 1], ring[number]) for number in range(self.arms)]
        paths = [path for _, connecting in built for path in connecting]
        return RoadMap("Roundabout", (*outer, *ring, *paths), tuple(junction for junction, _ in built))

    def _arm(self, number: int) -> Road:
        heading = number * 2 * math.pi / self.arms
        reach = self.radius + self.lanes * self.lane_width + self.flare
        start = Pose(reach * math.cos(heading), reach * math.sin(heading), heading)
        section = two_way(self.lanes, self.lanes, self.lane_width)
        return Road(
            ARM + number, f"Arm {number + 1}", start, (line(self.arm_length),), (section,), "town", self.speed_limit,
            predecessor=Link("junction", JUNCTION * (number + 1)),
        )  # fmt: skip

    def _segment(self, number: int) -> Road:
        step = 2 * math.pi / self.arms
        angle = number * step + self.half_mouth
        start = Pose(self.radius * math.cos(angle), self.radius * math.sin(angle), angle + math.pi / 2)
        section = Section(0.0, carriageway(self.lanes, self.lane_width), centre_mark="solid")
        plan = (arc(self.radius * (step - 2 * self.half_mouth), 1 / self.radius),)
        return Road(
            RING + number, f"Ring {number + 1}", start, plan, (section,), "town", self.ring_speed_limit,
            predecessor=Link("junction", JUNCTION * (number + 1)),
            successor=Link("junction", JUNCTION * ((number + 1) % self.arms + 1)),
        )  # fmt: skip

    def _junction(self, number: int, arm: Road, before: Road, after: Road) -> tuple[Junction, list[Road]]:
        """The junction of one arm: first all that passes, then what enters, then what leaves."""
        identity = JUNCTION * (number + 1)
        lanes = range(1, self.lanes + 1)
        pairs = (
            [((before, -lane), (after, -lane)) for lane in lanes]
            + [((arm, lane), (after, -lane)) for lane in lanes]
            + [((before, -lane), (arm, -lane)) for lane in lanes]
        )
        paths = [
            connecting_road(identity + 1 + index, identity, start, end, self.lane_width)
            for index, (start, end) in enumerate(pairs)
        ]
        connections = tuple(
            Connection(start[0].id, path.id, ((start[1], -1),)) for (start, _), path in zip(pairs, paths, strict=True)
        )
        entering = paths[self.lanes : 2 * self.lanes]
        priorities = tuple((high.id, low.id) for high in paths if high not in entering for low in entering)
        return Junction(identity, f"Junction of arm {number + 1}", connections, priorities), paths
