"""Post-encroachment time, Allen, Shin and Cooper (1978), of footprints of boxes.

Footprints of both participants at different times are compared; of those that overlap the ones least apart in time count. For
crossing paths this is the time from the first one leaving the conflict area until the second one enters it, for vehicles one
behind the other the time gap.

Only footprints whose bounds touch are compared: those of all others, sorted along the axis that the ego goes along most, in a
window about each of the ego's.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from runner.measures.measure import LONGEST_PET, Extreme
from runner.measures.relations import Motion, blocks, boxes_overlap, joined
from schemas.common.array_types import BoolArray, FloatArray, IntArray

_STEP = 0.05
"""Least time (s) between footprints that are compared"""
_PAIRS = 1 << 18
"""Pairs of footprints that are compared at once, about"""
_SLACK = 1e-3
"""Distance (m) at which bounds still touch: more than they are rounded by"""


def post_encroachment_time(ego: Motion, others: Sequence[Motion], longest: float = LONGEST_PET) -> Extreme | None:
    """Least time between the ego leaving a place and another one reaching it, or the other way round.

    Args:
        longest: the time above which there is no encounter, s.

    Returns:
        The time (0 for a collision), the instant of the ego, and the partner; None without an encounter.
    """
    step = max(_STEP, float(np.diff(ego.time).min()) if ego.time.size > 1 else 0.0)
    best: Extreme | None = None
    for block in blocks(others):
        found = _least(ego, block, step, int(longest / step))
        best = min((each for each in (best, found) if each is not None), default=None)
    return best


def _least(ego: Motion, others: Sequence[Motion], step: float, longest: int) -> Extreme | None:
    """The same of some others, with times as multiples of a step (s)."""
    everyone, who = joined(others)
    mine, theirs = _instants(ego.time, step, np.zeros(len(ego.time), np.int64)), _instants(everyone.time, step, who)
    a, b = ego.at(mine[1]), everyone.at(theirs[1])
    best: tuple[int, float, str] = (longest + 1, 0.0, "")
    for own, its in _near(_bounds(a), _bounds(b)):
        lag = np.abs(mine[0][own] - theirs[0][its])
        for more, most in pairwise((-1, longest // 8, longest // 4, longest // 2, longest)):  # no longer ones after a hit
            band = np.flatnonzero((lag > more) & (lag <= min(most, best[0])))
            hits = band[boxes_overlap(a.at(own[band]), b.at(its[band]))]
            if hits.size:
                hits = hits[lag[hits] == lag[hits].min()]
                names = (others[index].name for index in who[theirs[1][its[hits]]])
                best = min([best, *zip(lag[hits].tolist(), a.time[own[hits]].tolist(), names, strict=True)])
                break
    return Extreme(best[0] * step, best[1], best[2]) if best[0] <= longest else None


def _instants(time: FloatArray, step: float, who: IntArray) -> tuple[IntArray, IntArray]:
    """Instants on a grid of this step (s), as multiples of it, and their rows: the first of each participant at each."""
    ticks = np.round(time / step).astype(np.int64)
    again = np.diff(ticks, prepend=ticks[:1] - 1) == 0
    again[1:] &= who[1:] == who[:-1]
    rows = np.flatnonzero(~again)
    return ticks[rows], rows


class _Bounds(NamedTuple):
    """Of footprints along one axis, m: their middles, and half of what they cover."""

    middle: FloatArray
    half: FloatArray


def _bounds(motion: Motion) -> tuple[_Bounds, _Bounds]:
    """The bounds of a participant's footprints along the axes x and y."""
    (cos, sin), box = motion.facing, motion.box
    x, y = motion.x + cos * box.x - sin * box.y, motion.y + sin * box.x + cos * box.y
    cos, sin = np.abs(cos), np.abs(sin)
    return _Bounds(x, (box.length * cos + box.width * sin) / 2), _Bounds(y, (box.length * sin + box.width * cos) / 2)


def _near(a: tuple[_Bounds, _Bounds], b: tuple[_Bounds, _Bounds]) -> Iterator[tuple[IntArray, IntArray]]:
    """Pairs of rows whose bounds touch along both axes."""
    if not len(a[0].middle):
        return
    first, second = (0, 1) if np.ptp(a[0].middle) > np.ptp(a[1].middle) else (1, 0)
    along, across, its_along, its_across = a[first], a[second], b[first], b[second]
    right, left = (across.middle - across.half).min() - _SLACK, (across.middle + across.half).max() + _SLACK
    beside = np.flatnonzero((its_across.middle + its_across.half >= right) & (its_across.middle - its_across.half <= left))
    order = beside[np.argsort(its_along.middle[beside], kind="stable")]
    ahead, reach = its_along.middle[order], along.half + its_along.half[order].max(initial=0.0) + _SLACK
    begin, end = np.searchsorted(ahead, along.middle - reach), np.searchsorted(ahead, along.middle + reach, "right")
    sizes = end - begin
    ends = np.cumsum(sizes)
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
