"""What a tester reads off a manoeuvre: closing speed, headway, duration, acceleration, with units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from generation.density.roles import EGO, EGO_SPEED, NUISANCES, Role
from generation.search.space import Space
from xodr.array_types import FloatArray

_LEAST = 0.1
"""Least duration (s) and speed (m/s) to divide by"""
_UNITS = {"mps": "m/s", "mps2": "m/s²", "kph": "km/h", "deg": "°"}
"""How units are written that names of parameters end with"""


class Measure(NamedTuple):
    """A measure at some points: its name, its unit, values (n,)."""

    name: str
    unit: str
    values: FloatArray


def measures(space: Space, roles: Mapping[str, Role], theta: FloatArray) -> list[Measure]:
    """The measures of points (n, d): of each actor whose parameters are known in recordings, and all other parameters.

    Args:
        roles: of the parameters that are known in recordings, of pinned ones too: these enter into measures, and are none.
    """
    values = space.by_name(theta)
    roles = {name: role for name, role in roles.items() if name in values}
    metric = {name: values[name] / role.factor for name, role in roles.items()}
    actors = dict.fromkeys(role.actor for role in roles.values())
    found: list[Measure] = []
    for actor in actors:
        of = {role.role: metric[name] for name, role in roles.items() if role.actor == actor}
        others = next((metric[name] for name, role in roles.items() if role.role == EGO_SPEED), None)
        found += _of_actor(of | ({EGO_SPEED: others} if others is not None else {}), actor, len(actors) > 1)
    nuisances = {name for name, role in roles.items() if role.role in NUISANCES}
    ego = next((name for name, role in roles.items() if role.role == EGO_SPEED and name in space.names), None)
    read = set(roles) if found else set(nuisances)
    if ego is not None and found:
        found.append(Measure("speed of the leader" if EGO in actors else "speed of the ego", "m/s", metric[ego]))
    found += [Measure(name, unit_of(name), values[name]) for name in space.names if name not in read]
    return found


def unit_of(name: str) -> str:
    """The unit that a parameter's name ends with, as `Ego_Speed_mps`; empty where it ends with none."""
    last = name.rpartition("_")[2] if "_" in name else ""
    return _UNITS.get(last, last if last in ("m", "s", "percent") else "")


def _of_actor(of: Mapping[str, FloatArray], actor: str, several: bool) -> Iterator[Measure]:
    """Measures of one actor by the roles that are known; the one behind is the ego, or the actor where that is the ego."""
    before = f"{actor}: " if several else ""
    start, end, duration = (of.get(role) for role in ("start_speed", "end_speed", "duration"))
    behind, ahead = (start, of.get(EGO_SPEED)) if actor == EGO else (of.get(EGO_SPEED), start)
    if behind is not None and ahead is not None:
        yield Measure(f"{before}closing speed", "m/s", behind - ahead)
    if "gap" in of:
        headway = None if behind is None else of["gap"] / np.maximum(behind, _LEAST)
        yield Measure(f"{before}gap", "m", of["gap"]) if headway is None else Measure(f"{before}time headway", "s", headway)
    if duration is not None:
        yield Measure(f"{before}duration of the manoeuvre", "s", duration)
        if start is not None and end is not None:
            yield Measure(f"{before}acceleration of {actor or 'the actor'}", "m/s²", (end - start) / np.maximum(duration, _LEAST))
    if end is not None and "final_speed" in of:
        yield Measure(f"{before}change of speed afterwards", "m/s", of["final_speed"] - end)
