"""Location of world positions: the nearest place on a road network.

Each road is cut into chords at load; a tree of boxes over them (a bulk-loaded R-tree, as fast as
Shapely's on a town and twice as fast on one road: docs/performance.md) gives the few chords near a
point, nearest first, and a projection onto the exact reference line gives s and t. A point's
distance from a road is that from its surface, not
from its reference line: on the road it is 0, and where roads overlap (junctions, bridges) height,
heading and the
distance from the lane's centre decide, in this order.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from heapq import heappop, heappush
from itertools import pairwise
from typing import NamedTuple

from xodr.model import RoadPoint
from xodr.model.road import Road

_MOST_CHORDS = 400_000
_TOO_LONG = "the roads are too long or wind too much to be indexed"
_LONGEST_CHORD = 100.0
_FANOUT = 8
CONVERGED = 1e-6
ON_SURFACE = 1e-6
OTHER_LEVEL = 2.0
"""Height difference [m] from which a road is taken to be on another level."""


class _Chord(NamedTuple):
    """A piece of road with the line from its beginning to its end; the road keeps within `room` [m]
    of it."""

    road: Road
    start: float
    end: float
    x: float
    y: float
    dx: float
    dy: float
    room: float

    def near(self, x: float, y: float) -> float:
        """s of the chord's place nearest to a point: close to that of the road."""
        share = ((x - self.x) * self.dx + (y - self.y) * self.dy) / (
            self.dx * self.dx + self.dy * self.dy or 1.0
        )
        return self.start + min(max(share, 0.0), 1.0) * (self.end - self.start)

    def continues(self, road: Road, s: float) -> bool:
        """Whether an s of a road is so near along the road that this chord would lead to the same
        place."""
        return road is self.road and self.start - self.room <= s <= self.end + self.room


class _Box(NamedTuple):
    """Bounds of all chords below; a leaf has one chord and no children."""

    west: float
    south: float
    east: float
    north: float
    chord: _Chord | None
    children: tuple[_Box, ...]

    def distance(self, x: float, y: float) -> float:
        """Distance from a point to the box, 0 inside."""
        dx = max(self.west - x, 0.0, x - self.east)
        dy = max(self.south - y, 0.0, y - self.north)
        return math.hypot(dx, dy) if dx and dy else dx + dy


class _Hit(NamedTuple):
    """A projection onto a road. gap: distance from the road's surface [m], 0 on it."""

    road: Road
    s: float
    t: float
    gap: float


class Locator:
    """Finds road points for world positions.

    Raises:
        ValueError: the roads are too long or wind too much to be indexed.
    """

    def __init__(self, roads: Iterable[Road]) -> None:
        leaves: list[_Box] = []
        # Checked on the way, before the memory is taken.
        for road in roads:
            leaves.extend(_leaves(road))
            if len(leaves) > _MOST_CHORDS:
                raise ValueError(_TOO_LONG)
        self._root = _tree(leaves)

    def locate(self, x: float, y: float, z: float | None, h: float | None) -> RoadPoint:
        """The nearest road point; z [m] and h (heading of a road user [rad]) decide between roads
        that overlap."""
        gap = math.inf
        found: list[tuple[tuple[float, ...], RoadPoint]] = []
        feet: list[tuple[Road, float]] = []
        queue = [(self._root.distance(x, y), 0, self._root)]
        count = 0
        # Best first: a box farther away than the best place can hold no better one.
        while queue and queue[0][0] <= gap:
            box = heappop(queue)[2]
            for child in box.children:
                # The count breaks ties of distance: boxes themselves cannot be ordered.
                count += 1
                heappush(queue, (child.distance(x, y), count, child))
            # A place on the road was found within reach of this chord, which would give the same
            # again.
            if box.chord is None or any(box.chord.continues(*foot) for foot in feet):
                continue
            road = box.chord.road
            hit = project(road, x, y, box.chord.near(x, y), box.chord.start, box.chord.end)
            if hit.gap <= gap:
                gap = hit.gap
                point = road.point(hit.s, hit.t)
                found.append(((gap, *_mismatch(road, point, z, h)), point))
            if hit.gap == 0.0:
                feet.append((road, hit.s))
        return min(found, key=lambda candidate: candidate[0])[1]


def follow(road: Road, x: float, y: float, s: float) -> RoadPoint | None:
    """The road point near an s known before; None where the point has left the road's surface."""
    hit = project(road, x, y, s, max(s - _LONGEST_CHORD, 0.0), min(s + _LONGEST_CHORD, road.length))
    return road.point(hit.s, hit.t) if hit.gap == 0.0 else None


def project(road: Road, x: float, y: float, s: float, low: float, high: float) -> _Hit:
    """Foot of the perpendicular onto the reference line, by Newton's method from s, else by
    bisection between two s."""
    for _ in range(12):
        ahead, aside = _local(road, x, y, s)
        # d(ahead)/ds is 1 − κ·aside; kept away from 0 at the centre of a curve
        following = s + ahead / max(1.0 - road.line.curvature(s) * aside, 0.1)
        before, s = s, min(max(following, 0.0), road.length)
        # Clamped to an end, the step is 0 without any convergence: what is ahead there remains.
        if abs(s - before) < CONVERGED:
            if s == following:
                ahead = 0.0  # what is left is the square of the last step, far below a micrometre
            break
    else:
        s = _bisect(road, x, y, low, high)
        ahead, aside = _local(road, x, y, s)
    t = road.t_of(s, aside)
    right, left = road.edges(s)
    beside = max(right - t, 0.0, t - left)
    gap = beside
    if abs(ahead) > ON_SURFACE:
        gap = math.hypot(beside, ahead)
        if s in (0.0, road.length) and ahead * (s - 0.5 * road.length) > 0.0:
            s += ahead  # beyond the road's end, on the straight line that continues it
    return _Hit(road, s, t, 0.0 if gap <= ON_SURFACE else gap)


def _local(road: Road, x: float, y: float, s: float) -> tuple[float, float]:
    """A world position in the frame of the reference line at s: ahead and to the left."""
    px, py, h = road.line.at(s)
    cos, sin = math.cos(h), math.sin(h)
    return (x - px) * cos + (y - py) * sin, (y - py) * cos - (x - px) * sin


def _bisect(road: Road, x: float, y: float, low: float, high: float) -> float:
    """Find the s at which "ahead" changes sign. Works at kinks too, where Newton's method
    oscillates."""
    while high - low > CONVERGED:
        middle = 0.5 * (low + high)
        # At the resolution of floats, far along a road, halving ends before CONVERGED.
        if middle in (low, high):
            break
        if _local(road, x, y, middle)[0] > 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _mismatch(
    road: Road, point: RoadPoint, z: float | None, h: float | None
) -> tuple[float, float, float]:
    """Return the mismatch of a road point: level (m), heading against the lane (rad, coarse),
    distance (m) from the lane's centre."""
    height = abs(road.pose(point.s, point.t).z - z) if z is not None else 0.0
    angle = 0.0
    if h is not None:
        way = road.heading(point.s) + (
            0.0 if road.direction(point.lane_id, point.s) > 0 else math.pi
        )
        # Rounded, so that lanes of one direction tie and the distance from the centre decides.
        angle = round(abs(math.remainder(h - way, math.tau)), 3)
    return (height if height > OTHER_LEVEL else 0.0), angle, round(abs(point.offset), 6)


# the tree -----------------------------------------------------------------------------------


def _leaves(road: Road) -> Iterator[_Box]:
    if road.length / _LONGEST_CHORD > _MOST_CHORDS:
        raise ValueError(_TOO_LONG)
    # No chord spans a change of geometry or of lanes, where bends and widths jump.
    knots = {s for s in road.line.knots() if 0.0 < s < road.length} | {
        section.s for section in road.sections
    }
    for low, high in pairwise([*sorted(knots), road.length]):
        count = math.ceil((high - low) / _LONGEST_CHORD)
        for index in range(count):
            yield _leaf(
                road, low + (high - low) * index / count, low + (high - low) * (index + 1) / count
            )


def _leaf(road: Road, start: float, end: float) -> _Box:
    x0, y0, h0 = road.line.at(start)
    x1, y1, h1 = road.line.at(end)
    widest = max(abs(edge) for s in (start, 0.5 * (start + end), end) for edge in road.edges(s))
    # twice the height of an arc over its chord, and a margin for widths between the samples
    room = widest + abs(h1 - h0) * (end - start) / 4.0 + 0.5
    chord = _Chord(road, start, end, x0, y0, x1 - x0, y1 - y0, room)
    return _Box(
        min(x0, x1) - room, min(y0, y1) - room, max(x0, x1) + room, max(y0, y1) + room, chord, ()
    )


def _tree(boxes: list[_Box]) -> _Box:
    """Sort-tile-recursive packing (Leutenegger, Lopez, Edgington 1997)."""
    while len(boxes) > 1:
        parents = math.ceil(len(boxes) / _FANOUT)
        slice_size = _FANOUT * math.ceil(math.sqrt(parents))
        boxes.sort(key=lambda box: box.west + box.east)
        slices = [boxes[index : index + slice_size] for index in range(0, len(boxes), slice_size)]
        boxes = []
        for stripe in slices:
            stripe.sort(key=lambda box: box.south + box.north)
            boxes.extend(
                _parent(tuple(stripe[index : index + _FANOUT]))
                for index in range(0, len(stripe), _FANOUT)
            )
    return boxes[0]


def _parent(children: tuple[_Box, ...]) -> _Box:
    return _Box(
        min(box.west for box in children),
        min(box.south for box in children),
        max(box.east for box in children),
        max(box.north for box in children),
        None,
        children,
    )
