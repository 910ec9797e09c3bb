"""What a tester reads off a manoeuvre when it begins: who comes how much faster, how far apart in time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from generation.density.roles import EGO, EGO_SPEED, Role
from xodr.array_types import FloatArray

LEAST = 0.1
"""Least duration (s) and speed (m/s) to divide by"""


class Reading(NamedTuple):
    """Values (n,) in SI units; None where a role that they take is not known.

    Attributes:
        closing: how much faster the one behind is than the one ahead, m/s. headway: time headway of the one behind, s.
        ego: speed of the one who is not the actor, m/s.
    """

    closing: FloatArray | None
    headway: FloatArray | None
    ego: FloatArray | None


def by_actor(values: Mapping[str, FloatArray], roles: Mapping[str, Role]) -> dict[str, dict[str, FloatArray]]:
    """Values (n,) in SI units by role for each actor, with the speed of the one who is not an actor in all of them.

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
