"""Measures of many runs at once: those of `criticality` that batches in arrays need, of one ego and everyone else.

Motions are rows of all runs one after the other; everyone is there at all instants.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from runner.engine.motion.rss import RssParameters
from runner.engine.participants.outlines import box_distance, seen_by, vertical_gap
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
    """

    min_ttc: FloatArray
    max_drac: FloatArray
    min_distance: FloatArray
    nearest: FloatArray
    risk: FloatArray
    risk_before: FloatArray

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
    violated = np.zeros(count, bool)
    for other in others:
        apart, view, level = _relation(ego, other, run)
        distance = np.minimum(distance, np.where(level, apart, np.inf))
        touched |= level & (apart == 0.0)
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
    active = np.isfinite(distance) & ~_earlier(touched, run, starts)
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
    )


def _relation(
    ego: MotionRows, other: MotionRows, run: IntArray
) -> tuple[FloatArray, View, BoolArray]:
    """Distance of the boxes, the other one as the ego sees it, and whether both are on the same level."""
    seen = seen_by(ego, other)
    apart = box_distance(ego, other, seen)
    level = vertical_gap(ego, other) <= STEEPEST * apart
    view = in_ego_frame(ego, other, seen)
    same = np.equal(ego.road, other.road) & np.not_equal(ego.road, -1)
    if same.any():
        rows = np.arange(len(run))
        road = on_road_view(
            (ego, *along_road(ego, run, rows)), (other, *along_road(other, run, rows))
        )
        view = View(*(np.where(same, one, free) for one, free in zip(road, view, strict=True)))
    return apart, view, level


def _earlier(touched: BoolArray, run: IntArray, starts: IntArray) -> BoolArray:
    """Return a mask of instants after the first contact of their run."""
    before: IntArray = np.cumsum(touched) - touched
    found: BoolArray = before > before[starts][run]
    return found
