"""Readings of parameters that have roles, and limits of foreseeable manoeuvres."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from generation.density.roles import BEHIND, EGO, EGO_SPEED, Role
from recognition.maneuvers.parameters import JERK
from schemas.common.array_types import BoolArray, FloatArray

QUANTILE = 0.999
"""Share of the recorded units that keep within a limit, of each quantity."""
LANE = 3.5
"""Width (m) that the lateral acceleration of lane changes is worked out for"""
_BRIEF = 1.0
"""Rest times (s) that are shorter say nothing of an acceleration: differences of speeds are as large as their errors"""

ByRole = Mapping[str, FloatArray]
"""Values (n,) by the names of their roles, in SI units; roles that are not known are missing."""


def quantities(values: ByRole) -> dict[str, FloatArray]:
    """Deceleration, acceleration, jerk and lateral acceleration (n,), those that follow from the roles that are known.

    m/s², jerk m/s³: the change from the mean acceleration of the manoeuvre to that of what follows, over the time between their
    middles; the jerk at the onset is a parameter of its own. 0 where nothing can be said.
    """
    found: dict[str, FloatArray] = {"jerk at the onset": values[JERK]} if JERK in values else {}
    duration = values.get("duration")
    phases = []
    if duration is not None:
        found["lateral acceleration"] = 0.5 * np.pi**2 * LANE / np.square(duration)
        if {"start_speed", "end_speed"} <= values.keys():
            phases.append((values["end_speed"] - values["start_speed"]) / duration)
    if {"end_speed", "final_speed", "rest_time"} <= values.keys():
        rest = values["rest_time"]
        phases.append(np.where(rest >= _BRIEF, (values["final_speed"] - values["end_speed"]) / np.maximum(rest, _BRIEF), 0.0))
        if duration is not None and len(phases) == 2:
            found["jerk"] = np.where(rest >= _BRIEF, np.abs(phases[1] - phases[0]) / (0.5 * (duration + rest)), 0.0)
    if phases:
        found["deceleration"] = np.max([-each for each in phases], axis=0)
        found["acceleration"] = np.max(phases, axis=0)
    return found


@dataclass(frozen=True)
class LeastGap:
    """The gap that a follower keeps at least, which grows with the speed.

    Attributes:
        gap, speed: names of the two parameters.
        headway: gap by speed that all but 0.1 % of recorded followers keep.
    """

    gap: str
    speed: str
    headway: float

    @classmethod
    def of(cls, values: Mapping[str, FloatArray], roles: Mapping[str, Role]) -> LeastGap | None:
        """Fit to recorded values (n,) by parameter; None without a follower."""
        names = {role.role: name for name, role in roles.items() if name in values}
        if not {BEHIND, EGO_SPEED} <= names.keys():
            return None
        gap, speed = names[BEHIND], names[EGO_SPEED]
        moving = values[speed] > 0.0
        if not moving.any():
            return None
        return cls(gap, speed, float(np.quantile(values[gap][moving] / values[speed][moving], 1.0 - QUANTILE)))

    def at(self, values: Mapping[str, FloatArray]) -> FloatArray:
        """The least gap (n,)."""
        return self.headway * values[self.speed]


@dataclass(frozen=True)
class Limits:
    """Greatest values of `quantities`.

    Attributes:
        most: by the name of the quantity.
    """

    most: Mapping[str, float]

    @classmethod
    def of(cls, values: ByRole) -> Limits:
        """Return the limits that all but 0.1 % of recorded units keep."""
        return cls({name: float(np.quantile(each, QUANTILE)) for name, each in quantities(values).items()})

    def kept(self, values: ByRole) -> BoolArray:
        """Whether each is within them (n,)."""
        found = quantities(values)
        n = len(next(iter(values.values()), np.zeros(0)))
        within = [found[name] <= most for name, most in self.most.items() if name in found]
        return np.all(within, axis=0) if within else np.ones(n, bool)


LEAST = 0.1
"""Least duration (s) and speed (m/s) to divide by"""


class Reading(NamedTuple):
    """Values (n,) in SI units; None where a role that they take is not known.

    Attributes:
        closing: how much faster the one behind is than the one ahead, m/s. headway: time headway of the one behind, s.
        ego: speed of the vehicle that is not the actor, m/s.
    """

    closing: FloatArray | None
    headway: FloatArray | None
    ego: FloatArray | None


def by_actor(values: Mapping[str, FloatArray], roles: Mapping[str, Role]) -> dict[str, dict[str, FloatArray]]:
    """Values (n,) in SI units by role for each actor, with the speed of the vehicle that is not an actor in all of them.

    Args:
        values: by parameter. roles: of parameters; those without values are left out.
    """
    found: dict[str, dict[str, FloatArray]] = {}
    shared: dict[str, FloatArray] = {}
    for name, (actor, role, factor) in roles.items():
        if name in values:
            (shared if role == EGO_SPEED else found.setdefault(actor, {}))[role] = values[name] / factor
    return {actor: of | shared for actor, of in found.items()} or {"": shared}


def reading(of: Mapping[str, FloatArray], actor: str) -> Reading:
    """Read off one actor's values (n,) by role; the one behind is the ego, or the actor where that is the ego."""
    start, other, gap = (of.get(role) for role in ("start_speed", EGO_SPEED, "gap"))
    behind, ahead = (start, other) if actor == EGO else (other, start)
    closing = None if behind is None or ahead is None else behind - ahead
    headway = None if behind is None or gap is None else gap / np.maximum(behind, LEAST)
    return Reading(closing, headway, other)
