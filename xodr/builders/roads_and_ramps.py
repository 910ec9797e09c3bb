"""Single roads (straight, sharp curve, narrow, assumed for scenarios without one), motorway ramps,
lane layouts of all builders.

On-ramp (merge) and off-ramp (diverge) are the same picture in opposite directions of travel: a
carriageway along the x axis, a junction in which an arc joins the ramp to the carriageway's
right-hand edge, an extra lane beside the carriageway, and a taper in which that lane ends or
begins. Road 1 is upstream of the junction, road 2 downstream, road 3 the ramp; the junction has the
id 100, its connecting roads are 101 (through) and 102 (ramp).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

from schemas.common.errors import UsageError
from xodr.builders.elements import (
    Clothoid,
    LaneDesign,
    PlanPose,
    RoadDesign,
    RoadMap,
    SectionDesign,
    arc,
    connect,
    connection,
    line,
)
from xodr.model import Connection, Junction, RoadLink
from xodr.model.geometry import Cubic

# single roads -----------------------------------------------------------------------------------


LANE = "driving"


def require(name: str, value: float, minimum: float, maximum: float = math.inf) -> None:
    """UsageError unless `minimum` <= value <= `maximum` and the value is finite."""
    if not (math.isfinite(value) and minimum <= value <= maximum):
        bounds = (
            f"between {minimum:g} and {maximum:g}"
            if math.isfinite(maximum)
            else f"at least {minimum:g}"
        )
        raise UsageError(f"{name}={value!r} must be {bounds}")


def for_traffic(built: RoadMap, rule: str) -> RoadMap:
    """A map that was built for right-hand traffic, for the asked side: `RHT` or `LHT`."""
    if rule not in ("RHT", "LHT"):
        raise UsageError(f"rule={rule!r} must be RHT or LHT")
    return built if rule == "RHT" else built.mirrored()


def constant(width: float) -> tuple[Cubic, ...]:
    """A width that does not change."""
    return (Cubic(0.0, width),)


def opening(width: float, length: float) -> tuple[Cubic, ...]:
    """A width that grows smoothly from 0 to `width` over `length` (zero slope at both ends)."""
    return (Cubic(0.0, 0.0, 0.0, 3 * width / length**2, -2 * width / length**3),)


def closing(width: float, length: float) -> tuple[Cubic, ...]:
    """A width that shrinks smoothly from `width` to 0 over `length`."""
    return (Cubic(0.0, width, 0.0, -3 * width / length**2, 2 * width / length**3),)


def carriageway(
    lanes: int, width: float, side: int = -1, edge: float = 0.0
) -> dict[int, LaneDesign]:
    """`lanes` driving lanes on one side (-1 right, +1 left of the reference line) and, where `edge`
    > 0, a shoulder."""
    built = {
        side * number: LaneDesign(
            LANE, constant(width), mark="broken" if number < lanes else "solid"
        )
        for number in range(1, lanes + 1)
    }
    if edge > 0:
        built[side * (lanes + 1)] = LaneDesign("shoulder", constant(edge))
    return built


def linked(
    section: SectionDesign, predecessors: dict[int, int] | None, successors: dict[int, int] | None
) -> SectionDesign:
    """The section with lane links filled in; None links every lane to its own id, an empty table
    none."""
    lanes = {
        key: replace(
            lane,
            predecessor=key if predecessors is None else predecessors.get(key),
            successor=key if successors is None else successors.get(key),
        )
        for key, lane in section.lanes.items()
    }
    return replace(section, lanes=lanes)


def two_way(lanes: int, opposite: int, width: float, edge: float = 0.0) -> SectionDesign:
    """Driving lanes on both sides of the reference line, with a shoulder where `edge` > 0."""
    layout = carriageway(lanes, width, edge=edge)
    if opposite:
        layout |= carriageway(opposite, width, side=1, edge=edge)
    return SectionDesign(
        0.0, layout, centre_mark="broken" if lanes + opposite < 4 else "solid solid"
    )


def connecting_road(
    number: int,
    junction: int,
    before: tuple[RoadDesign, int],
    after: tuple[RoadDesign, int],
    width: float,
) -> RoadDesign:
    """One lane (-1) through a junction, from a lane to a lane of equal width: a single clothoid
    that fits both exactly.

    Its reference line leads along the lane's inner border. A left-hand lane is entered from or left
    towards the start of its road, a right-hand lane at the other end, as right-hand traffic has it.
    """
    start, first = _mouth(*before, width, entering=False)
    end, last = _mouth(*after, width, entering=True)
    lane = LaneDesign(LANE, constant(width), predecessor=before[1], successor=after[1])
    return RoadDesign(
        str(number), f"{before[0].name} to {after[0].name}", start, (connect(start, end),),
        (SectionDesign(0.0, {-1: lane}),),
        after[0].type, min(before[0].speed_limit, after[0].speed_limit), junction=str(junction),
        predecessor=RoadLink("road", before[0].id, first),
        successor=RoadLink("road", after[0].id, last),
    )  # fmt: skip


def _mouth(road: RoadDesign, lane: int, width: float, entering: bool) -> tuple[PlanPose, str]:
    """Pose of a lane's inner border in the direction of travel where traffic enters or leaves the
    road, and the contact point."""
    at_start = entering == (lane < 0)
    # Lanes further in are as wide: the builders have no others.
    border = (abs(lane) - 1) * width
    pose = (road.start if at_start else road.end).shifted(math.copysign(border, lane))
    return (pose if lane < 0 else pose.turned(math.pi)), "start" if at_start else "end"


_WIDTH, _SPEED_LIMIT = 3.5, 100 / 3.6
_APART = 200.0
"""Distance (m) between the reference lines of two roads: entities on different roads do not meet.
"""


class RoadUse(NamedTuple):
    """Used part of a road: length (m), and the number of lanes on its right and left side."""

    road_id: str
    length: float
    right: int
    left: int


def assumed_roads(used: Iterable[RoadUse], *, rule: str = "RHT") -> RoadMap:
    """A straight road for each that is used, not connected with each other.

    Args:
        used: each road once.
        rule: RHT or LHT.
    """
    roads = []
    for number, assumed in enumerate(used):
        require("length", assumed.length, 0.1)
        section = two_way(assumed.right, assumed.left, _WIDTH)
        start = PlanPose(0.0, -_APART * number, 0.0)
        name = f"assumed road {assumed.road_id}"
        roads.append(
            RoadDesign(
                assumed.road_id,
                name,
                start,
                (line(assumed.length),),
                (section,),
                "rural",
                _SPEED_LIMIT,
            )
        )
    return for_traffic(RoadMap("Assumed roads", tuple(roads)), rule)


ORIGIN = PlanPose(0.0, 0.0, 0.0)


def straight_highway(
    *, lanes: int = 3, opposite_lanes: int = 0, lane_width: float = 3.75, shoulder: float = 2.5,
    median: float = 3.5,
    length: float = 2000.0, speed_limit: float = 130 / 3.6, rule: str = "RHT",
) -> RoadMap:  # fmt: skip
    """A straight motorway along the x axis.

    Args:
        lanes: driving lanes in the direction of +s (ids -1 … -lanes in right-hand traffic).
        opposite_lanes: driving lanes of the other carriageway, beyond a median; 0 for none.
        lane_width, shoulder, median, length: in m.
        speed_limit: in m/s.
        rule: RHT or LHT.

    Example:
        >>> from xodr.builders import straight_highway
        >>> straight_highway(lanes=2, length=500.0).write("highway.xodr").name
        'highway.xodr'
    """
    require("lanes", lanes, 1)
    require("opposite_lanes", opposite_lanes, 0)
    for name, value in (
        ("lane_width", lane_width),
        ("length", length),
        ("speed_limit", speed_limit),
        ("median", median),
    ):
        require(name, value, 0.1)
    layout = carriageway(lanes, lane_width, edge=shoulder)
    if opposite_lanes:
        beyond = carriageway(opposite_lanes, lane_width, side=1, edge=shoulder)
        # As the first lane to the left, so that both carriageways are one road with one reference
        # line.
        layout[1] = LaneDesign("median", constant(median), mark="solid")
        layout |= {key + 1: lane for key, lane in beyond.items()}
    section = SectionDesign(0.0, layout, centre_mark="solid")
    road = RoadDesign("1", "Highway", ORIGIN, (line(length),), (section,), "motorway", speed_limit)
    return for_traffic(RoadMap("Straight highway", (road,)), rule)


def sharp_curve(
    *, radius: float = 60.0, angle: float = math.pi / 2, turn: str = "left", lanes: int = 1,
    opposite_lanes: int = 1,
    lane_width: float = 3.5, shoulder: float = 1.0, approach: float = 200.0,
    transition: float = 30.0,
    speed_limit: float = 70 / 3.6, rule: str = "RHT",
) -> RoadMap:  # fmt: skip
    """A rural road with one sharp curve between two straights.

    Args:
        radius: of the arc, at the reference line, in m.
        angle: change of heading over the whole curve, in rad.
        turn: `left` or `right`.
        lanes, opposite_lanes: driving lanes with and against +s.
        approach: length of each straight, in m.
        transition: length of each clothoid between straight and arc, in m.
        lane_width, shoulder: in m. speed_limit: in m/s. rule: RHT or LHT.
    """
    require("lanes", lanes, 1)
    require("opposite_lanes", opposite_lanes, 0)
    for name, value in (
        ("lane_width", lane_width),
        ("approach", approach),
        ("speed_limit", speed_limit),
    ):
        require(name, value, 0.1)
    require("angle", angle, 0.05, 1.75 * math.pi)
    # The inner edge of the road keeps a radius, too.
    require("radius", radius, 1.0 + max(lanes, opposite_lanes) * lane_width + shoulder)
    # Both clothoids together turn by transition/radius: beyond, no arc remains.
    require("transition", transition, 0.0, 0.999 * radius * angle)
    if turn not in ("left", "right"):
        raise UsageError(f"turn={turn!r} must be left or right")
    curvature = (1 if turn == "left" else -1) / radius
    bend = arc(radius * angle - transition, curvature)
    plan: tuple[Clothoid, ...] = (line(approach), bend, line(approach))
    if transition > 0:
        plan = (
            line(approach),
            Clothoid(transition, 0.0, curvature),
            bend,
            Clothoid(transition, curvature, 0.0),
            line(approach),
        )
    road = RoadDesign(
        "1",
        "Sharp curve",
        ORIGIN,
        plan,
        (two_way(lanes, opposite_lanes, lane_width, shoulder),),
        "rural",
        speed_limit,
    )
    return for_traffic(RoadMap(f"Sharp {turn} curve", (road,)), rule)


def narrow_road(
    *, lanes: int = 1, opposite_lanes: int = 1, lane_width: float = 2.5, shoulder: float = 0.5,
    length: float = 400.0,
    speed_limit: float = 30 / 3.6, rule: str = "RHT",
) -> RoadMap:  # fmt: skip
    """A straight narrow street along the x axis: lanes barely wider than a lorry, no room beside
    them.

    Args:
        lanes, opposite_lanes: driving lanes with and against +s.
        lane_width, shoulder, length: in m. speed_limit: in m/s. rule: RHT or LHT.
    """
    require("lanes", lanes, 1)
    require("opposite_lanes", opposite_lanes, 0)
    for name, value in (
        ("lane_width", lane_width),
        ("length", length),
        ("speed_limit", speed_limit),
    ):
        require(name, value, 0.1)
    section = two_way(lanes, opposite_lanes, lane_width, shoulder)
    road = RoadDesign("1", "Narrow road", ORIGIN, (line(length),), (section,), "town", speed_limit)
    return for_traffic(RoadMap("Narrow road", (road,)), rule)


# ramps ------------------------------------------------------------------------------------------


GORE = 1.0
"""Distance between the shoulder of the carriageway and the ramp where the junction ends, in m."""

JUNCTION, THROUGH, RAMP = 100, 101, 102
MOUTH = RoadLink("junction", str(JUNCTION), None)


def on_ramp(
    *, lanes: int = 2, lane_width: float = 3.75, ramp_width: float = 4.0, shoulder: float = 2.5,
    upstream: float = 500.0,
    acceleration: float = 250.0, taper: float = 75.0, downstream: float = 600.0,
    ramp: float = 200.0, angle: float = 0.07,
    speed_limit: float = 120 / 3.6, ramp_speed_limit: float = 80 / 3.6, rule: str = "RHT",
) -> RoadMap:  # fmt: skip
    """A motorway with an on-ramp that merges over an acceleration lane.

    Args:
        lanes: driving lanes of the carriageway; lane -(lanes + 1) of road 2 is the acceleration
            lane.
        lane_width, ramp_width, shoulder: in m.
        upstream: length of road 1. acceleration, taper, downstream: lengths of the three sections
            of road 2. ramp: of road 3.
        angle: between ramp and carriageway, in rad.
        speed_limit, ramp_speed_limit: in m/s. rule: RHT or LHT.
    """
    site = _Site(lanes, lane_width, ramp_width, shoulder, angle, speed_limit, ramp_speed_limit)
    site.check(
        upstream=upstream, acceleration=acceleration, taper=taper, downstream=downstream, ramp=ramp
    )
    before = site.main_road(1, PlanPose(0, 0, 0), upstream, (site.plain(0.0),))
    sections = (
        linked(site.wide(0.0, "entry", constant(lane_width)), {}, None),
        linked(
            site.wide(acceleration, "entry", closing(lane_width, taper)), None, site.wide_to_plain
        ),
        linked(site.plain(acceleration + taper), site.plain_to_wide, {}),
    )
    after = site.main_road(2, site.beyond(before), acceleration + taper + downstream, sections)
    gore = PlanPose(before.end.x, site.edge - shoulder - GORE, angle)
    start = PlanPose(gore.x - ramp * math.cos(angle), gore.y - ramp * math.sin(angle), angle)
    access = site.ramp_road("On-ramp", "onRamp", start, ramp, successor=MOUTH)
    fading = LaneDesign("shoulder", site.fading(-1), predecessor=-lanes - 1)
    joining = site.ramp_connection(
        access.end, (3, -1, ramp_width), (2, -lanes - 1, lane_width), "onRamp"
    )
    roads = (before, after, access, site.through(before.end, fading), joining)
    main = ((-lanes - 1, -lanes - 1),)
    return site.assemble(
        "On-ramp", roads, main, connection("3", str(RAMP), ((-1, -1), (-2, -2))), rule
    )


def off_ramp(
    *, lanes: int = 2, lane_width: float = 3.75, ramp_width: float = 4.0, shoulder: float = 2.5,
    upstream: float = 600.0,
    deceleration: float = 250.0, taper: float = 75.0, downstream: float = 500.0,
    ramp: float = 200.0, angle: float = 0.07,
    speed_limit: float = 120 / 3.6, ramp_speed_limit: float = 80 / 3.6, rule: str = "RHT",
) -> RoadMap:  # fmt: skip
    """A motorway with an off-ramp that diverges from a deceleration lane.

    Args:
        lanes: driving lanes of the carriageway; lane -(lanes + 1) of road 1 is the deceleration
            lane.
        lane_width, ramp_width, shoulder: in m.
        upstream, taper, deceleration: lengths of the three sections of road 1. downstream: of
            road 2. ramp: of road 3.
        angle: between ramp and carriageway, in rad.
        speed_limit, ramp_speed_limit: in m/s. rule: RHT or LHT.
    """
    site = _Site(lanes, lane_width, ramp_width, shoulder, angle, speed_limit, ramp_speed_limit)
    site.check(
        upstream=upstream, taper=taper, deceleration=deceleration, downstream=downstream, ramp=ramp
    )
    sections = (
        linked(site.plain(0.0), {}, site.plain_to_wide),
        linked(site.wide(upstream, "exit", opening(lane_width, taper)), site.wide_to_plain, None),
        linked(site.wide(upstream + taper, "exit", constant(lane_width)), None, {}),
    )
    before = site.main_road(1, PlanPose(0, 0, 0), upstream + taper + deceleration, sections)
    after = site.main_road(2, site.beyond(before), downstream, (site.plain(0.0),))
    leaving = site.ramp_connection(
        before.end.shifted(site.edge), (1, -lanes - 1, lane_width), (3, -1, ramp_width), "offRamp"
    )
    exit_ = site.ramp_road("Off-ramp", "offRamp", leaving.end, ramp, predecessor=MOUTH)
    growing = LaneDesign("shoulder", site.fading(+1), successor=-lanes - 1)
    roads = (before, after, exit_, site.through(before.end, growing), leaving)
    return site.assemble(
        "Off-ramp",
        roads,
        (),
        connection("1", str(RAMP), ((-lanes - 1, -1), (-lanes - 2, -2))),
        rule,
    )


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

    def plain(self, s: float) -> SectionDesign:
        """Driving lanes and shoulder."""
        return SectionDesign(
            s, carriageway(self.lanes, self.lane_width, edge=self.shoulder), centre_mark="solid"
        )

    def wide(self, s: float, kind: str, width: tuple[Cubic, ...]) -> SectionDesign:
        """Driving lanes, the extra lane and the shoulder."""
        layout = carriageway(self.lanes + 1, self.lane_width, edge=self.shoulder)
        layout[-self.lanes - 1] = LaneDesign(kind, width, mark="solid")
        return SectionDesign(s, layout, centre_mark="solid")

    def ramp_road(
        self,
        name: str,
        kind: str,
        start: PlanPose,
        length: float,
        *,
        predecessor: RoadLink | None = None,
        successor: RoadLink | None = None,
    ) -> RoadDesign:
        """Road 3: the ramp's lane and its shoulder."""
        lanes = {
            -1: LaneDesign(kind, constant(self.ramp_width), mark="solid"),
            -2: LaneDesign("shoulder", constant(self.shoulder)),
        }
        return RoadDesign(
            "3", name, start, (line(length),), (SectionDesign(0.0, lanes, "solid"),), "motorway",
            self.ramp_speed_limit,
            predecessor=predecessor, successor=successor,
        )  # fmt: skip

    def fading(self, direction: int) -> tuple[Cubic, ...]:
        """Width of the shoulder beside the ramp's arc: from full to nothing (-1) or the other way
        (+1)."""
        length = self.radius * math.sin(self.angle)
        if direction > 0:
            # A parabola, as an arc leaves its tangent nearly as s²/2r.
            return (Cubic(0.0, 0.0, 0.0, self.shoulder / length**2),)
        return (Cubic(0.0, self.shoulder, -2 * self.shoulder / length, self.shoulder / length**2),)

    def main_road(
        self, number: int, start: PlanPose, length: float, sections: tuple[SectionDesign, ...]
    ) -> RoadDesign:
        """Road 1 ends at the junction, road 2 begins there."""
        name, before, after = (
            ("Upstream", None, MOUTH) if number == 1 else ("Downstream", MOUTH, None)
        )
        return RoadDesign(
            str(number),
            name,
            start,
            (line(length),),
            sections,
            "motorway",
            self.speed_limit,
            predecessor=before,
            successor=after,
        )

    def beyond(self, before: RoadDesign) -> PlanPose:
        """Return the pose at which the carriageway leaves the junction."""
        return PlanPose(
            before.end.x + self.radius * math.sin(self.angle), before.end.y, before.end.heading
        )

    def through(self, start: PlanPose, shoulder: LaneDesign) -> RoadDesign:
        """The connecting road of the carriageway."""
        section = linked(self.plain(0.0), None, None)
        lanes = {**section.lanes, -self.lanes - 1: shoulder}
        plan = (line(self.radius * math.sin(self.angle)),)
        return RoadDesign(
            str(THROUGH), "Through", start, plan, (SectionDesign(0.0, lanes, "solid"),), "motorway",
            self.speed_limit, junction=str(JUNCTION),
            predecessor=RoadLink("road", "1", "end"), successor=RoadLink("road", "2", "start"),
        )  # fmt: skip

    def ramp_connection(
        self,
        start: PlanPose,
        before: tuple[int, int, float],
        after: tuple[int, int, float],
        kind: str,
    ) -> RoadDesign:
        """The connecting road of the ramp, from and to (road, lane, lane width): an arc to the
        right."""
        length = self.radius * self.angle
        change = after[2] - before[2]
        # Smooth, with zero slope at both ends.
        width = (Cubic(0.0, before[2], 0.0, 3 * change / length**2, -2 * change / length**3),)
        lanes = {
            -1: LaneDesign(kind, width, "solid", before[1], after[1]),
            -2: LaneDesign(
                "shoulder", constant(self.shoulder), "none", before[1] - 1, after[1] - 1
            ),
        }
        return RoadDesign(
            str(RAMP), "Ramp connection", start, (arc(length, -1 / self.radius),),
            (SectionDesign(0.0, lanes, "solid"),),
            "motorway", self.ramp_speed_limit, junction=str(JUNCTION),
            predecessor=RoadLink("road", str(before[0]), "end"),
            successor=RoadLink("road", str(after[0]), "start"),
        )  # fmt: skip

    def assemble(
        self,
        name: str,
        roads: tuple[RoadDesign, ...],
        extra: tuple[tuple[int, int], ...],
        ramp: Connection,
        rule: str,
    ) -> RoadMap:
        """The whole map; `extra` are lane pairs of the through connection beside
        the driving lanes.
        """
        main = connection(
            "1",
            str(THROUGH),
            tuple((-number, -number) for number in range(1, self.lanes + 1)) + extra,
        )
        junction = Junction(
            str(JUNCTION), name, "default", (main, ramp), priorities=((str(THROUGH), str(RAMP)),)
        )
        return for_traffic(RoadMap(name, roads, (junction,)), rule)
