"""A manoeuvre's trigger, actions and end, from terms of its parameters: the same in catalogues and in the library."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from recognition.maneuvers.parameters import JERK
from xosc import maneuvers
from xosc.maneuvers import Condition, Conditions, Dynamics

_SHAPE = "sinusoidal"
"""Shape of lane changes over time"""
_PATIENCE = 10.0
"""Time (s) after which a scenario ends whose gap never came, beyond the time that it would have taken"""


def started(delay: str) -> Condition:
    """That the time until the manoeuvre is over.

    Args:
        delay: the time, s; a parameter, or an expression in ${ }.
    """
    return replace(maneuvers.simulation_time(0.0, "greaterOrEqual"), delay=delay)


def gap_reached(follower: str, leader: str, gap: str) -> Condition:
    """That the gap between two is no longer than one (m), along the lane."""
    return maneuvers.relative_distance(follower, leader, gap, "lessOrEqual", coordinates="lane")


def events(
    change: str, settle: str, parameters: Mapping[str, str], actor: str, lanes: int, start: Conditions | list[Condition]
) -> list[Any]:
    """The events of the actor: its change of speed and lane over the duration, then the change to the final speed.

    Args:
        change, settle: names of the two.
        parameters: terms by role (`recognition.maneuvers.parameters.DECLARED`). Where there is a jerk, the acceleration of the
            change builds up and ends by it, which takes the change over the duration that much longer.
        lanes: how many lanes to the left; 0 for none.
        start: the trigger.
    """
    over_time = Dynamics("linear", "time", parameters["duration"])
    actions = [_sped(parameters, over_time)]
    if lanes:
        actions.append(maneuvers.lane_change(lanes, over_time._replace(shape=_SHAPE), relative_to=actor))
    settled = maneuvers.speed(parameters["final_speed"], over_time._replace(value=parameters["rest_time"]))
    changed = maneuvers.element_state("event", change, "completeState")
    return [maneuvers.event(change, actions, start), maneuvers.event(settle, [settled], changed)]


def _sped(parameters: Mapping[str, str], over_time: Dynamics) -> Any:
    """The change to the end speed."""
    if JERK not in parameters:
        return maneuvers.speed(parameters["end_speed"], over_time)
    return maneuvers.speed_profile([(parameters["end_speed"], over_time.value)], "follow", parameters[JERK])


def changed(change: str, after: str) -> Condition:
    """That an event has been complete for a time.

    Args:
        change: its name. after: the time, s; a parameter, or an expression in ${ }.
    """
    return replace(maneuvers.element_state("event", change, "completeState"), delay=after)


def ends(change: str, parameters: Mapping[str, str]) -> list[list[Condition]]:
    """The scene's ends: the rest time after the change, or when the gap never came.

    Args:
        change: name of the event.
        parameters: terms by role.
    """
    times = " + ".join(parameters[role] for role in ("start_time", "duration", "rest_time"))
    return [[changed(change, parameters["rest_time"])], [maneuvers.simulation_time(f"${{{times} + {_PATIENCE}}}")]]
