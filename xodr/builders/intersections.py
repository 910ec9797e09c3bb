"""Four-way intersection, T junction and roundabout.

Every arm is a road that begins at the junction and leads away from it: its right-hand lanes leave
the junction, its left-hand lanes enter it.

A roundabout is a ring of road segments with one junction at each arm. Right-hand traffic circulates
counterclockwise. Ring segment k leads from the junction of arm k to that of the next arm; its lanes
are -1 (inner) to -lanes (outer). Each junction has one connecting road for each lane that passes,
enters and leaves; circulating traffic has priority over entering traffic.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from xodr.builders.elements import (
    PlanPose,
    RoadDesign,
    RoadMap,
    SectionDesign,
    arc,
    connection,
    line,
    traffic_light,
)
from xodr.builders.roads_and_ramps import (
    carriageway,
    connecting_road,
    for_traffic,
    require,
    two_way,
)
from xodr.model import Controller, Junction, RoadLink, Signal

JUNCTION = 100
EAST, NORTH, WEST, SOUTH = 1, 2, 3, 4
"""Road ids of the arms; the road's name says where the arm lies as seen from the junction."""

_NAMES = {EAST: "East", NORTH: "North", WEST: "West", SOUTH: "South"}


def four_way_intersection(
    *, lanes: int = 1, lane_width: float = 3.5, arm: float = 150.0, corner_radius: float = 8.0,
    signals: bool = False,
    speed_limit: float = 50 / 3.6, rule: str = "RHT",
) -> RoadMap:  # fmt: skip
    """An urban intersection of two roads at right angles, centred on the origin.

    Args:
        lanes: driving lanes of each direction of each arm.
        lane_width, arm (length), corner_radius (of the kerb): in m.
        signals: with traffic lights, one for each approach; controller 1 switches east and west, 2
            north and south.
        speed_limit: in m/s. rule: RHT or LHT.
    """
    site = _IntersectionPlan(
        (EAST, NORTH, WEST, SOUTH), lanes, lane_width, arm, corner_radius, speed_limit, signals
    )
    return for_traffic(site.build("Four-way intersection"), rule)


def t_junction(
    *, lanes: int = 1, lane_width: float = 3.5, arm: float = 150.0, corner_radius: float = 8.0,
    signals: bool = False,
    speed_limit: float = 50 / 3.6, rule: str = "RHT",
) -> RoadMap:  # fmt: skip
    """A side road from the south that ends at a main road from west to east, which has the right of
    way.

    Arguments as those of `four_way_intersection`.
    """
    site = _IntersectionPlan(
        (EAST, WEST, SOUTH), lanes, lane_width, arm, corner_radius, speed_limit, signals
    )
    return for_traffic(site.build("T junction"), rule)


@dataclass(frozen=True)
class _IntersectionPlan:
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
        connections = tuple(
            connection(str(arm), path.id, ((lane, -1),)) for arm, lane, path in paths
        )
        controllers = self._controllers() if self.signals else ()
        # Three arms make a T whose straight road goes first; of four, none does. Lights need no
        # priorities.
        priorities = () if self.signals or len(self.arms) == 4 else _main_road_first(paths)
        switched = tuple(controller.id for controller in controllers)
        junction = Junction(str(JUNCTION), name, "default", connections, switched, priorities)
        return RoadMap(
            name, (*roads.values(), *(path for _, _, path in paths)), (junction,), controllers
        )

    def _arm(self, arm: int) -> RoadDesign:
        reach = self.lanes * self.lane_width + self.corner_radius
        heading = (arm - EAST) * math.pi / 2
        # Arms are at right angles: cosine and sine are 0 or ±1 but for rounding.
        start = PlanPose(
            round(math.cos(heading)) * reach, round(math.sin(heading)) * reach, heading
        )
        section = two_way(self.lanes, self.lanes, self.lane_width)
        lights: tuple[Signal, ...] = ()
        if self.signals:
            # Arms lead outwards, so arriving traffic drives against s, on the left lanes, with the
            # light beside them.
            t = self.lanes * self.lane_width + 1.0
            lights = (
                traffic_light(
                    arm, str(arm), 0.5, t, f"Signal {_NAMES[arm]}", (1, self.lanes), against=True
                ),
            )
        return RoadDesign(
            str(arm), _NAMES[arm], start, (line(self.arm_length),), (section,), "town",
            self.speed_limit,
            predecessor=RoadLink("junction", str(JUNCTION), None), signals=lights,
        )  # fmt: skip

    def _paths(self, roads: dict[int, RoadDesign]) -> Iterator[tuple[int, int, RoadDesign]]:
        """(incoming arm, incoming lane, connecting road): left turns from the inner lane, right
        turns from the outer one."""
        number = JUNCTION + 1
        for here in self.arms:
            for there in self.arms:
                # Arms are numbered counterclockwise: the next one is to the right of arriving
                # traffic.
                quarter = (there - here) % 4
                turns = {0: (), 1: (self.lanes,), 2: range(1, self.lanes + 1), 3: (1,)}
                for lane in turns[quarter]:
                    path = connecting_road(
                        number,
                        JUNCTION,
                        (roads[here], lane),
                        (roads[there], -lane),
                        self.lane_width,
                    )
                    yield here, lane, path
                    number += 1

    def _controllers(self) -> tuple[Controller, ...]:
        main = tuple(str(arm) for arm in self.arms if arm in (EAST, WEST))
        side = tuple(str(arm) for arm in self.arms if arm in (NORTH, SOUTH))
        return Controller("1", "East and west", None, main), Controller(
            "2", "North and south", None, side
        )


def _main_road_first(paths: list[tuple[int, int, RoadDesign]]) -> tuple[tuple[str, str], ...]:
    main = [path.id for arm, _, path in paths if arm in (EAST, WEST)]
    side = [path.id for arm, _, path in paths if arm not in (EAST, WEST)]
    return tuple((high, low) for high in main for low in side)


ARM, RING, JUNCTION = 1, 11, 100
"""First ids of the arms (1, 2, …), ring segments (11, 12, …) and junctions (100, 200, …; their
roads follow)."""


def roundabout(
    *, arms: int = 4, lanes: int = 1, lane_width: float = 4.0, radius: float = 16.0,
    arm: float = 120.0, flare: float = 14.0,
    speed_limit: float = 50 / 3.6, ring_speed_limit: float = 30 / 3.6, rule: str = "RHT",
) -> RoadMap:  # fmt: skip
    """A roundabout centred on the origin, its arms evenly spread from the x axis counterclockwise.

    Args:
        arms: number of arms, 3 to 6.
        lanes: lanes of the ring and of each direction of each arm, 1 or 2.
        lane_width: in m.
        radius: of the central island (inner border of the ring), in m.
        arm: length of each arm, in m.
        flare: distance between the ring's outer border and the arms' ends, in m, room for entry and
            exit curves.
        speed_limit, ring_speed_limit: in m/s. rule: RHT or LHT.
    """
    require("arms", arms, 3, 6)
    require("lanes", lanes, 1, 2)
    sizes = {
        "lane_width": lane_width,
        "arm": arm,
        "speed_limit": speed_limit,
        "ring_speed_limit": ring_speed_limit,
    }
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
        # Leaves about a third of the ring to the segments between the junctions.
        return 0.32 * 2 * math.pi / self.arms

    def build(self) -> RoadMap:
        outer = [self._arm(number) for number in range(self.arms)]
        ring = [self._segment(number) for number in range(self.arms)]
        built = [
            self._junction(number, outer[number], ring[number - 1], ring[number])
            for number in range(self.arms)
        ]
        paths = [path for _, connecting in built for path in connecting]
        return RoadMap(
            "Roundabout", (*outer, *ring, *paths), tuple(junction for junction, _ in built)
        )

    def _arm(self, number: int) -> RoadDesign:
        heading = number * 2 * math.pi / self.arms
        reach = self.radius + self.lanes * self.lane_width + self.flare
        start = PlanPose(reach * math.cos(heading), reach * math.sin(heading), heading)
        section = two_way(self.lanes, self.lanes, self.lane_width)
        return RoadDesign(
            str(ARM + number), f"Arm {number + 1}", start, (line(self.arm_length),), (section,),
            "town", self.speed_limit,
            predecessor=RoadLink("junction", str(JUNCTION * (number + 1)), None),
        )  # fmt: skip

    def _segment(self, number: int) -> RoadDesign:
        step = 2 * math.pi / self.arms
        angle = number * step + self.half_mouth
        start = PlanPose(
            self.radius * math.cos(angle), self.radius * math.sin(angle), angle + math.pi / 2
        )
        section = SectionDesign(0.0, carriageway(self.lanes, self.lane_width), centre_mark="solid")
        plan = (arc(self.radius * (step - 2 * self.half_mouth), 1 / self.radius),)
        return RoadDesign(
            str(RING + number), f"Ring {number + 1}", start, plan, (section,), "town",
            self.ring_speed_limit,
            predecessor=RoadLink("junction", str(JUNCTION * (number + 1)), None),
            successor=RoadLink("junction", str(JUNCTION * ((number + 1) % self.arms + 1)), None),
        )  # fmt: skip

    def _junction(
        self, number: int, arm: RoadDesign, before: RoadDesign, after: RoadDesign
    ) -> tuple[Junction, list[RoadDesign]]:
        """The junction of one arm, and its paths: those that pass, then enter, then leave."""
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
            connection(start[0].id, path.id, ((start[1], -1),))
            for (start, _), path in zip(pairs, paths, strict=True)
        )
        # The middle one of three groups of paths, as listed above.
        entering = paths[self.lanes : 2 * self.lanes]
        priorities = tuple(
            (high.id, low.id) for high in paths if high not in entering for low in entering
        )
        return Junction(
            str(identity),
            f"Junction of arm {number + 1}",
            "default",
            connections,
            priorities=priorities,
        ), paths
