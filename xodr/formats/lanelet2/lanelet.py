"""Lanelets: pieces of lanes between two bounds, with the geometry of their borders as polylines."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import NamedTuple

import numpy as np

from schemas.common.array_types import FloatArray

Points = FloatArray
"""Points of a line, (n, 2), m."""


class LaneletNeighbour(NamedTuple):
    """A lanelet beside another one, and whether it leads the same way."""

    id: str
    same_direction: bool


@dataclass(frozen=True, eq=False)
class Lanelet:
    """A piece of a lane that leads from the first to the last points of its bounds.

    Attributes:
        left, right: its bounds, (n, 2) and (m, 2), m.
        predecessors, successors: lanelets before and after it; naming one of a pair is enough.
        beside_left, beside_right: neighbours that share a whole bound.
        type: lane type of OpenDRIVE, e.g. "driving", "biking", "sidewalk".
        road_type: road type of OpenDRIVE, e.g. "town", "rural", "motorway".
        speed_limit: in m/s, infinite for none.
        left_mark, right_mark: road marks of OpenDRIVE on the bounds.
        lights: names of the traffic lights at its end.
    """

    id: str
    left: Points
    right: Points
    predecessors: tuple[str, ...] = ()
    successors: tuple[str, ...] = ()
    beside_left: LaneletNeighbour | None = None
    beside_right: LaneletNeighbour | None = None
    type: str = "driving"
    road_type: str = "town"
    speed_limit: float = 50 / 3.6
    left_mark: str = "none"
    right_mark: str = "none"
    lights: tuple[str, ...] = ()


WALKS = ("sidewalk", "walking")
"""Lane types of pedestrians."""
REACH = 8.0
"""Length of line from which a direction is taken, m."""
_BEYOND = 40.0
_SAME = 1e-3
_WINDING = 1.5 * math.pi
"""Change of heading (rad) from which on a line is taken to wind."""
_SAME_CROSSING = 0.5
"""Difference of offsets (m) up to which turns cross a frame at one place."""
_FEWEST, _MOST = 8, 4000
"""Fewest and most stretches that a line is cut into."""
_AT_ONCE = 2_000_000
"""Number of pairs of points and stretches per block, to save memory."""


class CrossLine(NamedTuple):
    """A line across the road: it passes through (x, y) at right angles to the heading."""

    x: float
    y: float
    heading: float

    def local(self, points: Points) -> Points:
        """Return the coordinates (n, 2) of points ahead of the line and to the
        left of (x, y), m.
        """
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return (points - (self.x, self.y)) @ np.array([[cos, -sin], [sin, cos]])

    def world(self, ahead: float, aside: float) -> tuple[float, float]:
        """The point that far ahead and to the left."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return self.x + cos * ahead - sin * aside, self.y + sin * ahead + cos * aside


def lengths(line: Points) -> Points:
    """Arc length at each point, (n,), m."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])


def points_at(line: Points, s: Points) -> Points:
    """Points at arc lengths, (n, 2), m."""
    at = lengths(line)
    return np.column_stack([np.interp(s, at, line[:, axis]) for axis in (0, 1)])


def resampled(line: Points, count: int) -> Points:
    """`count` points at equal distances along the line, its ends included."""
    return points_at(line, np.linspace(0.0, lengths(line)[-1], count))


def places(length: float, step: float) -> int:
    """Return the number of samples on a length (m), about a step apart, ends included; bounded on
    both sides."""
    return min(max(int(length / step), _FEWEST), _MOST) + 1


def middle(left: Points, right: Points, step: float = 0.5) -> Points:
    """The line half-way between two lines: points at equal shares of their lengths, about a step
    apart."""
    count = places(max(lengths(left)[-1], lengths(right)[-1]), step)
    return (resampled(left, count) + resampled(right, count)) / 2


def joined(lines: list[Points]) -> Points:
    """Lines one after the other, without points that repeat."""
    points = np.concatenate(lines)
    steps = np.hypot(*np.diff(points, axis=0).T)
    return points[np.concatenate([[True], steps > _SAME])]


def prolonged(line: Points) -> Points:
    """The line with a straight piece before its start and after its end."""
    first, last = line[0] - line[1], line[-1] - line[-2]
    before = line[0] + first * (_BEYOND / np.hypot(*first))
    after = line[-1] + last * (_BEYOND / np.hypot(*last))
    return np.concatenate([[before], line, [after]])


def direction(line: Points, at_end: bool) -> float:
    """Heading [rad] of a line at one of its ends: the tangent of a parabola through its last
    (first) `REACH` metres."""
    total = lengths(line)[-1]
    # The last chord alone follows each jitter of the drawn nodes.
    reach = min(REACH, total)
    near = points_at(
        line, np.linspace(total - reach, total, 33) if at_end else np.linspace(0.0, reach, 33)
    )
    parameter = np.linspace(-1.0, 0.0, 33) if at_end else np.linspace(0.0, 1.0, 33)
    dx, dy = (
        np.polynomial.Polynomial.fit(parameter, near[:, axis], 2).deriv()(0.0) for axis in (0, 1)
    )
    return math.atan2(dy, dx)


def frame_at(line: Points, s: float) -> CrossLine:
    """The line across a line at an arc length, m."""
    before = points_at(line, np.linspace(0.0, s, 65))
    return CrossLine(float(before[-1, 0]), float(before[-1, 1]), direction(before, True))


def crossing(line: Points, frame: CrossLine) -> tuple[float, float]:
    """Return the arc length (m) at which a line crosses a frame from behind, and the offset (m) to
    the left of the frame's origin.

    The crossing nearest to the origin is meant; where there is none, the line's point nearest to
    the frame.
    """
    ahead, aside = frame.local(line).T
    # From behind only: on a loop the line also comes back over the frame.
    steps = np.flatnonzero((ahead[:-1] <= 0.0) & (ahead[1:] > 0.0))
    at = lengths(line)
    if not len(steps):
        nearest = int(np.argmin(np.abs(ahead)))
        return float(at[nearest]), float(aside[nearest])
    share = ahead[steps] / (ahead[steps] - ahead[steps + 1])
    places = aside[steps] + share * (aside[steps + 1] - aside[steps])
    best = int(np.argmin(np.abs(places)))
    step = steps[best]
    return float(at[step] + share[best] * (at[step + 1] - at[step])), float(places[best])


def between(line: Points, start: CrossLine, end: CrossLine) -> Points:
    """The part of a line between two frames that it crosses."""
    s0, s1 = crossing(line, start)[0], crossing(line, end)[0]
    if winds(line):  # each turn crosses both frames at the same place
        s0, s1 = (_outermost(line, frame, at) for frame, at in ((start, 0), (end, -1)))
    # Frames that cross each other upon the line would leave no part of it.
    if s1 <= s0:
        s1 = s0 + _SAME
    at = lengths(line)
    inner = at[(at > s0) & (at < s1)]
    return points_at(line, np.concatenate([[s0], inner, [s1]]))


def headings(line: Points) -> FloatArray:
    """Directions of the stretches of a line, (n - 1,), rad, without jumps by a full turn.

    Means over some metres of points at equal distances: where surveyed pieces meet, and on the
    inner border of a sharp corner, short stretches lead back, whose directions tell no turns.
    """
    along = lengths(line)
    even = resampled(line, places(along[-1], 1.0))
    single = np.diff(even, axis=0)
    window = np.ones(min(int(REACH), len(single)) - 1 | 1)
    steps = np.column_stack([np.convolve(part, window, "same") for part in single.T])
    turned = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    middles = (np.arange(len(turned)) + 0.5) * along[-1] / len(turned)
    return np.asarray(np.interp(0.5 * (along[:-1] + along[1:]), middles, turned))


def winds(line: Points) -> bool:
    """Whether a line turns about so far that it may pass a place, or its own ends, again."""
    return bool(np.ptp(headings(line)) > _WINDING)


def _outermost(line: Points, frame: CrossLine, at: int) -> float:
    """The arc length (m) of the first (0) or last (-1) of the crossings of a frame that lie no
    farther from its origin than the nearest one."""
    ahead, aside = frame.local(line).T
    steps = np.flatnonzero((ahead[:-1] <= 0.0) & (ahead[1:] > 0.0))
    if not len(steps):
        return crossing(line, frame)[0]
    share = ahead[steps] / (ahead[steps] - ahead[steps + 1])
    places = np.abs(aside[steps] + share * (aside[steps + 1] - aside[steps]))
    chosen = np.flatnonzero(places <= places.min() + _SAME_CROSSING)[at]
    along = lengths(line)
    step = steps[chosen]
    return float(along[step] + share[chosen] * (along[step + 1] - along[step]))


def across(
    points: Points, tangents: Points, line: Points, turned: FloatArray | None = None
) -> FloatArray:
    """Return the offset (m) to the left of each point, at right angles to tangents (n,), of a line
    with the same direction.

    The place nearest to the point is meant; NaN where the line does not pass.

    Args:
        turned: headings (rad) of the points, without jumps, if the line winds: its places that are
            half a turn or more away are those of another turn.
    """
    # The table of all points and stretches grows with their product.
    count = max(_AT_ONCE // len(line), 1)
    blocks = [slice(start, start + count) for start in range(0, len(points), count)]
    return np.concatenate(
        [
            _across(points[block], tangents[block], line, None if turned is None else turned[block])
            for block in blocks
        ]
        or [np.zeros(0)]
    )


def _across(
    points: Points, tangents: Points, line: Points, turned: FloatArray | None
) -> FloatArray:
    tangents = tangents / np.hypot(*tangents.T)[:, None]
    delta = line[None] - points[:, None]
    ahead = (delta * tangents[:, None]).sum(axis=2)
    aside = delta[..., 1] * tangents[:, None, 0] - delta[..., 0] * tangents[:, None, 1]
    meets = (ahead[:, :-1] <= 0.0) & (ahead[:, 1:] > 0.0)
    if turned is not None:
        meets &= np.abs(headings(line)[None] - turned[:, None]) < math.pi
    share = np.divide(
        ahead[:, :-1], ahead[:, :-1] - ahead[:, 1:], where=meets, out=np.zeros(meets.shape)
    )
    t = np.where(meets, aside[:, :-1] + share * (aside[:, 1:] - aside[:, :-1]), np.inf)
    nearest = np.take_along_axis(t, np.argmin(np.abs(t), axis=1)[:, None], axis=1)[:, 0]
    return np.where(np.isfinite(nearest), nearest, np.nan)


def parts_of(name: str, among: Iterable[str]) -> list[str]:
    """The parts of a lanelet that was split, or itself: the first one keeps its id, others have
    theirs after a slash."""
    return [one for one in among if one == name or one.startswith(f"{name}/")]


def row_of(table: dict[str, Lanelet], lanelet: Lanelet) -> list[Lanelet]:
    """A lanelet and its neighbours, from left to right; the lanelets of the table name their right
    ones."""
    left_of = {one.beside_right.id: one.id for one in table.values() if one.beside_right}
    first = lanelet.id
    while first in left_of:
        first = left_of[first]
    row = [table[first]]
    while (beside := row[-1].beside_right) is not None:
        row.append(table[beside.id])
    return row


def split(table: dict[str, Lanelet], row: Sequence[Lanelet], frame: CrossLine) -> dict[str, str]:
    """Replace lanelets that lie beside each other by their parts before and after a line across
    them.

    The lanelets of the table name their successors and right neighbours only.

    Returns:
        the id of each lanelet's second part.
    """
    seconds = {lanelet.id: _free(lanelet.id, table) for lanelet in row}
    for lanelet in row:
        (left, left_rest), (right, right_rest) = (
            _parts(line, frame) for line in (lanelet.left, lanelet.right)
        )
        name = seconds[lanelet.id]
        beside = (
            LaneletNeighbour(seconds[lanelet.beside_right.id], True)
            if lanelet.beside_right
            else None
        )
        # read anew: it may follow itself, or another one of the row
        table[name] = replace(
            table[lanelet.id], id=name, left=left_rest, right=right_rest, beside_right=beside
        )
        table[lanelet.id] = replace(lanelet, left=left, right=right, successors=(name,), lights=())
    return seconds


def _free(name: str, table: Mapping[str, Lanelet]) -> str:
    head = name.rpartition("/")[0]  # it may be a part itself; ids of maps may have slashes, too
    whole = head if head in table else name
    return next(free for number in count(2) if (free := f"{whole}/{number}") not in table)


def _parts(line: Points, frame: CrossLine) -> tuple[Points, Points]:
    """The parts of a line before and after it crosses a frame; near its end where it does not cross
    it within."""
    s, at = crossing(line, frame)[0], lengths(line)
    # A frame that meets a bound at its end must not leave a part without length.
    s = min(max(s, 0.05 * at[-1]), 0.95 * at[-1])
    cut = points_at(line, np.array([s]))
    return np.concatenate([line[at < s], cut]), np.concatenate([cut, line[at > s]])
