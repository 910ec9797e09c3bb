"""The parameters that scenarios with a manoeuvre declare: the seven with their ranges, and what follows from them."""

from __future__ import annotations

import math
from typing import Any

from recognition.maneuvers.events.maneuver import LONGEST, Maneuver
from recognition.maneuvers.parameters import EGO_SPEED, OTHER_SPEED, PARAMETERS
from recognition.maneuvers.scenario import terms
from xosc import maneuvers
from xosc.versions import Version

GAP, START_SPEED, START_TIME, END_SPEED, DURATION, FINAL_SPEED, REST_TIME = (each.name for each in PARAMETERS.values())
RANGES = {each.name: (each.low, each.high) for each in PARAMETERS.values()}
"""Ranges of the parameters (m, m/s, s); a recorded value beyond widens its range"""
ONWARDS = "OtherFinalSpeed_mps"
"""Speed of the other one in a passage at the end of the scene"""
BEGIN = "Begin_s"
"""When a manoeuvre begins: at the start time, or sooner where that is longer than everyone can keep a speed until then"""
TRIGGER_GAP = "TriggerGap_m"
"""The longest gap at which the manoeuvre begins"""

_IN_TOWN = (0.0, 15.0)
"""Speeds of passages, m/s"""


def values(maneuver: Maneuver) -> dict[str, float]:
    """The parameters that the manoeuvre has, with their recorded values."""
    return {name: round(value, 3) for name, value in maneuver.values.named.items()}


def passive(maneuver: Maneuver) -> str:
    """Name of the speed of the one who is not the actor."""
    return OTHER_SPEED if maneuver.ego_acts else EGO_SPEED


def declarations(maneuver: Maneuver, version: Version) -> list[Any]:
    """Declarations of the seven, with their ranges, and of what else the scenario uses."""
    declared = []
    for name, value in values(maneuver).items():
        low, high = _range(name, maneuver)
        limits = ("greaterOrEqual", min(low, value)), ("lessOrEqual", max(high, value))
        declared.append(maneuvers.parameter(name, "double", value, [limits]))
    if maneuver.other is not None:
        declared.append(maneuvers.parameter(passive(maneuver), "double", round(maneuver.speed, 3)))
    if maneuver.passage is not None and maneuver.passage.continuation is not None:
        declared.append(maneuvers.parameter(ONWARDS, "double", round(maneuver.passage.continuation.speed, 3)))
    if maneuver.other is not None:
        opening = _opening(maneuver) if maneuver.kind != "passage" else None
        longest = terms.trigger_gap(f"${GAP}", opening, version)
        declared.append(maneuvers.parameter(TRIGGER_GAP, "double", f"${{{longest}}}"))
    return [*declared, maneuvers.parameter(BEGIN, "double", f"${{{_begin(maneuver, version)}}}")]


def _range(name: str, maneuver: Maneuver) -> tuple[float, float]:
    passage = maneuver.passage
    if maneuver.kind == "passage" and name in (START_SPEED, END_SPEED, FINAL_SPEED):
        return _IN_TOWN
    low, high = RANGES[name]
    if passage is not None and passage.conflict is not None and name == GAP:  # no farther than where its way begins
        return low, min(high, math.floor(passage.conflict.reach * 1e3) / 1e3)
    return low, high


def _begin(maneuver: Maneuver, version: Version) -> str:
    """The start time, no longer than everyone can keep a speed until the manoeuvre: the same as `Maneuver.delay`."""
    begin, passage = f"${START_TIME}", maneuver.passage
    if maneuver.approach < LONGEST:
        begin = terms.lesser(begin, f"{maneuver.approach:.3f}", version)
    if maneuver.in_one_lane:
        begin = terms.approach(begin, f"${GAP}", _opening(maneuver), version)
    if passage is not None:
        begin = terms.lesser(begin, f"{passage.begin:.3f} / (${START_SPEED} + {terms.STILL})", version)
        if passage.conflict is not None:
            reached = f"({passage.conflict.reach:.3f} - ${GAP}) / (${OTHER_SPEED} + {terms.STILL})"
            begin = terms.lesser(begin, reached, version)
    return begin


def _opening(maneuver: Maneuver) -> str:
    """Speed by which leader and ego move apart."""
    return f"(${OTHER_SPEED} - ${START_SPEED})" if maneuver.ego_acts else f"(${START_SPEED} - ${EGO_SPEED})"
