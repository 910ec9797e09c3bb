"""What a tester reads off a manoeuvre: closing speed, headway, duration, acceleration, with units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from generation.density.roles import AHEAD, BEGINS, EGO, EGO_SPEED, NUISANCES, Role
from generation.search.readings import LEAST, by_actor, reading
from generation.search.space import Space
from xodr.array_types import FloatArray

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
    actors = by_actor(values, roles) if roles else {}
    found = [each for actor, of in actors.items() for each in _of_actor(of, actor, len(actors) > 1)]
    nuisances = {name for name, role in roles.items() if role.role in NUISANCES}
    ego = next((name for name, role in roles.items() if role.role == EGO_SPEED and name in space.names), None)
    read = set(roles) if found else set(nuisances)
    if ego is not None and found:
        whose = "leader" if EGO in actors else "ego"
        found.append(Measure(f"speed of the {whose}", "m/s", values[ego] / roles[ego].factor))
    found += [Measure(name, unit_of(name), values[name]) for name in space.names if name not in read]
    return found


def unit_of(name: str) -> str:
    """The unit that a parameter's name ends with, as `Ego_Speed_mps`; empty where it ends with none."""
    last = name.rpartition("_")[2] if "_" in name else ""
    return _UNITS.get(last, last if last in ("m", "s", "percent") else "")


def _of_actor(of: Mapping[str, FloatArray], actor: str, several: bool) -> Iterator[Measure]:
    """Measures of one actor by the roles that are known."""
    before = f"{actor}: " if several else ""
    start, end, duration = (of.get(role) for role in ("start_speed", "end_speed", "duration"))
    read = reading(of, actor)
    if read.closing is not None:
        yield Measure(f"{before}closing speed", "m/s", read.closing)
    if read.headway is not None:
        yield Measure(f"{before}time headway", "s", read.headway)
    elif "gap" in of:
        yield Measure(f"{before}gap", "m", of["gap"])
    if AHEAD in of:
        yield Measure(f"{before}gap to the one before", "m", of[AHEAD])
    if BEGINS in of:
        yield Measure(f"{before}begins at", "s", of[BEGINS])
    if duration is not None:
        yield Measure(f"{before}duration" if several else "duration of the manoeuvre", "s", duration)
        if start is not None and end is not None:
            of_whom = f"{before}acceleration" if several else f"acceleration of {actor or 'the actor'}"
            yield Measure(of_whom, "m/s²", (end - start) / np.maximum(duration, LEAST))
    if end is not None and "final_speed" in of:
        yield Measure(f"{before}change of speed afterwards", "m/s", of["final_speed"] - end)
