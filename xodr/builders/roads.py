"""Single roads: straight highway, sharp curve, narrow road."""

from __future__ import annotations

import math

from schemas.errors import UsageError
from xodr.builders.curves import Pose, Segment, arc, line
from xodr.builders.elements import Lane, Road, RoadMap, Section
from xodr.builders.lanes import carriageway, constant, for_traffic, require, two_way

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
