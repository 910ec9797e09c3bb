"""Critical moments of a recording, of any class: time to collision, braking, encroachment, evasive
steering, contact.

The measures are those of runs (`runner.judging.measures`). RSS violations are reported beside them
but make no moment: ordinary close following violates RSS.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from recognition.labels.classes import Label, LabelledEvent, Rules
from recognition.labels.scene import EGOS, is_parked
from recognition.scenes import Site, place
from runner.engine.motion import rss
from runner.engine.participants.declaration import BoundingBox
from runner.judging.measures.contacts import post_encroachment_time
from runner.judging.measures.criticality import (
    deceleration_to_avoid_crash,
    rss_margin,
    time_to_collision,
)
from runner.judging.measures.measure import Series
from runner.judging.measures.relations import MotionRows, Relations, relations
from runner.recording import Recording, Track
from schemas.common.array_types import BoolArray, FloatArray, IntArray

UNNAMED = "unnamed critical"
"""Title of critical moments that are of none of the 17 classes"""


@dataclass(frozen=True)
class CriticalLimits:
    """Limits beyond which a moment is critical.

    Attributes:
        ttc: greatest time to collision, s.
        drac: least deceleration to avoid a crash, m/s²: what drivers do without emergency.
        closing: least closing speed of both, m/s: slower, a queue closes up.
        pet: greatest post-encroachment time of crossing paths, s.
        braking: least deceleration over a second, m/s².
        steering: least lateral acceleration to each side of a swerve, m/s².
        steering_speed: least speed of a swerve, m/s.
        contact: least relative speed of a contact, m/s.
        hold: least time that TTC or DRAC last, s: errors of boxes and tracking are shorter.
        gap: greatest time between two parts of one moment, s.
        before, after: greatest time from an event of a class to its critical moment, and back, s.
    """

    ttc: float = 1.5
    drac: float = 3.4
    closing: float = 2.0
    pet: float = 1.0
    braking: float = 5.0
    steering: float = 3.0
    steering_speed: float = 8.0
    contact: float = 1.0
    hold: float = 0.3
    gap: float = 2.0
    before: float = 5.0
    after: float = 2.0


_GRAVEST = {"drac": 9.8, "braking": 9.0, "steering": 8.0}
"""Values (m/s²) of severity 1: the limits of tyres"""
_STEERED = 0.27
"""Time to collision (s) below which steering at 8 m/s² moves a vehicle aside by less than 0.3 m"""
_SHRUNK = 0.85
"""Share of boxes that counts for contacts: recorded sizes are rough"""
_CROSSING = np.radians(30.0)
"""Least angle between the headings of crossing paths"""
_BESIDE, _AWAY = 3.0, 1.0
"""Lateral ways (m) until a collision by which another one has left the path, and the ego its
straight course"""
_MUTUAL = frozenset(("pet", "contact"))
"""Measures that are the same for both"""
_OBLIQUE = 0.5
"""Lateral over longitudinal speed above which another one has another direction"""
_SAMPLE = 0.5
"""Time (s) between instants at which pairs are looked for"""
_NEAR = 12.0
"""Distance (m) of centres within which pairs count whatever their speeds"""
_WIDEST = 80.0
"""Greatest distance of pairs, m"""
_AHEAD = 0.1
"""Time (s) over which the approach of two bodies is taken: shorter than what drivers react to"""
_TURN = 0.25
"""Half of the time (s) over which yaw rates are averaged"""
_SWERVE = 2.0
"""Greatest time (s) between both sides of a swerve"""
_MARGIN, _FASTER = 2.0, 1.5
"""Distance (m) and share of the speed that bound how far a corner of a body moves beyond its
place: bodies turn, and places are smoothed apart from speeds"""
_RSS = next(iter(rss.PARAMETERS))


class Exceedance(NamedTuple):
    """One measure beyond its limit: from when to when (s), when most, its value, severity in [0,
    1], and the partner."""

    start: float
    end: float
    time: float
    name: str
    value: float
    severity: float
    partner: str | None


@dataclass(frozen=True)
class CriticalMoment:
    """A critical moment of an ego.

    Attributes:
        ego, time: name of the track, and instant of the worst measure, s.
        partner: of the worst measure that has one; None for none.
        participants: all partners, the worst first.
        severity: from 0 at a limit to 1 at a contact or at the limits of tyres.
        values: worst value of each measure beyond its limit (s, m/s²), and the least RSS margin
            (m).
    """

    ego: str
    time: float
    partner: str | None
    participants: tuple[str, ...]
    severity: float
    values: dict[str, float]

    @property
    def text(self) -> str:
        """Measures with values, as text."""
        units = {"ttc": "s", "pet": "s", "contact": "m/s", "rss_margin": "m"}
        return ", ".join(
            f"{name.replace('_', ' ')} {value:.2f} {units.get(name, 'm/s²')}"
            for name, value in self.values.items()
        )


def with_critical(
    events: Sequence[LabelledEvent], recording: Recording, site: Site, name: str, rules: Rules
) -> list[LabelledEvent]:
    """Events of a recording with the severity of their critical moments, and an unnamed event for
    each other moment.

    A moment belongs to the nearest event of the same participants, from `CriticalLimits.before` it
    to `CriticalLimits.after` it. Free cruise is never critical.
    """
    limits = CriticalLimits()
    found = list(events)
    for moment in critical_moments(recording, site, rules, limits):
        # A class names the moment if it fits: an unnamed event only where no rule has found any.
        fitting = [index for index, event in enumerate(events) if _fits(event, moment, limits)]
        if not fitting:
            event = LabelledEvent(
                name, moment.ego, round(moment.time, 6), Label.UNKNOWN, moment.partner, {}
            )
            found.append(_marked(event, moment))
            continue
        index = min(fitting, key=lambda number: abs(events[number].time - moment.time))
        if moment.severity > (found[index].severity or 0.0):
            found[index] = _marked(found[index], moment)
    return sorted(found, key=lambda event: (event.ego, event.time))


def _fits(event: LabelledEvent, moment: CriticalMoment, limits: CriticalLimits) -> bool:
    if event.label in (Label.FREE_CRUISE, Label.UNKNOWN):
        return False
    if not -limits.after <= moment.time - event.time <= limits.before:
        return False
    known = event.partner is not None and moment.partner is not None
    same = event.ego == moment.ego and (not known or event.partner in moment.participants)
    return same or (event.partner == moment.ego and event.ego in moment.participants)


def _marked(event: LabelledEvent, moment: CriticalMoment) -> LabelledEvent:
    return replace(
        event,
        severity=round(moment.severity, 4),
        critical=moment.text,
        participants=moment.participants,
    )


def critical_moments(
    recording: Recording,
    site: Site,
    rules: Rules = Rules(),  # noqa: B008
    limits: CriticalLimits = CriticalLimits(),
) -> list[CriticalMoment]:
    """Critical moments of the motor vehicles of a recording that are not parked, by ego and time.

    The recording gets the road coordinates that it lacks.
    """
    place(recording, site.network)
    tracks = [track for track in recording.tracks.values() if len(track.columns["time"]) > 1]
    motions = [MotionRows.of(track) for track in tracks]
    found: list[CriticalMoment] = []
    for number, others in enumerate(_near(motions, recording.timestep)):
        track = tracks[number]
        if track.kind != "vehicle" or track.category not in EGOS or is_parked(track, rules):
            continue
        parts = [*_alone(track, limits, recording.timestep)]
        if len(others):
            beside = [motions[number] for number in others.tolist()]
            parts += _encounters(motions[number], beside, limits, recording.timestep)
        found += _moments(track.name, parts, limits)
    return sorted(_once(found, limits), key=lambda moment: (moment.ego, moment.time))


def _once(moments: Sequence[CriticalMoment], limits: CriticalLimits) -> Iterator[CriticalMoment]:
    """Yield the moments without those that another one already is, as its partner sees it."""
    kept: dict[str, list[CriticalMoment]] = {}
    for moment in sorted(
        moments, key=lambda one: (_MUTUAL.issuperset(one.values), one.ego, one.time)
    ):
        # Contacts and encroachments are the same for both; the moment of the first ego stands for
        # them.
        mutual = _MUTUAL.issuperset(moment.values)
        if mutual and any(
            moment.ego in other.participants and abs(other.time - moment.time) <= limits.gap
            for partner in moment.participants
            for other in kept.get(partner, ())
        ):
            continue
        kept.setdefault(moment.ego, []).append(moment)
        yield moment


def _near(motions: Sequence[MotionRows], step: float) -> list[IntArray]:
    """Numbers of the participants that each one approaches within reach of its closing speed."""
    from scipy.spatial import KDTree

    if not motions:
        return []
    every = max(round(_SAMPLE / step), 1)
    sizes = [len(motion.time) for motion in motions]
    who = np.repeat(np.arange(len(motions)), sizes)
    time, x, y, h, speed = (
        np.concatenate([getattr(motion, name) for motion in motions])
        for name in ("time", "x", "y", "h", "speed")
    )
    length = np.repeat([0.5 * motion.box.length for motion in motions], sizes)
    frame = np.round(time / step).astype(np.int64)
    rows = np.flatnonzero(frame % every == 0)
    velocity = np.stack([speed * np.cos(h), speed * np.sin(h)], axis=1)[rows]
    # The frame as third coordinate: one tree finds the pairs of all instants.
    apart = 4.0 * _WIDEST  # frames lie on levels that are further apart than pairs
    points = np.stack([x[rows], y[rows], apart * (frame[rows] // every)], axis=1)
    pairs = KDTree(points).query_pairs(_WIDEST, output_type="ndarray")
    one, other = pairs.T if len(pairs) else np.zeros((2, 0), np.int64)
    away = np.hypot(*(points[one] - points[other])[:, :2].T)
    closing = np.hypot(*(velocity[one] - velocity[other]).T)
    # Pairs that can matter: two seconds of closing, and braking at 3.4 m/s² (v²/(2·3.4)).
    reach = _NEAR + length[rows][one] + length[rows][other] + 2.0 * closing + closing**2 / 6.8
    near = away <= reach
    first, second = who[rows][one[near]], who[rows][other[near]]
    linked = np.unique(
        np.concatenate([np.stack([first, second], 1), np.stack([second, first], 1)]), axis=0
    )
    ends = np.searchsorted(linked[:, 0], np.arange(len(motions) + 1))
    return [linked[a:b, 1] for a, b in pairwise(ends)]


def _alone(track: Track, limits: CriticalLimits, step: float) -> Iterator[Exceedance]:
    """Hard braking and swerves, which need no partner."""
    columns = track.columns
    time, speed, h = columns["time"], columns["speed"], np.unwrap(columns["h"])
    ahead = max(round(1.0 / step), 1)
    if len(time) > ahead:
        apart = time[ahead:] - time[:-ahead]
        # Over a second: differences of single steps are noise.
        slower = (np.abs(speed[:-ahead]) - np.abs(speed[ahead:])) / apart
        hard = (slower >= limits.braking) & (apart < 1.5)
        for run in _runs(hard):
            at = run[int(slower[run].argmax())]
            severity = _share(float(slower[at]), limits.braking, _GRAVEST["braking"])
            end = float(time[run[-1] + ahead])
            yield Exceedance(
                float(time[run[0]]), end, float(time[at + ahead // 2]), "braking",
                float(slower[at]), severity, None,
            )  # fmt: skip
    half = max(round(_TURN / step), 1)
    if len(time) <= 2 * half:
        return
    rate = (h[2 * half :] - h[: -2 * half]) / (time[2 * half :] - time[: -2 * half])
    # v·ω is the lateral acceleration of a vehicle that does not slide.
    lateral = rate * speed[half:-half]
    fast = np.abs(speed[half:-half]) >= limits.steering_speed
    left, right = (
        np.flatnonzero(fast & (side * lateral >= limits.steering)) for side in (1.0, -1.0)
    )
    # Both sides within two seconds: a bend has one side only.
    for at in left.tolist():
        near = right[np.abs(time[right + half] - time[at + half]) <= _SWERVE]
        if len(near):
            value = float(min(lateral[at], -lateral[near].min()))
            times = sorted((float(time[at + half]), float(time[near[0] + half])))
            severity = _share(value, limits.steering, _GRAVEST["steering"])
            yield Exceedance(times[0], times[1], times[0], "steering", value, severity, None)


def _encounters(
    ego: MotionRows, others: Sequence[MotionRows], limits: CriticalLimits, step: float
) -> Iterator[Exceedance]:
    """Time to collision, deceleration to avoid a crash, encroachment and contacts with others."""
    between = relations(ego, others)
    view = between.view
    closing = view.speed - view.other_speed
    ahead = (view.aside == 0.0) & (view.ahead > 0.0) & (closing >= limits.closing)
    ttc, drac = (
        time_to_collision(view.ahead, closing),
        deceleration_to_avoid_crash(view.ahead, closing),
    )
    margin = rss_margin(view, rss.PARAMETERS[_RSS])
    time = ego.time[between.rows]
    across = view.other_sideways - view.sideways
    # Until the collision the other one would have crossed and left the path.
    ahead &= np.abs(across) * ttc.value < _BESIDE
    oblique = (view.other_speed < 0.0) | (np.abs(across) > _OBLIQUE * np.abs(view.other_speed))
    # With crossing or oncoming traffic a TTC along the heading holds only if the ego drives
    # straight on.
    ahead &= ~oblique | _on_course(ego, between.rows, ttc.value)
    least = max(round(limits.hold / step), 2)
    soon = ahead & ttc.valid & (ttc.value < limits.ttc)
    hard = ahead & drac.valid & (drac.value > limits.drac)
    if (soon | hard).any():
        # Extents along the heading overlap where an oblique body only reaches beside the ego.
        approach = _approach(ego, others, between)
        nearing = time_to_collision(between.distance, approach)
        needed = deceleration_to_avoid_crash(between.distance, approach)
        ttc = Series(np.maximum(ttc.value, nearing.value), ttc.valid & nearing.valid)
        drac = Series(np.minimum(drac.value, needed.value), drac.valid & needed.valid)
        soon &= ttc.valid & (ttc.value < limits.ttc)
        hard &= drac.valid & (drac.value > limits.drac)
    # Neither steering nor braking could avert it: if nothing happened, sizes or places are off.
    hopeless = ahead & ttc.valid & (ttc.value < _STEERED) & drac.valid
    hopeless &= drac.value > _GRAVEST["drac"]
    for number, other in enumerate(others):
        own = np.flatnonzero(between.who == number)
        apart = False
        if (soon | hard)[own].any():
            touching = _touch(ego, other)
            if touching[:1].any():
                continue  # they overlap from the beginning: sizes or places are wrong
            apart = not touching.any()
        for name, flag, values in (("ttc", soon, ttc.value), ("drac", hard, drac.value)):
            for run in _runs(flag[own]):
                rows = own[run]
                if len(rows) < least or (apart and hopeless[rows].any()):
                    # nothing could have averted it, and nothing happened: its course was another
                    # one
                    continue
                found = values[rows]
                at = rows[int(found.argmin() if name == "ttc" else found.argmax())]
                value = float(values[at])
                severity = (
                    _share(limits.ttc - value, 0.0, limits.ttc)
                    if name == "ttc"
                    else _share(value, limits.drac, _GRAVEST["drac"])
                )
                start, end, when = (float(time[row]) for row in (rows[0], rows[-1], at))
                yield Exceedance(start, end, when, name, value, severity, other.name)
                yield Exceedance(
                    start, end, when, "rss_margin", float(margin[rows].min()), 0.0, other.name
                )
        yield from _meeting(ego, other, between.distance[own], limits)


def _approach(ego: MotionRows, others: Sequence[MotionRows], between: Relations) -> FloatArray:
    """Speed (m/s) at which the distance of the bodies falls if both keep their velocities.

    The distance of convex bodies is a convex function of time then: distance over this speed is a
    lower bound of the time to their collision.
    """
    later = relations(_later(ego), [_later(other) for other in others])
    count = len(ego.time)
    now, then = (seen.who * count + seen.rows for seen in (between, later))
    _, known, found = np.intersect1d(now, then, assume_unique=True, return_indices=True)
    approach = np.zeros(len(now))
    approach[known] = (between.distance[known] - later.distance[found]) / _AHEAD
    return approach


def _later(motion: MotionRows) -> MotionRows:
    """The same, each instant moved on along its heading."""
    cos, sin = motion.facing
    way = _AHEAD * motion.speed
    return replace(motion, x=motion.x + way * cos, y=motion.y + way * sin)


def _on_course(ego: MotionRows, rows: IntArray, ttc: FloatArray) -> BoolArray:
    """Rows at which the ego drives straight on until the collision; an ego that
    turns would miss.
    """
    turning = np.gradient(np.unwrap(ego.h), ego.time)[rows] * ego.speed[rows]
    return np.asarray(0.5 * np.abs(turning) * ttc**2 < _AWAY, bool)


def _meeting(
    ego: MotionRows, other: MotionRows, distance: FloatArray, limits: CriticalLimits
) -> Iterator[Exceedance]:
    """The contact with another participant, else the encroachment of paths that cross.

    Args:
        distance: of the boxes at their common instants, m.
    """
    # Boxes that are shrunk touch only where whole ones do.
    touching = relations(_smaller(ego), [_smaller(other)]) if (distance == 0.0).any() else None
    if touching is not None and (inside := touching.distance == 0.0).any():
        if inside[0]:
            return  # it was there from the beginning: sizes or places are wrong
        at = int(np.flatnonzero(inside)[0])
        view = touching.view
        speed = float(
            np.hypot(view.speed[at] - view.other_speed[at],
                view.sideways[at] - view.other_sideways[at])
        )  # fmt: skip
        if speed >= limits.contact:
            time = float(ego.time[touching.rows[at]])
            yield Exceedance(time, time, time, "contact", speed, 1.0, other.name)
        return
    if not len(distance) or distance.min() > _within(ego, other, limits.pet):
        return
    if not _cross(ego, other):
        return
    found = post_encroachment_time(ego, [other], limits.pet)
    if found is not None and found.value < limits.pet:
        severity = _share(limits.pet - found.value, 0.0, limits.pet)
        yield Exceedance(
            found.time, found.time, found.time, "pet", found.value, severity, other.name
        )


def _within(ego: MotionRows, other: MotionRows, time: float) -> float:
    """Greatest distance (m) of two bodies when the first of them is where the other one is within a
    time (s)."""
    fastest = max(float(np.abs(motion.speed).max()) for motion in (ego, other))
    return _MARGIN + _FASTER * fastest * time


def _touch(ego: MotionRows, other: MotionRows) -> BoolArray:
    """Rows at which two bodies touch."""
    return np.asarray(relations(_smaller(ego), [_smaller(other)]).distance == 0.0, bool)


def _cross(ego: MotionRows, other: MotionRows) -> bool:
    """Whether two paths have different headings where they are nearest, and both
    participants move.
    """
    from scipy.spatial import KDTree

    moving, its = np.abs(ego.speed) > 1.0, np.abs(other.speed) > 1.0
    if not moving.any() or not its.any():
        return False
    tree = KDTree(np.stack([other.x[its], other.y[its]], axis=1))
    found = tree.query(np.stack([ego.x[moving], ego.y[moving]], axis=1))
    away, index = (np.asarray(values) for values in found)
    at = int(away.argmin())
    turn = ego.h[moving][at] - other.h[its][int(index[at])]
    return bool(np.abs(np.sin(turn)) > np.sin(_CROSSING))


def _smaller(motion: MotionRows) -> MotionRows:
    box = motion.box
    return replace(
        motion,
        box=BoundingBox(*box._replace(length=_SHRUNK * box.length, width=_SHRUNK * box.width)),
    )


def _moments(
    ego: str, parts: Sequence[Exceedance], limits: CriticalLimits
) -> Iterator[CriticalMoment]:
    """Moments of an ego: measures beyond their limits that follow each other closely."""
    # One encounter exceeds several limits one after the other: it is one moment.
    groups: list[list[Exceedance]] = []
    end = -np.inf
    for part in sorted(parts):
        if part.start > end + limits.gap:
            groups.append([])
        groups[-1].append(part)
        end = max(end, part.end) if len(groups[-1]) > 1 else part.end
    for group in groups:
        ranked = sorted(group, key=lambda part: (-part.severity, part.time, part.name))
        values: dict[str, float] = {}
        for part in ranked:
            values.setdefault(part.name, part.value)
        partners = tuple(dict.fromkeys(part.partner for part in ranked if part.partner))
        yield CriticalMoment(
            ego,
            ranked[0].time,
            partners[0] if partners else None,
            partners,
            ranked[0].severity,
            values,
        )


def _runs(flags: BoolArray) -> list[IntArray]:
    """Indices of each run of flags that hold."""
    index = np.flatnonzero(flags)
    return [run for run in np.split(index, np.flatnonzero(np.diff(index) > 1) + 1) if len(run)]


def _share(value: float, low: float, high: float) -> float:
    """Position of a value between two others, from 0 to 1."""
    return min(max((value - low) / (high - low), 0.0), 1.0)
