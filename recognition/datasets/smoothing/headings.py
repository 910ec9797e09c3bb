"""Headings that agree with the motion: what the smoothing of vehicles begins with."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import groupby, pairwise
from operator import itemgetter

import numpy as np

from recognition.datasets.smoothing.observations import Seen, turned
from recognition.datasets.tables.rates import rate
from recognition.datasets.tables.rows import Rows
from xodr.array_types import FloatArray

_MOVES = 1.0
"""Speed over a second (m/s) from which the motion shows where a vehicle heads."""
_AWAY = 2.0
"""Distance (m) that a stretch of motion leads away at least; less is noise."""
_FAR = 15.0
"""Distance (m) that jitter about a place does not lead away."""
_SHARP = 1.0
"""Turn from row to row (rad) that ends a stretch: no vehicle turns so fast, it goes the other way."""


def headings(rows: Rows, seen: Seen) -> FloatArray:
    """Headings (rad) by the motion where there is some, without jumps of whole turns within a track.

    In between the heading is that of the last motion; without any, the mean of the recorded ones.
    """
    n, here = len(rows), np.arange(len(rows))
    vx, vy = rate(seen.x, rows), rate(seen.y, rows)
    speed, motion = np.hypot(vx, vy), np.arctan2(vy, vx)
    stretches = _stretches(rows, seen, speed, motion)
    shows = np.zeros(n, bool)
    for first, last in stretches:
        shows[first : last + 1] = True
    h = motion.copy()
    for first, last in _backwards(rows, seen, stretches, speed, motion):
        h[first : last + 1] += np.pi
    start, end = rows.each(rows.starts[:-1]), rows.each(rows.starts[1:])
    before = np.maximum.accumulate(np.where(shows, here, -1))
    after = np.minimum.accumulate(np.where(shows, here, n)[::-1])[::-1]
    source = np.where(before >= start, before, np.where(after < end, after, -1))
    mean = rows.each(np.arctan2(rows.totals(np.sin(seen.h)), rows.totals(np.cos(seen.h))))
    return _unwrapped(np.where(source >= 0, h[source], mean), rows)


def _stretches(rows: Rows, seen: Seen, speed: FloatArray, motion: FloatArray) -> list[tuple[int, int]]:
    """First and last row of each stretch of motion within a track."""
    moves = speed >= _MOVES
    begins = np.ones(len(rows), bool)
    begins[1:] = (moves[1:] != moves[:-1]) | (moves[1:] & (np.abs(turned(np.diff(motion))) > _SHARP))
    begins[rows.starts[:-1]] = True
    heads = np.flatnonzero(begins)
    ends = np.append(heads[1:], len(rows)) - 1
    away = np.hypot(seen.x[ends] - seen.x[heads], seen.y[ends] - seen.y[heads])
    leads = moves[heads] & (away >= _AWAY)
    return list(zip(heads[leads].tolist(), ends[leads].tolist(), strict=True))


def _backwards(
    rows: Rows, seen: Seen, stretches: list[tuple[int, int]], speed: FloatArray, motion: FloatArray
) -> Iterator[tuple[int, int]]:
    """Stretches that a vehicle drives in reverse.

    Stretches that are far and fast are forwards. From one stretch to the next the heading changes by less than a right angle: who
    goes back where it came from is in reverse. A track without a fast stretch goes forwards where its recorded headings say so.
    """
    track = np.searchsorted(rows.starts, [first for first, _ in stretches], side="right").tolist()
    for _, group in groupby(zip(track, stretches, strict=True), itemgetter(0)):
        own = [stretch for _, stretch in group]
        turns = [_turns_back(motion[a[1]], motion[b[0]]) for a, b in pairwise(own)]
        parity = np.append(0, np.cumsum(turns)) % 2
        fast = [i for i, each in enumerate(own) if _fast(seen, each, speed)]
        if fast:
            near = np.array(fast)[np.maximum(np.searchsorted(fast, np.arange(len(own)), side="right") - 1, 0)]
            back = parity != parity[near]
        else:
            agree = sum((1 - 2 * p) * _agreement(seen, each, speed, motion) for p, each in zip(parity, own, strict=True))
            back = parity != (agree < 0.0)
        yield from (each for each, reverse in zip(own, back, strict=True) if reverse)


def _turns_back(before: float, after: float) -> bool:
    return abs(math.remainder(after - before, math.tau)) > 0.5 * math.pi


def _fast(seen: Seen, stretch: tuple[int, int], speed: FloatArray) -> bool:
    """Whether a stretch is too far and fast for reverse; that of a pedestrian always is."""
    first, last = stretch
    if seen.bounds.reverse[first] == 0.0:
        return True
    away = math.hypot(seen.x[last] - seen.x[first], seen.y[last] - seen.y[first])
    return away > _FAR and bool(np.median(speed[first : last + 1]) > seen.bounds.reverse[first])


def _agreement(seen: Seen, stretch: tuple[int, int], speed: FloatArray, motion: FloatArray) -> float:
    """Way that goes where the recorded headings point, less that which goes the other way."""
    own = slice(stretch[0], stretch[1] + 1)
    return float((speed[own] * np.cos(motion[own] - seen.h[own])).sum())


def _unwrapped(h: FloatArray, rows: Rows) -> FloatArray:
    """The same directions without a change of more than half a turn from row to row of a track."""
    change = turned(np.diff(h, prepend=h[:1]))
    change[rows.starts[:-1]] = 0.0
    total = np.cumsum(change)
    heads = rows.starts[:-1]
    return rows.each(h[heads] - total[heads]) + total
