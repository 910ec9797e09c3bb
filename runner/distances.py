"""Distances between entities and positions in the coordinate systems of OpenSCENARIO XML 1.3, 6.4.

Signs are those of the first entity, whatever the traffic rule and whichever way it faces: longitudinal distances are
positive where the other one is ahead in the direction that the entity faces, lateral ones where it is to the left. All are
in metres; None means that the quantity is not defined (no road network, no way between the roads, no trajectory).

- entity: along the axes of the entity, in the plane.
- road: s and t along the road network, the shortest way (or that of the routing algorithm) between different roads.
- lane: along and across the centre line of the entity's lane. Between different roads, where no lane of the one goes on as a
  lane of the other by itself, it is the road's.
- trajectory: along and across the trajectory that the entity follows.

With `freespace` a distance is that of the closest points of the bounding boxes, 0 where they overlap in the direction
measured; without, that of the reference points. A position has no extent.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from runner.boxes import Spot, gap, interval_gap, outlook, spans
from runner.entities import BoundingBox, Entity
from runner.paths import nearest

if TYPE_CHECKING:
    from runner.motion import Placement
    from runner.paths import Path
    from runner.simulation import Simulation
    from xodr.model import RoadPoint
    from xodr.network import RoadNetwork
    from xodr.road import Road

SYSTEMS = ("entity", "lane", "road", "trajectory")
ROUTINGS = ("assignedRoute", "fastest", "leastIntersections", "shortest", "undefined")
_PANEL = 10.0
"""Longest stretch (m) that Simpson's rule takes at once along a curved lane"""
_STRAIGHT = 1e-9
"""Curvature (1/m) below which a road counts as straight under a vehicle"""


class Footprint(NamedTuple):
    """Extent of a bounding box in coordinates along and across a road or trajectory, m (on roads s is that from the
    reference point)."""

    rear: float
    front: float
    right: float
    left: float

    def turned(self) -> Footprint:
        """The same seen by a road of opposite direction."""
        return Footprint(-self.front, -self.rear, -self.left, -self.right)


def euclidean(a: Entity, b: Entity | Placement, freespace: bool = False) -> float:
    """Straight distance in space, ≥ 0; boxes stand upright."""
    if not freespace:
        return math.sqrt((b.x - a.x) ** 2 + (b.y - a.y) ** 2 + (b.z - a.z) ** 2)
    return gap(a, _boxed(b))


def longitudinal(
    sim: Simulation, a: Entity, b: Entity | Placement, system: str, freespace: bool, routing: str = "undefined"
) -> float | None:
    """Signed distance ahead of a."""
    if system == "entity":
        return _ahead(a, b, freespace)
    if system == "trajectory":
        return _along_trajectory(a, b, freespace)
    return _along_road(sim, a, b, system == "lane", freespace, routing)


def lateral(
    sim: Simulation, a: Entity, b: Entity | Placement, system: str, freespace: bool, routing: str = "undefined"
) -> float | None:
    """Signed distance to the left of a."""
    if system == "entity":
        return _aside(a, b, freespace)
    if system == "trajectory":
        return _across_trajectory(a, b, freespace)
    return _across_road(sim, a, b, system == "lane", freespace, routing)


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


# road and lane ------------------------------------------------------------------------------


class Bearing(NamedTuple):
    """Where b lies on the road network as seen from a, in the direction of a's road (not of a's travel).

    ds, dt (m) and lanes are towards +s and +t of a's road; `aligned` says whether +s is the same direction at both.
    """

    a: RoadPoint
    b: RoadPoint
    ds: float
    dt: float
    lanes: int
    aligned: bool


def road_point(sim: Simulation, b: Entity | Placement) -> RoadPoint | None:
    """Where an entity or a position is on the road network."""
    if isinstance(b, Entity):
        return sim.road_point(b)
    if b.point is not None or sim.network is None:
        return b.point
    return sim.network.locate(b.x, b.y, b.z, b.h)


def bearing(sim: Simulation, a: Entity, b: Entity | Placement, routing: str = "undefined") -> Bearing | None:
    """Where b lies on the road network as seen from a; None where no way leads from one to the other."""
    here, there = road_point(sim, a), road_point(sim, b)
    if here is None or there is None or sim.network is None:
        return None
    if routing == "assignedRoute" and a.route is not None:
        return _on_route(a, here, there, sim.network)
    strategy = routing if routing in ("fastest", "leastIntersections") else "shortest"
    seen = sim.network.relative(here, there, strategy)
    return Bearing(here, there, *seen) if seen is not None else None


def _on_route(a: Entity, here: RoadPoint, there: RoadPoint, network: RoadNetwork) -> Bearing | None:
    """Along the route assigned to a; None where b is not on it."""
    path = a.route
    start = path.position(here)
    end = path.position(there, start) if start is not None else None
    if start is None or end is None:
        return None
    seen = network.relative(here, there, "shortest")
    _, _, forward = path.at(start)
    return Bearing(here, there, (end - start) * (1 if forward else -1), *seen[1:]) if seen is not None else None


def facing(a: Entity, road: Road, s: float) -> int:
    """+1 where an entity faces the road's +s, −1 where it faces −s."""
    if a.on_lane:
        return a.along
    return 1 if math.cos(a.h - road.heading(s)) >= 0.0 else -1


def footprint(road: Road, point: RoadPoint, h: float, box: BoundingBox) -> Footprint:
    """Extent of a box in road coordinates, its reference point being at `point` with heading h (rad).

    The road is taken as an arc of its curvature there, which is exact on lines and arcs.
    """
    turn = h - road.heading(point.s)
    c, s = math.cos(turn), math.sin(turn)
    curvature = road.curvature(point.s)
    along, across = [], []
    for x in (box.x - box.length / 2, box.x + box.length / 2):
        for y in (box.y - box.width / 2, box.y + box.width / 2):
            p, q = x * c - y * s, point.t + x * s + y * c
            if -_STRAIGHT < curvature < _STRAIGHT:
                along.append(p)
                across.append(q)
            else:
                radius = math.hypot(curvature * p, 1.0 - curvature * q)
                along.append(math.atan2(curvature * p, 1.0 - curvature * q) / curvature)
                across.append((1.0 - radius) / curvature)
    return Footprint(min(along), max(along), min(across), max(across))


def _footprints(a: Entity, b: Entity | Placement, seen: Bearing, network: RoadNetwork) -> tuple[Footprint, Footprint]:
    """Extents of both in the road coordinates of a."""
    other = _boxed(b)
    ours = footprint(network.roads[seen.a.road_id], seen.a, a.h, a.box)
    theirs = footprint(network.roads[seen.b.road_id], seen.b, other.h, other.box)
    return ours, theirs if seen.aligned else theirs.turned()


def _along_road(sim: Simulation, a: Entity, b: Entity | Placement, lane: bool, freespace: bool, routing: str) -> float | None:
    seen = bearing(sim, a, b, routing)
    if seen is None or sim.network is None:
        return None
    road = sim.network.roads[seen.a.road_id]
    same_road = seen.b.road_id == seen.a.road_id
    ds = _lane_length(road, seen.a.lane_id, seen.a.s, seen.b.s) if lane and same_road else seen.ds
    if freespace:
        ours, theirs = _footprints(a, b, seen, sim.network)
        stretch = ds / seen.ds if seen.ds else 1.0
        ds = interval_gap(ours.rear, ours.front, seen.ds + theirs.rear, seen.ds + theirs.front) * stretch
    return ds * facing(a, road, seen.a.s)


def _across_road(sim: Simulation, a: Entity, b: Entity | Placement, lane: bool, freespace: bool, routing: str) -> float | None:
    seen = bearing(sim, a, b, routing)
    if seen is None or sim.network is None:
        return None
    road = sim.network.roads[seen.a.road_id]
    drift = _drift(road, seen) if lane else 0.0
    if freespace:
        ours, theirs = _footprints(a, b, seen, sim.network)
        dt = interval_gap(ours.right, ours.left, theirs.right - drift, theirs.left - drift)
    else:
        dt = seen.dt - drift
    return dt * facing(a, road, seen.a.s)


def _drift(road: Road, seen: Bearing) -> float:
    """By how much a's lane has moved towards +t where b is; 0 where the lane does not reach b."""
    lane_id = seen.a.lane_id
    if seen.b.road_id != seen.a.road_id or lane_id not in road.section(seen.b.s).lanes:
        return 0.0
    return road.lane_t(seen.b.s, lane_id) - road.lane_t(seen.a.s, lane_id)


def _lane_length(road: Road, lane_id: int, start: float, end: float) -> float:
    """Signed length of a lane's centre line from one s to another on the same road, by Simpson's rule.

    Where the lane does not go on (another lane section), its last t is kept.
    """
    section = road.section(start)
    center = section.lanes[lane_id].center
    if road.line.straight and center.constant is not None:
        return end - start
    panels = max(math.ceil(abs(end - start) / _PANEL), 1)
    half = (end - start) / panels / 2.0

    def rate(s: float) -> float:
        lane = road.section(s).lanes.get(lane_id)
        t, slope = (lane.center(s), lane.center.slope(s)) if lane is not None else (center(start), 0.0)
        return math.hypot(1.0 - road.curvature(s) * t, slope)

    total = sum(
        rate(start + 2 * i * half) + 4.0 * rate(start + (2 * i + 1) * half) + rate(start + (2 * i + 2) * half)
        for i in range(panels)
    )
    return total * half / 3.0


# trajectory ---------------------------------------------------------------------------------


def _along_trajectory(a: Entity, b: Entity | Placement, freespace: bool) -> float | None:
    path = trajectory(a)
    if path is None:
        return None
    ours, theirs = _trace(path, a, freespace), _trace(path, b, freespace)
    return interval_gap(ours.rear, ours.front, theirs.rear, theirs.front)


def _across_trajectory(a: Entity, b: Entity | Placement, freespace: bool) -> float | None:
    path = trajectory(a)
    if path is None:
        return None
    ours, theirs = _trace(path, a, freespace), _trace(path, b, freespace)
    return interval_gap(ours.right, ours.left, theirs.right, theirs.left)


def trajectory(a: Entity) -> Path | None:
    """The trajectory that an entity follows now, None where it follows none."""
    path: Path | None = getattr(a.motion, "path", None)
    return path


def _trace(path: Path, b: Entity | Placement, freespace: bool) -> Footprint:
    """Extent in the coordinates of a trajectory, which is taken as straight under the box."""
    s = nearest(path, b.x, b.y)
    track = path.at(s)
    here = Spot(track.x, track.y, track.z, track.h)
    seen = outlook(here, _boxed(b) if freespace else Spot(b.x, b.y, b.z, b.h))
    rear, front, right, left = spans(seen, b.box if freespace and isinstance(b, Entity) else here.box)
    return Footprint(s + rear, s + front, right, left)
