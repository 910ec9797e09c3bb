"""Measures of many runs while they are played: the subset of `criticality` for runs in arrays.

Motions come in segments, some instants of all runs (c, k); everyone is there at all instants.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

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
    in_ego_frame,
    on_road_view,
)
from runner.judging.measures.segments import ENDLESS, FRAME, MotionAlong, RoadMotion, Segment
from schemas.common.array_types import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from runner.engine.participants.declaration import BoundingBox
    from xodr.graph.network import RoadNetwork

_ABREAST = 256
"""Runs whose instants are measured at once: arrays of them fit into caches"""
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
        led, present: share of the instants with a lead, with anyone on the ego's level.
        impact_speed, side, striking: of the first contact, as of
            `runner.judging.measures.contacts.Impact`; 0, empty and false without one.
    """

    min_ttc: FloatArray
    max_drac: FloatArray
    min_distance: FloatArray
    nearest: FloatArray
    risk: FloatArray
    risk_before: FloatArray
    led: FloatArray
    present: FloatArray
    impact_speed: FloatArray
    side: NDArray[np.str_]
    striking: BoolArray


class Measuring(NamedTuple):
    """Choice of measures: RSS parameters, and the time before a conflict (s) that counts for
    `RunMeasures.risk_before`."""

    parameters: RssParameters
    window: float = 1.0


class ArrayMeasures:
    """Measures n runs, a segment after the other.

    Args:
        n: number of runs.
        boxes: of the participants, the ego's first.
        roads: names of roads by their keys.
        network: by which those off roads are located; None without roads.
        chosen: the measures.
        dt: time between instants, s.
    """

    def __init__(
        self,
        n: int,
        boxes: Sequence[BoundingBox],
        roads: Mapping[int, str],
        network: RoadNetwork | None,
        chosen: Measuring,
        dt: float,
    ) -> None:
        self._parameters, self._window, self._dt = chosen.parameters, chosen.window, dt
        self._ways = [RoadMotion(n, box, roads, network, dt) for box in boxes]
        self._nearest_pairs = [np.full(n, np.inf) for _ in boxes[1:]]
        """least distance of reference points so far, of each other and the ego, m"""
        self._waiting: deque[Segment] = deque()
        self._violations: list[tuple[IntArray, IntArray, BoolArray]] = []
        """steps (c,), runs (k,) and where RSS was violated (c, k)"""
        self._ttc, self._drac, self._distance = np.full(n, np.inf), np.zeros(n), np.full(n, np.inf)
        self._nearest, self._touched = np.zeros(n, np.int64), np.zeros(n, bool)
        self._counted, self._risky = np.zeros(n, np.int64), np.zeros(n, np.int64)
        self._led, self._present = np.zeros(n, np.int64), np.zeros(n, np.int64)
        self._impacts = _Impacts(n, len(boxes) - 1)

    def add(self, part: Segment, sizes: IntArray) -> Iterator[Segment]:
        """Add the next segment; yield segments that are measured and no longer needed.

        A segment waits until it is known which way everyone faces who has not moved yet.

        Args:
            sizes: number of instants of each run that is over (n,), `ENDLESS` of others; 0 of
                those that need no measures.
        """
        for number, way in enumerate(self._ways):
            way.survey(part, number, sizes)
        self._waiting.append(part)
        while self._waiting and self._is_known(self._waiting[0], sizes):
            part = self._waiting.popleft()
            for low in range(0, len(part.at), _ABREAST):
                self._measure(part, slice(low, low + _ABREAST), sizes)
            yield part

    def _is_known(self, part: Segment, sizes: IntArray) -> bool:
        # Runs that are over have no later movement that a segment could wait for.
        going = sizes[part.at] == ENDLESS
        return all((way.facing[part.at] != 0.0)[going].all() for way in self._ways)

    def _measure(self, part: Segment, some: slice, sizes: IntArray) -> None:
        runs, steps = part.at[some], part.steps
        valid = steps[:, None] < sizes[runs]
        whole = bool(valid.all())
        ego, *others = (way.moved(part, number, some) for number, way in enumerate(self._ways))
        shape = valid.shape
        gap, closing = np.full(shape, np.inf), np.zeros(shape)
        distance = np.full(shape, np.inf)
        touched, violated, present = (np.zeros(shape, bool) for _ in range(3))
        for number, other in enumerate(others):
            bound = self._nearest_pairs[number]
            apart, view, level = _relation(ego, other, runs, bound, None if whole else valid)
            present |= level
            np.minimum(distance, np.where(level, apart, np.inf), out=distance)
            touching = level & (apart == 0.0)
            if touching.any():
                touched |= touching
                self._impacts.add(number, ego.rows, other.rows, view, level, touching, runs, steps)
            self._impacts.keep(number, view, level, runs)
            beside = level & lateral_violation(view, self._parameters)
            if beside.any():
                violated |= beside & longitudinal_violation(view, self._parameters)
            ahead = level & (view.aside == 0.0) & ((view.ahead > 0.0) | (apart == 0.0))
            ahead &= view.ahead < gap
            if ahead.any():
                gap = np.where(ahead, view.ahead, gap)
                closing = np.where(ahead, view.speed - view.other_speed, closing)
        # One lead per instant, the nearest of all participants: measures of others would be those
        # of cars behind it.
        self._take_lead(runs, gap, closing)
        self._take_nearest(runs, steps, distance)
        # Exposure ends at the contact: shares of risk of runs that go on after it would be diluted.
        active = present & ~self._after_contact(runs, touched)
        self._present[runs] += present.sum(axis=0)
        self._counted[runs] += active.sum(axis=0)
        self._risky[runs] += (violated & active).sum(axis=0)
        if violated.any():
            self._violations.append((steps, runs, violated))

    def _take_lead(self, runs: IntArray, gap: FloatArray, closing: FloatArray) -> None:
        led = np.isfinite(gap)
        if not led.any():
            return
        self._led[runs] += led.sum(axis=0)
        gap[~led] = 0.0
        ttc, drac = time_to_collision(gap, closing), deceleration_to_avoid_crash(gap, closing)
        least = np.where(ttc.valid & led, ttc.value, np.inf).min(axis=0)
        most = np.where(drac.valid & led, drac.value, 0.0).max(axis=0)
        self._ttc[runs] = np.minimum(self._ttc[runs], least)
        self._drac[runs] = np.maximum(self._drac[runs], most)

    def _take_nearest(self, runs: IntArray, steps: IntArray, distance: FloatArray) -> None:
        place = distance.argmin(axis=0)
        least = distance[place, np.arange(len(runs))]
        nearer = least < self._distance[runs]
        self._distance[runs[nearer]] = least[nearer]
        self._nearest[runs[nearer]] = steps[place[nearer]]

    def _after_contact(self, runs: IntArray, touched: BoolArray) -> BoolArray:
        """Mask of instants after the first contact of their run."""
        before: BoolArray = np.broadcast_to(self._touched[runs], touched.shape)
        if touched.any():
            # The instant of the first contact itself still counts.
            before = before | (np.cumsum(touched, axis=0) > touched)
            self._touched[runs] |= touched.any(axis=0)
        return before

    def result(self, sizes: IntArray) -> RunMeasures:
        """The measures, once all segments are in.

        Args:
            sizes: number of instants of each run (n,).
        """
        n = len(sizes)
        conflict = np.where(np.isfinite(self._distance), self._times(self._nearest), 0.0)
        recent = np.zeros(n, np.int64)
        for steps, runs, violated in self._violations:
            time, until = self._times(steps)[:, None], conflict[runs]
            inside = (time > until - self._window + _INSTANT) & (time <= until + _INSTANT)
            recent[runs] += (violated & inside).sum(axis=0)
        # A window holds one instant more than its length has steps.
        before = np.minimum(recent * self._dt / self._window, 1.0)
        risk = np.divide(self._risky, self._counted, out=np.zeros(n), where=self._counted > 0)
        return RunMeasures(
            self._ttc,
            self._drac,
            self._distance,
            conflict,
            risk,
            np.where(sizes > 1, before, 0.0),
            self._led / np.maximum(sizes, 1),
            self._present / np.maximum(sizes, 1),
            *self._impacts.manner,
        )

    def _times(self, steps: IntArray) -> FloatArray:
        return np.round(steps * self._dt, 9)


class _Impacts:
    """First contacts of n runs; of several at one instant the contact with the first participant
    counts.

    Args:
        n: number of runs.
        others: number of other participants.
    """

    def __init__(self, n: int, others: int) -> None:
        self._steps = np.full(n, ENDLESS)
        self._level = np.zeros((others, n), bool)
        """whether the ego was on the level of each other one"""
        self._views = np.zeros((others, len(View._fields), n))
        """how it saw each other one then, the last time"""
        self.manner = Manner(np.zeros(n), np.full(n, "", "<U5"), np.zeros(n, bool))

    def keep(self, number: int, view: View, level: BoolArray, runs: IntArray) -> None:
        """Keep the last view of a participant on the ego's level."""
        count = len(level)
        if level[-1].all():
            self._level[number, runs] = True
            self._views[number][:, runs] = [values[-1] for values in view]
            return
        # Views off the level (a bridge above) say nothing of the side that is hit later.
        some = np.flatnonzero(level.any(axis=0))
        last = count - 1 - level[::-1, some].argmax(axis=0)
        self._level[number, runs[some]] = True
        self._views[number][:, runs[some]] = [values[last, some] for values in view]

    def add(
        self,
        number: int,
        ego: MotionRows,
        other: MotionRows,
        view: View,
        level: BoolArray,
        touching: BoolArray,
        runs: IntArray,
        steps: IntArray,
    ) -> None:
        """Add the contacts with a participant at instants of some runs (c, k)."""
        # Later contacts of a run are consequences of the first: only that one has a manner.
        columns = np.flatnonzero(touching.any(axis=0))
        rows = touching[:, columns].argmax(axis=0)
        sooner = steps[rows] < self._steps[runs[columns]]
        columns, rows = columns[sooner], rows[sooner]
        if not columns.size:
            return
        chosen = runs[columns]
        self._steps[chosen] = steps[rows]
        now = View(*(values[rows, columns] for values in view))
        # The instant before at which both were on one level; the contact
        # itself where there is none.
        place = np.where(level, np.arange(len(level))[:, None], -1)
        place = np.maximum.accumulate(place, axis=0)[np.maximum(rows - 1, 0), columns]
        inside, known = (place >= 0) & (rows > 0), self._level[number, chosen]
        then = View(
            *(
                np.where(
                    inside,
                    values[np.maximum(place, 0), columns],
                    np.where(known, before[chosen], own),
                )
                for values, before, own in zip(view, self._views[number], now, strict=True)
            )
        )
        at = rows, columns
        for values, found in zip(
            self.manner, manner(_picked(ego, at), _picked(other, at), now, then), strict=True
        ):
            values[chosen] = found


def _relation(
    ego: MotionAlong,
    other: MotionAlong,
    runs: IntArray,
    bounds: FloatArray,
    valid: BoolArray | None,
) -> tuple[FloatArray, View, BoolArray]:
    """Distance of the boxes, view of the other one, and mask of one level, at instants of runs (c,
    k).

    Distances above the least one of a run are infinite where the other is far away.

    Args:
        bounds: least distance of reference points on one level so far (n,), m; kept up to date.
        valid: instants that count (c, k); None for all.
    """
    a, b = ego.rows, other.rows
    heights = vertical_gap(a, b)
    # Exact distances only where a bound says that they may be the least of their run.
    near: Any = np.nonzero(_may_be_nearest(a, b, runs, bounds, heights, valid))
    apart = np.full(heights.shape, np.inf)
    apart[near] = box_distance(OutlinesAt.of(a, near), OutlinesAt.of(b, near))
    # Distances that were not worked out are infinite: `near` holds all rows with a height.
    level = heights <= STEEPEST * apart
    if valid is not None:
        level &= valid
    same = (a.road == b.road) & (a.road != -1)
    if not same.any():
        return apart, in_ego_frame(a, b, seen_by(a, b)), level
    view = on_road_view(ego, other)
    if not same.all():
        elsewhere = np.nonzero(~same)
        c, d = _picked(a, elsewhere), _picked(b, elsewhere)
        # `on_road_view` returns arrays of the motion itself, which must not be written to.
        view = View(*(np.array(values) for values in view))
        for values, free in zip(view, in_ego_frame(c, d, seen_by(c, d)), strict=True):
            values[elsewhere] = free
    return apart, view, level


def _picked(motion: MotionRows, at: tuple[IntArray, ...]) -> MotionRows:
    """Subset of the instants (c, k) of a participant, in a row (m,)."""
    return replace(motion, **{name: getattr(motion, name)[at] for name in ("time", "road", *FRAME)})


def _may_be_nearest(
    ego: MotionRows,
    other: MotionRows,
    runs: IntArray,
    bounds: FloatArray,
    heights: FloatArray,
    valid: BoolArray | None,
) -> BoolArray:
    """Instants whose distance of boxes may be the least of their run, or counts for the level.

    The distance of reference points bounds it: by the radii of the boxes about them from below, by
    the offsets of the centres from above.
    """
    dx, dy = other.x - ego.x, other.y - ego.y
    between = np.sqrt(dx * dx + dy * dy)
    offsets = sum(math.hypot(each.box.x, each.box.y) for each in (ego, other))
    slack = reach(ego.box) + reach(other.box) + offsets + _ROUNDING
    counts = heights == 0.0 if valid is None else (heights == 0.0) & valid
    upright = between if counts.all() else np.where(counts, between, np.inf)
    bounds[runs] = least = np.minimum(bounds[runs], upright.min(axis=0))
    found: BoolArray = (between <= least + slack) | (heights > 0.0)
    return found
