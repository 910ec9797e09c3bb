"""Passages: how the ego goes through a junction, or into, out of and round in a roundabout.

The ego is the actor, as in the library's scenarios of these classes: its manoeuvre is the change of speed on its way. It and the
one whose way it meets keep to the ways that were recorded. When the manoeuvre begins, both are where they were recorded; the
other one has the speed with which it comes from there to where the ways meet in time, and goes on from there to where it is
when the scene ends.
"""

from __future__ import annotations

import numpy as np

from recognition.catalogue.maneuvers.courses import Course
from recognition.catalogue.maneuvers.meetings import meeting
from recognition.catalogue.maneuvers.record import LONGEST, SHORTEST, Maneuver, Meeting, Onwards, Passage, Seven, Span, speed_at
from recognition.catalogue.maneuvers.speeds import EVERY, fitted_speeds, ways
from recognition.labels.classes import Label
from recognition.labels.stays import held, stays
from runner.recording import Recording, Track
from schemas.errors import Unsupported
from xodr.network import RoadNetwork

JUNCTION = (Label.LEFT_TURN, Label.RIGHT_TURN, Label.STRAIGHT_CROSS, Label.MERGING)
"""Classes whose passage is all the way through the junction"""
ROUNDABOUT = (Label.ROUNDABOUT_ENTERING, Label.ROUNDABOUT_EXITING, Label.ROUNDABOUT_CIRCULATING)
"""Classes whose passage is what was recognised: entering and leaving have no other beginning and end"""
_STANDS = 0.5
"""Speed (m/s) below which somebody stands"""
_FLICKER = 0.5
"""Stays (s) on another road that don't count: where lanes of a junction overlap, rows may jump between them"""


def passage(recording: Recording, network: RoadNetwork, label: Label, ego: str, partner: str | None, span: Span) -> Maneuver:
    """The passage of an event; see `maneuvers.maneuver`.

    Raises:
        Unsupported: it was not recorded whole, or the partner was past where the ways meet before it began.
    """
    own = recording.tracks[ego]
    start, end = _inside(own, network, span.middle, recording.timestep) if label in JUNCTION else (span.start, span.end)
    time, course = own.columns["time"], Course.of(own)
    if not time[0] < start < end <= time[-1]:
        raise Unsupported("the manoeuvre was not recorded whole")
    met = meeting(recording, own, course, start, partner)
    if partner is not None and met is None:
        raise Unsupported("the ways of the two don't meet after the passage begins")
    duration, rest = max(end - start, SHORTEST), min(LONGEST, float(time[-1]) - end)
    speeds = _speeds(own, course, start, duration, rest)
    begins, delay = float(course.at(start)), min(LONGEST, start - float(time[0]))
    gap, speed, onwards = None, 0.0, None
    if met is not None:
        here = float(met.course.at(start))
        gap = met.reach - here
        speed = gap / (met.time - start)
        delay = min(delay, start - float(met.other.columns["time"][0]), here / speed)
        onwards = _onwards(met, speed, end + rest)
    delay = min(delay, begins / speeds[0] if speeds[0] else LONGEST)
    values = Seven(gap, speeds[0], delay, speeds[1], duration, speeds[2], rest)
    other = met.other if met is not None else None
    return Maneuver("passage", own, other, None, values, speed, start - delay, end + rest, Passage(course, begins, met, onwards))


def _inside(track: Track, network: RoadNetwork, time: float, timestep: float) -> tuple[float, float]:
    """When a track comes into the junction that it is in or has just left at a time (s), and when it leaves it.

    Who stands in the junction comes to it when setting off for the last time.

    Raises:
        Unsupported: it was not recorded before or after.
    """
    at = track.columns["time"]
    inside = np.array([network.road(road).junction_id is not None for road in track.columns["road_id"]], np.int64)
    begin, size = stays(held(inside, np.zeros_like(inside), max(1, round(_FLICKER / timestep))), np.zeros_like(inside))
    chosen = np.flatnonzero(inside[begin] == 1)
    first, last = begin[chosen], (begin + size)[chosen] - 1
    if not len(chosen):
        raise Unsupported("the way through the junction can't be told from the roads")
    away = np.maximum(np.maximum(at[first] - time, time - at[last]), 0.0)
    nearest = int(away.argmin())
    if first[nearest] == 0 or last[nearest] == len(at) - 1:
        raise Unsupported("the manoeuvre was not recorded whole")
    rows = np.arange(first[nearest], last[nearest] + 1)
    stands = rows[track.columns["speed"][rows] < _STANDS]
    return float(at[stands[-1] if len(stands) else rows[0]]), float(at[rows[-1] + 1])


def _speeds(track: Track, course: Course, start: float, duration: float, rest: float) -> list[float]:
    """Start, end and final speed (m/s) with which the ego comes along its way as it did from the beginning of the passage on."""
    time = np.arange(EVERY, duration + rest + EVERY / 2, EVERY)
    seen = np.array([speed_at(track, start + after) for after in (0.0, duration, duration + rest)])
    way = course.at(start + time) - course.at(start)
    found: list[float] = fitted_speeds(ways(time, duration, rest), way, seen).tolist()
    return found


def _onwards(met: Meeting, speed: float, end: float) -> Onwards:
    """How the other one comes from the meeting, where it has a speed (m/s), to where it is at the end of the scene (s)."""
    last = min(end, float(met.other.columns["time"][-1]))
    duration = last - met.time
    if duration < SHORTEST:
        return Onwards(speed, SHORTEST)
    way = float(met.course.at(last)) - met.reach
    return Onwards(max(2.0 * way / duration - speed, 0.0), duration)
