"""OpenDRIVE from the lanes of a map, by way of lanelets: roads of neighbouring lanes, junctions,
lights, speed limits.

Elevation and superelevation of a road are those of its outer borders. All lanes are right-hand
lanes of roads that run in the direction of traffic.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial import cKDTree
from shapely import LineString

from schemas.common.array_types import FloatArray
from xodr.builders.elements import Geo, LaneDesign, RoadDesign
from xodr.formats.lanelet2 import Built, Lanelet, LaneletNeighbour, build
from xodr.formats.lanelet2.conversion import with_crosswalks
from xodr.formats.lanelet2.lanelet import headings, joined, parts_of, places, winds
from xodr.formats.lanelet2.reader import Crosswalk
from xodr.formats.maps.lane_map import LaneMap, MapLane, at_lengths, gone, heights_on, resampled
from xodr.model import RoadObject, Signal, SignalReference
from xodr.model.geometry import Cubic, Profile

_TOLERANCE = 0.02
"""Largest distance (m) of borders from those of the lanes, but for the ends of roads."""
_SHORTEST = 0.3
"""Lanes shorter than this (m) are ways without a length between others, which are linked directly.
"""
_NARROWEST = 0.1
"""Lanes nowhere wider than this (m) are left out."""
_BACK = 2.0
"""Distance (m) from which on a lane begins behind the end of another."""
_BESIDE = 0.05
"""Greatest distance (m) of the borders of neighbours that share one."""
_STEP, _HALVINGS = 16.0, 6
"""Distance (m) between the places of a road at which its heights are taken, and how often it is
halved where that is too far."""
_CLOSE, _WEIGHTS = 0.01, np.array([[1.0], [5.0]])
"""Largest distance (m) of elevation and superelevation from heights between these places; a roll
counts 5 m beside."""
_KERBED = {"sidewalk", "walking", "curb"}
"""Types of lanes that lie over the road's surface, perhaps."""
_ROLLED, _LEANED_STEP = 0.03, 2.0
"""Roll (rad) above which widths from above are no widths of the surface, and distance (m) of the
places where these are taken."""
_SIGN_STEP, _TANGENTS, _MOVED = 2.0, 4, 0.1
"""Distance (m) of the places of a road among which that beside a sign is looked up, tangents on
which it is improved, and distance (m) from the ends of a road that is named."""
_PAINT, _RADIUS, _CANDIDATES = 0.3, 0.1, 24
"""Width (m) of stop lines and radius (m) of poles, which a map does not say; stations among which
the road beside a pole is looked up."""
_WHOLE, _TINY = 1.4, 1e-18
"""Length of borders, in lengths of their road, up to which they are its own, and least square of a
length (m²)."""
_LEVEL = 1e-3
"""Heights (m) of a map that count as none."""


def write(lane_map: LaneMap) -> tuple[bytes, list[str]]:
    """The content of a file, and what is changed or left out, one sentence each.

    Raises:
        UsageError: the lanes make no roads.
    """
    lanes, notes = _usable(lane_map)
    lights = {
        name: [
            signal.id
            for signal in lane_map.signals
            if signal.kind == "light" and name in signal.lanes
        ]
        for name in lanes
    }
    lanelets = [_lanelet(lane, lanes, tuple(lights[lane.id])) for lane in lanes.values()]
    geo = None
    if lane_map.projection is not None:
        x, y, z, heading = lane_map.offset
        geo = Geo(lane_map.projection, (x, y), z, heading)
    ranks = [pair for pair in lane_map.priorities if pair[0] in lanes and pair[1] in lanes]
    built = build(lanelets, lane_map.name, geo, ranks, tolerance=_TOLERANCE)
    made = built.map
    highest = max(
        (float(np.abs(line[:, 2]).max()) for lane in lanes.values() for line in (lane.left,
            lane.right)), default=0.0
    )  # fmt: skip
    if highest > _LEVEL:
        made = replace(made, roads=tuple(_raised(built, lanes)))
    areas = [Crosswalk(area.id, area.outline[:, :2]) for area in lane_map.crosswalks]
    made = replace(made, roads=with_crosswalks(made.roads, areas))
    beside = _RoadIndex(made.roads, built.lanelets)
    for kind, put in (
        ("signs", _with_signs), ("stop lines", _with_stop_lines), ("poles", _with_poles),
    ):  # fmt: skip
        roads, moved = put(made.roads, beside, lane_map)
        made = replace(made, roads=roads)
        if moved:
            notes.append(f"{kind} beyond the ends of their roads are moved: {' '.join(moved)}")
    if lane_map.left_hand:
        notes.append("traffic keeps to the left: roads are one-way, so the rule says right")
    return made.to_xml(), [*notes, *built.notes]


def _raised(built: Built, lanes: Mapping[str, MapLane]) -> Iterator[RoadDesign]:
    """The roads with the heights of the lanes that they are made of."""
    members: dict[str, dict[int, list[MapLane]]] = defaultdict(lambda: defaultdict(list))
    for name, (road_id, number) in built.lanelets.items():
        whole = name if name in lanes else name.rpartition("/")[0]  # it was split
        members[road_id][number].append(lanes[whole])
    for road in built.map.roads:
        borders = _LaneBorders(road, members[road.id])
        stations = np.linspace(0.0, road.length, places(road.length, _STEP))
        known = borders.surface(stations)
        for _ in range(_HALVINGS):
            # Stations are halved only where the heights need it, to keep the profile short.
            between = (stations[1:] + stations[:-1]) / 2
            wanted = borders.surface(between)
            away = np.abs(PchipInterpolator(stations, known, axis=1)(between) - wanted)
            far = (away * _WEIGHTS > _CLOSE).any(axis=0)
            if not far.any():
                break
            stations = np.append(stations, between[far])
            known = np.append(known, wanted[:, far], axis=1)
            order = np.argsort(stations)
            stations, known = stations[order], known[:, order]
        elevation, superelevation = (_profile(stations, values) for values in known)
        over = dict(borders.kerbed(stations, known))
        raised = replace(
            road, elevation=elevation, superelevation=superelevation,
            sections=(replace(road.sections[0], lanes=over),),
        )  # fmt: skip
        yield _leaned(raised) if np.abs(known[1]).max() > _ROLLED else raised


def _leaned(road: RoadDesign) -> RoadDesign:
    """A road with widths as seen from above, with those of its inclined surface instead."""
    stations = np.linspace(0.0, road.length, places(road.length, _LEANED_STEP))
    inner = _values(road.offset, stations)
    # The lanelets' widths are as seen from above; OpenDRIVE's lie on the inclined surface.
    share = np.cos(_values(road.superelevation, stations))
    lanes = {
        number: replace(lane, width=_profile(stations, _values(lane.width, stations) / share))
        for number, lane in road.sections[0].lanes.items()
    }
    section = replace(road.sections[0], lanes=lanes)
    return replace(road, offset=_profile(stations, inner / share), sections=(section,))


class _LaneBorders:
    """Places and heights of the borders of a road's lanes.

    Args:
        road: its design.
        members: the lanes that each of its lanes is made of, by id.
    """

    def __init__(self, road: RoadDesign, members: Mapping[int, Sequence[MapLane]]) -> None:
        self._road, self._members = road, members
        self._lanes = road.sections[0].lanes
        # Kerbed lanes are raised over the surface, so they don't tell where it is.
        flat = [number for number in members if self._lanes[number].type not in _KERBED]
        self._first, self._last = max(flat or members), min(flat or members)

    def at(self, number: int, side: int, stations: FloatArray) -> tuple[FloatArray, FloatArray]:
        """t and height (m) at places s of the left (0) or the right (1) border of a lane."""
        t = _values(self._road.offset, stations)
        for lane_id in range(-1, number - side, -1):
            t = t - _values(self._lanes[lane_id].width, stations)
        poses = self._road.poses_at(stations.tolist())
        points = [pose.shifted(aside)[:2] for pose, aside in zip(poses, t.tolist(), strict=True)]
        lines = [(lane.left, lane.right)[side] for lane in self._members[number]]
        return t, self._heights(stations, np.array(points), lines)

    def _heights(
        self, stations: FloatArray, points: FloatArray, lines: Sequence[FloatArray]
    ) -> FloatArray:
        """Heights (n,) of borders beside points (n, 2) at places s, on the same turn of a ramp."""
        whole = np.vstack(lines)
        # A part of a lane that was split does not tell which of the turns is its own.
        if not winds(whole[:, :2]) or gone(whole)[-1] > _WHOLE * self._road.length:
            return heights_on(points, lines)
        even = np.linspace(0.0, self._road.length, places(self._road.length, 1.0))
        way = np.interp(
            stations, even, np.unwrap([pose.heading for pose in self._road.poses_at(even.tolist())])
        )
        turned = headings(whole[:, :2])
        way += math.tau * round((turned[0] - way[0]) / math.tau)
        starts, steps = whole[:-1], np.diff(whole, axis=0)
        ahead = np.einsum("ijk,jk->ij", points[:, None] - starts[None, :, :2], steps[:, :2])
        share = np.clip(ahead / np.maximum((steps[:, :2] ** 2).sum(axis=1), _TINY), 0.0, 1.0)
        feet = starts + share[..., None] * steps
        away = np.hypot(*(feet[..., :2] - points[:, None]).transpose(2, 0, 1))
        away[np.abs(turned - way[:, None]) >= math.pi] = np.inf
        return np.asarray(feet[np.arange(len(points)), away.argmin(axis=1), 2])

    def surface(self, stations: FloatArray) -> FloatArray:
        """Height (m) and roll (rad) of the road at places s, (2, n), by its outer borders without
        kerbed lanes."""
        (left, high), (right, low) = (
            self.at(self._first, 0, stations), self.at(self._last, 1, stations)
        )  # fmt: skip
        # Kept from 0: the road may narrow to nothing.
        slope = (high - low) / np.maximum(left - right, _NARROWEST)
        return np.array([high - slope * left, np.arctan(slope)])

    def kerbed(self, stations: FloatArray, surface: FloatArray) -> Iterator[tuple[int, LaneDesign]]:
        """Each lane with the heights of its borders over the surface, where these are no part of
        it."""
        level, roll = surface
        for number, lane in self._lanes.items():
            over = []
            for side in (0, 1):
                t, height = self.at(number, side, stations)
                # One height all along a border: the median, which an outlier at an end does not
                # move.
                over.append(float(np.median(height - level - t * np.tan(roll))))
            raised = max(map(abs, over)) > _CLOSE
            yield number, replace(lane, height=(over[0], over[1])) if raised else lane


_Placed = tuple[tuple[RoadDesign, ...], list[str]]
"""Roads with what stands beside them, and the names of those that had to be moved"""


def _with_signs(roads: Sequence[RoadDesign], beside: _RoadIndex, lane_map: LaneMap) -> _Placed:
    """Put signs beside roads.

    A sign stands on the road nearest to it of those whose lanes it holds; the others refer to it.
    """
    own: dict[str, list[Signal]] = defaultdict(list)
    referring: dict[str, list[SignalReference]] = defaultdict(list)
    moved = []
    # Ids go on after those of the lights.
    first = 1 + sum(len(road.signals) for road in roads)
    signs = [signal for signal in lane_map.signals if signal.kind == "sign"]
    for number, sign in enumerate(signs, first):
        held = beside.held(sign.lanes, sign.place)
        nearest = beside.nearest(sign.place, held)
        for road_id in [nearest, *(road_id for road_id in held if road_id != nearest)]:
            s, t, height, heading, beyond = beside.by_id[road_id].place(sign.place)
            # Lane 0 where the sign holds no lane of this road.
            ranges = tuple((lane, lane) for lane in sorted(held.get(road_id, {0})))
            if road_id != nearest:
                referring[road_id].append(SignalReference(str(number), s, t, "+", ranges))
                continue
            if beyond > _MOVED:
                moved.append(sign.id)
            # Signs look against the traffic that they are for.
            turn = math.remainder(sign.heading - heading - math.pi, math.tau)
            own[road_id].append(
                Signal(
                    str(number), road_id, s, t, sign.id, False, sign.type, sign.subtype or "-1",
                    sign.country, "+",
                    sign.value, sign.unit, z_offset=sign.place[2] - height, h_offset=turn,
                    validity=ranges,
                )
            )  # fmt: skip
    made = tuple(
        replace(
            road,
            signals=(*road.signals, *own[road.id]),
            references=(*road.references, *referring[road.id]),
        )
        for road in roads
    )
    return made, moved


def _with_stop_lines(roads: Sequence[RoadDesign], beside: _RoadIndex, lane_map: LaneMap) -> _Placed:
    """Paint stop lines on roads: `roadMark` of subtype `signalLines` (OpenDRIVE 1.9, 13.14.8)."""
    own: dict[str, list[RoadObject]] = defaultdict(list)
    moved = []
    for line in lane_map.stop_lines:
        first, last = line.line[0], line.line[-1]
        middle = (0.5 * (first + last)).tolist()
        held = beside.held(line.lanes, middle)
        road_id = beside.nearest(middle, held)
        s, t, height, heading, beyond = beside.by_id[road_id].place(middle)
        if beyond > _MOVED:
            moved.append(line.id)
        across = math.atan2(*(last - first)[1::-1]) - 0.5 * math.pi
        # A range is of one road: lanes of several are found again by place.
        ranges = tuple((lane, lane) for lane in sorted(held[road_id])) if len(held) == 1 else ()
        own[road_id].append(
            RoadObject(
                "", road_id, s, t, line.id, "roadMark", "signalLines", "+",
                z_offset=middle[2] - height, heading=math.remainder(across - heading, math.tau),
                length=_PAINT, width=math.dist(first[:2], last[:2]), height=0.0, validity=ranges,
            )
        )  # fmt: skip
    return _with_objects(roads, own), moved


def _with_poles(roads: Sequence[RoadDesign], beside: _RoadIndex, lane_map: LaneMap) -> _Placed:
    """Put poles beside the roads nearest to them."""
    own: dict[str, list[RoadObject]] = defaultdict(list)
    moved = []
    for pole in lane_map.poles:
        road_id = beside.nearest(pole.place, {})
        s, t, height, _, beyond = beside.by_id[road_id].place(pole.place)
        if beyond > _MOVED:
            moved.append(pole.id)
        own[road_id].append(
            RoadObject(
                "", road_id, s, t, pole.id, "pole", z_offset=pole.place[2] - height,
                radius=_RADIUS, height=pole.height,
            )
        )  # fmt: skip
    return _with_objects(roads, own), moved


def _with_objects(
    roads: Sequence[RoadDesign], own: Mapping[str, Sequence[RoadObject]]
) -> tuple[RoadDesign, ...]:
    """Roads with more objects, whose ids go on after those that are there."""
    ids = count(1 + sum(len(road.objects) for road in roads))
    return tuple(
        replace(
            road,
            objects=(
                *road.objects,
                *(replace(item, id=str(next(ids))) for item in own.get(road.id, ())),
            ),
        )
        for road in roads
    )


class _RoadIndex:
    """Roads by place.

    Args:
        roads: with the reference lines that things are put beside.
        where: road and lane of each lane of the map; of its parts, where it was split.
    """

    def __init__(
        self, roads: Sequence[RoadDesign], where: Mapping[str, tuple[str, int]]
    ) -> None:  # fmt: skip
        self._where = where
        self.by_id = {road.id: _Stations(road) for road in roads}
        self._names = [road.id for road in roads for _ in self.by_id[road.id].points]
        self._tree = cKDTree(np.vstack([self.by_id[road.id].points for road in roads]))

    def held(self, lanes: Sequence[str], place: Sequence[float]) -> dict[str, set[int]]:
        """Lanes of roads by road; of a lane that was split, that of the part nearest to a place."""
        held: dict[str, set[int]] = defaultdict(set)
        for name in lanes:
            parts = [self._where[part] for part in parts_of(name, self._where)]
            if parts:
                road_id, lane = min(parts, key=lambda part: self.by_id[part[0]].distance(place))
                held[road_id].add(lane)
        return held

    def nearest(self, place: Sequence[float], among: Collection[str]) -> str:
        """The road nearest to a place, of some or of all; of all the one that it lies beside, not
        beyond, where there is one."""
        if among:
            return min(among, key=lambda road_id: self.by_id[road_id].distance(place))
        _, stations = self._tree.query(place[:2], k=min(_CANDIDATES, len(self._names)))
        names = dict.fromkeys(self._names[station] for station in np.atleast_1d(stations).tolist())
        # The first of equals is the nearest.
        return min(names, key=lambda name: max(self.by_id[name].place(place)[4], _MOVED))


class _Stations:
    """The reference line of a road, to place signs beside it."""

    def __init__(self, road: RoadDesign) -> None:
        self._road = road
        self._s = np.linspace(0.0, road.length, places(road.length, _SIGN_STEP))
        self._poses = road.poses_at(self._s.tolist())
        self.points = np.array([(pose.x, pose.y) for pose in self._poses])

    def distance(self, place: Sequence[float]) -> float:
        """Distance (m) of a place from the line, from above."""
        return float(np.hypot(*(self.points - place[:2]).T).min())

    def place(self, place: Sequence[float]) -> tuple[float, float, float, float, float]:
        """s, t, height (m) and heading (rad) of the road beside a place.

        Last: distance (m) of the place beyond the road's ends.
        """
        number = int(np.argmin(np.hypot(*(self.points - place[:2]).T)))
        s, pose = float(self._s[number]), self._poses[number]
        # Along the tangent to the foot, again and again: Newton's method, from the nearest station.
        for _ in range(_TANGENTS):
            s = min(max(s + pose.local(place)[0], 0.0), self._road.length)
            (pose,) = self._road.poses_at([s])
        beyond, t = pose.local(place)
        level, roll = (
            Profile(profile)(s) if profile else 0.0
            for profile in (self._road.elevation, self._road.superelevation)
        )
        return s, t / math.cos(roll), level + t * math.tan(roll), pose.heading, abs(beyond)


def _values(cubics: Sequence[Cubic], stations: FloatArray) -> FloatArray:
    profile = Profile(cubics)
    return np.array([profile(s) for s in stations.tolist()])


def _profile(stations: FloatArray, values: FloatArray) -> tuple[Cubic, ...]:
    """Piecewise cubics through values that overshoot nowhere; one number where they are all the
    same."""
    if np.ptp(values) < 1e-6:
        return (Cubic(0.0, float(values[0]), 0.0, 0.0, 0.0),)
    # Other splines overshoot beside a step, which makes bumps.
    d, c, b, a = PchipInterpolator(stations, values).c
    return tuple(Cubic(*map(float, row)) for row in zip(stations[:-1], a, b, c, d, strict=True))


def _usable(lane_map: LaneMap) -> tuple[dict[str, MapLane], list[str]]:
    """Lanes with length and width, and notes on the others."""
    short = {name for name, lane in lane_map.lanes.items() if lane.length < _SHORTEST}
    narrow = {name for name, lane in lane_map.lanes.items() if _width(lane) < _NARROWEST} - short
    closed = {name for name, lane in lane_map.lanes.items() if lane.type == "none"} - short - narrow
    notes = [f"{len(narrow)} lanes without width are left out"] if narrow else []
    notes += [f"{len(closed)} lanes of type none are left out"] if closed else []
    gone = narrow | closed
    kept, behind = {}, []
    for name, lane in lane_map.lanes.items():
        if name not in short | gone:
            following = list(dict.fromkeys(_following(lane_map.lanes, lane, short, gone, 4)))
            backward = [other for other in following if _behind(lane, lane_map.lanes[other])]
            behind += [f"{name} to {other}" for other in backward]
            following = [other for other in following if other not in backward]
            # A lane that follows itself was closed by the map; others must not become rings by what
            # is left out.
            ring = name in lane.successors
            kept[name] = replace(
                lane, successors=[other for other in following if other != name or ring]
            )
    if behind:
        notes.append(
            "links are left out, since the next lane begins behind the end of the one before:"
            f" {', '.join(behind)}"
        )
    return kept, notes


def _behind(lane: MapLane, following: MapLane) -> bool:
    """Whether a lane that is said to follow begins farther back than the other ends: a road that
    leads from one to the other would turn about."""
    end, begin = lane.centre[-1, :2], following.centre[0, :2]
    ahead = end - at_lengths(lane.centre, np.array([max(lane.length - 1.0, 0.0)]))[0, :2]
    return bool(np.hypot(*(begin - end)) > _BACK and (begin - end) @ ahead < 0.0)


def _following(
    lanes: dict[str, MapLane], lane: MapLane, short: set[str], gone: set[str], depth: int
) -> Iterator[str]:
    for name in lane.successors:
        if name in short and depth:
            yield from _following(lanes, lanes[name], short, gone, depth - 1)
        elif name in lanes and name not in gone and name not in short:
            yield name


def _width(lane: MapLane) -> float:
    """Greatest distance of the ends and the middles of the borders, m."""
    left, right = (resampled(line, 3)[:, :2] for line in (lane.left, lane.right))
    return float(np.hypot(*(left - right).T).max())


def _lanelet(lane: MapLane, lanes: dict[str, MapLane], lights: tuple[str, ...]) -> Lanelet:
    right = _neighbour(lane, lanes)
    # One bound for both, or rounding would open a gap between neighbours.
    bound = lanes[right].left if right is not None else lane.right
    return Lanelet(
        lane.id, joined([lane.left[:, :2]]), joined([bound[:, :2]]), (), tuple(lane.successors),
        None,
        LaneletNeighbour(right, True) if right is not None else None, lane.type,
        lane.road_type if lane.road_type != "unknown" else "town",
        math.inf if lane.limit is None else lane.limit,
        lane.marks[0][0], lane.marks[1][0], lights,
    )  # fmt: skip


def _neighbour(lane: MapLane, lanes: dict[str, MapLane]) -> str | None:
    """The lane to the right that leads the same way and shares the border."""
    beside = lane.beside[1]
    if beside is None or not beside[1] or beside[0] not in lanes:
        return None
    other = lanes[beside[0]]
    # Both have to name each other, as maps may contradict themselves.
    if other.beside[0] is None or other.beside[0][0] != lane.id:
        return None
    ends = [np.hypot(*(lane.right[at, :2] - other.left[at, :2])) for at in (0, -1)]
    # The distance of whole lines is costly: only for lines whose ends meet.
    apart = (
        LineString(lane.right[:, :2]).hausdorff_distance(LineString(other.left[:, :2]))
        if max(ends) < _BESIDE
        else math.inf
    )
    return other.id if apart < _BESIDE else None
