"""Footprints that meet: post-encroachment time, first contact, and braking that would have avoided
a contact.

Post-encroachment time, Allen, Shin and Cooper (1978): footprints of both participants at different
times are compared; of those that overlap the ones least apart in time count. For crossing paths
this is the time from the first one leaving the conflict area until the second one enters it, for
vehicles one behind the other the time gap. Only footprints whose bounds touch are compared: those
of all others, sorted along the axis that the ego goes along most, in a window about each of the
ego's.

Braking: an entity slows down on its own path, the other one moves as recorded.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from runner.engine.participants.boxes import box_corners
from runner.engine.participants.outlines import boxes_overlap
from runner.judging.measures.measure import GREATEST_DECELERATION, LONGEST_PET, Extreme
from runner.judging.measures.relations import MotionRows, View, blocks, joined, relations
from schemas.common.array_types import BoolArray, FloatArray, IntArray

_STEP = 0.05
"""Least time (s) between footprints that are compared"""
_PAIRS = 1 << 18
"""Pairs of footprints that are compared at once, about"""
_SLACK = 1e-3
"""Distance (m) at which bounds still touch: more than they are rounded by"""


def post_encroachment_time(
    ego: MotionRows, others: Sequence[MotionRows], longest: float = LONGEST_PET
) -> Extreme | None:
    """Least time between the ego leaving a place and another one reaching it, or the other way
    round.

    Args:
        longest: the time above which there is no encounter, s.

    Returns:
        The time (0 for a collision), the instant of the ego, and the partner; None without an
        encounter.
    """
    # Pairs grow with the square of instants: finer recordings are thinned to this step.
    step = max(_STEP, float(np.diff(ego.time).min()) if ego.time.size > 1 else 0.0)
    best: Extreme | None = None
    for block in blocks(others):
        found = _least(ego, block, step, int(longest / step))
        best = min(
            (candidate for candidate in (best, found) if candidate is not None), default=None
        )
    return best


def _least(
    ego: MotionRows, others: Sequence[MotionRows], step: float, longest: int
) -> Extreme | None:
    """Post-encroachment time with some others; times are multiples of a step (s)."""
    everyone, who = joined(others)
    mine, theirs = (
        _instants(ego.time, step, np.zeros(len(ego.time), np.int64)),
        _instants(everyone.time, step, who),
    )
    a, b = ego.at(mine[1]), everyone.at(theirs[1])
    best: tuple[int, float, str] = (longest + 1, 0.0, "")
    for own, its in _near(_bounds(a), _bounds(b)):
        lag = np.abs(mine[0][own] - theirs[0][its])
        for more, most in pairwise(
            (-1, longest // 8, longest // 4, longest // 2, longest)
        ):  # no longer ones after a hit
            band = np.flatnonzero((lag > more) & (lag <= min(most, best[0])))
            hits = band[boxes_overlap(a.at(own[band]), b.at(its[band]))]
            if hits.size:
                hits = hits[lag[hits] == lag[hits].min()]
                names = (others[index].name for index in who[theirs[1][its[hits]]])
                best = min(
                    [best, *zip(lag[hits].tolist(), a.time[own[hits]].tolist(), names, strict=True)]
                )
                break
    return Extreme(best[0] * step, best[1], best[2]) if best[0] <= longest else None


def _instants(time: FloatArray, step: float, who: IntArray) -> tuple[IntArray, IntArray]:
    """Instants on a grid of this step (s), as multiples of it, and their rows: the first of each
    participant at each."""
    ticks = np.round(time / step).astype(np.int64)
    again = np.diff(ticks, prepend=ticks[:1] - 1) == 0
    again[1:] &= who[1:] == who[:-1]
    rows = np.flatnonzero(~again)
    return ticks[rows], rows


class _Bounds(NamedTuple):
    """Intervals that footprints cover along one axis (m): middles and half lengths."""

    middle: FloatArray
    half: FloatArray


def _bounds(motion: MotionRows) -> tuple[_Bounds, _Bounds]:
    """The bounds of a participant's footprints along the axes x and y."""
    (cos, sin), box = motion.facing, motion.box
    x, y = motion.x + cos * box.x - sin * box.y, motion.y + sin * box.x + cos * box.y
    cos, sin = np.abs(cos), np.abs(sin)
    return _Bounds(x, (box.length * cos + box.width * sin) / 2), _Bounds(
        y, (box.length * sin + box.width * cos) / 2
    )


def _near(
    a: tuple[_Bounds, _Bounds], b: tuple[_Bounds, _Bounds]
) -> Iterator[tuple[IntArray, IntArray]]:
    """Pairs of rows whose bounds touch along both axes."""
    if not len(a[0].middle):
        return
    # Sorting along the longer axis leaves fewer neighbours to compare.
    first, second = (0, 1) if np.ptp(a[0].middle) > np.ptp(a[1].middle) else (1, 0)
    along, across, its_along, its_across = a[first], a[second], b[first], b[second]
    right, left = (
        (across.middle - across.half).min() - _SLACK,
        (across.middle + across.half).max() + _SLACK,
    )
    beside = np.flatnonzero(
        (its_across.middle + its_across.half >= right)
        & (its_across.middle - its_across.half <= left)
    )
    order = beside[np.argsort(its_along.middle[beside], kind="stable")]
    ahead, reach = (
        its_along.middle[order],
        along.half + its_along.half[order].max(initial=0.0) + _SLACK,
    )
    begin, end = (
        np.searchsorted(ahead, along.middle - reach),
        np.searchsorted(ahead, along.middle + reach, "right"),
    )
    sizes = end - begin
    ends = np.cumsum(sizes)
    # In portions: the indices of all pairs of a long recording would fill the memory.
    starts = np.searchsorted(ends, np.arange(0, sizes.sum(), _PAIRS))
    for low, high in pairwise([*starts, len(sizes)]):
        own = np.repeat(np.arange(low, high), sizes[low:high])
        before = np.repeat(ends[low:high] - sizes[low:high] - begin[low:high], sizes[low:high])
        its = order[np.arange(len(own)) + (ends[low] - sizes[low]) - before]
        close = _touch(across, own, its_across, its) & _touch(along, own, its_along, its)
        yield own[close], its[close]


def _touch(a: _Bounds, own: IntArray, b: _Bounds, its: IntArray) -> BoolArray:
    """Whether pairs of rows touch along an axis."""
    touch: BoolArray = np.abs(a.middle[own] - b.middle[its]) <= a.half[own] + b.half[its] + _SLACK
    return touch


FRONT, REAR, LEFT, RIGHT = "front", "rear", "left", "right"
_TOUCHING = 1e-6
"""Distance (m) at which boxes touch"""
_STILL = 1e-9
"""Closing speeds below this (m/s) do not close a gap"""


class Impact(NamedTuple):
    """A first contact.

    Attributes:
        time: s.
        other: name of the other one.
        speed: relative speed of the two, m/s.
        side: of the own box that is touched: `front`, `rear`, `left` or `right`.
        point: middle of the overlap at the first instant of contact, m ahead of the middle of the
            own box and to its left.
        striking: whether the participant itself hit the other one: of the two it was the faster one
            towards the other, across the side that is touched.
    """

    time: float
    other: str
    speed: float
    side: str
    striking: bool
    point: tuple[float, float]


def sentence(ego: str, other: str, side: str, striking: bool) -> str:
    """Describe a contact: striking entity, struck entity, side of the ego."""
    where = side if side in (FRONT, REAR) else f"{side} side"
    if striking:
        return f"{ego} hit {other} with its {where}"
    return f"{other} hit {ego} {'in the' if side in (FRONT, REAR) else 'on its'} {where}"


class Manner(NamedTuple):
    """Manner of contacts, as of `Impact`: arrays (m,)."""

    speed: FloatArray
    side: NDArray[np.str_]
    striking: BoolArray


def first_impact(ego: MotionRows, others: Sequence[MotionRows]) -> Impact | None:
    """The earliest contact of the ego's box with another one; None where there is none."""
    found = [impact for other in others if (impact := _with(ego, other)) is not None]
    return min(found, key=lambda impact: impact.time, default=None)


def _with(ego: MotionRows, other: MotionRows) -> Impact | None:
    rows, _, distance, view = relations(ego, [other])
    touching = np.flatnonzero(distance == 0.0)
    if not touching.size:
        return None
    first = int(touching[0])
    # The view before tells the side: in contact both gaps may be 0.
    now, before = (
        View(*(values[row : row + 1] for values in view)) for row in (first, max(first - 1, 0))
    )
    time = float(ego.time[rows[first]])
    its_row = int(np.argmin(np.abs(other.time - time)))
    how = manner(ego.at(rows[first : first + 1]), other.at(np.array([its_row])), now, before)
    speed, side, striking = float(how.speed[0]), str(how.side[0]), bool(how.striking[0])
    return Impact(time, other.name, speed, side, striking, _point(ego, other, time))


def manner(ego: MotionRows, other: MotionRows, now: View, before: View) -> Manner:
    """Manner of first contacts.

    Args:
        ego, other: both at the first instant of each contact (m,).
        now, before: the other one as the ego sees it then, and a step before.
    """
    ahead, aside = _bearing(ego, other)
    along = _closing_time(before.ahead, before.speed - before.other_speed)
    across = _closing_time(before.aside, before.sideways - before.other_sideways)
    # the side of the gap which closes last; where no gap was left, the other's centre decides
    lengthwise = np.where(along != across, along > across, np.abs(ahead) >= np.abs(aside))
    is_front = np.where(before.ahead != 0.0, before.ahead, ahead) > 0.0
    is_left = np.where(before.aside != 0.0, before.aside, aside) > 0.0
    side = np.where(lengthwise, np.where(is_front, FRONT, REAR), np.where(is_left, LEFT, RIGHT))
    own = np.where(lengthwise, now.speed, now.sideways)
    its = np.where(lengthwise, now.other_speed, now.other_sideways)
    way = np.where(np.where(lengthwise, is_front, is_left), 1.0, -1.0)
    speed = np.hypot(now.speed - now.other_speed, now.sideways - now.other_sideways)
    return Manner(speed, side, way * own > -way * its)


def _point(ego: MotionRows, other: MotionRows, time: float) -> tuple[float, float]:
    """Middle of the overlap of two boxes at an instant (s), ahead of the middle of the ego's box
    and to its left, m."""
    own, its = (
        _outline(motion, int(np.argmin(np.abs(motion.time - time)))) for motion in (ego, other)
    )
    # Boxes touch within a rounding: without the buffer their intersection may be empty.
    place = shapely.intersection(own, its.buffer(_TOUCHING)).centroid
    row = int(np.argmin(np.abs(ego.time - time)))
    c, s = float(np.cos(ego.h[row])), float(np.sin(ego.h[row]))
    dx, dy = place.x - float(ego.x[row]), place.y - float(ego.y[row])
    return dx * c + dy * s - ego.box.x, dy * c - dx * s - ego.box.y


def _outline(motion: MotionRows, row: int) -> shapely.Polygon:
    return shapely.Polygon(
        box_corners(float(motion.x[row]), float(motion.y[row]), float(motion.h[row]), motion.box)
    )


def _closing_time(gap: FloatArray, closing: FloatArray) -> FloatArray:
    """Times (s) until signed gaps close; 0 without a gap, infinite if it does not close."""
    closes = (np.abs(closing) > _STILL) & (gap * closing > 0.0)
    endless = np.where(gap == 0.0, 0.0, np.inf)
    return np.divide(gap, closing, out=endless, where=closes)


def _bearing(ego: MotionRows, other: MotionRows) -> tuple[FloatArray, FloatArray]:
    """The other's centre as the ego sees it, ahead and to the left, in half lengths and widths of
    both, row by row."""
    c, s = ego.facing
    dx, dy = other.x - ego.x, other.y - ego.y
    ahead, aside = dx * c + dy * s, dy * c - dx * s
    length, width = ego.box.length + other.box.length, ego.box.width + other.box.width
    return 2.0 * ahead / np.maximum(length, _TOUCHING), 2.0 * aside / np.maximum(width, _TOUCHING)


FULL = 8.0
"""Deceleration (m/s²) of full braking by a car on a dry road"""
_LONGEST = 10.0
"""Longest time (s) before a contact at which braking is tried"""
_BRAKING_STEP = 0.05
"""Between the instants that are looked at, s"""
_HALVINGS = 12
"""Of the interval in which the least deceleration lies"""


@dataclass(frozen=True)
class Conflict:
    """Participant, touched participant, and the row of the contact."""

    ego: MotionRows
    other: MotionRows
    row: int

    def latest(self, deceleration: float) -> float | None:
        """The latest instant (s) from which constant braking (m/s²) avoids the contact; None where
        none of the last 10 s does."""
        stride = max(1, round(_BRAKING_STEP / _timestep(self.ego)))
        first = int(np.searchsorted(self.ego.time, self.ego.time[self.row] - _LONGEST))
        # Backwards from the contact: the first row that avoids it is the latest.
        rows = range(self.row - 1, first - 1, -stride)
        return next(
            (float(self.ego.time[row]) for row in rows if self._avoids(row, deceleration)), None
        )

    def least(self, time: float) -> float | None:
        """The least constant braking (m/s²) from an instant (s) on that avoids the contact; None if
        it is beyond grip."""
        row = int(np.searchsorted(self.ego.time, time - 1e-6))
        if row >= self.row or not self._avoids(row, GREATEST_DECELERATION):
            return None
        low, high = 0.0, GREATEST_DECELERATION
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            low, high = (low, middle) if self._avoids(row, middle) else (middle, high)
        return high

    def _avoids(self, row: int, deceleration: float) -> bool:
        """Whether no contact comes of constant braking from a row on, until the ego stands and the
        other's record has ended."""
        begin, speed = float(self.ego.time[row]), abs(float(self.ego.speed[row]))
        standing = speed / max(deceleration, 1e-3)
        # Standing is no escape: the other one may still drive into the ego.
        end = max(begin + min(standing, 2 * _LONGEST), float(self.other.time[-1]))
        time = np.arange(max(begin, float(self.other.time[0])), end + _BRAKING_STEP, _BRAKING_STEP)
        braked = np.minimum(time - begin, standing)
        way = speed * braked - deceleration * braked**2 / 2
        return not boxes_overlap(_along(self.ego, row, way), _at(self.other, time)).any()


def _along(motion: MotionRows, row: int, way: FloatArray) -> MotionRows:
    """Participant at distances (m) along its own path from a row on; straight on beyond the end of
    the path."""
    x, y = motion.x[row:], motion.y[row:]
    driven = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    # `np.interp` needs ascending ways: rows in standstill are left out.
    moving = np.concatenate([[True], np.diff(driven) > 0.0])
    # Interpolated headings must not turn round between -π and π.
    h = np.unwrap(motion.h[row:])
    x, y, z, h = (
        np.interp(way, driven[moving], values[moving]) for values in (x, y, motion.z[row:], h)
    )
    return _moved(motion, x, y, z, h, np.maximum(way - driven[-1], 0.0))


def _at(motion: MotionRows, time: FloatArray) -> MotionRows:
    """A participant at instants (s); after its last one straight on with its last speed."""
    h = np.unwrap(motion.h)
    x, y, z, h = (
        np.interp(time, motion.time, values) for values in (motion.x, motion.y, motion.z, h)
    )
    return _moved(motion, x, y, z, h, motion.speed[-1] * np.maximum(time - motion.time[-1], 0.0))


def _moved(
    motion: MotionRows,
    x: FloatArray,
    y: FloatArray,
    z: FloatArray,
    h: FloatArray,
    ahead: FloatArray,
) -> MotionRows:
    """A participant at other places, each moved ahead (m)."""
    nothing = np.zeros_like(x)
    x, y = x + ahead * np.cos(h), y + ahead * np.sin(h)
    no_road = np.full(len(x), None, object)
    return replace(
        motion, time=nothing, x=x, y=y, z=z, h=h, speed=nothing, road=no_road, s=nothing, t=nothing
    )


def _timestep(motion: MotionRows) -> float:
    return float(np.diff(motion.time).min()) if len(motion.time) > 1 else _BRAKING_STEP
