"""Measures of many runs at once: those of `criticality` that batches in arrays need, of one ego and
everyone else.

Motions are rows of all runs one after the other; everyone is there at all instants.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runner.engine.motion.rss import RssParameters
from runner.engine.participants.boxes import reach
from runner.engine.participants.outlines import OutlinesAt, box_distance, seen_by, vertical_gap
from runner.judging.measures.contacts import Manner, manner
from runner.judging.measures.criticality import (
    deceleration_to_avoid_crash,
    lateral_violation,
    longitudinal_violation,
    time_to_collision,
)
from runner.judging.measures.relations import (
    STEEPEST,
    MotionRows,
    View,
    along_road,
    in_ego_frame,
    on_road_view,
)
from schemas.common.array_types import BoolArray, FloatArray, IntArray

_INSTANT = 1e-6
"""Instants nearer to each other than this (s) are one"""
_ROUNDING = 1e-6
"""Slack of bounds of distances, m"""


@dataclass(frozen=True, eq=False)
class RunMeasures:
    """Measures of n runs; arrays (n,).

    Attributes:
        min_ttc: least time to collision with the lead, s; infinite without a lead.
        max_drac: greatest deceleration that just avoids a collision with the lead, m/s²; 0 without
            a lead.
        min_distance: least distance of boxes, m; infinite without others.
        nearest: time of the first least distance, s; 0 without others.
        risk: share of the instants up to a contact at which RSS is violated; 0 without others.
        risk_before: the same of a time window up to `nearest`, or to the first contact.
        impact_speed, side, striking: of the first contact, as of
            `runner.judging.measures.contacts.Impact`; 0, empty and false without one.
    """

    min_ttc: FloatArray
    max_drac: FloatArray
    min_distance: FloatArray
    nearest: FloatArray
    risk: FloatArray
    risk_before: FloatArray
    impact_speed: FloatArray
    side: NDArray[np.str_]
    striking: BoolArray

    @classmethod
    def joined(cls, parts: Sequence[RunMeasures]) -> RunMeasures:
        """The measures of runs of several parts, one after the other."""
        return cls(
            *(np.concatenate([vars(part)[name] for part in parts]) for name in vars(parts[0]))
        )


def measure_runs(
    ego: MotionRows,
    others: Sequence[MotionRows],
    sizes: IntArray,
    parameters: RssParameters,
    window: float,
    dt: float,
) -> RunMeasures:
    """Measure runs.

    Args:
        ego, others: rows of all runs, each with times from 0 on.
        sizes: number of instants of each run (n,), positive.
        window: time before a conflict that counts for `RunMeasures.risk_before`, s.
        dt: time between instants, s.
    """
    n, count = len(sizes), len(ego.time)
    run, starts = np.repeat(np.arange(n), sizes), np.cumsum(sizes) - sizes
    gap, closing = np.full(count, np.inf), np.zeros(count)
    distance, touched = np.full(count, np.inf), np.zeros(count, bool)
    violated, present = np.zeros(count, bool), np.zeros(count, bool)
    impacts = _Impacts(n, count)
    for other in others:
        apart, view, level = _relation(ego, other, run, starts)
        present |= level
        distance = np.minimum(distance, np.where(level, apart, np.inf))
        touching = level & (apart == 0.0)
        if touching.any():
            touched |= touching
            impacts.add(ego, other, view, level, np.flatnonzero(touching), run)
        beside = level & lateral_violation(view, parameters)
        if beside.any():
            violated |= beside & longitudinal_violation(view, parameters)
        ahead = level & (view.aside == 0.0) & ((view.ahead > 0.0) | (apart == 0.0))
        ahead &= view.ahead < gap
        gap = np.where(ahead, view.ahead, gap)
        closing = np.where(ahead, view.speed - view.other_speed, closing)
    led = np.isfinite(gap)
    gap[~led] = 0.0
    ttc = time_to_collision(gap, closing)
    drac = deceleration_to_avoid_crash(gap, closing)
    least = np.minimum.reduceat(distance, starts)
    nearest = starts.copy()
    rows = np.flatnonzero(distance == least[run])
    found, first = np.unique(run[rows], return_index=True)
    nearest[found] = rows[first]
    conflict = np.where(np.isfinite(least), ego.time[nearest], 0.0)
    active = present & ~_earlier(touched, run, starts)
    counted = np.add.reduceat(active.astype(np.int64), starts)
    risky = np.add.reduceat((violated & active).astype(np.int64), starts)
    until = conflict[run]
    inside = (ego.time > until - window + _INSTANT) & (ego.time <= until + _INSTANT)
    recent = np.add.reduceat((violated & inside).astype(np.int64), starts) * dt / window
    return RunMeasures(
        np.minimum.reduceat(np.where(ttc.valid & led, ttc.value, np.inf), starts),
        np.maximum.reduceat(np.where(drac.valid & led, drac.value, 0.0), starts),
        least,
        conflict,
        np.divide(risky, counted, out=np.zeros(n), where=counted > 0),
        np.where(sizes > 1, np.minimum(recent, 1.0), 0.0),
        *impacts.manner,
    )


class _Impacts:
    """First contacts of n runs: the earliest one with anyone, of several at one instant the first
    that is added."""

    def __init__(self, n: int, count: int) -> None:
        self._rows = np.full(n, count)
        self.manner = Manner(np.zeros(n), np.full(n, "", "<U5"), np.zeros(n, bool))

    def add(
        self,
        ego: MotionRows,
        other: MotionRows,
        view: View,
        level: BoolArray,
        touching: IntArray,
        run: IntArray,
    ) -> None:
        """Add the contacts with a participant, which are at some rows, ascending."""
        runs, first = np.unique(run[touching], return_index=True)
        rows = touching[first]
        sooner = rows < self._rows[runs]
        runs, rows = runs[sooner], rows[sooner]
        self._rows[runs] = rows
        same_level = np.maximum.accumulate(np.where(level, np.arange(len(level)), -1))
        before = same_level[rows - 1]
        before = np.where((before >= 0) & (run[before] == runs) & (rows > 0), before, rows)
        now, then = (View(*(values[at] for values in view)) for at in (rows, before))
        for values, found in zip(
            self.manner, manner(ego.at(rows), other.at(rows), now, then), strict=True
        ):
            values[runs] = found


def _relation(
    ego: MotionRows, other: MotionRows, run: IntArray, starts: IntArray
) -> tuple[FloatArray, View, BoolArray]:
    """Distance of the boxes, the other one as the ego sees it, and whether both are on the same
    level.

    Distances above the least one of a run are infinite where the other is far away.
    """
    heights = vertical_gap(ego, other)
    near = np.flatnonzero(_may_be_nearest(ego, other, run, starts, heights))
    apart = np.full(len(run), np.inf)
    apart[near] = box_distance(OutlinesAt.of(ego, near), OutlinesAt.of(other, near))
    level = heights <= STEEPEST * apart
    same = np.equal(ego.road, other.road) & np.not_equal(ego.road, -1)
    if not same.any():
        return apart, in_ego_frame(ego, other, seen_by(ego, other)), level
    rows = np.arange(len(run))
    view = on_road_view((ego, *along_road(ego, run, rows)), (other, *along_road(other, run, rows)))
    if not same.all():
        elsewhere = np.flatnonzero(~same)
        a, b = ego.at(elsewhere), other.at(elsewhere)
        view = View(*(values.copy() for values in view))
        for values, free in zip(view, in_ego_frame(a, b, seen_by(a, b)), strict=True):
            values[elsewhere] = free
    return apart, view, level


def _may_be_nearest(
    ego: MotionRows, other: MotionRows, run: IntArray, starts: IntArray, heights: FloatArray
) -> BoolArray:
    """Rows whose distance of boxes may be the least of their run, or counts for the level.

    The distance of reference points bounds it: by the radii of the boxes about them from below, by
    the offsets of the centres from above.
    """
    dx, dy = other.x - ego.x, other.y - ego.y
    between = np.sqrt(dx * dx + dy * dy)
    offsets = sum(math.hypot(each.box.x, each.box.y) for each in (ego, other))
    slack = reach(ego.box) + reach(other.box) + offsets + _ROUNDING
    upright = np.where(heights == 0.0, between, np.inf)
    bound = np.minimum.reduceat(upright, starts) + slack
    found: BoolArray = (between <= bound[run]) | (heights > 0.0)
    return found


def _earlier(touched: BoolArray, run: IntArray, starts: IntArray) -> BoolArray:
    """Return a mask of instants after the first contact of their run."""
    before: IntArray = np.cumsum(touched) - touched
    found: BoolArray = before > before[starts][run]
    return found
