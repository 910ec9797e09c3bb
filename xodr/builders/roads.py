"""Single roads (straight, sharp curve, narrow, assumed for scenarios without one), and the lane layouts of all builders."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from schemas.common.errors import UsageError
from xodr.builders.curves import Pose, Segment, arc, connect, line
from xodr.builders.elements import Cubic, Lane, Link, Road, RoadMap, Section

LANE = "driving"


def require(name: str, value: float, minimum: float, maximum: float = math.inf) -> None:
    """UsageError unless `minimum` <= value <= `maximum` and the value is finite."""
    if not (math.isfinite(value) and minimum <= value <= maximum):
        bounds = f"between {minimum:g} and {maximum:g}" if math.isfinite(maximum) else f"at least {minimum:g}"
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


def carriageway(lanes: int, width: float, side: int = -1, edge: float = 0.0) -> dict[int, Lane]:
    """`lanes` driving lanes on one side (-1 right, +1 left of the reference line) and, where `edge` > 0, a shoulder."""
    built = {
        side * number: Lane(LANE, constant(width), mark="broken" if number < lanes else "solid") for number in range(1, lanes + 1)
    }
    if edge > 0:
        built[side * (lanes + 1)] = Lane("shoulder", constant(edge))
    return built


def linked(section: Section, predecessors: dict[int, int] | None, successors: dict[int, int] | None) -> Section:
    """The section with lane links filled in; None links every lane to its own id, an empty table none."""
    lanes = {
        key: replace(
            lane,
            predecessor=key if predecessors is None else predecessors.get(key),
            successor=key if successors is None else successors.get(key),
        )
        for key, lane in section.lanes.items()
    }
    return replace(section, lanes=lanes)


def two_way(lanes: int, opposite: int, width: float, edge: float = 0.0) -> Section:
    """Driving lanes on both sides of the reference line, with a shoulder where `edge` > 0."""
    layout = carriageway(lanes, width, edge=edge)
    if opposite:
        layout |= carriageway(opposite, width, side=1, edge=edge)
    return Section(0.0, layout, centre_mark="broken" if lanes + opposite < 4 else "solid solid")


def connecting_road(number: int, junction: int, before: tuple[Road, int], after: tuple[Road, int], width: float) -> Road:
    """One lane (-1) through a junction, from a lane to a lane of equal width: a single clothoid that fits both exactly.

    Its reference line leads along the lane's inner border. A left-hand lane is entered from or left
    towards the start of its road, a right-hand lane at the other end, as right-hand traffic has it.
    """
    start, first = _mouth(*before, width, entering=False)
    end, last = _mouth(*after, width, entering=True)
    lane = Lane(LANE, constant(width), predecessor=before[1], successor=after[1])
    return Road(
        number, f"{before[0].name} to {after[0].name}", start, (connect(start, end),), (Section(0.0, {-1: lane}),),
        after[0].type, min(before[0].speed_limit, after[0].speed_limit), junction=junction,
        predecessor=Link("road", before[0].id, first), successor=Link("road", after[0].id, last),
    )  # fmt: skip


def _mouth(road: Road, lane: int, width: float, entering: bool) -> tuple[Pose, str]:
    """Pose of a lane's inner border in the direction of travel where traffic enters or leaves the road, and the contact point."""
    at_start = entering == (lane < 0)
    border = (abs(lane) - 1) * width
    pose = (road.start if at_start else road.end).shifted(math.copysign(border, lane))
    return (pose if lane < 0 else pose.turned(math.pi)), "start" if at_start else "end"


_WIDTH, _SPEED_LIMIT = 3.5, 100 / 3.6
_APART = 200.0
"""Distance (m) between the reference lines of two roads: entities on different roads do not meet."""


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
    for number, each in enumerate(used):
        require("length", each.length, 0.1)
        section = two_way(each.right, each.left, _WIDTH)
        start = Pose(0.0, -_APART * number, 0.0)
        name = f"assumed road {each.road_id}"
        roads.append(Road(each.road_id, name, start, (line(each.length),), (section,), "rural", _SPEED_LIMIT))
    return for_traffic(RoadMap("Assumed roads", tuple(roads)), rule)


ORIGIN = Pose(0.0, 0.0, 0.0)


def straight_highway(
    *, lanes: int = 3, opposite_lanes: int = 0, lane_width: float = 3.75, shoulder: float = 2.5, median: float = 3.5,
    length: float = 2000.0, speed_limit: float = 130 / 3.6, rule: str = "RHT",
) -> RoadMap:  # fmt: skip
    """A straight motorway along the x axis.

    Args:
        lanes: driving lanes in the direction of +s (ids -1 … -lanes in right-hand traffic).
        opposite_lanes: driving lanes of the other carriageway, beyond a median; 0 for none.
        lane_width, shoulder, median, length: in m.
        speed_limit: in m/s.
        rule: RHT or LHT.
    """
    require("lanes", lanes, 1)
    require("opposite_lanes", opposite_lanes, 0)
    for name, value in (("lane_width", lane_width), ("length", length), ("speed_limit", speed_limit), ("median", median)):
        require(name, value, 0.1)
    layout = carriageway(lanes, lane_width, edge=shoulder)
    if opposite_lanes:
        beyond = carriageway(opposite_lanes, lane_width, side=1, edge=shoulder)
        layout[1] = Lane("median", constant(median), mark="solid")
        layout |= {key + 1: lane for key, lane in beyond.items()}
    section = Section(0.0, layout, centre_mark="solid")
    road = Road(1, "Highway", ORIGIN, (line(length),), (section,), "motorway", speed_limit)
    return for_traffic(RoadMap("Straight highway", (road,)), rule)


def sharp_curve(
    *, radius: float = 60.0, angle: float = math.pi / 2, turn: str = "left", lanes: int = 1, opposite_lanes: int = 1,
    lane_width: float = 3.5, shoulder: float = 1.0, approach: float = 200.0, transition: float = 30.0,
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
    for name, value in (("lane_width", lane_width), ("approach", approach), ("speed_limit", speed_limit)):
        require(name, value, 0.1)
    require("angle", angle, 0.05, 1.75 * math.pi)
    require("radius", radius, 1.0 + max(lanes, opposite_lanes) * lane_width + shoulder)
    require("transition", transition, 0.0, 0.999 * radius * angle)
    if turn not in ("left", "right"):
        raise UsageError(f"turn={turn!r} must be left or right")
    curvature = (1 if turn == "left" else -1) / radius
    bend = arc(radius * angle - transition, curvature)
    plan: tuple[Segment, ...] = (line(approach), bend, line(approach))
    if transition > 0:
        plan = (line(approach), Segment(transition, 0.0, curvature), bend, Segment(transition, curvature, 0.0), line(approach))
    road = Road(1, "Sharp curve", ORIGIN, plan, (two_way(lanes, opposite_lanes, lane_width, shoulder),), "rural", speed_limit)
    return for_traffic(RoadMap(f"Sharp {turn} curve", (road,)), rule)


def narrow_road(
    *, lanes: int = 1, opposite_lanes: int = 1, lane_width: float = 2.5, shoulder: float = 0.5, length: float = 400.0,
    speed_limit: float = 30 / 3.6, rule: str = "RHT",
) -> RoadMap:  # fmt: skip
    """A straight narrow street along the x axis: lanes barely wider than a lorry, no room beside them.

    Args:
        lanes, opposite_lanes: driving lanes with and against +s.
        lane_width, shoulder, length: in m. speed_limit: in m/s. rule: RHT or LHT.
    """
    require("lanes", lanes, 1)
    require("opposite_lanes", opposite_lanes, 0)
    for name, value in (("lane_width", lane_width), ("length", length), ("speed_limit", speed_limit)):
        require(name, value, 0.1)
    section = two_way(lanes, opposite_lanes, lane_width, shoulder)
    road = Road(1, "Narrow road", ORIGIN, (line(length),), (section,), "town", speed_limit)
    return for_traffic(RoadMap("Narrow road", (road,)), rule)
