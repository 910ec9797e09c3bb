"""Differences between two maps of one place: distances of borders and centre lines, lanes gained and lost, connections.

Each lane of one map is compared at places about a metre apart. There the lane of the other map
counts whose centre line is nearest, runs the same way and is not further away than half the lane's
width. A place without one is lost (of the first map) or gained (of the second). Borders are
compared with the borders of that lane, so a lane that ends earlier or is cut into more pieces is no
difference.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import shapely

from schemas.common.array_types import FloatArray, IntArray
from xodr.formats.lane_map import LaneMap, MapLane, at_lengths, gone

STEP = 1.0
"""Distance of the places that are compared, m."""
_SAME_WAY = math.cos(math.radians(50.0))
_LEAST_REACH, _MOST_REACH = 0.5, 2.0
"""Bounds (m) of the distance between centre lines of one lane in both maps."""
_INSIDE = 2.0
"""Distance (m) from the ends of lanes at which connections are looked up."""
_HOPS = 6
"""Lanes in a row that a connection of the other map may be cut into."""
_NARROW = 0.15
"""Lanes narrower than this (m) are not compared there."""
VEHICLES = {
    "driving", "bidirectional", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane", "bus", "taxi", "HOV",
    "mwyEntry", "mwyExit",
}  # fmt: skip
"""Types of lanes that vehicles drive on."""


class Distances(NamedTuple):
    """Distances of one kind, in m: number of places, the median, that of 95 % of them, and the largest with its lane."""

    places: int
    median: float
    most: float
    largest: float
    where: str

    @classmethod
    def of(cls, values: FloatArray, names: list[str]) -> Distances:
        """Summary of distances with the lane of each."""
        if not len(values):
            return cls(0, 0.0, 0.0, 0.0, "")
        worst = int(values.argmax())
        return cls(
            len(values),
            float(np.median(values)),
            float(np.quantile(values, 0.95)),
            float(values[worst]),
            names[worst],
        )


@dataclass
class Difference:
    """Difference between two maps.

    Attributes:
        borders, centres, heights: distances, m.
        lost, gained: lanes with the length (m) that the other map has no lane for, longest first.
        length: of all compared lanes of the first map, m.
        connections: number of connections of the first map.
        connections_lost, connections_gained: pairs of lanes.
        within: share of the length of lanes whose borders are within 5 cm.
        types, limits: lanes whose type or limit differs, with both values.
        worst: places with the largest distances of borders: x, y and distance, m.
    """

    borders: Distances
    centres: Distances
    heights: Distances
    lost: dict[str, float] = field(default_factory=dict)
    gained: dict[str, float] = field(default_factory=dict)
    length: float = 0.0
    connections: int = 0
    connections_lost: list[tuple[str, str]] = field(default_factory=list)
    connections_gained: list[tuple[str, str]] = field(default_factory=list)
    within: float = 1.0
    types: list[tuple[str, str, str]] = field(default_factory=list)
    limits: list[tuple[str, float | None, float | None]] = field(default_factory=list)
    worst: list[tuple[float, float, float]] = field(default_factory=list)

    @property
    def connections_kept(self) -> float:
        """Share of the connections of the first map that the second has, too."""
        return 1.0 - len(self.connections_lost) / self.connections if self.connections else 1.0


class _Places(NamedTuple):
    """Places along the middle of all lanes of a map.

    lane: number of the lane of each. point: x, y, z, (n, 3). way: direction of travel, (n, 2).
    width: m.
    """

    names: list[str]
    lane: IntArray
    point: FloatArray
    way: FloatArray
    width: FloatArray


def _places(lanes: Iterable[MapLane]) -> _Places:
    names: list[str] = []
    numbers, points, ways, widths = [], [], [], []
    for lane in lanes:
        count = max(int(lane.length / STEP), 1)
        share = (np.arange(count) + 0.5) / count
        left, right = (at_lengths(line, share * gone(line)[-1]) for line in (lane.left, lane.right))
        middle = at_lengths(lane.centre, share * gone(lane.centre)[-1])
        ahead = at_lengths(lane.centre, np.minimum(share * lane.length + 0.2, lane.length))
        behind = at_lengths(lane.centre, np.maximum(share * lane.length - 0.2, 0.0))
        way = (ahead - behind)[:, :2]
        way /= np.maximum(np.hypot(*way.T), 1e-9)[:, None]
        normal = np.column_stack([-way[:, 1], way[:, 0]])
        width = np.abs(np.einsum("ij,ij->i", (left - right)[:, :2], normal))
        numbers.append(np.full(count, len(names)))
        names.append(lane.id)
        points.append(middle)
        ways.append(way)
        widths.append(width)
    if not names:
        return _Places([], np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 2)), np.zeros(0))
    return _Places(
        names, np.concatenate(numbers), np.vstack(points), np.vstack(ways), np.concatenate(widths)
    )


class _Index:
    """The lanes of a map, to be found by place."""

    def __init__(self, lanes: dict[str, MapLane]) -> None:
        self.names = list(lanes)
        self.lanes = lanes
        self._centres = [shapely.LineString(lane.centre[:, :2]) for lane in lanes.values()]
        self._borders = [
            shapely.MultiLineString([lane.left[:, :2], lane.right[:, :2]])
            for lane in lanes.values()
        ]
        self._lines = np.array(self._borders, dtype=object)
        self._tree = shapely.STRtree(self._centres)

    def near(self, place: FloatArray, way: FloatArray, reach: float) -> list[tuple[float, int]]:
        """Lanes that run the same way near a place, with their distances, nearest first."""
        found = []
        point = shapely.Point(place[0], place[1])
        for number in self._tree.query(point, predicate="dwithin", distance=reach).tolist():
            line = self._centres[number]
            at = line.project(point)
            a, b = (
                line.interpolate(max(at - 0.2, 0.0)),
                line.interpolate(min(at + 0.2, line.length)),
            )
            dx, dy = b.x - a.x, b.y - a.y
            if dx * way[0] + dy * way[1] > _SAME_WAY * math.hypot(dx, dy):
                found.append((line.distance(point), number))
        return sorted(found)

    def border_distance(self, number: int, x: float, y: float) -> float:
        """Distance of a place from the nearer border of a lane, m."""
        return float(self._lines[number].distance(shapely.Point(x, y)))

    def height(self, number: int, x: float, y: float) -> float:
        """Height of the middle of a lane beside a place, m."""
        line, point = self._centres[number], shapely.Point(x, y)
        centre = self.lanes[self.names[number]].centre
        along = gone(centre)
        return float(np.interp(line.project(point), along, centre[:, 2]))


def _chosen(lanes: dict[str, MapLane], types: frozenset[str] | None) -> dict[str, MapLane]:
    return {name: lane for name, lane in lanes.items() if types is None or lane.type in types}


def compare(one: LaneMap, other: LaneMap, types: frozenset[str] | None = None) -> Difference:
    """Compare two maps in the same coordinates.

    Args:
        one, other: the maps: source and result of a conversion, or an old and a new version.
        types: lane types that are compared; None for all that both maps have.
    """
    if types is None:
        types = frozenset(lane.type for lane in one.lanes.values()) & frozenset(
            lane.type for lane in other.lanes.values()
        )
        types |= VEHICLES
    ours, theirs = _chosen(one.lanes, types), _chosen(other.lanes, types)
    index = _Index(theirs)
    places = _places(ours.values())
    borders, centres, heights = [], [], []
    names: list[str] = []
    missing: dict[str, float] = {}
    worst: list[tuple[float, float, float]] = []
    pairs: dict[str, dict[str, int]] = {}
    for number, point, way, width in zip(
        places.lane.tolist(), places.point, places.way, places.width.tolist(), strict=True
    ):
        if width < _NARROW:
            continue
        name = places.names[number]
        found = index.near(point, way, min(max(0.5 * width, _LEAST_REACH), _MOST_REACH))
        if not found:
            missing[name] = missing.get(name, 0.0) + STEP
            continue
        away, match = found[0]
        half = 0.5 * width * np.array([-way[1], way[0]])
        sides = [point[:2] + half, point[:2] - half]
        off = max(index.border_distance(match, *side) for side in sides)
        names.append(name)
        borders.append(off)
        centres.append(away)
        heights.append(abs(index.height(match, *point[:2]) - point[2]))
        worst.append((float(point[0]), float(point[1]), off))
        counts = pairs.setdefault(name, {})
        counts[index.names[match]] = counts.get(index.names[match], 0) + 1
    extra = (
        _extra(theirs, _Index(ours))
        if ours
        else {name: lane.length for name, lane in theirs.items()}
    )
    matched = {name: max(counts, key=counts.__getitem__) for name, counts in pairs.items()}
    found_borders = np.array(borders)
    lost, total = _connections(ours, theirs, index)
    gained, _ = _connections(theirs, ours, _Index(ours)) if ours else ([], 0)
    return Difference(
        Distances.of(found_borders, names), Distances.of(np.array(centres), names), Distances.of(np.array(heights), names),
        _longest_first(missing), _longest_first(extra), sum(lane.length for lane in ours.values()), total, lost, gained,
        float((found_borders <= 0.05).sum() / max(len(found_borders) + sum(missing.values()) / STEP, 1.0)),
        [(name, ours[name].type, theirs[match].type) for name, match in matched.items() if ours[name].type != theirs[match].type],
        [
            (name, ours[name].limit, theirs[match].limit)
            for name, match in matched.items()
            if abs((ours[name].limit or 0.0) - (theirs[match].limit or 0.0)) > 0.01
        ],
        sorted(worst, key=lambda each: -each[2])[:20],
    )  # fmt: skip


def _longest_first(lengths: dict[str, float]) -> dict[str, float]:
    """Lanes with more than a step, longest first."""
    kept = {name: length for name, length in lengths.items() if length > 2.0 * STEP}
    return dict(sorted(kept.items(), key=lambda item: -item[1]))


def _extra(lanes: dict[str, MapLane], index: _Index) -> dict[str, float]:
    """Lengths of lanes for which the other map has none."""
    places, found = _places(lanes.values()), dict[str, float]()
    for number, point, way, width in zip(
        places.lane.tolist(), places.point, places.way, places.width.tolist(), strict=True
    ):
        if width >= _NARROW and not index.near(
            point, way, min(max(0.5 * width, _LEAST_REACH), _MOST_REACH)
        ):
            name = places.names[number]
            found[name] = found.get(name, 0.0) + STEP
    return found


def _connections(
    ours: dict[str, MapLane], theirs: dict[str, MapLane], index: _Index
) -> tuple[list[tuple[str, str]], int]:
    """Connections of some lanes that others lack, and the number of all."""
    lost, total = [], 0
    at: dict[tuple[str, bool], list[str]] = {}

    def there(name: str, at_end: bool) -> list[str]:
        key = (name, at_end)
        if key not in at:
            lane = ours[name]
            inside = min(_INSIDE, 0.5 * lane.length)
            s = np.array([lane.length - inside if at_end else inside])
            place = at_lengths(lane.centre, s)[0]
            ahead = (
                at_lengths(lane.centre, np.minimum(s + 0.2, lane.length))[0]
                - at_lengths(lane.centre, s - 0.2)[0]
            )
            way = ahead[:2] / max(float(np.hypot(*ahead[:2])), 1e-9)
            at[key] = [index.names[number] for _, number in index.near(place, way, _LEAST_REACH)]
        return at[key]

    for name, lane in ours.items():
        for following in lane.successors:
            if following not in ours or lane.length < STEP or ours[following].length < STEP:
                continue
            total += 1
            starts, ends = there(name, True), set(there(following, False))
            if not _reaches(starts, ends, theirs):
                lost.append((name, following))
    return lost, total


def _reaches(starts: list[str], ends: set[str], lanes: dict[str, MapLane]) -> bool:
    """Whether a lane of `starts` is one of `ends`, or leads to one in a few steps."""
    current = set(starts)
    for _ in range(_HOPS):
        if current & ends:
            return True
        current = {
            following
            for name in current
            for following in lanes[name].successors
            if following in lanes
        }
    return bool(current & ends)
