"""Manoeuvres in lanes: lane changes, also from and to ramps, cutting in and out, car following and free cruise.

Their parameters are those of a unit (`recognition.maneuvers.units`): a lane change's own, or the stretch that was recognised as
following or cruising. At ramps a manoeuvre has its place: the ego comes to where it was recorded.
"""

from __future__ import annotations

from dataclasses import replace

from recognition.labels.classes import Label
from recognition.labels.scene.leads import ABSENT
from recognition.maneuvers.estimation.estimate import estimate
from recognition.maneuvers.events.maneuver import EGO_ACTS, LONGEST, SHORTEST, Maneuver, Passage, Span
from recognition.maneuvers.events.paths import RecordedPath
from recognition.maneuvers.unit import ACCELERATION, BRAKING, CUT_IN, CUT_OUT, LANE_CHANGE, Unit
from recognition.maneuvers.units.segmentation import Segmentation
from schemas.errors import Unsupported

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


def in_lanes(segmentation: Segmentation, kind: str, ego: str, partner: str | None, span: Span) -> Maneuver:
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


def _lane_change(segmentation: Segmentation, kind: str, actor: int, passive: int, time: float) -> Unit:
    """The unit of the lane change of a track about a time (s)."""
    index = segmentation.nearest_change(actor, time, SHORTEST)
    if index is None:
        raise Unsupported("no lane change was recorded completely then")
    if kind == "lane_change" and passive == ABSENT:
        passive = segmentation.leader(index)
    unit = segmentation.of_change(index, _UNITS[kind], passive)
    if abs(unit.shift) < _SIDEWAYS:
        raise Unsupported(f"the lane change covers {abs(unit.shift):.1f} m sideways only, which does not stand out from drifting")
    return unit


def _kept_lane(segmentation: Segmentation, kind: str, actor: int, passive: int, span: Span) -> Unit:
    """The unit of a track's stretch that was recognised."""
    scene = segmentation.motion.scene
    times = span.start, min(span.end, span.start + LONGEST)
    start, last = (segmentation.motion.row(actor, round((time - scene.begin) / scene.step)) for time in times)
    if start is None or last is None or segmentation.motion.last[start] < last:
        raise Unsupported("the manoeuvre was not recorded completely")
    return segmentation.between(BRAKING if kind == "following" else ACCELERATION, passive, start, last)


def _maneuver(segmentation: Segmentation, kind: str, own: int, unit: Unit) -> Maneuver:
    """The manoeuvre of a unit for an ego, by the index of its track."""
    motion, tracks = segmentation.motion, segmentation.motion.scene.recording.tracks
    names, time = motion.scene.names, motion.scene.time
    found = estimate(motion, unit)
    if found is None and unit.kind == LANE_CHANGE:  # the leader is not ahead of the ego, or was not recorded then
        unit = replace(unit, other=ABSENT)
        found = estimate(motion, unit)
    if found is None:
        raise Unsupported("the other vehicle is not ahead of the ego when the manoeuvre begins, or was not recorded then")
    begin, ego, other, approach = float(time[unit.start]), tracks[names[own]], None, LONGEST
    if not unit.alone:
        other = tracks[names[unit.other if unit.actor == own else unit.actor]]
        row = motion.row(unit.other, int(motion.scene.frame[unit.start]))
        assert row is not None, "the other was recorded then"
        approach = min(LONGEST, begin - float(time[motion.in_lane_since(row)]))
    left = unit.shift > 0.0 if kind in _UNITS else None
    passage = Passage.of(RecordedPath.of(ego), begin) if kind == "ramp" else None
    return Maneuver(kind, ego, other, left, found.values, found.other_speed, begin, approach, passage)
