"""The parameters that scenarios with a manoeuvre declare: the seven with their ranges, and what follows from them."""

from __future__ import annotations

import math
from typing import Any

from recognition.maneuvers.events.maneuver import Maneuver
from recognition.maneuvers.parameters import PARAMETERS
from xosc import maneuvers

GAP, START_SPEED, START_TIME, END_SPEED, DURATION, FINAL_SPEED, REST_TIME = (each.name for each in PARAMETERS.values())
RANGES = {each.name: (each.low, each.high) for each in PARAMETERS.values()}
"""Ranges of the parameters (m, m/s, s); a recorded value beyond widens its range"""
EGO_SPEED, OTHER_SPEED = "EgoSpeed_mps", "OtherSpeed_mps"
"""Speed of the one who is not the actor, by who that is"""
ONWARDS = "OtherFinalSpeed_mps"
"""Speed of the other one in a passage at the end of the scene"""
BEGIN = "Begin_s"
"""When a manoeuvre that has its place begins: after the delay, or sooner where the recorded ways are too short for that"""

_IN_TOWN = (0.0, 15.0)
"""Speeds of passages, m/s"""
_STILL = 0.001
"""Added to speeds (m/s) that are divided by"""


def values(maneuver: Maneuver) -> dict[str, float]:
    """The parameters that the manoeuvre has, with their recorded values."""
    return {name: round(value, 3) for name, value in maneuver.values.named.items()}


def passive(maneuver: Maneuver) -> str:
    """Name of the speed of the one who is not the actor."""
    return OTHER_SPEED if maneuver.ego_acts else EGO_SPEED


def declarations(maneuver: Maneuver) -> list[Any]:
    """Declarations of the seven, with their ranges, and of what else the scenario uses."""
    declared = []
    for name, value in values(maneuver).items():
        low, high = _range(name, maneuver)
        limits = ("greaterOrEqual", min(low, value)), ("lessOrEqual", max(high, value))
        declared.append(maneuvers.parameter(name, "double", value, [limits]))
    if maneuver.other is not None:
        declared.append(maneuvers.parameter(passive(maneuver), "double", round(maneuver.speed, 3)))
    if maneuver.passage is not None:
        if maneuver.passage.onwards is not None:
            declared.append(maneuvers.parameter(ONWARDS, "double", round(maneuver.passage.onwards.speed, 3)))
        declared.append(maneuvers.parameter(BEGIN, "double", f"${{{_begin(maneuver)}}}"))
    return declared


def _range(name: str, maneuver: Maneuver) -> tuple[float, float]:
    passage = maneuver.passage
    if maneuver.kind == "passage" and name in (START_SPEED, END_SPEED, FINAL_SPEED):
        return _IN_TOWN
    low, high = RANGES[name]
    if passage is not None and passage.meeting is not None and name == GAP:  # no farther than where its way begins
        return low, min(high, math.floor(passage.meeting.reach * 1e3) / 1e3)
    return low, high


def _begin(maneuver: Maneuver) -> str:
    """The delay, no longer than both need from where their ways begin."""
    passage = maneuver.passage
    assert passage is not None
    begin = _lesser(f"${START_TIME}", f"{passage.begins:.3f} / (${START_SPEED} + {_STILL})")
    if passage.meeting is None:
        return begin
    return _lesser(begin, f"({passage.meeting.reach:.3f} - ${GAP}) / (${OTHER_SPEED} + {_STILL})")


def _lesser(a: str, b: str) -> str:
    """The lesser of two terms; versions of the standard before 1.3 have no min()."""
    return f"({a} + {b} - sqrt(pow({a} - {b}, 2))) / 2"
