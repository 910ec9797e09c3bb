"""Distances between entities and positions in the coordinate systems of OpenSCENARIO XML 1.3, 6.4.

Signs are those of the first entity, whatever the traffic rule and whichever way it faces:
longitudinal distances are positive where the other one is ahead in the direction that the entity
faces, lateral ones where it is to the left. All are in metres; None means that the quantity is not
defined (no road network, no way between the roads, no trajectory).

- entity: along the axes of the entity, in the plane.
- road: s and t along the road network, the shortest way (or that of the routing algorithm) between
  different roads.
- lane: along and across the centre line of the entity's lane, which goes on over road borders by
  its lane links.
- trajectory: along and across the trajectory that the entity follows.

With `freespace` a distance is that of the closest points of the bounding boxes, 0 where they
overlap in the direction measured; without, that of the reference points. A position has no extent.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from runner.engine.motion.following import PathMotion
from runner.engine.motion.paths import nearest
from runner.engine.motion.routes import AssignedRoute
from runner.engine.participants.boxes import Spot, gap, interval_gap, outlook, spans
from runner.engine.participants.declaration import BoundingBox
from runner.engine.participants.entity import Entity
from runner.engine.participants.rows import EntityRows
from xodr.model import RoadPoint

if TYPE_CHECKING:
    from runner.engine.motion.on_roads import Roads
    from runner.engine.motion.paths import Path
    from runner.engine.motion.placement import Placement
    from schemas.common.array_types import BoolArray, FloatArray
    from xodr.model.road import Road

SYSTEMS = ("entity", "lane", "road", "trajectory")
ROUTINGS = ("assignedRoute", "fastest", "leastIntersections", "shortest", "undefined")
_STRAIGHT = 1e-9
"""Curvature (1/m) below which a road counts as straight under a vehicle"""
_MOMENT = 1e-3
"""Time (s) over which the distance of two boxes is differentiated"""
_SHARPEST = 1e-3
"""Least length of the way per length of the reference line, inside of sharp curves"""


class Footprint(NamedTuple):
    """Extent of a bounding box along and across a road, lane or trajectory, m from the reference
    point."""

    rear: float
    front: float
    right: float
    left: float

    def turned(self) -> Footprint:
        """The same seen in the opposite direction."""
        return Footprint(-self.front, -self.rear, -self.left, -self.right)


_POINT = Footprint(0.0, 0.0, 0.0, 0.0)


def euclidean(a: Entity, b: Entity | Placement, freespace: bool = False) -> float:
    """Straight distance in space, ≥ 0; boxes stand upright."""
    if not freespace:
        return math.sqrt((b.x - a.x) ** 2 + (b.y - a.y) ** 2 + (b.z - a.z) ** 2)
    return gap(a, _boxed(b))


def longitudinal(
    roads: Roads,
    a: Entity,
    b: Entity | Placement,
    system: str,
    freespace: bool,
    routing: str = "undefined",
) -> float | None:
    """Signed distance ahead of a."""
    if system == "entity":
        return _ahead(a, b, freespace)
    plain = system == "road" and not freespace and routing != "assignedRoute"
    if (
        plain and isinstance(b, Entity) and a.on_lane and b.on_lane and a.road is b.road
    ):  # what `_extents` would find, but where a ring may be shorter the other way round
        apart, road = b.s - a.s, a.road
        if (
            road is None
            or 2.0 * abs(apart) <= road.length
            or not (road.successor and road.predecessor)
        ):
            return apart if a.direction > 0 else -apart
    extents = _extents(roads, a, b, system, freespace, routing)
    if extents is None:
        return None
    ours, theirs = extents
    return interval_gap(ours.rear, ours.front, theirs.rear, theirs.front)


def lateral(
    roads: Roads,
    a: Entity,
    b: Entity | Placement,
    system: str,
    freespace: bool,
    routing: str = "undefined",
) -> float | None:
    """Signed distance to the left of a."""
    if system == "entity":
        return _aside(a, b, freespace)
    extents = _extents(roads, a, b, system, freespace, routing)
    if extents is None:
        return None
    ours, theirs = extents
    return interval_gap(ours.right, ours.left, theirs.right, theirs.left)


def _boxed(b: Entity | Placement) -> Entity | Spot:
    return b if isinstance(b, Entity) else Spot(b.x, b.y, b.z, b.h)


# entity -------------------------------------------------------------------------------------


def _ahead(a: Entity, b: Entity | Placement, freespace: bool) -> float:
    if not freespace:
        return (b.x - a.x) * math.cos(a.h) + (b.y - a.y) * math.sin(a.h)
    other = _boxed(b)
    rear, front, _, _ = spans(outlook(a, other), other.box)
    return interval_gap(-a.box.length / 2, a.box.length / 2, rear, front)


def _aside(a: Entity, b: Entity | Placement, freespace: bool) -> float:
    if not freespace:
        return (b.y - a.y) * math.cos(a.h) - (b.x - a.x) * math.sin(a.h)
    other = _boxed(b)
    _, _, right, left = spans(outlook(a, other), other.box)
    return interval_gap(-a.box.width / 2, a.box.width / 2, right, left)


def _extents(
    roads: Roads, a: Entity, b: Entity | Placement, system: str, freespace: bool, routing: str
) -> tuple[Footprint, Footprint] | None:
    """Extents of both along and across a's trajectory, road or lane, in the direction of a; None
    where there is no way."""
    if system == "trajectory":
        return _on_trajectory(a, b, freespace)
    return _on_road(roads, a, b, system == "lane", freespace, routing)


# road and lane ------------------------------------------------------------------------------


class Bearing(NamedTuple):
    """Relation of b to a on the road network, in the direction of a's road (not of a's travel).

    ds, dt (m) and lanes are towards +s and +t of a's road, in road or lane coordinates; `aligned`
    says whether +s is the same direction at both. line_a, line_b: t (m) of the line along which ds
    is measured, at a and at b.
    """

    a: RoadPoint
    b: RoadPoint
    ds: float
    dt: float
    lanes: int
    aligned: bool
    line_a: float = 0.0
    line_b: float = 0.0


def road_point(roads: Roads, b: Entity | Placement) -> RoadPoint | None:
    """Return the road position of an entity or a position."""
    if isinstance(b, Entity):
        return roads.road_point(b)
    if b.point is not None or roads.network is None:
        return b.point
    return roads.network.locate(b.x, b.y, b.z, b.h)


def bearing(
    roads: Roads, a: Entity, b: Entity | Placement, lane: bool, routing: str = "undefined"
) -> Bearing | None:
    """Return the relation of b to a on the road network; None if no way connects them.

    Args:
        lane: in coordinates of a's lane, not of its road.
        routing: the routing algorithm; `assignedRoute` measures along the route of a where both are
            on it.
    """
    here, there = road_point(roads, a), road_point(roads, b)
    if here is None or there is None or roads.network is None:
        return None
    relative = roads.network.relative_in_lane if lane else roads.network.relative
    seen = relative(
        here, there, routing if routing in ("fastest", "leastIntersections") else "shortest"
    )
    if seen is None:
        return None
    # Only ds is measured along the route: dt and lanes are relations at the two places.
    along_route = _along_route(a, here, there) if routing == "assignedRoute" else None
    ds, dt, lanes, aligned = seen
    if along_route is not None:
        ds = along_route
    if not lane:
        return Bearing(here, there, ds, dt, lanes, aligned)
    # dt counts from a's place; from the lane's centre line b is `aside` away.
    aside = dt + here.offset
    return Bearing(
        here,
        there,
        ds,
        dt,
        lanes,
        aligned,
        here.t - here.offset,
        there.t - (aside if aligned else -aside),
    )


def _along_route(a: Entity, here: RoadPoint, there: RoadPoint) -> float | None:
    """Distance along the route assigned to a, towards +s of its road; None where one of the two is
    not on a route."""
    route = a.controls.route
    if not isinstance(route, AssignedRoute):
        return None
    distance = route.distance(here, there)
    if distance is None:
        return None
    return distance if route.forward(here) else -distance


def facing(a: Entity, road: Road, s: float) -> int:
    """+1 where an entity faces the road's +s, −1 where it faces −s."""
    if a.on_lane:
        return a.direction
    return 1 if math.cos(a.h - road.heading(s)) >= 0.0 else -1


def footprint(
    road: Road, point: RoadPoint, h: float, box: BoundingBox, line: float = 0.0
) -> Footprint:
    """Extent in road coordinates of a box whose reference point is at `point`, with heading h
    (rad).

    Lengths are those on the line at t = `line` (m), the reference line or the centre of a lane.
    The road is taken as an arc of its curvature there, which is exact on lines and arcs.
    """
    turn = h - road.heading(point.s)
    c, s = math.cos(turn), math.sin(turn)
    curvature = road.curvature(point.s)
    straight = -_STRAIGHT < curvature < _STRAIGHT
    along, across = [], []
    # Corners are the extremes on a line; on an arc the middle of a side may reach further by l²κ/8:
    # 2.5 cm for a car of 4.5 m on a radius of 100 m.
    for x in (box.x - box.length / 2, box.x + box.length / 2):
        for y in (box.y - box.width / 2, box.y + box.width / 2):
            p, q = x * c - y * s, x * s + y * c
            if straight:
                along.append(p)
                across.append(q)
            else:
                # Polar coordinates about the centre of the arc: angle over curvature is s, radius
                # is t.
                inward = 1.0 - curvature * (point.t + q)
                along.append(math.atan2(curvature * p, inward) / curvature)
                across.append((1.0 - math.hypot(curvature * p, inward)) / curvature - point.t)
    stretch = 1.0 - curvature * line
    return Footprint(min(along) * stretch, max(along) * stretch, min(across), max(across))


def _on_road(
    roads: Roads, a: Entity, b: Entity | Placement, lane: bool, freespace: bool, routing: str
) -> tuple[Footprint, Footprint] | None:
    """Extents of both from a's reference point, ahead and to the left of a."""
    seen = bearing(roads, a, b, lane, routing)
    if seen is None or roads.network is None:
        return None
    here, there = roads.network.roads[seen.a.road_id], roads.network.roads[seen.b.road_id]
    side = facing(a, here, seen.a.s)
    ours = theirs = _POINT
    if freespace:
        ours = footprint(here, seen.a, a.h, a.box, seen.line_a)
        theirs = (
            footprint(there, seen.b, b.h, b.box, seen.line_b) if isinstance(b, Entity) else _POINT
        )
        # b's road runs the other way: its extent is turned into the direction of a's.
        theirs = theirs if seen.aligned else theirs.turned()
    rear, front, right, left = theirs
    theirs = Footprint(seen.ds + rear, seen.ds + front, seen.dt + right, seen.dt + left)
    return (ours, theirs) if side > 0 else (ours.turned(), theirs.turned())


# trajectory ---------------------------------------------------------------------------------


def _on_trajectory(
    a: Entity, b: Entity | Placement, freespace: bool
) -> tuple[Footprint, Footprint] | None:
    """Extents of both along and across a's trajectory."""
    path = trajectory(a)
    return (_trace(path, a, freespace), _trace(path, b, freespace)) if path is not None else None


def trajectory(a: Entity) -> Path | None:
    """The trajectory that an entity follows now, None where it follows none."""
    return a.controls.motion.path if isinstance(a.controls.motion, PathMotion) else None


def on_path(path: Path, b: Entity | Placement) -> tuple[float, float, float]:
    """Place on a trajectory: s along it, t to its left (m), and its heading there (rad)."""
    s = nearest(path, b.x, b.y)
    pose = path.at(s)
    return s, (b.y - pose.y) * math.cos(pose.h) - (b.x - pose.x) * math.sin(pose.h), pose.h


def _trace(path: Path, b: Entity | Placement, freespace: bool) -> Footprint:
    """Extent in the coordinates of a trajectory, which is taken as straight under the box."""
    s, t, h = on_path(path, b)
    if not (freespace and isinstance(b, Entity)):
        return Footprint(s, s, t, t)
    rear, front, right, left = spans(outlook(Spot(b.x, b.y, b.z, h), b), b.box)
    return Footprint(s + rear, s + front, t + right, t + left)


# many runs ----------------------------------------------------------------------------------


class PointRows(Protocol):
    """Reference points in many runs, m (n,): of an entity's rows, or of a place."""

    @property
    def x(self) -> FloatArray: ...
    @property
    def y(self) -> FloatArray: ...
    @property
    def z(self) -> FloatArray: ...


def euclidean_arrays(a: EntityRows, b: PointRows, freespace: bool) -> tuple[FloatArray, BoolArray]:
    """`euclidean` in many runs (n,), and where it is known; gaps of boxes are worked out where they
    are near."""
    distance = np.sqrt((b.x - a.x) ** 2 + (b.y - a.y) ** 2 + (b.z - a.z) ** 2)
    return distance, np.full(len(distance), not freespace)


def directed_arrays(
    a: EntityRows, b: PointRows, ahead: bool, system: str, freespace: bool
) -> tuple[FloatArray, BoolArray]:
    """`longitudinal` (ahead) or `lateral` in many runs (n,), and where it is known: on one straight
    road, or in entity axes."""
    if system == "entity":
        return _in_axes_of_arrays(a, b, ahead, freespace)
    if not isinstance(b, EntityRows) or system == "trajectory":
        return np.full(len(a.x), np.nan), np.zeros(len(a.x), bool)
    known = a.gliding & b.gliding & a.straight & (a.road_key == b.road_key)
    if system == "lane":
        known &= a.section_key == b.section_key
    side = a.direction
    apart = b.s - a.s if ahead else b.t - a.t
    if not freespace:
        return side * apart, known
    # At most one of the two terms is not 0; overlapping intervals have a gap of 0.
    (low_a, high_a), (low_b, high_b) = (_extent_arrays(entity, ahead) for entity in (a, b))
    gap = np.maximum(apart + low_b - high_a, 0.0) + np.minimum(apart + high_b - low_a, 0.0)
    return side * gap, known


def ahead_arrays(
    roads: Roads, a: EntityRows, b: EntityRows, system: str, rows: BoolArray
) -> FloatArray:
    """`longitudinal` between reference points in some runs; NaN where it is undefined, and in the
    others (n,)."""
    found, known = directed_arrays(a, b, True, system, False)
    found = np.where(known & rows, found, np.nan)
    for row in np.flatnonzero(rows & ~known):
        value = longitudinal(roads, a.load(row), b.load(row), system, False)
        found[row] = np.nan if value is None else value
    return found


def _extent_arrays(rows: EntityRows, along: bool) -> tuple[FloatArray, FloatArray]:
    """Extent of boxes along or across a straight road, m from the reference point (n,)."""
    turn, box = rows.h - rows.start_h, rows.box
    c, s = np.ones_like(turn), np.zeros_like(turn)
    some = np.flatnonzero(turn)  # mostly the few that change lanes
    c[some], s[some] = np.cos(turn[some]), np.sin(turn[some])
    middle = box.x * c - box.y * s if along else box.x * s + box.y * c
    half = (
        box.length * np.abs(c) + box.width * np.abs(s)
        if along
        else box.length * np.abs(s) + box.width * np.abs(c)
    ) / 2
    return middle - half, middle + half


def _in_axes_of_arrays(
    a: EntityRows, b: PointRows, ahead: bool, freespace: bool
) -> tuple[FloatArray, BoolArray]:
    """Distance along the axes of a (n,); with freespace it is worked out run by run."""
    c, s, dx, dy = np.cos(a.h), np.sin(a.h), b.x - a.x, b.y - a.y
    found = dx * c + dy * s if ahead else dy * c - dx * s
    return found, np.full(len(found), not freespace)


# closing speeds: how fast distances shrink with the present velocities, positions standing still
# (m/s) -------------


def velocity(b: Entity | Placement) -> tuple[float, float]:
    """Velocity over ground, m/s; that of a position is zero."""
    return (b.vx, b.vy) if isinstance(b, Entity) else (0.0, 0.0)


def closing_euclidean(a: Entity, b: Entity | Placement, freespace: bool) -> float:
    """Closing speed of the straight distance, along the line between reference points or nearest
    points of the boxes."""
    (vx, vy), (wx, wy) = velocity(a), velocity(b)
    # By a finite difference: which points of the boxes are nearest changes from pose to pose.
    if freespace:
        return (euclidean(a, b, True) - _gap_after(a, b, wx - vx, wy - vy)) / _MOMENT
    dx, dy = b.x - a.x, b.y - a.y
    distance = math.sqrt(dx * dx + dy * dy + (b.z - a.z) ** 2)
    return (dx * (vx - wx) + dy * (vy - wy)) / distance if distance else 0.0


def _gap_after(a: Entity, b: Entity | Placement, vx: float, vy: float) -> float:
    """Gap a moment later, when b has moved with its velocity relative to a."""
    moved = Spot(b.x + vx * _MOMENT, b.y + vy * _MOMENT, b.z, b.h)
    return gap(a, moved._replace(box=b.box) if isinstance(b, Entity) else moved)


def closing_longitudinal(
    roads: Roads, a: Entity, b: Entity | Placement, system: str, routing: str
) -> float | None:
    """Closing speed of the longitudinal distance."""
    seen = _encounter(roads, a, b, system, routing)
    return (
        math.copysign(1.0, seen.apart[0]) * (seen.own[0] - seen.other[0])
        if seen is not None
        else None
    )


def closing_lateral(
    roads: Roads, a: Entity, b: Entity | Placement, system: str, routing: str
) -> float | None:
    """Closing speed of the lateral distance."""
    seen = _encounter(roads, a, b, system, routing)
    return (
        math.copysign(1.0, seen.apart[1]) * (seen.own[1] - seen.other[1])
        if seen is not None
        else None
    )


class _Encounter(NamedTuple):
    """Position of b relative to a (m) and both velocities (m/s), each ahead and
    to the left of a.
    """

    apart: tuple[float, float]
    own: tuple[float, float]
    other: tuple[float, float]


def _encounter(
    roads: Roads, a: Entity, b: Entity | Placement, system: str, routing: str
) -> _Encounter | None:
    if system == "entity":
        return _Encounter(
            _turned((b.x - a.x, b.y - a.y), a.h),
            _turned(velocity(a), a.h),
            _turned(velocity(b), a.h),
        )
    if system == "trajectory":
        return _met_on_trajectory(a, b)
    seen = bearing(roads, a, b, system == "lane", routing)
    if seen is None or roads.network is None:
        return None
    here, there = roads.network.roads[seen.a.road_id], roads.network.roads[seen.b.road_id]
    own, other = (
        _speeds_on_road(velocity(a), here, seen.a, seen.line_a),
        _speeds_on_road(velocity(b), there, seen.b, seen.line_b),
    )
    side = facing(a, here, seen.a.s)
    turn = side if seen.aligned else -side
    return _Encounter(
        (side * seen.ds, side * seen.dt),
        (side * own[0], side * own[1]),
        (turn * other[0], turn * other[1]),
    )


def _met_on_trajectory(a: Entity, b: Entity | Placement) -> _Encounter | None:
    path = trajectory(a)
    if path is None:
        return None
    (s, t, h), (other_s, other_t, other_h) = on_path(path, a), on_path(path, b)
    return _Encounter(
        (other_s - s, other_t - t), _turned(velocity(a), h), _turned(velocity(b), other_h)
    )


def _turned(v: tuple[float, float], h: float) -> tuple[float, float]:
    c, s = math.cos(h), math.sin(h)
    return v[0] * c + v[1] * s, v[1] * c - v[0] * s


def _speeds_on_road(
    v: tuple[float, float], road: Road, point: RoadPoint, line: float
) -> tuple[float, float]:
    """Return the speeds of a road point with a given velocity along the line at t = `line` and
    across it (m/s)."""
    along, across = _turned(v, road.heading(point.s))
    curvature = road.curvature(point.s)
    # The same turn about the arc's centre is a longer way further outside.
    return along * (1.0 - curvature * line) / max(1.0 - curvature * point.t, _SHARPEST), across
