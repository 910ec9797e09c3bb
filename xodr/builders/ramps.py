"""Motorway ramps: on-ramp (merge) and off-ramp (diverge).

Both are the same picture in opposite directions of travel: a carriageway along the x axis, a junction in
which an arc joins the ramp to the carriageway's right-hand edge, an extra lane beside the carriageway, and
a taper in which that lane ends or begins. Road 1 is upstream of the junction, road 2 downstream, road 3 the
ramp; the junction has the id 100, its connecting roads are 101 (through) and 102 (ramp).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from xodr.builders.curves import Pose, arc, line
from xodr.builders.elements import Connection, Cubic, Junction, Lane, Link, Road, RoadMap, Section
from xodr.builders.roads import carriageway, closing, constant, for_traffic, linked, opening, require

GORE = 1.0
"""Distance between the shoulder of the carriageway and the ramp where the junction ends, in m."""

JUNCTION, THROUGH, RAMP = 100, 101, 102
MOUTH = Link("junction", JUNCTION)


def on_ramp(
    *, lanes: int = 2, lane_width: float = 3.75, ramp_width: float = 4.0, shoulder: float = 2.5, upstream: float = 500.0,
    acceleration: float = 250.0, taper: float = 75.0, downstream: float = 600.0, ramp: float = 200.0, angle: float = 0.07,
    speed_limit: float = 120 / 3.6, ramp_speed_limit: float = 80 / 3.6, rule: str = "RHT",
) -> RoadMap:  # fmt: skip
    """A motorway with an on-ramp that merges over an acceleration lane.

    Args:
        lanes: driving lanes of the carriageway; lane -(lanes + 1) of road 2 is the acceleration lane.
        lane_width, ramp_width, shoulder: in m.
        upstream: length of road 1. acceleration, taper, downstream: lengths of the three sections of road 2. ramp: of road 3.
        angle: between ramp and carriageway, in rad.
        speed_limit, ramp_speed_limit: in m/s. rule: RHT or LHT.
    """
    site = _Site(lanes, lane_width, ramp_width, shoulder, angle, speed_limit, ramp_speed_limit)
    site.check(upstream=upstream, acceleration=acceleration, taper=taper, downstream=downstream, ramp=ramp)
    before = site.main_road(1, Pose(0, 0, 0), upstream, (site.plain(0.0),))
    sections = (
        linked(site.wide(0.0, "entry", constant(lane_width)), {}, None),
        linked(site.wide(acceleration, "entry", closing(lane_width, taper)), None, site.wide_to_plain),
        linked(site.plain(acceleration + taper), site.plain_to_wide, {}),
    )
    after = site.main_road(2, site.beyond(before), acceleration + taper + downstream, sections)
    gore = Pose(before.end.x, site.edge - shoulder - GORE, angle)
    start = Pose(gore.x - ramp * math.cos(angle), gore.y - ramp * math.sin(angle), angle)
    access = site.ramp_road("On-ramp", "onRamp", start, ramp, successor=MOUTH)
    fading = Lane("shoulder", site.fading(-1), predecessor=-lanes - 1)
    joining = site.ramp_connection(access.end, (3, -1, ramp_width), (2, -lanes - 1, lane_width), "onRamp")
    roads = (before, after, access, site.through(before.end, fading), joining)
    main = ((-lanes - 1, -lanes - 1),)
    return site.assemble("On-ramp", roads, main, Connection(3, RAMP, ((-1, -1), (-2, -2))), rule)


def off_ramp(
    *, lanes: int = 2, lane_width: float = 3.75, ramp_width: float = 4.0, shoulder: float = 2.5, upstream: float = 600.0,
    deceleration: float = 250.0, taper: float = 75.0, downstream: float = 500.0, ramp: float = 200.0, angle: float = 0.07,
    speed_limit: float = 120 / 3.6, ramp_speed_limit: float = 80 / 3.6, rule: str = "RHT",
) -> RoadMap:  # fmt: skip
    """A motorway with an off-ramp that diverges from a deceleration lane.

    Args:
        lanes: driving lanes of the carriageway; lane -(lanes + 1) of road 1 is the deceleration lane.
        lane_width, ramp_width, shoulder: in m.
        upstream, taper, deceleration: lengths of the three sections of road 1. downstream: of road 2. ramp: of road 3.
        angle: between ramp and carriageway, in rad.
        speed_limit, ramp_speed_limit: in m/s. rule: RHT or LHT.
    """
    site = _Site(lanes, lane_width, ramp_width, shoulder, angle, speed_limit, ramp_speed_limit)
    site.check(upstream=upstream, taper=taper, deceleration=deceleration, downstream=downstream, ramp=ramp)
    sections = (
        linked(site.plain(0.0), {}, site.plain_to_wide),
        linked(site.wide(upstream, "exit", opening(lane_width, taper)), site.wide_to_plain, None),
        linked(site.wide(upstream + taper, "exit", constant(lane_width)), None, {}),
    )
    before = site.main_road(1, Pose(0, 0, 0), upstream + taper + deceleration, sections)
    after = site.main_road(2, site.beyond(before), downstream, (site.plain(0.0),))
    leaving = site.ramp_connection(before.end.shifted(site.edge), (1, -lanes - 1, lane_width), (3, -1, ramp_width), "offRamp")
    exit_ = site.ramp_road("Off-ramp", "offRamp", leaving.end, ramp, predecessor=MOUTH)
    growing = Lane("shoulder", site.fading(+1), successor=-lanes - 1)
    roads = (before, after, exit_, site.through(before.end, growing), leaving)
    return site.assemble("Off-ramp", roads, (), Connection(1, RAMP, ((-lanes - 1, -1), (-lanes - 2, -2))), rule)


@dataclass(frozen=True)
class _Site:
    """Shared part of on-ramp and off-ramp."""

    lanes: int
    lane_width: float
    ramp_width: float
    shoulder: float
    angle: float
    speed_limit: float
    ramp_speed_limit: float

    def check(self, **lengths: float) -> None:
        """UsageError for parameters that make no sense."""
        require("lanes", self.lanes, 1)
        require("angle", self.angle, 0.01, 0.5)
        require("shoulder", self.shoulder, 0.1)
        for name in ("lane_width", "ramp_width", "speed_limit", "ramp_speed_limit"):
            require(name, getattr(self, name), 0.1)
        for name, length in lengths.items():
            require(name, length, 1.0)

    @property
    def edge(self) -> float:
        """t of the right-hand edge of the carriageway's driving lanes."""
        return -self.lanes * self.lane_width

    @property
    def radius(self) -> float:
        """Radius of the ramp's arc: from parallel to `angle` while it leaves shoulder and gore."""
        return (self.shoulder + GORE) / (1 - math.cos(self.angle))

    @property
    def plain_to_wide(self) -> dict[int, int]:
        """Lanes of the section without the extra lane and their neighbours in the one with it."""
        same = {-number: -number for number in range(1, self.lanes + 1)}
        return same | {-self.lanes - 1: -self.lanes - 2}

    @property
    def wide_to_plain(self) -> dict[int, int]:
        """The inverse of `plain_to_wide`: the extra lane has no neighbour."""
        return {wide: plain for plain, wide in self.plain_to_wide.items()}

    def plain(self, s: float) -> Section:
        """Driving lanes and shoulder."""
        return Section(s, carriageway(self.lanes, self.lane_width, edge=self.shoulder), centre_mark="solid")

    def wide(self, s: float, kind: str, width: tuple[Cubic, ...]) -> Section:
        """Driving lanes, the extra lane and the shoulder."""
        layout = carriageway(self.lanes + 1, self.lane_width, edge=self.shoulder)
        layout[-self.lanes - 1] = Lane(kind, width, mark="solid")
        return Section(s, layout, centre_mark="solid")

    def ramp_road(
        self, name: str, kind: str, start: Pose, length: float, *, predecessor: Link | None = None, successor: Link | None = None
    ) -> Road:
        """Road 3: the ramp's lane and its shoulder."""
        lanes = {-1: Lane(kind, constant(self.ramp_width), mark="solid"), -2: Lane("shoulder", constant(self.shoulder))}
        return Road(
            3, name, start, (line(length),), (Section(0.0, lanes, "solid"),), "motorway", self.ramp_speed_limit,
            predecessor=predecessor, successor=successor,
        )  # fmt: skip

    def fading(self, direction: int) -> tuple[Cubic, ...]:
        """Width of the shoulder beside the ramp's arc: from full to nothing (-1) or the other way (+1)."""
        length = self.radius * math.sin(self.angle)
        if direction > 0:
            return (Cubic(0.0, 0.0, 0.0, self.shoulder / length**2),)
        return (Cubic(0.0, self.shoulder, -2 * self.shoulder / length, self.shoulder / length**2),)

    def main_road(self, number: int, start: Pose, length: float, sections: tuple[Section, ...]) -> Road:
        """Road 1 ends at the junction, road 2 begins there."""
        name, before, after = ("Upstream", None, MOUTH) if number == 1 else ("Downstream", MOUTH, None)
        return Road(
            number, name, start, (line(length),), sections, "motorway", self.speed_limit, predecessor=before, successor=after
        )

    def beyond(self, before: Road) -> Pose:
        """Return the pose at which the carriageway leaves the junction."""
        return Pose(before.end.x + self.radius * math.sin(self.angle), before.end.y, before.end.heading)

    def through(self, start: Pose, shoulder: Lane) -> Road:
        """The connecting road of the carriageway."""
        section = linked(self.plain(0.0), None, None)
        lanes = {**section.lanes, -self.lanes - 1: shoulder}
        plan = (line(self.radius * math.sin(self.angle)),)
        return Road(
            THROUGH, "Through", start, plan, (Section(0.0, lanes, "solid"),), "motorway", self.speed_limit, junction=JUNCTION,
            predecessor=Link("road", 1, "end"), successor=Link("road", 2, "start"),
        )  # fmt: skip

    def ramp_connection(self, start: Pose, before: tuple[int, int, float], after: tuple[int, int, float], kind: str) -> Road:
        """The connecting road of the ramp, from and to (road, lane, lane width): an arc to the right."""
        length = self.radius * self.angle
        change = after[2] - before[2]
        width = (Cubic(0.0, before[2], 0.0, 3 * change / length**2, -2 * change / length**3),)
        lanes = {
            -1: Lane(kind, width, "solid", before[1], after[1]),
            -2: Lane("shoulder", constant(self.shoulder), "none", before[1] - 1, after[1] - 1),
        }
        return Road(
            RAMP, "Ramp connection", start, (arc(length, -1 / self.radius),), (Section(0.0, lanes, "solid"),), "motorway",
            self.ramp_speed_limit, junction=JUNCTION,
            predecessor=Link("road", before[0], "end"), successor=Link("road", after[0], "start"),
        )  # fmt: skip

    def assemble(
        self, name: str, roads: tuple[Road, ...], extra: tuple[tuple[int, int], ...], ramp: Connection, rule: str
    ) -> RoadMap:
        """The whole map; `extra` are lane pairs of the through connection beside the driving lanes."""
        main = Connection(1, THROUGH, tuple((-number, -number) for number in range(1, self.lanes + 1)) + extra)
        junction = Junction(JUNCTION, name, (main, ramp), priorities=((THROUGH, RAMP),))
        return for_traffic(RoadMap(name, roads, (junction,)), rule)
