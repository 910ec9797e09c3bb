"""Criticality of encounters: measures of the ego against all others, per step and over a run.

All functions work on arrays over time. A measure that is not defined at an instant is marked so:
`Series.valid` is false there and its value 0, never NaN. Distances are in m, times in s, speeds in
m/s, accelerations in m/s².

Gaps are those of the bounding boxes; how they are measured is said in
`runner.judging.measures.relations`.

Sources: time to collision, Hayward (1972); time headway and deceleration rate to avoid a crash as
in Mahmud et al., "Application of proximal surrogate indicators for safety evaluation" (2017);
post-encroachment time as in `runner.judging.measures.contacts`; RSS as in
`runner.engine.motion.rss`; the probabilistic risk field as in
`runner.judging.measures.risk_field`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from runner.engine.motion import rss
from runner.judging.measures.contacts import Impact, first_impact, post_encroachment_time
from runner.judging.measures.measure import Extreme, Series, least, measures
from runner.judging.measures.relations import MotionRows, View, blocks, relations
from runner.judging.measures.risk_field import greatest
from schemas.common.array_types import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from runner.recording import Recording

_STILL = 1e-3
"""Speeds below this (m/s) count as standing, slower closing as not closing"""
_INSTANT = 1e-6
"""Instants nearer to each other than this (s) are one"""


# measures -----------------------------------------------------------------------------------


def time_to_collision(gap: FloatArray, closing: FloatArray) -> Series:
    """gap / closing speed, where the gap is closing; 0 where the boxes overlap."""
    return _quotient(gap, closing, (closing > _STILL) | (gap <= 0.0))


def time_headway(gap: FloatArray, speed: FloatArray) -> Series:
    """gap / own speed, while driving: time until the ego's front is at the present place of the
    lead's rear."""
    return _quotient(gap, speed, speed > _STILL)


def deceleration_to_avoid_crash(gap: FloatArray, closing: FloatArray) -> Series:
    """closing² / (2 gap): the constant deceleration that just avoids the collision with a lead that
    keeps its speed."""
    return _quotient(closing**2, 2.0 * gap, (closing > _STILL) & (gap > 0.0))


def _quotient(numerator: FloatArray, denominator: FloatArray, valid: BoolArray) -> Series:
    value = np.zeros_like(numerator)
    # 0 where the boxes overlap, whatever the closing speed: 0 / 0 would be no number.
    np.divide(
        numerator,
        denominator,
        out=value,
        where=valid & (np.abs(denominator) > 0.0) & (numerator != 0.0),
    )
    return Series(value, valid)


def longitudinal_violation(seen: View, parameters: rss.RssParameters) -> BoolArray:
    """Return a mask of longitudinal gaps below RSS's safe distance; boxes side by side count."""
    return _violated(seen.ahead, _longitudinal_margin(seen, parameters))


def lateral_violation(seen: View, parameters: rss.RssParameters) -> BoolArray:
    """Return a mask of lateral gaps below RSS's safe distance; boxes one behind the other count."""
    return _violated(seen.aside, _lateral_margin(seen, parameters))


def _violated(gap: FloatArray, margin: FloatArray) -> BoolArray:
    return (gap == 0.0) | (margin < 0.0)


def rss_margin(seen: View, parameters: rss.RssParameters) -> FloatArray:
    """Distance (m) left before RSS is violated; negative by the missing distance once it is.

    One behind the other, the longitudinal gap minus its safe distance; side by side, the lateral
    one; else the greater of the two, since either safe distance alone is enough.
    """
    return _margin(seen, _longitudinal_margin(seen, parameters), _lateral_margin(seen, parameters))


def _margin(seen: View, along: FloatArray, across: FloatArray) -> FloatArray:
    return np.select(
        [(seen.aside == 0.0) & (seen.ahead == 0.0), seen.aside == 0.0, seen.ahead == 0.0],
        [np.minimum(along, across), along, across],
        np.maximum(along, across),
    )


def _longitudinal_margin(seen: View, parameters: rss.RssParameters) -> FloatArray:
    # A rear one that reverses is taken as standing: it moves away from what is ahead.
    following = rss.longitudinal_distance(np.maximum(seen.speed, 0.0), seen.other_speed, parameters)
    followed = rss.longitudinal_distance(
        np.maximum(seen.other_speed, 0.0), seen.speed, parameters, parameters.response_other
    )
    return np.abs(seen.ahead) - np.where(seen.ahead >= 0.0, following, followed)


def _lateral_margin(seen: View, parameters: rss.RssParameters) -> FloatArray:
    # `View` counts lateral speeds to the left, `lateral_distance` to the right.
    own, other = parameters.response, parameters.response_other
    ego_left = rss.lateral_distance(-seen.sideways, -seen.other_sideways, own, other, parameters)
    ego_right = rss.lateral_distance(-seen.other_sideways, -seen.sideways, other, own, parameters)
    return np.abs(seen.aside) - np.where(seen.aside <= 0.0, ego_left, ego_right)


JERK_WINDOW = 0.5
"""Time (s) that jerk is a mean over, as in UN Regulation 79"""


# a run --------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Criticality:
    """The measures of one ego over a run.

    Args:
        time: instants of the ego, s.
        ttc, thw, drac: time to collision, time headway and deceleration to avoid the crash with the
            lead: the nearest one ahead whose box overlaps the ego's laterally.
        distance: shortest distance of boxes to anyone.
        lead: name of the lead, empty where there is none.
        violation: by RSS parameter set, mask of ego and another entity closer than safe in both
            directions.
        margin: by RSS parameter set, the least `rss_margin` (m) to anyone.
        active: instants that count for the shares: another entity exists, and no collision has
            happened before.

    Example:
        >>> import xosc_toolchain as xt
        >>> result = xt.run("xosc/library/simple_cut_in.xosc", world="kinematic", max_time=1.0)
        >>> least = result.criticality.summary["min_distance"]
        >>> least["other"], round(least["value"], 1)
        ('CutIn', 40.2)
    """

    time: FloatArray
    ttc: Series
    thw: Series
    drac: Series
    distance: Series
    lead: NDArray[np.object_]
    violation: dict[str, BoolArray]
    margin: dict[str, Series]
    active: BoolArray
    nearest: NDArray[np.object_] = field(repr=False)
    _touched: BoolArray = field(repr=False)
    _motions: tuple[MotionRows, Sequence[MotionRows]] = field(repr=False)

    @property
    def ego(self) -> MotionRows:
        """The ego's motion."""
        return self._motions[0]

    def other(self, name: str) -> MotionRows:
        """The motion of another participant."""
        return next(motion for motion in self._motions[1] if motion.name == name)

    @cached_property
    def pet(self) -> Extreme | None:
        """Post-encroachment time, its least value over all others; worked out when asked for, it
        costs more than the rest."""
        return post_encroachment_time(*self._motions)

    @cached_property
    def risk_field(self) -> tuple[Extreme, ...]:
        """Greatest collision probability and greatest strength of the risk field over all entities;
        empty without any."""
        return tuple(greatest(*self._motions))

    @cached_property
    def impact(self) -> Impact | None:
        """The first contact with anyone; None without one."""
        ego, others = self._motions
        # Relations are worked out anew for each one: only for those that have touched the ego.
        return first_impact(
            ego, [other for other, touched in zip(others, self._touched, strict=True) if touched]
        )

    @property
    def opponent(self) -> MotionRows | None:
        """The participant of the first contact; None without one."""
        return self.other(self.impact.other) if self.impact is not None else None

    @property
    def conflict(self) -> float | None:
        """Time (s) of the first contact, else of the shortest distance; None without another
        entity."""
        if self.impact is not None:
            return self.impact.time
        nearest = least(self.distance, self.nearest, self.time)
        return nearest.time if nearest is not None else None

    def risk_before(self, parameters: str, until: float, window: float) -> float:
        """Share of a time window (s) that ends at an instant (s) in which RSS is violated, by
        parameter set.

        The window is as long for every run: time before the run's beginning counts as safe.
        """
        if len(self.time) < 2:
            return 0.0
        inside = (self.time > until - window + _INSTANT) & (self.time <= until + _INSTANT)
        # The least step: a track with gaps has longer ones.
        step = float(np.diff(self.time).min())
        return min(float((self.violation[parameters] & inside).sum()) * step / window, 1.0)

    def table(self) -> dict[str, Any]:
        """One column for each measure over time; `<measure>_valid` says where it is defined."""
        columns: dict[str, Any] = {"time": self.time, "lead": self.lead}
        for name in ("ttc", "thw", "drac", "distance"):
            measure: Series = getattr(self, name)
            columns[name], columns[f"{name}_valid"] = measure
        for name, margin in self.margin.items():
            columns[f"rss_margin_{_column(name)}"], columns[f"rss_margin_{_column(name)}_valid"] = (
                margin
            )
        columns["active"] = self.active
        return columns | {
            f"rss_violation_{_column(name)}": flags for name, flags in self.violation.items()
        }

    @cached_property
    def acceleration(self) -> FloatArray:
        """The ego's acceleration along its heading (n,), m/s², from speeds of neighbouring
        instants."""
        time = self.time
        return np.gradient(self.ego.speed, time) if len(time) > 1 else np.zeros(len(time))

    @cached_property
    def jerk(self) -> FloatArray:
        """Change of the ego's acceleration over the last `JERK_WINDOW`, per second (n,), m/s³; over
        less at the beginning counts as over all of it.

        A mean, as regulations and ISO 15622 have it: the difference of two steps depends on the
        time step.
        """
        before = np.interp(self.time - JERK_WINDOW, self.time, self.acceleration)
        return (self.acceleration - before) / JERK_WINDOW

    @cached_property
    def signals(self) -> dict[str, FloatArray]:
        """Values over time (n,) by the names of `runner.judging.measures.measure.SIGNALS`; where
        one is not defined it is as where nothing is near."""
        far = {name: getattr(self, name) for name in ("ttc", "thw", "distance")}
        found = {name: np.where(one.valid, one.value, np.inf) for name, one in far.items()}
        safe = self.margin["ad-rss"]
        return found | {
            "drac": np.where(self.drac.valid, self.drac.value, 0.0),
            "rss_margin": np.where(safe.valid, safe.value, np.inf),
            "speed": self.ego.speed,
            "acceleration": self.acceleration,
            "jerk": self.jerk,
            "x": self.ego.x,
            "y": self.ego.y,
            "s": self.ego.s,
            "t": self.ego.t,
        }

    def risk(self, parameters: str) -> float | None:
        """R_risk: share of the active instants at which RSS is violated, by parameter set; None
        without active instants."""
        return float(self.violation[parameters][self.active].mean()) if self.active.any() else None

    @cached_property
    def summary(self) -> dict[str, Any]:
        """All measures of the run by name (`runner.judging.measures.measure`), extremes as
        `Extreme._asdict`; None for undefined ones."""
        found = {name: measure.result(self) for name, measure in measures().items()}
        return {
            name: value._asdict() if isinstance(value, Extreme) else value
            for name, value in found.items()
        }


def _column(name: str) -> str:
    return name.replace("-", "_")


def criticality(ego: MotionRows, others: Sequence[MotionRows]) -> Criticality:
    """All measures of an ego against all other participants."""
    count = len(ego.time)
    gap, closing = np.full(count, np.inf), np.zeros(count)
    distance, collided = np.full(count, np.inf), np.zeros(count, bool)
    lead, nearest = np.full(count, "", object), np.full(count, "", object)
    violation = {name: np.zeros(count, bool) for name in rss.PARAMETERS}
    margin = {name: np.full(count, np.inf) for name in rss.PARAMETERS}
    touched = []
    for block in blocks(others):
        names = np.array([other.name for other in block], object)
        rows, who, apart, view = relations(ego, block)
        collided[rows[apart == 0.0]] = True
        touched.append(np.bincount(who[apart == 0.0], minlength=len(block)) > 0)
        for name, parameters in rss.PARAMETERS.items():
            along, across = (
                _longitudinal_margin(view, parameters),
                _lateral_margin(view, parameters),
            )
            violation[name][rows[_violated(view.ahead, along) & _violated(view.aside, across)]] = (
                True
            )
            # Rows repeat, one for each other: plain assignment would keep the last one.
            np.minimum.at(margin[name], rows, _margin(view, along, across))
        nearer = _least(rows, apart, distance)
        distance[rows[nearer]], nearest[rows[nearer]] = apart[nearer], names[who[nearer]]
        # Boxes that touch have no gap along: they count as a lead with gap 0.
        ahead = np.flatnonzero((view.aside == 0.0) & ((view.ahead > 0.0) | (apart == 0.0)))
        ahead = ahead[_least(rows[ahead], view.ahead[ahead], gap)]
        gap[rows[ahead]], lead[rows[ahead]] = view.ahead[ahead], names[who[ahead]]
        closing[rows[ahead]] = (view.speed - view.other_speed)[ahead]
    led, present = np.isfinite(gap), np.isfinite(distance)
    gap[~led] = 0.0
    return Criticality(
        time=ego.time,
        ttc=_where(led, time_to_collision(gap, closing)),
        thw=_where(led, time_headway(gap, ego.speed)),
        drac=_where(led, deceleration_to_avoid_crash(gap, closing)),
        distance=Series(np.where(present, distance, 0.0), present),
        lead=lead,
        violation=violation,
        margin={
            name: Series(np.where(present, least, 0.0), present) for name, least in margin.items()
        },
        # Shares end with the first collision: what follows it is its consequence.
        active=present & ~_earlier(collided),
        nearest=nearest,
        _touched=np.concatenate([np.zeros(0, bool), *touched]),
        _motions=(ego, others),
    )


def _least(rows: IntArray, values: FloatArray, least: FloatArray) -> IntArray:
    """Return the rows whose value is the first minimum of their group and below the present one."""
    order = np.lexsort((values, rows))
    first = order[np.flatnonzero(np.diff(rows[order], prepend=-1))]
    return first[values[first] < least[rows[first]]]


def _earlier(happened: BoolArray) -> BoolArray:
    """Return a mask of steps after the first occurrence."""
    return np.logical_or.accumulate(np.concatenate(([False], happened)))[:-1]


def _where(defined: BoolArray, measure: Series) -> Series:
    valid = measure.valid & defined
    return Series(np.where(valid, measure.value, 0.0), valid)


def of_recording(recording: Recording, ego_name: str | None) -> Criticality | None:
    """The measures of one participant of a recording; None where there is no such name in it."""
    tracks = recording.locate().tracks
    motions = {name: MotionRows.of(track) for name, track in tracks.items()}
    ego = motions.pop(ego_name, None) if ego_name is not None else None
    return criticality(ego, list(motions.values())) if ego is not None else None
