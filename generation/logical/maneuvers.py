"""The manoeuvres of the logical scenarios: who does what, and where that makes sense."""

from __future__ import annotations

from dataclasses import dataclass

from generation.logical.geometries import Limits
from generation.units.unit import BRAKING, CUT_IN, CUT_OUT, LANE_CHANGE

EGO = "Ego"


@dataclass(frozen=True)
class Maneuver:
    """A manoeuvre of an actor near the ego, or of the ego behind a leader.

    Attributes:
        words: what happens.
        actor: whose parameters the seven are.
        leader: who is ahead of the ego when it begins.
        ego_lane, leader_lane: "left" or "right" of the geometry's lanes, where the ego and the leader are at the beginning.
        change: lanes to the left that the actor changes: +1, −1, or 0 for none.
        kind: of recorded units that are such manoeuvres (`generation.units.KINDS`).
        geometries: where it makes sense.
        braking: limits of the speeds at and after the end, m/s, where the actor slows down whatever the road.
        ahead: who is ahead of the leader in its lane, at a speed of its own.
        beside: who is beside the leader in the other lane, with its speeds.
        turns: whether the leader turns off afterwards.
    """

    words: str
    actor: str
    leader: str
    ego_lane: str
    leader_lane: str
    change: int
    kind: str
    geometries: tuple[str, ...]
    braking: Limits | None = None
    ahead: str | None = None
    beside: str | None = None
    turns: bool = False


JUNCTIONS = ("four_way_intersection", "t_junction")
EVERYWHERE = ("highway", "sharp_curve", "narrow_road", *JUNCTIONS)
MANEUVERS = {
    "cut_in": Maneuver(
        "A vehicle cuts in from the left in front of the ego",
        "CutIn", "CutIn", "right", "left", -1, CUT_IN, EVERYWHERE,
    ),
    "cut_out": Maneuver(
        "The ego's leader leaves its lane to the left, in front of a slower vehicle",
        "CutOut", "CutOut", "right", "right", 1, CUT_OUT, EVERYWHERE, ahead="Slow",
    ),
    "lane_change_left": Maneuver(
        "The ego changes to the left behind a leader",
        EGO, "Lead", "right", "right", 1, LANE_CHANGE, EVERYWHERE,
    ),
    "lane_change_right": Maneuver(
        "The ego changes to the right behind a leader",
        EGO, "Lead", "left", "left", -1, LANE_CHANGE, EVERYWHERE,
    ),
    "congestion": Maneuver(
        "The ego's leader brakes at the end of a queue that fills both lanes",
        "Lead", "Lead", "right", "right", 0, BRAKING, EVERYWHERE, braking=(0.0, 10.0), beside="Queue",
    ),
    "merging": Maneuver(
        "A vehicle merges in front of the ego",
        "Merging", "Merging", "left", "right", 1, CUT_IN, ("on_ramp",),
    ),
    "diverging": Maneuver(
        "The ego's leader leaves the motorway",
        "Diverging", "Diverging", "left", "left", -1, CUT_OUT, ("off_ramp",),
    ),
    "turn_off": Maneuver(
        "The ego's leader brakes and turns off to the right",
        "TurnOff", "TurnOff", "right", "right", 0, BRAKING, JUNCTIONS, braking=(2.0, 8.0), turns=True,
    ),
}  # fmt: skip
"""Manoeuvres by name."""
