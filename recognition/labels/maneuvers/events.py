"""Manoeuvres in lanes: lane changes, also from and to ramps, cutting in and out, car following and
free cruise.

Their parameters are those of a unit (`recognition.labels.maneuvers.units`): a lane change's own, or
the stretch that was recognised as following or cruising. At ramps a manoeuvre has its place: the
ego comes to where it was recorded."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from recognition.labels.changes import held, stays
from recognition.labels.classes import Label, Rules
from recognition.labels.maneuvers.estimation import Segmentation, estimate, lane_motion
from recognition.labels.maneuvers.maneuver import (
    EGO_ACTS,
    LONGEST,
    SHORTEST,
    ConflictPoint,
    Passage,
    RecordedManeuver,
    RecordedPath,
    Span,
    SpeedChange,
    recorded_speeds,
)
from recognition.labels.maneuvers.parameters import (
    ACCELERATION,
    BRAKING,
    CUT_IN,
    CUT_OUT,
    LANE_CHANGE,
    Unit,
    Values,
)
from recognition.labels.scene import ABSENT, prepare
from recognition.scenes import Site
from runner.recording import Recording, Track
from schemas.common.array_types import FloatArray
from schemas.common.errors import Unsupported
from xodr.graph.network import RoadNetwork

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

KINDS = {
    Label.FREE_CRUISE: "cruise",
    Label.CAR_FOLLOWING: "following",
    Label.CUT_IN: "cut_in",
    Label.URBAN_CUT_IN: "cut_in",
    Label.CUT_OUT: "cut_out",
    Label.URBAN_CUT_OUT: "cut_out",
    Label.LANE_CHANGE_LEFT: "lane_change",
    Label.LANE_CHANGE_RIGHT: "lane_change",
    Label.RAMP_ENTERING: "ramp",
    Label.RAMP_EXITING: "ramp",
}
"""Kinds of manoeuvres of the classes that lanes define."""
_UNITS = {"cut_in": CUT_IN, "cut_out": CUT_OUT, "lane_change": LANE_CHANGE, "ramp": LANE_CHANGE}
"""The kinds of their units, where they are lane changes"""
_SIDEWAYS = 1.0
"""Lateral distance (m) of a lane change, at least"""


def in_lanes(
    segmentation: Segmentation, kind: str, ego: str, partner: str | None, span: Span
) -> RecordedManeuver:
    """The manoeuvre of an event of one of the kinds in `KINDS`; see `Maneuvers.of`.

    Raises:
        Unsupported: what was recorded is no such manoeuvre.
    """
    tracks = segmentation.motion.scene.numbers
    own, other = tracks[ego], tracks.get(partner, ABSENT) if partner is not None else ABSENT
    actor = own if kind in EGO_ACTS else other
    if actor == ABSENT:
        raise Unsupported("the other vehicle is not known")
    passive = other if actor == own else own
    if kind in _UNITS:
        unit = _lane_change(segmentation, kind, actor, passive, span.middle)
    else:
        unit = _kept_lane(segmentation, kind, actor, passive, span)
    return _maneuver(segmentation, kind, own, unit)


def _lane_change(
    segmentation: Segmentation, kind: str, actor: int, passive: int, time: float
) -> Unit:
    """The unit of the lane change of a track about a time (s)."""
    index = segmentation.nearest_change(actor, time, SHORTEST)
    if index is None:
        raise Unsupported("no lane change was recorded completely then")
    if kind == "lane_change" and passive == ABSENT:
        passive = segmentation.leader(index)
    unit = segmentation.of_change(index, _UNITS[kind], passive)
    if abs(unit.shift) < _SIDEWAYS:
        raise Unsupported(
            f"the lane change covers {abs(unit.shift):.1f} m sideways only, which does not stand "
            "out from drifting"
        )
    return unit


def _kept_lane(segmentation: Segmentation, kind: str, actor: int, passive: int, span: Span) -> Unit:
    """The unit of a track's stretch that was recognised."""
    scene = segmentation.motion.scene
    # The parameters reach `LONGEST` at most: of longer following the first part is the manoeuvre.
    times = span.start, min(span.end, span.start + LONGEST)
    start, last = (
        segmentation.motion.row(actor, round((time - scene.begin) / scene.step)) for time in times
    )
    if start is None or last is None or segmentation.motion.last[start] < last:
        raise Unsupported("the manoeuvre was not recorded completely")
    return segmentation.between(
        BRAKING if kind == "following" else ACCELERATION, passive, start, last
    )


def _maneuver(segmentation: Segmentation, kind: str, own: int, unit: Unit) -> RecordedManeuver:
    """The manoeuvre of a unit for an ego, by the index of its track."""
    motion, tracks = segmentation.motion, segmentation.motion.scene.recording.tracks
    names, time = motion.scene.names, motion.scene.time
    found = estimate(motion, unit)
    if (
        found is None and unit.kind == LANE_CHANGE
    ):  # the leader is not ahead of the ego, or was not recorded then
        unit = replace(unit, other=ABSENT)
        found = estimate(motion, unit)
    if found is None:
        raise Unsupported(
            "the other vehicle is not ahead of the ego when the manoeuvre begins, or was not "
            "recorded then"
        )
    begin, ego, other, approach = float(time[unit.start]), tracks[names[own]], None, LONGEST
    if not unit.alone:
        other = tracks[names[unit.other if unit.actor == own else unit.actor]]
        row = motion.row(unit.other, int(motion.scene.frame[unit.start]))
        assert row is not None, "the other was recorded then"
        # Before that the other vehicle was in another lane: the scene must not start earlier.
        approach = min(LONGEST, begin - float(time[motion.in_lane_since(row)]))
    left = unit.shift > 0.0 if kind in _UNITS else None
    passage = Passage.of(RecordedPath.of(ego), begin) if kind == "ramp" else None
    return RecordedManeuver(
        kind, ego, other, left, found.values, found.other_speed, begin, approach, passage
    )


_SAME = 1.0
"""Ways that come closer than this meet, m"""
_BESIDE = 2.0
"""Distance (m) from the ego's path at the start of the passage below which a vehicle drives
alongside"""
_SOON = 5.0
"""Time (s) between two at one place that is too long for either to mind the other"""
_STEP = 0.25
"""Distance (m) of the points of the ego's way that others are compared with"""


def nearest_conflict(
    recording: Recording, ego: Track, path: RecordedPath, time: float, partner: str | None
) -> ConflictPoint | None:
    """Return the conflict with the least time between the ego and a vehicle whose path meets its
    own from the side.

    Args:
        path: the ego's.
        time: when its passage begins, s; the other one has not reached it yet then.
        partner: partner of the event; None for any participant at the same place up to `_SOON` s
            earlier or later.
    """
    from scipy.spatial import cKDTree

    station = np.arange(0.0, float(path.station[-1]), _STEP)
    points = np.column_stack(
        [np.interp(station, path.station, values) for values in (path.x, path.y)]
    )
    then = np.interp(station, path.station, path.time)
    own = _EgoPath(cKDTree(points), then, time)
    tracks = [recording.tracks[partner]] if partner is not None else list(recording.tracks.values())
    found = [
        one
        for track in tracks
        if track is not ego and track.kind != "miscellaneous" and (one := own.conflict_with(track))
    ]
    least, best = min(found, key=lambda one: (one[0], one[1].other.name), default=(np.inf, None))
    return best if partner is not None or least <= _SOON else None


class _EgoPath:
    """The ego's path, with the times (s) at which it was at its points; and when its passage
    begins."""

    def __init__(self, tree: cKDTree, then: FloatArray, begins: float) -> None:
        self._tree, self._then, self._begins = tree, then, begins

    def conflict_with(self, track: Track) -> tuple[float, ConflictPoint] | None:
        """Return the conflict of a track with the path, and the time between both visits (s); None
        without a conflict."""
        columns = track.columns
        time = columns["time"]
        row = int(np.searchsorted(time, self._begins))
        if self._begins < time[0] or row == len(time):
            return None
        places = np.column_stack([columns["x"][row:], columns["y"][row:]])
        apart, nearest = map(np.asarray, self._tree.query(places, distance_upper_bound=_BESIDE))
        near = np.flatnonzero(
            (apart < _SAME) & (self._then[np.minimum(nearest, len(self._then) - 1)] > self._begins)
        )
        # Beside the ego's path from the start on: it drives alongside and does not come from the
        # side.
        if not len(near) or apart[0] < _BESIDE:
            return None
        first = int(near[0])
        place = row + first
        path = RecordedPath.of(track)
        # Its front is there first, ahead of the reference point.
        reach = float(path.at(time[place])) - track.box.x - 0.5 * track.box.length
        if reach <= path.at(self._begins):
            return None
        x, y = (round(float(columns[axis][place]), 3) for axis in ("x", "y"))
        conflict = ConflictPoint(
            track, path, x, y, reach, float(np.interp(reach, path.station, path.time))
        )
        return abs(float(time[place] - self._then[nearest[first]])), conflict


JUNCTION = (Label.LEFT_TURN, Label.RIGHT_TURN, Label.STRAIGHT_CROSS, Label.MERGING)
"""Classes whose passage is all the way through the junction"""
ROUNDABOUT = (Label.ROUNDABOUT_ENTERING, Label.ROUNDABOUT_EXITING, Label.ROUNDABOUT_CIRCULATING)
"""Classes whose passage is what was recognised: entering and leaving have no other beginning and
end"""
_STANDS = 0.5
"""Speed (m/s) below which a participant stands"""
_BEND = 0.1
"""Change of heading (rad) that is none yet, or left over"""
_FLICKER = 0.5
"""Stays (s) on another road that don't count: where lanes of a junction overlap, rows may jump
between them"""


def passage(
    recording: Recording,
    network: RoadNetwork,
    label: Label,
    ego: str,
    partner: str | None,
    span: Span,
) -> RecordedManeuver:
    """The passage of an event; see `maneuvers.maneuver`.

    Raises:
        Unsupported: it was not recorded completely, no participant moves in it, or the partner had
            passed the conflict point before it began.
    """
    own = recording.tracks[ego]
    start, end = span.start, span.end
    if label in JUNCTION:
        start, end = _inside(
            own,
            network,
            span.middle,
            recording.timestep,
            label in (Label.LEFT_TURN, Label.RIGHT_TURN),
        )
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
        return RecordedManeuver("passage", own, None, None, values, 0.0, start, passage=alone)
    here = float(conflict.path.at(start))
    speed = (conflict.reach - here) / (conflict.time - start)
    delay = min(delay, start - float(conflict.other.columns["time"][0]), here / speed)
    values = Values(conflict.reach - here, speeds[0], delay, speeds[1], duration, speeds[2], rest)
    both = alone._replace(
        conflict=conflict, continuation=_continuation(conflict, speed, end + rest)
    )
    return RecordedManeuver(
        "passage", own, conflict.other, None, values, speed, start, passage=both
    )


def _inside(
    track: Track, network: RoadNetwork, time: float, timestep: float, turns: bool
) -> tuple[float, float]:
    """Return the times at which a track enters and leaves the junction that it is in, or has just
    left, at a time (s).

    A turning vehicle enters where its heading begins to change, and leaves where the change ends. A
    vehicle that stands in the junction enters when it last sets off. For a track that begins or
    ends inside, the recorded times are returned.
    """
    at = track.columns["time"]
    inside = np.array(
        [network.road(road).junction_id is not None for road in track.columns["road_id"]], np.int64
    )
    begin, size = stays(
        held(inside, np.zeros_like(inside), max(1, round(_FLICKER / timestep))),
        np.zeros_like(inside),
    )
    chosen = np.flatnonzero(inside[begin] == 1)
    if not len(chosen):
        raise Unsupported("the roads do not show the way through the junction")
    first, last = begin[chosen], (begin + size)[chosen] - 1
    nearest = int(np.maximum(at[first] - time, time - at[last]).argmin())
    rows = np.arange(first[nearest], last[nearest] + 1)
    if turns:
        turned = np.unwrap(track.columns["h"][rows])
        bends = np.flatnonzero(
            (np.abs(turned - turned[0]) > _BEND) & (np.abs(turned - turned[-1]) > _BEND)
        )
        rows = rows[bends[0] : bends[-1] + 1] if len(bends) else rows
    # Waiting for oncoming traffic inside the junction belongs to the approach.
    stands = rows[track.columns["speed"][rows] < _STANDS]
    start = stands[-1] if len(stands) else rows[0]
    return float(at[start]), float(at[min(rows[-1] + 1, len(at) - 1)])


def _continuation(conflict: ConflictPoint, speed: float, end: float) -> SpeedChange:
    """Return the speed change of the other vehicle from the conflict point (m/s) to its place at
    the end of the scene (s)."""
    last = min(end, float(conflict.other.columns["time"][-1]))
    duration = last - conflict.time
    if duration < SHORTEST:
        return SpeedChange(speed, SHORTEST)
    way = float(conflict.path.at(last)) - conflict.reach
    # Under a constant acceleration the way is the mean of both speeds times the duration.
    return SpeedChange(max(2.0 * way / duration - speed, 0.0), duration)


_USUAL_LIMITS = {
    "town": 13.9,
    "townExpressway": 19.4,
    "townCollector": 13.9,
    "townArterial": 13.9,
    "townLocal": 13.9,
    "rural": 27.8,
}
"""Limits (m/s) of roads whose file gives their type alone"""
_SLOWEST, _FASTEST = 0.3, 1.3
"""Shares of the limit between which speeds vary"""
_TURNING = 15.0
"""Greatest speed of passages, m/s"""


class Maneuvers:
    """The manoeuvres of a recording's events.

    Args:
        site: where it was recorded; its network is the one that the recording's road coordinates
            are on.
    """

    def __init__(self, recording: Recording, site: Site) -> None:
        self._recording, self._site = recording, site

    @cached_property
    def _segmentation(self) -> Segmentation:
        return Segmentation(lane_motion(prepare(self._recording, self._site, Rules())))

    def of(self, label: Label, ego: str, partner: str | None, span: Span) -> RecordedManeuver:
        """The manoeuvre of an event.

        Args:
            partner: partner of the ego in the event.

        Raises:
            Unsupported: the class is none of the 17, or what was recorded is no manoeuvre that the
                parameters describe.
        """
        if label in KINDS:
            found = in_lanes(self._segmentation, KINDS[label], ego, partner, span)
        elif label in JUNCTION or label in ROUNDABOUT:
            found = passage(self._recording, self._site.network, label, ego, partner, span)
        else:
            raise Unsupported(
                "the manoeuvre is unknown: its class, unknown or discovered, is none of the 17"
            )
        return replace(found, speeds=self._speeds(label, found))

    def _speeds(self, label: Label, found: RecordedManeuver) -> tuple[float, float]:
        """Range of speeds (m/s) on the ego's road when the manoeuvre begins: by the limit, else by
        the kind of road."""
        columns = found.ego.columns
        row = min(int(np.searchsorted(columns["time"], found.begin)), len(columns["time"]) - 1)
        road, lane, s = (
            self._site.network.road(str(columns["road_id"][row])),
            int(columns["lane_id"][row]),
            float(columns["s"][row]),
        )
        limit = road.speed_limit(s, lane if lane else None)
        if limit is None:
            town = label in (Label.URBAN_CUT_IN, Label.URBAN_CUT_OUT) or found.kind == "passage"
            limit = _USUAL_LIMITS.get(road.road_type(s), _USUAL_LIMITS["town"] if town else None)
        if limit is None:
            return found.speeds
        most = min(_FASTEST * limit, found.speeds[1])
        # Passages may begin from standstill.
        return (0.0, min(most, _TURNING)) if found.kind == "passage" else (_SLOWEST * limit, most)
