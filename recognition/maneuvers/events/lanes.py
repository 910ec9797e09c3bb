"""Manoeuvres in lanes: lane changes, also from and to ramps, cutting in and out, car following and free cruise.

A lane change begins and ends where the lateral motion does. At ramps it has its place: the ego comes to where it was recorded.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recognition.datasets.tables.rows import Floats
from recognition.labels.classes import Label
from recognition.maneuvers.events.maneuver import EGO_ACTS, LONGEST, SHORTEST, Maneuver, Passage, Span
from recognition.maneuvers.events.paths import SMOOTHING, RecordedPath, recorded_speeds, speed_at
from recognition.maneuvers.parameters import Values
from runner.measures.relations import Motion, relation
from runner.recording import Recording, Track
from schemas.errors import Unsupported
from xodr.network import RoadNetwork

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
"""Kinds of the classes whose manoeuvre is told by lanes."""
_DRIFT = 0.1
"""Lateral speed (m/s) below which a lane change has not begun yet, or has ended"""
_SIDEWAYS = 1.0
"""Lateral way (m) of a lane change, at least"""
_JUMP = 0.7
"""Lateral way (m) from one row to the next that is no motion: the road's reference line has changed"""
_APART = 1.0
"""Gap (m) at the beginning between those in one lane, at least"""


def in_lanes(recording: Recording, network: RoadNetwork, kind: str, ego: str, partner: str | None, span: Span) -> Maneuver:
    """The manoeuvre of an event of one of the kinds in `KINDS`; see `maneuvers.maneuver`.

    Raises:
        Unsupported: what was recorded is no such manoeuvre.
    """
    own, other = recording.tracks[ego], recording.tracks[partner] if partner is not None else None
    actor = own if kind in EGO_ACTS else other
    if actor is None:
        raise Unsupported("the other vehicle is not known")
    if kind in ("following", "cruise"):
        start, end, left = span.start, min(span.end, span.start + LONGEST), None
    else:
        start, end, left = lane_change(actor, network, span.middle)
    gap = _gap(own, other, start, kind) if other is not None else None
    if gap is None:
        other = None
    first = max(start - LONGEST, *(_in_lane_since(track, start) for track in (own, other) if track is not None))
    last = min(end + LONGEST, float(actor.columns["time"][-1]))
    if not first <= start < end <= last:
        raise Unsupported("the manoeuvre was not recorded whole")
    passive = own if actor is not own else other
    if gap is not None and passive is not None and kind != "cut_in":
        first = max(first, start - _longest_approach(gap, speed_at(own, start), speed_at(other or own, start)))
    speed = _mean_speed(passive, first, start) if passive is not None else 0.0
    duration, passage = max(end - start, SHORTEST), None
    course, counted = RecordedPath.of(actor), start if kind == "ramp" else first
    starting, ending, final = recorded_speeds(actor, course, counted, start, duration, last - end)
    if kind == "ramp":
        passage = Passage.of(course, start)
        first = max(first, start - passage.longest(starting))
    values = Values(gap, starting, start - first, ending, duration, final, last - end)
    return Maneuver(kind, own, other, left, values, speed, first, last, passage)


def lane_change(track: Track, network: RoadNetwork, time: float) -> tuple[float, float, bool]:
    """When the lane change at a time (s) begins and ends, and whether it is to the left.

    Raises:
        Unsupported: there is none that stands out from drifting.
    """
    at, side = track.columns["time"], _sideways(track, network)
    width = max(1, round(SMOOTHING / max(float(np.median(np.diff(at))), 1e-3)))
    rate = np.convolve(np.gradient(side, at), np.full(width, 1.0 / width), "same")
    near = np.flatnonzero(np.abs(at - time) <= SHORTEST)
    left = _to_the_left(track, network, near, time)
    towards = rate if left else -rate
    middle = int(near[towards[near].argmax()])
    still = np.flatnonzero(towards <= _DRIFT)
    before, after = still[still <= middle], still[still >= middle]
    first, last = (before[-1] if len(before) else 0), (after[0] if len(after) else len(at) - 1)
    way = abs(float(side[last] - side[first]))
    if len(_changes(track, np.arange(first, last + 1))) > 1:
        raise Unsupported("the lane change goes on over another lane")
    if way < _SIDEWAYS:
        raise Unsupported(f"the lane change covers {way:.1f} m sideways only, which does not stand out from drifting")
    return float(at[_beside_since(track, network, np.arange(first, middle + 1), left)]), float(at[last]), left


def _beside_since(track: Track, network: RoadNetwork, rows: NDArray[np.int64], left: bool) -> int:
    """The first of some rows from which on there is a lane to the left (or right) of the one that the track is in then.

    Rows in the lane changed to don't count: they have had theirs.
    """
    changed = _changes(track, rows)
    rows = rows[rows < changed[0]] if len(changed) else rows
    columns, side = track.columns, facing(track, network) * (1 if left else -1)
    lacking = [
        row
        for row in rows.tolist()
        if network.road(columns["road_id"][row]).lane_beside(columns["s"][row], int(columns["lane_id"][row]), int(side[row]))
        is None
    ]
    return min(lacking[-1] + 1, int(rows[-1])) if lacking else int(rows[0])


def _to_the_left(track: Track, network: RoadNetwork, rows: NDArray[np.int64], time: float) -> bool:
    """Whether the change of lane ids among some rows that is nearest to a time (s) is to the left.

    Raises:
        Unsupported: there is none on one road.
    """
    changes = _changes(track, rows)
    if not len(changes):
        raise Unsupported("there is no change of lane on one road")
    columns = track.columns
    row = changes[np.abs(columns["time"][changes] - time).argmin()]
    return bool((columns["lane_id"][row] - columns["lane_id"][row - 1]) * facing(track, network)[row] > 0.0)


def _changes(track: Track, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Those of some consecutive rows that are the first ones in another lane of the same road."""
    lane, road = track.columns["lane_id"][rows], track.columns["road_id"][rows]
    return rows[1:][(lane[1:] != lane[:-1]) & (road[1:] == road[:-1])]


def _in_lane_since(track: Track, time: float) -> float:
    """Since when (s) a track has been in the lane that it is in at a time (s)."""
    at = track.columns["time"]
    changes = _changes(track, np.arange(int(np.searchsorted(at, time, side="right"))))
    return float(at[changes[-1]] if len(changes) else at[0])


def _sideways(track: Track, network: RoadNetwork) -> Floats:
    """Way to the left of a track since its beginning (m), along its roads."""
    columns = track.columns
    moved = np.diff(columns["t"]) * facing(track, network)[1:]
    moved[(columns["road_id"][1:] != columns["road_id"][:-1]) | (np.abs(moved) > _JUMP)] = 0.0
    return np.concatenate([[0.0], np.cumsum(moved)])


def facing(track: Track, network: RoadNetwork) -> NDArray[np.float64]:
    """+1 at rows where a track faces increasing s, −1 at the others."""
    columns = track.columns
    places = zip(columns["road_id"], columns["s"].tolist(), strict=True)
    headings = np.array([network.road(road).heading(s) for road, s in places])
    return np.where(np.cos(columns["h"] - headings) >= 0.0, 1.0, -1.0)


def _gap(ego: Track, other: Track, time: float, kind: str) -> float | None:
    """Gap of the boxes (m) as the ego sees it; None where an ego that changes lane has the other one in another lane."""
    rows, _, view = relation(*(Motion.from_columns(track.name, track.box, track.columns) for track in (ego, other)))
    if not len(rows):
        raise Unsupported("the other vehicle was not recorded together with the ego")
    nearest = int(np.abs(ego.columns["time"][rows] - time).argmin())
    gap, aside = float(view.ahead[nearest]), float(view.aside[nearest])
    if kind in EGO_ACTS and (gap <= 0.0 or aside != 0.0):
        return None
    if gap <= 0.0:
        raise Unsupported("the other vehicle is not ahead of the ego when the manoeuvre begins")
    return gap


def _longest_approach(gap: float, ego_speed: float, other_speed: float) -> float:
    """Time (s) that two in one lane can have kept their speeds before they had this gap (m)."""
    opening = other_speed - ego_speed
    return (gap - _APART) / opening if opening * LONGEST > gap - _APART > 0.0 else LONGEST


def _mean_speed(track: Track, start: float, end: float) -> float:
    """Speed (m/s) with which a track would have come from where it was at `start` to where it was at `end` (s)."""
    columns = track.columns
    rows = np.flatnonzero((columns["time"] >= start) & (columns["time"] <= end))
    if end - start < SMOOTHING or len(rows) < 2:
        return speed_at(track, end)
    way = np.hypot(np.diff(columns["x"][rows]), np.diff(columns["y"][rows])).sum()
    return float(way / (columns["time"][rows[-1]] - columns["time"][rows[0]]))
