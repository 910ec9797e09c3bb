"""Geometry of roads: their ends, a smooth reference line along the middle, and borders as functions
of s.

A joint is measured on one road, its owner: the one that splits or the one into which others merge.
Its line runs at right angles to the owner where all its lanes still (or already) exist, since
lanelets rarely end abreast. Border pieces that the other lanelets lack up to that line, or have
beyond it, are taken from, or left to, the owner.

SciPy evaluates the splines; the fit is ours, because SciPy's `make_lsq_spline` and
`make_smoothing_spline` keep no values and slopes at the ends, without which neighbouring roads
would not meet."""

from __future__ import annotations

import math
from collections.abc import Iterator
from math import factorial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from schemas.common.array_types import FloatArray
from xodr.builders.elements import CubicPiece, PlanPose
from xodr.formats.lanelet2.graph import Graph, Joint, Layout
from xodr.formats.lanelet2.lanelet import (
    CrossLine,
    Points,
    across,
    between,
    crossing,
    direction,
    headings,
    joined,
    lengths,
    middle,
    places,
    points_at,
    prolonged,
    resampled,
    winds,
)

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

_STIFFNESS = 1e-4
"""Weight of the bending against the distance from the samples, so that gaps between samples are
bridged smoothly."""


def fit(
    at: FloatArray, samples: FloatArray, ends: FloatArray, slopes: FloatArray, intervals: int
) -> PPoly:
    """The cubic spline nearest to samples in the sense of least squares, of class C2.

    Args:
        at: parameters, ascending (n,). samples: (n, d).
        ends, slopes: values and derivatives at the first and last parameter, (2, d) each, kept
            exactly.
        intervals: number of pieces, all of the same length.
    """
    from scipy.interpolate import BSpline, PPoly
    from scipy.linalg import solveh_banded
    from scipy.sparse import diags_array, vstack

    first, last = at[0], at[-1]
    grid = np.linspace(first, last, intervals + 1)
    knots = np.concatenate([[first] * 3, grid, [last] * 3])
    count, step = intervals + 3, grid[1] - grid[0]
    control = np.zeros((count, samples.shape[1]))
    # The outer two control points at each end are fixed by value and slope there; the others are
    # fitted.
    control[0], control[-1] = ends
    control[1], control[-2] = ends[0] + slopes[0] * step / 3, ends[1] - slopes[1] * step / 3
    if intervals > 1:
        basis = BSpline.design_matrix(np.clip(at, first, last), knots, 3)
        second = diags_array([1.0, -2.0, 1.0], offsets=[0, 1, 2], shape=(count - 2, count))
        rows = vstack([basis, np.sqrt(_STIFFNESS) * second]).tocsc()
        free = rows[:, 2:-2]
        goal = np.vstack([samples, np.zeros((count - 2, samples.shape[1]))]) - rows @ control
        # Control points act on four pieces each: normal equations with three diagonals beside the
        # main one, whose time grows with the number of pieces, not with its square.
        normal = free.T @ free
        beside = min(3, intervals - 2)
        banded = np.zeros((beside + 1, intervals - 1))
        for number in range(beside + 1):
            banded[beside - number, number:] = normal.diagonal(number)
        control[2:-2] = solveh_banded(banded, free.T @ goal)
    spline = BSpline(knots, control, 3)
    return PPoly(
        np.stack([spline(grid[:-1], power) / factorial(power) for power in (3, 2, 1, 0)]), grid
    )


_MOST_CUT = 0.5
"""Largest share of a road that may be cut off at one end."""

_ONE_PLACE = 1.5
"""Largest distance (m) of the borders of lanes at one place from their mean."""
_LEVEL = 0.005
"""Reference lines of linked roads that are no farther apart than this (m) meet."""

End = tuple[int, bool]
"""A bundle, and whether its end (True) or its start is meant."""


class BorderCrossing(NamedTuple):
    """Crossing of a border with a line across the road: offset (m) to the left of its origin, and
    tangent of the angle."""

    t: float
    slope: float


class Mouth(NamedTuple):
    """The end of a road: the line across it, and where its borders pass, from left to right.

    centre: offset (m) at which the reference line passes, where a linked road has it; None for
    half-way between the borders.
    """

    frame: CrossLine
    edges: tuple[BorderCrossing, ...]
    centre: float | None = None

    @property
    def t(self) -> float:
        """Offset at which the reference line passes, m."""
        return (self.edges[0].t + self.edges[-1].t) / 2 if self.centre is None else self.centre


class Borders:
    """The borders of bundles as lines, from left to right."""

    def __init__(self, graph: Graph, layout: Layout) -> None:
        self.graph, self.layout = graph, layout

    def own(self, number: int) -> list[Points]:
        """The borders of a bundle as its lanelets have them."""
        lanelets = self.graph.lanelets
        lanes = self.layout.bundles[number].lanes
        return [joined([lanelets[name].left for name in lanes[0]])] + [
            joined([lanelets[name].right for name in lane]) for lane in lanes
        ]

    def extended(self, number: int) -> list[Points]:
        """The same with those of the lanelets before and after, and straight pieces beyond."""
        lanes = self.layout.bundles[number].lanes
        before = [next(iter(self.graph.before[lane[0]]), None) for lane in lanes]
        after = [next(iter(self.graph.after[lane[-1]]), None) for lane in lanes]
        lines = []
        for index, line in enumerate(self.own(number)):
            lane = max(index - 1, 0)
            first, last = (self._side(name, index) for name in (before[lane], after[lane]))
            if first is not None and last is not None and before[lane] == after[lane]:
                # Of a ring of two each half is before and after the other: no place comes twice.
                first, last = first[len(first) // 2 :], last[: len(last) // 2 + 1]
            parts = [part for part in (first, line, last) if part is not None]
            lines.append(prolonged(joined(parts)))
        return lines

    def middle(self, number: int) -> Points:
        """The line half-way between the outer borders of a bundle."""
        own = self.own(number)
        return middle(own[0], own[-1])

    def _side(self, name: str | None, index: int) -> Points | None:
        if name is None:
            return None
        lanelet = self.graph.lanelets[name]
        return lanelet.right if index else lanelet.left


def mouths(borders: Borders) -> dict[End, Mouth]:
    """Both ends of every bundle."""
    layout = borders.layout
    by_end: dict[End, Mouth] = {}
    for joint in layout.joints:
        # Where several roads end and several begin, none is the owner: the line is half-way between
        # all.
        owner = _owner(layout, joint)
        frame = _meeting(borders, joint) if owner is None else _cut(borders, owner)
        edges = (
            _lane_edges(borders, owner, frame) if owner else _shared_edges(borders, joint, frame)
        )
        links = [*joint.lanes, *((after, before) for before, after in joint.lanes)]
        for end in [
            *((number, True) for number in joint.ending),
            *((number, False) for number in joint.beginning),
        ]:
            partner = (
                {
                    lane: edges[other]
                    for lane, other in links
                    if lane[0] == end[0] and other in edges
                }
                if end != owner
                else edges
            )
            by_end[end] = Mouth(frame, tuple(_edges(borders, end, frame, partner)))
        if joint.plain and owner:
            other = (joint.beginning[0], False) if owner[1] else (joint.ending[0], True)
            # Two roads in a row have one reference line: a step in it is a break that readers
            # refuse.
            if abs(by_end[other].t - by_end[owner].t) > _LEVEL:
                by_end[other] = by_end[other]._replace(centre=by_end[owner].t)
    for number in range(len(layout.bundles)):
        for end in ((number, False), (number, True)):
            if end not in by_end:
                frame = _free(borders, end)
                by_end[end] = Mouth(frame, tuple(_edges(borders, end, frame, {})))
    return by_end


def _owner(layout: Layout, joint: Joint) -> End | None:
    alone = [
        (side[0], at_end)
        for side, at_end in ((joint.ending, True), (joint.beginning, False))
        if len(side) == 1
    ]
    # A road outside the junction before a way through it: the way fits itself to the road.
    return min(alone, key=lambda end: layout.bundles[end[0]].inside, default=None)


def _across(borders: Borders, end: End) -> CrossLine:
    """The line across the middle of a bundle's end."""
    line = borders.middle(end[0])
    x, y = line[-1 if end[1] else 0]
    return CrossLine(float(x), float(y), direction(line, end[1]))


def _corners(borders: Borders, end: End, frame: CrossLine) -> Points:
    """Return the offset (m) at which the borders of a bundle end (begin) ahead of a line across its
    end."""
    return frame.local(np.array([border[-1 if end[1] else 0] for border in borders.own(end[0])]))[
        :, 0
    ]


def _free(borders: Borders, end: End) -> CrossLine:
    """The line across a bundle's end that no border passes: nothing of a lanelet is lost where no
    other road goes on."""
    frame = _across(borders, end)
    corners = _corners(borders, end, frame)
    x, y = frame.world(float(corners.max() if end[1] else corners.min()), 0.0)
    return CrossLine(x, y, frame.heading)


def _cut(borders: Borders, end: End) -> CrossLine:
    """The line across a bundle near its end, up to which all its lanes reach."""
    line = borders.middle(end[0])
    corners = _corners(borders, end, _across(borders, end))
    shift = max(-corners.min(), 0.0) if end[1] else max(corners.max(), 0.0)
    total = lengths(line)[-1]
    # Ends that are far from abreast would cut a short road away.
    shift = min(shift, _MOST_CUT * total)
    rest = points_at(
        line, np.linspace(0.0, total - shift, 65) if end[1] else np.linspace(shift, total, 65)
    )
    x, y = rest[-1 if end[1] else 0]
    return CrossLine(float(x), float(y), direction(rest, end[1]))


def _meeting(borders: Borders, joint: Joint) -> CrossLine:
    """The line half-way between all that end and all that begin."""
    ends = [
        *((number, True) for number in joint.ending),
        *((number, False) for number in joint.beginning),
    ]
    frames = [_across(borders, end) for end in ends]
    x, y = np.mean([(frame.x, frame.y) for frame in frames], axis=0)
    heading = math.atan2(
        sum(math.sin(frame.heading) for frame in frames),
        sum(math.cos(frame.heading) for frame in frames),
    )
    return CrossLine(float(x), float(y), heading)


_Lane = tuple[int, int]


def _lane_edges(
    borders: Borders, end: End, frame: CrossLine
) -> dict[_Lane, tuple[BorderCrossing, BorderCrossing]]:
    """The left and right edges of each lane of the owner."""
    edges = [_edge(line, frame, end[1]) for line in borders.own(end[0])]
    return {(end[0], lane): (edges[lane], edges[lane + 1]) for lane in range(len(edges) - 1)}


def _shared_edges(
    borders: Borders, joint: Joint, frame: CrossLine
) -> dict[_Lane, tuple[BorderCrossing, BorderCrossing]]:
    """Return mean edges of the lanes that lead into each other where several roads end and several
    begin, if at one place."""
    ends = [
        *((number, True) for number in joint.ending),
        *((number, False) for number in joint.beginning),
    ]
    own = {
        (lane, end[1]): pair
        for end in ends
        for lane, pair in _lane_edges(borders, end, frame).items()
    }
    alike = {(key, side): {(key, side)} for key in own for side in (0, 1)}
    pairs = [
        (((before, True), side), ((after, False), side))
        for before, after in joint.lanes
        for side in (0, 1)
    ]
    pairs += [
        ((key, 1), (right, 0))
        for key in own
        if (right := ((key[0][0], key[0][1] + 1), key[1])) in own
    ]
    for one, other in pairs:
        # Sets that grow together: edges that are shared through any chain of lanes.
        both = alike[one] | alike[other]
        alike |= dict.fromkeys(both, both)
    shared_edges: dict[_Lane, tuple[BorderCrossing, BorderCrossing]] = {}
    for key, pair in own.items():
        shared = [
            np.array([own[number][place] for number, place in sorted(alike[key, side])]).mean(
                axis=0
            )
            for side in (0, 1)
        ]
        if all(
            abs(edge.t - mean[0]) <= _ONE_PLACE for edge, mean in zip(pair, shared, strict=True)
        ):
            shared_edges[key[0]] = (
                BorderCrossing(*shared[0].tolist()),
                BorderCrossing(*shared[1].tolist()),
            )
    return shared_edges


def _edges(
    borders: Borders,
    end: End,
    frame: CrossLine,
    known: dict[_Lane, tuple[BorderCrossing, BorderCrossing]],
) -> list[BorderCrossing]:
    """The edges of a bundle on a line across it: those of the lanes that it continues where they
    are known."""
    found = []
    lines = borders.own(end[0])
    for index, line in enumerate(lines):
        sides = [(known.get((end[0], index - 1)), 1), (known.get((end[0], index)), 0)]
        edges = [pair[side] for pair, side in sides if pair]
        found.append(
            BorderCrossing(*np.mean(edges, axis=0).tolist())
            if edges
            else _edge(line, frame, end[1])
        )
    return found


def _edge(line: Points, frame: CrossLine, at_end: bool) -> BorderCrossing:
    """Return the crossing of a border, its slope taken from the road's side of the line."""
    longer = prolonged(line)
    s, t = crossing(longer, frame)
    total = lengths(longer)[-1]
    rest = points_at(longer, np.linspace(0.0, s, 257) if at_end else np.linspace(s, total, 257))
    return BorderCrossing(t, math.tan(direction(rest, at_end) - frame.heading))


STEP = 0.25
"""Distance between the places where borders are measured, m."""
LINE_TOLERANCE = 0.3
"""Largest distance (m) of the reference line from the middle of the road: only its smoothness
matters."""
BORDER_TOLERANCE = 0.15
"""Largest distance (m) of the borders from those of the lanelets."""
_SHORTEST_BEND, _SHORTEST_PIECE = 3.0, 0.6
"""Shortest pieces of the reference line and of the borders, m."""
_MOST_PIECES = 512
_SHARPEST = 0.8
"""Largest curvature, in parts of that at which the road's inner edge would be the centre of the
curve."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


class RoadShape(NamedTuple):
    """A reference line and the borders.

    start, plan: of the reference line. s: where the pieces of the borders begin, (m,). t: their
    coefficients, from left to right, (m, 4, borders).
    """

    start: PlanPose
    plan: tuple[CubicPiece, ...]
    s: FloatArray
    t: FloatArray

    @property
    def length(self) -> float:
        """Length of the reference line, m."""
        return sum(piece.length for piece in self.plan)

    @property
    def end(self) -> list[float]:
        """t of the borders at the end of the road, from left to right, m."""
        ds = self.length - self.s[-1]
        return [float(value) for value in ds ** np.arange(4) @ self.t[-1]]


def shape(
    lines: list[Points], start: Mouth, end: Mouth, tolerance: float = BORDER_TOLERANCE
) -> RoadShape:
    """The geometry of the road between two mouths whose borders (from left to right) are the given
    lines.

    Args:
        tolerance: largest distance (m) of the borders from those lines, but for their ends.
    """
    line = _reference_line(
        between(lines[0], start.frame, end.frame),
        between(lines[-1], start.frame, end.frame),
        start,
        end,
    )
    knots = _arc_lengths(line)
    at = np.linspace(line.x[0], line.x[-1], places(knots[-1], STEP))
    s = _arc_lengths(line, at)
    samples = np.column_stack([_offsets(line, at, border) for border in lines])
    ends = np.array([_own(start), _own(end)])
    samples[[0, -1]] = ends
    samples = np.minimum.accumulate(
        samples, axis=1
    )  # borders that cross leave a lane without width
    slopes = np.array([[edge.slope for edge in mouth.edges] for mouth in (start, end)])
    borders = _smooth(s, samples, ends, slopes, tolerance)
    first = line(line.x[:1])[0]
    heading = math.atan2(*line(line.x[:1], 1)[0][::-1])
    return RoadShape(
        PlanPose(float(first[0]), float(first[1]), heading),
        tuple(_pieces(line, knots)),
        borders.x[:-1],
        _by_power(borders),
    )


def _own(mouth: Mouth) -> list[float]:
    """Return the offsets of the borders from the reference line, m."""
    return [edge.t - mouth.t for edge in mouth.edges]


def _reference_line(left: Points, right: Points, start: Mouth, end: Mouth) -> PPoly:
    """The spline along the middle that does not turn too sharply for the road's width; of those the
    coarsest one near to it."""
    samples = middle(left, right, STEP)
    half = np.hypot(*(resampled(left, len(samples)) - resampled(right, len(samples))).T) / 2
    ends = np.array([mouth.frame.world(0.0, mouth.t) for mouth in (start, end)])
    kept = _between_ends(samples, half, ends, start.centre is None, end.centre is None)
    samples, half = samples[kept], half[kept]
    for mouth, to_end, place in (
        (start, np.linspace(1.0, 0.0, len(samples)), 0),
        (end, np.linspace(0.0, 1.0, len(samples)), 1),
    ):
        if mouth.centre is not None:  # the line leaves the middle little by little
            samples += to_end[:, None] * (ends[place] - samples[-place])
    samples[[0, -1]] = ends
    at = lengths(samples)
    slopes = np.array(
        [(math.cos(mouth.frame.heading), math.sin(mouth.frame.heading)) for mouth in (start, end)]
    )
    candidates = []
    # The coarsest first: each further piece follows what noise the samples have.
    for intervals in _doubled(at[-1] / _SHORTEST_BEND):
        line = fit(at, samples, ends, slopes, intervals)
        away = float(np.hypot(*(line(at) - samples).T).max())
        sharp = float(np.abs(_curvatures(line, at) * half).max())
        if sharp <= _SHARPEST and away <= LINE_TOLERANCE:
            return line
        # Within both limits all are alike, so that of those the fewest pieces win.
        candidates.append((max(sharp, _SHARPEST), max(away, LINE_TOLERANCE), intervals, line))
    return min(candidates, key=lambda candidate: candidate[:3])[3]


def _between_ends(
    samples: Points, half: FloatArray, ends: Points, from_start: bool, to_end: bool
) -> slice:
    """Samples of a middle line between its ends: all, unless an end is farther from the line's than
    the lane is wide there.

    So it is where a lanelet is wider than long, and the line across its end lies along the lane.
    """
    first, last = 0, len(samples) - 1
    if from_start and np.hypot(*(samples[0] - ends[0])) > 2.0 * half[0] + STEP:
        first = int(np.hypot(*(samples - ends[0]).T).argmin())
    if to_end and np.hypot(*(samples[-1] - ends[1])) > 2.0 * half[-1] + STEP:
        last = int(np.hypot(*(samples - ends[1]).T).argmin())
    return slice(min(first, max(last - 1, 0)), max(last, first + 1) + 1)


def _doubled(most: float) -> Iterator[int]:
    """1, 2, 4, … up to a number, and 1 at least."""
    number = 1
    while number <= max(min(most, _MOST_PIECES), 1.0):
        yield number
        number *= 2


def _curvatures(line: PPoly, at: FloatArray) -> FloatArray:
    (dx, dy), (ddx, ddy) = line(at, 1).T, line(at, 2).T
    return np.asarray((dx * ddy - dy * ddx) / np.hypot(dx, dy) ** 3)


def _arc_lengths(line: PPoly, at: FloatArray | None = None) -> FloatArray:
    """Arc length of a plane curve at its knots, or at parameters."""
    grid = line.x if at is None else at
    ends = np.concatenate([[line.x[0]], grid])
    half = np.diff(ends)[:, None] / 2
    places = ends[:-1, None] + half * (1 + _NODES)
    # By Gauss's rule on each piece: arc lengths of cubics have no closed form.
    speeds = np.hypot(*line(places.ravel(), 1).T).reshape(places.shape)
    return np.cumsum((half * speeds) @ _WEIGHTS)


def _offsets(line: PPoly, at: FloatArray, border: Points) -> FloatArray:
    """t of a border at parameters of the reference line, interpolated where no normal of the line
    meets it."""
    tangents = line(at, 1)
    t = np.full(len(at), np.nan)
    if winds(border):
        turned = np.unwrap(np.arctan2(tangents[:, 1], tangents[:, 0]))
        # Both begin at the same end, so that their headings there differ by whole turns at most.
        turned += math.tau * round((headings(border)[0] - turned[0]) / math.tau)
        t = across(line(at), tangents, border, turned)
    if not np.isfinite(t).any():
        t = across(line(at), tangents, border)
    found = np.isfinite(t)
    return np.interp(at, at[found], t[found]) if found.any() else np.zeros(len(at))


def _smooth(
    s: FloatArray, samples: FloatArray, ends: FloatArray, slopes: FloatArray, tolerance: float
) -> PPoly:
    """The coarsest spline within tolerance (m) of the samples, else the nearest one."""
    candidates = []
    for intervals in _doubled(s[-1] / _SHORTEST_PIECE):
        spline = fit(s, samples, ends, slopes, intervals)
        away = float(np.abs(spline(s) - samples).max())
        if away <= tolerance:
            return spline
        candidates.append((away, intervals, spline))
    return min(candidates, key=lambda candidate: candidate[:2])[2]


def _pieces(line: PPoly, s: FloatArray) -> list[CubicPiece]:
    """The pieces of a plane spline in the frames of their starts, with parameters from 0 to 1."""
    pieces = []
    for index, piece in enumerate(_by_power(line)):
        scaled = piece * (line.x[index + 1] - line.x[index]) ** np.arange(4)[:, None]
        # The frame is that of the start, so both offsets there are 0, and v has no slope.
        scaled[0] = 0.0
        direction = scaled[1] / np.hypot(*scaled[1])
        u = scaled @ direction
        v = scaled @ np.array([-direction[1], direction[0]])
        v[1] = 0.0
        pieces.append(
            CubicPiece(float(s[index + 1] - s[index]), tuple(u.tolist()), tuple(v.tolist()))
        )
    return pieces


def _by_power(spline: PPoly) -> FloatArray:
    """The coefficients a, b, c, d of each piece, (m, 4, d)."""
    return spline.c[::-1].transpose(1, 0, 2)
