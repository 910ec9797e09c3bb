"""Differences between two maps of one place: distances of borders and centre lines, lanes gained
and lost, connections.

Each lane of one map is compared at places about a metre apart. There the lane of the other map
counts whose centre line is nearest, runs the same way and is not further away than half the lane's
width. A place without one is lost (of the first map) or gained (of the second). Borders are
compared with the borders of that lane, so a lane that ends earlier or is cut into more pieces is no
difference.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from schemas.common.array_types import BoolArray, FloatArray, IntArray
from xodr.formats.maps.lane_map import LaneMap, MapLane, at_lengths, gone

STEP = 1.0
"""Distance of the places that are compared, m."""
_SAME_WAY = math.cos(math.radians(50.0))
_LEAST_REACH, _MOST_REACH = 0.5, 2.0
"""Bounds (m) of the distance between centre lines of one lane in both maps."""
_INSIDE = 15.0
"""Greatest distance (m) from the ends of lanes at which connections are looked up: where ways that
part are apart."""
_HOPS = 6
"""Lanes in a row that a connection of the other map may be cut into."""
_CLOSE, _SAME_SPEED, _WORST = 0.05, 0.01, 20
"""Distance (m) of close borders, difference (m/s) of equal limits, number of the worst places."""
_POINTS = 32
"""Most points of a piece of a line that is searched."""
_BORDER_REACH = 1.0
"""Distance (m) up to which borders are searched among those near a place, else along the lane."""
_NARROW = 0.15
"""Lanes narrower than this (m) are not compared there."""


class Distances(NamedTuple):
    """Distances of one kind, in m: number of places, the median, that of 95 % of them, and the
    largest with its lane."""

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
class MapDifference:
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


class _LaneSamples(NamedTuple):
    """Places along the middle of all lanes of a map.

    lane: number of the lane of each. point: x, y, z, (n, 3). way: direction of travel, (n, 2).
    width: m. sides: x and y of the left and the right border beside it, (n, 2, 2).
    """

    names: list[str]
    lane: IntArray
    point: FloatArray
    way: FloatArray
    width: FloatArray
    sides: FloatArray


def _places(lanes: Iterable[MapLane]) -> _LaneSamples:
    names: list[str] = []
    numbers, points, ways, widths, sides = [], [], [], [], []
    for lane in lanes:
        count = max(int(lane.length / STEP), 1)
        share = (np.arange(count) + 0.5) / count
        middle = at_lengths(lane.centre, share * gone(lane.centre)[-1])
        ahead = at_lengths(lane.centre, np.minimum(share * lane.length + 0.2, lane.length))
        behind = at_lengths(lane.centre, np.maximum(share * lane.length - 0.2, 0.0))
        way = (ahead - behind)[:, :2]
        # A lane that stands still for a step has no direction; it matches nothing.
        way /= np.maximum(np.hypot(*way.T), 1e-9)[:, None]
        left, right = (_beside(line, middle) for line in (lane.left, lane.right))
        numbers.append(np.full(count, len(names)))
        names.append(lane.id)
        points.append(middle)
        ways.append(way)
        widths.append(np.hypot(*(left - right).T))
        sides.append(np.stack([left, right], axis=1))
    if not names:
        empty = np.zeros((0, 2))
        return _LaneSamples(
            [], np.zeros(0, np.int64), np.zeros((0, 3)), empty, np.zeros(0), np.zeros((0, 2, 2))
        )
    return _LaneSamples(
        names,
        np.concatenate(numbers),
        np.vstack(points),
        np.vstack(ways),
        np.concatenate(widths),
        np.concatenate(sides),
    )


def _beside(line: FloatArray, points: FloatArray) -> FloatArray:
    """The places of a line that are nearest to points from above: x and y, (n, 2)."""
    pieces, places = np.array(_pieces(line[:, :2]), object), shapely.points(points[:, :2])
    (place, piece) = shapely.STRtree(pieces).query_nearest(places, all_matches=False)
    lines, places = pieces[piece], places[place]
    nearest = shapely.line_interpolate_point(lines, shapely.line_locate_point(lines, places))
    return np.asarray(shapely.get_coordinates(nearest))


def _pieces(line: FloatArray) -> list[shapely.LineString]:
    """A line in pieces of few points: the time to find the place nearest to a point grows with the
    points of the line."""
    starts = range(0, len(line) - 1, _POINTS - 1)
    return [shapely.LineString(line[start : start + _POINTS]) for start in starts]


class _Matches(NamedTuple):
    """Lanes near places: number of the place, number of the lane, distance from its centre line
    from above, height over it (m). A lane may come with several pieces of its line."""

    place: IntArray
    lane: IntArray
    away: FloatArray
    above: FloatArray

    def nearest(self, count: int) -> tuple[IntArray, FloatArray, FloatArray]:
        """The nearest lane of each of `count` places, -1 where there is none, its distance from
        above and the height over it.

        Nearest in space: bridges cross lanes.
        """
        lane, away, above = np.full(count, -1), np.full(count, np.inf), np.full(count, np.inf)
        order = np.lexsort((self.lane, -np.hypot(self.away, self.above)))  # the nearest comes last
        lane[self.place[order]] = self.lane[order]
        away[self.place[order]] = self.away[order]
        above[self.place[order]] = self.above[order]
        return lane, away, above


class _LaneIndex:
    """The lanes of a map, to be found by place."""

    def __init__(self, lanes: dict[str, MapLane]) -> None:
        self.names = list(lanes)
        self._centres, self._lane_of_centre = _cut([lane.centre] for lane in lanes.values())
        self._borders, self._lane_of_border = _cut(
            [lane.left[:, :2], lane.right[:, :2]] for lane in lanes.values()
        )
        self._whole = [
            shapely.MultiLineString([lane.left[:, :2], lane.right[:, :2]])
            for lane in lanes.values()
        ]
        self._tree = shapely.STRtree(self._centres)
        self._border_tree = shapely.STRtree(self._borders)

    def near(self, points: FloatArray, ways: FloatArray, reach: FloatArray) -> _Matches:
        """Lanes that run the same way near places.

        Args:
            points: (n, 3), m.
            ways: directions, (n, 2).
            reach: greatest distances, (n,), m.
        """
        if not self.names or not len(points):
            nothing = np.zeros(0, np.int64)
            return _Matches(nothing, nothing, np.zeros(0), np.zeros(0))
        places = shapely.points(points[:, :2])
        place, piece = self._tree.query(places, predicate="dwithin", distance=reach)
        lines, lane = self._centres[piece], self._lane_of_centre[piece]
        at = shapely.line_locate_point(lines, places[place])
        ends = [
            shapely.get_coordinates(shapely.line_interpolate_point(lines, distance))
            for distance in (np.maximum(at - 0.2, 0.0), np.minimum(at + 0.2, shapely.length(lines)))
        ]
        ahead = ends[1] - ends[0]
        same = np.einsum("ij,ij->i", ahead, ways[place]) > _SAME_WAY * np.hypot(*ahead.T)
        away = shapely.distance(lines, places[place])
        above = points[place, 2] - shapely.get_z(shapely.line_interpolate_point(lines, at))
        return _Matches(place[same], lane[same], away[same], above[same])

    def border_distances(self, lanes: IntArray, points: FloatArray) -> FloatArray:
        """Distances of places from the nearer border of a lane each, m."""
        places, away = shapely.points(points), np.full(len(points), np.inf)
        place, piece = self._border_tree.query(places, predicate="dwithin", distance=_BORDER_REACH)
        # Of the matched lane alone: a neighbour's border is often nearer.
        own = self._lane_of_border[piece] == lanes[place]
        place, piece = place[own], piece[own]
        np.minimum.at(away, place, shapely.distance(self._borders[piece], places[place]))
        # Few: the whole line is slow, and needed only where borders are metres apart.
        for far in np.flatnonzero(np.isinf(away)).tolist():
            away[far] = shapely.distance(self._whole[lanes[far]], places[far])
        return away


def _cut(lanes: Iterable[list[FloatArray]]) -> tuple[NDArray[np.object_], IntArray]:
    """The lines of lanes in pieces, and the number of the lane that each is of."""
    pieces = [[piece for line in lines for piece in _pieces(line)] for lines in lanes]
    numbers = np.repeat(np.arange(len(pieces)), [len(row) for row in pieces])
    return np.array([piece for row in pieces for piece in row], object), numbers


def _chosen(lanes: dict[str, MapLane], types: frozenset[str] | None) -> dict[str, MapLane]:
    return {
        name: lane
        for name, lane in lanes.items()
        if (lane.type != "none" if types is None else lane.type in types)
    }


def compare(one: LaneMap, other: LaneMap, types: frozenset[str] | None = None) -> MapDifference:
    """Compare two maps in the same coordinates.

    Args:
        one, other: the maps: source and result of a conversion, or an old and a new version.
        types: lane types that are compared; None for all but `none`.
    """
    ours, theirs = _chosen(one.lanes, types), _chosen(other.lanes, types)
    index, own = _LaneIndex(theirs), _LaneIndex(ours)
    places = _wide(_places(ours.values()))
    match, away, above = index.near(places.point, places.way, _reach(places)).nearest(
        len(places.lane)
    )
    there = match >= 0
    missing = _lengths(places, ~there)
    middle, sides, lanes = places.point[there], places.sides[there], match[there]
    borders = np.maximum(*(index.border_distances(lanes, sides[:, side]) for side in (0, 1)))
    heights = np.abs(above[there])
    names = [places.names[number] for number in places.lane[there].tolist()]
    pairs: dict[str, Counter[str]] = {}
    for name, other_lane in zip(names, lanes.tolist(), strict=True):
        pairs.setdefault(name, Counter())[index.names[other_lane]] += 1
    worst = np.argsort(-borders, kind="stable")[:_WORST]
    # The lane beside most places of it: at its ends a lane may lie on its neighbours.
    matched = {name: counts.most_common(1)[0][0] for name, counts in pairs.items()}
    lost, total = _connections(ours, theirs, index)
    gained, _ = _connections(theirs, ours, own)
    compared = len(borders) + sum(missing.values()) / STEP
    kinds = [(name, ours[name].type, theirs[match_].type) for name, match_ in matched.items()]
    limits = [(name, ours[name].limit, theirs[match_].limit) for name, match_ in matched.items()]
    return MapDifference(
        Distances.of(borders, names),
        Distances.of(away[there], names),
        Distances.of(heights, names),
        _longest_first(missing),
        _longest_first(_extra(theirs, own)),
        sum(lane.length for lane in ours.values()),
        total,
        lost,
        gained,
        float((borders <= _CLOSE).sum() / compared) if compared else 1.0,
        [pair for pair in kinds if pair[1] != pair[2]],
        [pair for pair in limits if abs((pair[1] or 0.0) - (pair[2] or 0.0)) > _SAME_SPEED],
        [(*middle[at, :2].tolist(), float(borders[at])) for at in worst.tolist()],
    )


def _wide(places: _LaneSamples) -> _LaneSamples:
    """The places at which lanes are wide enough to be compared."""
    wide = places.width >= _NARROW
    return _LaneSamples(
        places.names,
        places.lane[wide],
        places.point[wide],
        places.way[wide],
        places.width[wide],
        places.sides[wide],
    )


def _reach(places: _LaneSamples) -> FloatArray:
    return np.clip(0.5 * places.width, _LEAST_REACH, _MOST_REACH)


def _lengths(places: _LaneSamples, chosen: BoolArray) -> dict[str, float]:
    """Length of the chosen places by lane, m."""
    counts = Counter(places.lane[chosen].tolist())
    return {places.names[number]: STEP * count for number, count in counts.items()}


def _longest_first(lengths: dict[str, float]) -> dict[str, float]:
    """Lanes with more than a step, longest first."""
    kept = {name: length for name, length in lengths.items() if length > 2.0 * STEP}
    return dict(sorted(kept.items(), key=lambda item: -item[1]))


def _extra(lanes: dict[str, MapLane], index: _LaneIndex) -> dict[str, float]:
    """Lengths of lanes for which the other map has none."""
    places = _wide(_places(lanes.values()))
    match, *_ = index.near(places.point, places.way, _reach(places)).nearest(len(places.lane))
    return _lengths(places, match < 0)


def _connections(
    ours: dict[str, MapLane], theirs: dict[str, MapLane], index: _LaneIndex
) -> tuple[list[tuple[str, str]], int]:
    """Connections of some lanes that others lack, and the number of all."""
    pairs = [
        (name, following)
        for name, lane in ours.items()
        for following in lane.successors
        # Lanes shorter than a step have no place that could be matched.
        if following in ours and lane.length >= STEP and ours[following].length >= STEP
    ]
    ends = list(dict.fromkeys(end for a, b in pairs for end in ((a, True), (b, False))))
    points, ways = np.zeros((len(ends), 3)), np.zeros((len(ends), 2))
    for number, (name, at_end) in enumerate(ends):
        lane = ours[name]
        inside = min(_INSIDE, 0.5 * lane.length)
        s = lane.length - inside if at_end else inside
        behind, place, ahead = at_lengths(lane.centre, np.array([s - 0.2, s, s + 0.2]))
        way = (ahead - behind)[:2]
        points[number], ways[number] = place, way / max(math.hypot(*way), 1e-9)
    matches = index.near(points, ways, np.full(len(ends), _LEAST_REACH))
    near: dict[tuple[str, bool], set[str]] = {end: set() for end in ends}
    for at, lane_number in zip(matches.place.tolist(), matches.lane.tolist(), strict=True):
        near[ends[at]].add(index.names[lane_number])
    lost = [(a, b) for a, b in pairs if not _reaches(near[a, True], near[b, False], theirs)]
    return lost, len(pairs)


def _reaches(starts: set[str], ends: set[str], lanes: dict[str, MapLane]) -> bool:
    """Whether a lane of `starts` is one of `ends`, or leads to one in a few steps."""
    current = starts
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
