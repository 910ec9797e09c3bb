"""Reference lines, profiles and lanes evaluated at many places at once, and roads sampled as
arrays, in numpy.

Reference lines become cubics between knots so close together that they are exact to a
micrometre."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from schemas.common.array_types import BoolArray, FloatArray, IntArray
from xodr.model import NO_WIDTH, LaneSection
from xodr.model.geometry import Profile
from xodr.model.road import Road

_FINE = 0.02
"""Most that the heading changes from knot to knot, rad: a cubic then misses an arc of 1 km radius
by less than 1e-6 m."""
_COARSE = 0.3
"""Most that it changes along a chord, rad, but for one piece between knots."""
_LARGEST_TURN = 0.5 * math.pi
"""Most that it changes within a part, rad."""
_EDGES = 5.0
"""Distance between places where a road's width is looked at, m."""
_MARGIN = 0.5
"""Room for widths between those places, m."""
_TINY = 1e-18


class Local(NamedTuple):
    """Positions in the frame of a reference line at given s: ahead and to the left (m), and the
    line's curvature (1/m)."""

    ahead: FloatArray
    aside: FloatArray
    curvature: FloatArray


class OnChord(NamedTuple):
    """Places on chords: s, the s of both ends of the chord, and the distance from the position that
    each is nearest to, m."""

    s: FloatArray
    low: FloatArray
    high: FloatArray
    distance: FloatArray

    def at(self, rows: IntArray) -> OnChord:
        """Subset of the places."""
        return OnChord(*(values[rows] for values in self))


class RoadPart(NamedTuple):
    """A part of a road that does not bend back on itself.

    s: its knots. x, y: its line, a cubic of the distance from each knot (coefficients by power, (4,
    knots - 1)). chords: indices of those knots that straight lines between come near the line.
    room: how far the road's surface reaches from these, m. bounds: west, east, south and north of
    the surface, m.
    """

    road: Road
    s: FloatArray
    x: FloatArray
    y: FloatArray
    chords: IntArray
    room: float
    bounds: tuple[float, float, float, float]

    def near(self, x: FloatArray, y: FloatArray, reach: float) -> BoolArray:
        """Positions that may be within this distance (m) of the part's surface."""
        west, east, south, north = self.bounds
        return (
            (x >= west - reach) & (x <= east + reach) & (y >= south - reach) & (y <= north + reach)
        )

    def local(self, x: FloatArray, y: FloatArray, s: FloatArray) -> Local:
        """Positions in the frame of the line at each s."""
        # At the last knot and beyond the ends, the piece next to them goes on.
        index = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        u = s - self.s[index]
        (px, dx, ddx), (py, dy, ddy) = (_cubic(line[:, index], u) for line in (self.x, self.y))
        norm = np.hypot(dx, dy)
        ahead, aside = (
            ((x - px) * dx + (y - py) * dy) / norm,
            ((y - py) * dx - (x - px) * dy) / norm,
        )
        return Local(ahead, aside, (dx * ddy - dy * ddx) / norm**3)

    def heading(self, s: FloatArray) -> FloatArray:
        """Heading of the line at each s, rad."""
        index = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        u = s - self.s[index]
        return np.arctan2(_cubic(self.y[:, index], u)[1], _cubic(self.x[:, index], u)[1])

    def on_chords(self, x: FloatArray, y: FloatArray) -> OnChord:
        """The place on the chords that is nearest to each position."""
        best, s, low, high = np.full(len(x), np.inf), *np.zeros((3, len(x)))
        (ax, ay), start = self._corners(), self.s[self.chords]
        # A loop over the chords, which are few; the positions may be many.
        for index, (dx, dy) in enumerate(zip(np.diff(ax), np.diff(ay), strict=True)):
            px, py, since, until = x - ax[index], y - ay[index], start[index], start[index + 1]
            # _TINY: a chord without length has one place only, not 0/0.
            share = np.clip((px * dx + py * dy) / max(dx * dx + dy * dy, _TINY), 0.0, 1.0)
            square = (px - share * dx) ** 2 + (py - share * dy) ** 2
            nearer = square < best
            best[nearer], s[nearer] = square[nearer], since + share[nearer] * (until - since)
            low[nearer], high[nearer] = since, until
        return OnChord(s, low, high, np.sqrt(best))

    def _corners(self) -> tuple[FloatArray, FloatArray]:
        """x and y of the ends of the chords."""
        end = self.s[-1:] - self.s[-2:-1]
        x, y = (
            np.append(line[0], _cubic(line[:, -1:], end)[0])[self.chords]
            for line in (self.x, self.y)
        )
        return x, y


def _cubic(coefficients: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Values and two derivatives of cubics."""
    a, b, c, d = coefficients
    return a + u * (b + u * (c + u * d)), b + u * (2.0 * c + 3.0 * u * d), 2.0 * c + 6.0 * u * d


def parts(road: Road) -> list[RoadPart]:
    """A road cut into parts."""
    knots = np.array(_knots(road))
    pieces = np.array(
        [(*road.line.at(a), *road.line.at(_inside(b))) for a, b in pairwise(knots.tolist())]
    )
    turned = _turned(pieces)
    # Cut at each quarter turn: on a part that bends back, the nearest chord may be on the wrong
    # stretch.
    ends = [*np.flatnonzero(np.diff(turned // _LARGEST_TURN)) + 1, len(pieces)]
    return [
        _part(road, knots[a : b + 1], pieces[a:b], turned[a:b]) for a, b in pairwise([0, *ends])
    ]


def _knots(road: Road) -> list[float]:
    """s between which a cubic is as good as the road's line."""
    fine = [0.0]
    # Knots go back where geometries overlap.
    inside = {s for s in road.line.knots() if 0.0 < s < road.length}
    for high in (*sorted(inside), road.length):
        low = fine[-1]
        # Curvature may change along a piece, so both ends and the middle are asked.
        bend = max(abs(road.curvature(s)) for s in (low, 0.5 * (low + high), _inside(high))) * (
            high - low
        )
        count = max(1, math.ceil(bend / _FINE))
        fine += [low + (high - low) * (index + 1) / count for index in range(count)]
    return fine


def _inside(end: float) -> float:
    """The s just before an end: where a line has a kink, its heading before it."""
    return math.nextafter(end, -math.inf)


def _turned(pieces: FloatArray) -> FloatArray:
    """Sum of the absolute changes of heading up to the end of each piece (x, y, heading of its
    ends), rad."""
    begins, ends = pieces[:, 2], pieces[:, 5]
    # Kinks between pieces count like bends.
    return np.cumsum(np.abs(ends - begins) + np.abs(begins - np.append(begins[:1], ends[:-1])))


def _part(road: Road, knots: FloatArray, pieces: FloatArray, turned: FloatArray) -> RoadPart:
    x0, y0, h0, x1, y1, h1 = pieces.T
    length = np.diff(knots)
    x = _hermite(x0, np.cos(h0), x1, np.cos(h1), length)
    y = _hermite(y0, np.sin(h0), y1, np.sin(h1), length)
    chords = np.unique([0, *np.flatnonzero(np.diff(turned // _COARSE)) + 1, len(pieces)])
    # twice as much as an arc is away from its chord
    sagitta = float(np.diff(knots[chords]).max()) * 2.0 * _COARSE / 4.0
    room = _room(road, float(knots[0]), float(knots[-1])) + (
        sagitta if turned[-1] > turned[0] else 0.0
    )
    west, east, south, north = (
        min(x0.min(), x1[-1]),
        max(x0.max(), x1[-1]),
        min(y0.min(), y1[-1]),
        max(y0.max(), y1[-1]),
    )
    return RoadPart(
        road, knots, x, y, chords, room, (west - room, east + room, south - room, north + room)
    )


def _hermite(
    a: FloatArray, slope_a: FloatArray, b: FloatArray, slope_b: FloatArray, length: FloatArray
) -> FloatArray:
    """Coefficients of the cubics through a and b with the given slopes."""
    rise = (b - a) / length
    return np.stack(
        [
            a,
            slope_a,
            (3.0 * rise - 2.0 * slope_a - slope_b) / length,
            (slope_a + slope_b - 2.0 * rise) / length**2,
        ]
    )


def _room(road: Road, start: float, end: float) -> float:
    """Return the reach (m) of the surface from the line between two s."""
    count = 1 + math.ceil((end - start) / _EDGES)
    places = [
        *np.linspace(start, end, count).tolist(),
        *(section.s for section in road.sections if start < section.s < end),
    ]
    return max(abs(edge) for s in places for edge in road.edges(s)) + _MARGIN


# profiles and lanes -------------------------------------------------------------------------


def values(profile: Profile, s: FloatArray) -> FloatArray:
    """A profile at each s."""
    if profile.constant is not None:
        return np.full(len(s), profile.constant)
    # Before the first piece, that one goes on backwards.
    start, a, b, c, d = np.array(profile.pieces).T[
        :, np.maximum(np.searchsorted(profile.starts, s, side="right") - 1, 0)
    ]
    u = s - start
    return a + u * (b + u * (c + u * d))


def sections(road: Road, s: FloatArray) -> IntArray:
    """Index of the lane section at each s."""
    return np.maximum(
        np.searchsorted([section.s for section in road.sections], s, side="right") - 1, 0
    )


def edges(section: LaneSection, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """t of the right and left edge at each s: `Road.edges` within one lane section."""
    right, left = (
        section.lanes[side[-1] if side else 0].outer for side in (section.right, section.left)
    )
    return values(right, s), values(left, s)


def lanes(section: LaneSection, s: FloatArray, t: FloatArray) -> IntArray:
    """The lane of each (s, t): `xodr.model.road.lane_in` for many."""
    centre = values(section.lanes[0].center, s)
    found = np.zeros(len(s), np.int64)
    for mine, here, beyond in (
        (t > centre, section.left, section.right),
        (t <= centre, section.right, section.left),
    ):
        found[mine] = _lanes_of_side(
            section, s[mine], np.abs(t - centre)[mine], centre[mine], here, beyond
        )
    return found


def _lanes_of_side(
    section: LaneSection,
    s: FloatArray,
    away: FloatArray,
    centre: FloatArray,
    here: tuple[int, ...],
    beyond: tuple[int, ...],
) -> IntArray:
    lanes = np.zeros(len(s), np.int64)
    searching = np.ones(len(s), bool)
    for lane_id in here:
        lane = section.lanes[lane_id]
        there = searching & (values(lane.width, s) > NO_WIDTH)
        lanes[there] = lane_id
        searching &= ~(there & (away <= np.abs(values(lane.outer, s) - centre)))
    # No lane on the side of the place: the nearest one beyond the centre, as in lane_in.
    for lane_id in beyond:
        lanes[(lanes == 0) & (values(section.lanes[lane_id].width, s) > NO_WIDTH)] = lane_id
    return lanes


Points = FloatArray
"""World coordinates: one row x, y, z [m] for each place."""


def sample(road: Road, s: ArrayLike, t: ArrayLike = 0.0) -> Points:
    """World coordinates of many (s, t); the two are broadcast against each other."""
    at_s, at_t = (
        values.ravel().tolist()
        for values in np.broadcast_arrays(np.asarray(s, float), np.asarray(t, float))
    )
    return np.array(
        [road.pose(*place)[:3] for place in zip(at_s, at_t, strict=True)], float
    ).reshape(-1, 3)


def stations(road: Road, longest: float = 5.0) -> FloatArray:
    """s [m] from 0 to the road's length: denser where the line bends, never further apart than
    `longest`."""
    knots = {0.0, road.length, *(section.s for section in road.sections), *road.line.knots()}
    inside = sorted(s for s in knots if 0.0 <= s <= road.length)
    pieces = [
        np.linspace(a, b, int(np.ceil((b - a) / longest)), endpoint=False)
        for a, b in pairwise(inside)
    ]
    return np.append(np.concatenate(pieces), road.length)


_FINEST = 0.05
"""Distance (m) of stations below which none is added"""


def section_stations(
    road: Road, section: LaneSection, error: float, longest: float = 5.0
) -> FloatArray:
    """s (m) of a lane section, ends included, between which straight lines miss no lane border by
    more than `error` (m)."""
    inside = [s for s in stations(road, longest).tolist() if section.s < s < section.end]
    borders = [
        section.lanes[0].center,
        *(section.lanes[lane].outer for lane in (*section.left, *section.right)),
    ]
    inside += [s for border in borders for s in border.starts if section.s < s < section.end]
    found = np.array(sorted({section.s, section.end, *inside}))
    if len(found) < 2:
        return found
    places = {s: _across(road, borders, s) for s in found.tolist()}
    pending = list(pairwise(found.tolist()))
    records = set(pending)
    while pending:
        low, high = pending.pop()
        middle = 0.5 * (low + high)
        # A border that jumps never comes near a straight line: halving has to end.
        if high - low < _FINEST:
            continue
        places[middle] = _across(road, borders, middle)
        chord = places[low], places[high]
        away = _off(places[middle], chord, 0.5)
        if away <= error and (low, high) in records:
            # The middle of a bend and its counterbend lies on the line between their ends.
            away = max(
                _off(_across(road, borders, low + share * (high - low)), chord, share)
                for share in (0.25, 0.75)
            )
        if away > error:
            pending += [(low, middle), (middle, high)]
        else:
            # Straight enough without it.
            del places[middle]
    return np.array(sorted(places))


def _off(places: Points, chord: tuple[Points, Points], share: float) -> float:
    """Largest distance (m) of places from those at a share of chords."""
    straight = (1.0 - share) * chord[0] + share * chord[1]
    return float(np.linalg.norm(places - straight, axis=1).max())


def _across(road: Road, borders: list[Profile], s: float) -> Points:
    return np.array([road.pose(s, border(s))[:3] for border in borders])


def lane_borders(road: Road, longest: float = 5.0) -> list[tuple[int, Points, Points]]:
    """Return, for every lane of every section, its id and its inner and outer
    border as polylines.
    """
    everywhere = stations(road, longest)
    borders = []
    for section in road.sections:
        inside = [
            section.s,
            *(s for s in everywhere.tolist() if section.s < s < section.end),
            section.end,
        ]
        for lane_id in (*section.left, *section.right):
            lane = section.lanes[lane_id]
            inner, outer = (
                sample(road, inside, [side(s) for s in inside]) for side in (lane.inner, lane.outer)
            )
            borders.append((lane_id, inner, outer))
    return borders
