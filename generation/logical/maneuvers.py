"""The manoeuvres of the logical scenarios: who does what, and where that makes sense."""

from __future__ import annotations

from dataclasses import dataclass

from generation.logical.geometries import Limits
from recognition.labels import Label
from recognition.maneuvers.unit import BRAKING, CUT_IN, CUT_OUT, LANE_CHANGE

EGO = "Ego"


@dataclass(frozen=True)
class Maneuver:
    """A manoeuvre of an actor near the ego, or of the ego behind a leader.

    Attributes:
        description: what happens.
        actor: whose parameters the seven are.
        leader: who is ahead of the ego when it begins.
        ego_lane, leader_lane: "left" or "right" of the geometry's lanes, where the ego and the leader are at the beginning.
        change: lanes to the left that the actor changes: +1, −1, or 0 for none.
        kind: of recorded units that are such manoeuvres (`recognition.maneuvers.units.KINDS`).
        geometries: where it makes sense.
        label, urban_label: the class of it for the ego on motorways, and elsewhere; None where it is none of the 17.
        braking: limits of the speeds at and after the end, m/s, where the actor slows down whatever the road.
        ahead: who is ahead of the leader in its lane, at a speed of its own.
        beside: who is beside the leader in the other lane, with its speeds.
        turns: whether the leader turns off afterwards.
        jerk: by default, m/s³, of an actor who has one; None for changes of speed with accelerations that jump.
        pace: default speed of the slower one, as a share of the faster one's.
        dense: greatest default speed (m/s) before the manoeuvre, where traffic is dense; None for that of the geometry.
    """

    description: str
    actor: str
    leader: str
    ego_lane: str
    leader_lane: str
    change: int
    kind: str
    geometries: tuple[str, ...]
    label: Label | None = None
    urban_label: Label | None = None
    braking: Limits | None = None
    ahead: str | None = None
    beside: str | None = None
    turns: bool = False
    jerk: float | None = None
    pace: float = 0.85
    dense: float | None = None


JUNCTIONS = ("four_way_intersection", "t_junction")
EVERYWHERE = ("highway", "sharp_curve", "narrow_road", *JUNCTIONS)
MANEUVERS = {
    "free_cruise": Maneuver(
        "The ego drives freely, its leader far ahead slows down a little",
        "Lead", "Lead", "right", "right", 0, BRAKING, ("free_highway",), Label.FREE_CRUISE, pace=1.0,
    ),
    "car_following": Maneuver(
        "The ego follows a leader that slows down a little",
        "Lead", "Lead", "right", "right", 0, BRAKING, ("highway",), Label.CAR_FOLLOWING, pace=1.0,
    ),
    "braking_leader": Maneuver(
        "The ego's leader brakes a little, as suddenly as its jerk says",
        "Lead", "Lead", "right", "right", 0, BRAKING, ("highway",), Label.CAR_FOLLOWING, jerk=3.0, pace=1.0,
    ),
    "cut_in": Maneuver(
        "A vehicle cuts in from the left in front of the ego",
        "CutIn", "CutIn", "right", "left", -1, CUT_IN, EVERYWHERE, Label.CUT_IN, Label.URBAN_CUT_IN,
    ),
    "cut_out": Maneuver(
        "The ego's leader leaves its lane to the left, in front of a slower vehicle",
        "CutOut", "CutOut", "right", "right", 1, CUT_OUT, EVERYWHERE, Label.CUT_OUT, Label.URBAN_CUT_OUT, ahead="Slow",
    ),
    "lane_change_left": Maneuver(
        "The ego changes to the left behind a leader",
        EGO, "Lead", "right", "right", 1, LANE_CHANGE, EVERYWHERE, Label.LANE_CHANGE_LEFT, Label.LANE_CHANGE_LEFT,
    ),
    "lane_change_right": Maneuver(
        "The ego changes to the right behind a leader",
        EGO, "Lead", "left", "left", -1, LANE_CHANGE, EVERYWHERE, Label.LANE_CHANGE_RIGHT, Label.LANE_CHANGE_RIGHT,
    ),
    "congestion": Maneuver(
        "The ego's leader brakes at the end of a queue that fills both lanes",
        "Lead", "Lead", "right", "right", 0, BRAKING, EVERYWHERE, braking=(0.0, 10.0), beside="Queue",
        dense=16.0,
    ),
    "merging": Maneuver(
        "A vehicle merges in front of the ego",
        "Merging", "Merging", "left", "right", 1, CUT_IN, ("on_ramp",), Label.CUT_IN,
    ),
    "diverging": Maneuver(
        "The ego's leader leaves the motorway",
        "Diverging", "Diverging", "left", "left", -1, CUT_OUT, ("off_ramp",), Label.CUT_OUT,
    ),
    "ramp_entering": Maneuver(
        "The ego enters a motorway behind a leader on it",
        EGO, "Lead", "right", "left", 1, LANE_CHANGE, ("on_ramp",), Label.RAMP_ENTERING, pace=1.0,
    ),
    "ramp_exiting": Maneuver(
        "The ego leaves a motorway behind a leader that stays on it",
        EGO, "Lead", "left", "left", -1, LANE_CHANGE, ("exit_lane",), Label.RAMP_EXITING, pace=1.0,
    ),
    "turn_off": Maneuver(
        "The ego's leader brakes and turns off to the right",
        "TurnOff", "TurnOff", "right", "right", 0, BRAKING, JUNCTIONS, braking=(2.0, 8.0), turns=True,
    ),
}  # fmt: skip
"""Manoeuvres by name."""
