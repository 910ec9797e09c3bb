"""Passages: how the ego goes through a junction, or into, out of and round in a roundabout.

The ego is the actor, as in the library's scenarios of these classes: its manoeuvre is the change of speed on its way. It and the
one whose way it meets keep to the ways that were recorded. When the manoeuvre begins, both are where they were recorded; the
other one has the speed with which it comes from there to where the ways meet in time, and goes on from there to where it is
when the scene ends.
"""

from __future__ import annotations

import numpy as np

from recognition.labels.classes import Label
from recognition.labels.scene.stays import held, stays
from recognition.maneuvers.events.conflicts import nearest_conflict
from recognition.maneuvers.events.maneuver import LONGEST, SHORTEST, Conflict, Maneuver, Passage, Span, SpeedChange
from recognition.maneuvers.events.paths import RecordedPath, recorded_speeds
from recognition.maneuvers.parameters import Values
from runner.recording import Recording, Track
from schemas.errors import Unsupported
from xodr.network import RoadNetwork

JUNCTION = (Label.LEFT_TURN, Label.RIGHT_TURN, Label.STRAIGHT_CROSS, Label.MERGING)
"""Classes whose passage is all the way through the junction"""
ROUNDABOUT = (Label.ROUNDABOUT_ENTERING, Label.ROUNDABOUT_EXITING, Label.ROUNDABOUT_CIRCULATING)
"""Classes whose passage is what was recognised: entering and leaving have no other beginning and end"""
_STANDS = 0.5
"""Speed (m/s) below which a participant stands"""
_BEND = 0.1
"""Change of heading (rad) that is none yet, or left over"""
_FLICKER = 0.5
"""Stays (s) on another road that don't count: where lanes of a junction overlap, rows may jump between them"""


def passage(recording: Recording, network: RoadNetwork, label: Label, ego: str, partner: str | None, span: Span) -> Maneuver:
    """The passage of an event; see `maneuvers.maneuver`.

    Raises:
        Unsupported: it was not recorded completely, no participant moves in it, or the partner had passed the conflict point
            before it began.
    """
    own = recording.tracks[ego]
    start, end = span.start, span.end
    if label in JUNCTION:
        start, end = _inside(own, network, span.middle, recording.timestep, label in (Label.LEFT_TURN, Label.RIGHT_TURN))
    time = own.columns["time"]
    if not time[0] <= start < end <= time[-1]:
        raise Unsupported("the manoeuvre was not recorded completely")
    path = RecordedPath.of(own)
    alone = Passage.of(path, start)
    if alone.begin >= path.station[-1]:
        raise Unsupported("the ego does not move after the passage begins")
    conflict = nearest_conflict(recording, own, path, start, partner)
    if partner is not None and conflict is None:
        raise Unsupported("the ways of the two don't meet after the passage begins")
    duration, rest = max(end - start, SHORTEST), min(LONGEST, float(time[-1]) - end)
    speeds = recorded_speeds(own, path, start, start, duration, rest)
    delay = min(alone.longest(speeds[0]), start - float(time[0]))
    if conflict is None:
        values = Values(None, speeds[0], delay, speeds[1], duration, speeds[2], rest)
        return Maneuver("passage", own, None, None, values, 0.0, start, passage=alone)
    here = float(conflict.path.at(start))
    speed = (conflict.reach - here) / (conflict.time - start)
    delay = min(delay, start - float(conflict.other.columns["time"][0]), here / speed)
    values = Values(conflict.reach - here, speeds[0], delay, speeds[1], duration, speeds[2], rest)
    both = alone._replace(conflict=conflict, continuation=_continuation(conflict, speed, end + rest))
    return Maneuver("passage", own, conflict.other, None, values, speed, start, passage=both)


def _inside(track: Track, network: RoadNetwork, time: float, timestep: float, turns: bool) -> tuple[float, float]:
    """When a track comes into the junction that it is in or has just left at a time (s), and when it leaves it.

    Who turns comes to it where the heading begins to change, and leaves it where it has changed. Who stands in it comes to it
    when setting off for the last time. Of who was first or last recorded inside, it is what was recorded.
    """
    at = track.columns["time"]
    inside = np.array([network.road(road).junction_id is not None for road in track.columns["road_id"]], np.int64)
    begin, size = stays(held(inside, np.zeros_like(inside), max(1, round(_FLICKER / timestep))), np.zeros_like(inside))
    chosen = np.flatnonzero(inside[begin] == 1)
    if not len(chosen):
        raise Unsupported("the roads do not show the way through the junction")
    first, last = begin[chosen], (begin + size)[chosen] - 1
    nearest = int(np.maximum(at[first] - time, time - at[last]).argmin())
    rows = np.arange(first[nearest], last[nearest] + 1)
    if turns:
        turned = np.unwrap(track.columns["h"][rows])
        bends = np.flatnonzero((np.abs(turned - turned[0]) > _BEND) & (np.abs(turned - turned[-1]) > _BEND))
        rows = rows[bends[0] : bends[-1] + 1] if len(bends) else rows
    stands = rows[track.columns["speed"][rows] < _STANDS]
    start = stands[-1] if len(stands) else rows[0]
    return float(at[start]), float(at[min(rows[-1] + 1, len(at) - 1)])


def _continuation(conflict: Conflict, speed: float, end: float) -> SpeedChange:
    """How the other one comes from the conflict point, where it has a speed (m/s), to where it is at the end of the scene (s)."""
    last = min(end, float(conflict.other.columns["time"][-1]))
    duration = last - conflict.time
    if duration < SHORTEST:
        return SpeedChange(speed, SHORTEST)
    way = float(conflict.path.at(last)) - conflict.reach
    return SpeedChange(max(2.0 * way / duration - speed, 0.0), duration)
