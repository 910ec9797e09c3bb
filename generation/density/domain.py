"""Operational domain: the conditions that a system is made for; failures outside of them are not foreseeable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from generation.density.roles import EGO, EGO_SPEED, Role
from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.errors import UsageError, nearest

if TYPE_CHECKING:
    from generation.search.space import Space
    from runner.settings import RunSettings

R157, ROAD = "r157", "road"
R157_SPEED = 130.0 / 3.6
"""Greatest speed (m/s) of an automated lane keeping system: UN Regulation 157 with its 01 series of amendments"""
_FORM = f"{R157}, {ROAD} or NAME=LOW..HIGH is expected, as Ego_Speed_mps=0..36"


@dataclass(frozen=True)
class Domain:
    """Limits of parameters, which hold for what is searched and for what is pinned.

    Attributes:
        limits: least and greatest value by the parameter's name.
    """

    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.limits)

    def holds(self, space: Space, theta: FloatArray) -> BoolArray:
        """Points (n, d) of a space that are within it: (n,)."""
        found, values = np.ones(len(theta), bool), space.by_name(theta)
        for name, (low, high) in self.limits.items():
            found &= (values[name] >= low) & (values[name] <= high)
        return found

    def __str__(self) -> str:
        told = (f"{name} {low:g} to {high:g}" for name, (low, high) in self.limits.items())
        return ", ".join(told) or "not limited"

    @classmethod
    def of(cls, texts: Sequence[str], scenario: Path, space: Space, roles: Mapping[str, Role], run: RunSettings) -> Domain:
        """The domain of texts: `r157`, the ego up to 130 km/h; `road`, the ego up to the greatest speed limit of the scenario's
        roads; or a parameter's range.

        Args:
            roles: of the scenario's parameters, which tell the ego's speed.

        Raises:
            UsageError: a text is of no form, a parameter is not known, roads have no limit, or a pinned value is outside.
            InvalidFile: a road network is malformed.
        """
        found: dict[str, tuple[float, float]] = {}
        values = space.by_name((space.low + space.high)[None] / 2)
        for text in texts:
            for name, (low, high) in _limits(text, scenario, roles, run).items():
                if name not in values:
                    raise UsageError(f"--domain {text}: there is no number {name!r}; {nearest(name, values)}", path=scenario)
                least, most = found.get(name, (low, high))
                found[name] = max(low, least), min(high, most)
                pinned = space.pinned.get(name)
                if pinned is not None and not low <= float(pinned) <= high:
                    raise UsageError(f"--domain {text}: {name} is pinned at {pinned}, outside {low:g} to {high:g}", path=scenario)
        return cls(found)


EVERYWHERE = Domain()
"""The domain without limits"""


def _limits(text: str, scenario: Path, roles: Mapping[str, Role], run: RunSettings) -> dict[str, tuple[float, float]]:
    if text in (R157, ROAD):
        most = R157_SPEED if text == R157 else _speed_limit(scenario, run)
        speeds = {name: role for name, role in roles.items() if _is_ego_speed(role, roles)}
        if not speeds:
            raise UsageError(
                f"--domain {text}: no parameter is known as the ego's speed; NAME=LOW..HIGH limits one", path=scenario
            )
        return {name: (0.0, most * role.factor) for name, role in speeds.items()}
    name, equals, limits = text.partition("=")
    low, dots, high = limits.partition("..")
    try:
        if not (name and equals and dots and float(low) < float(high)):
            raise ValueError
    except ValueError:
        raise UsageError(f"--domain {text!r}: {_FORM}") from None
    return {name: (float(low), float(high))}


def _is_ego_speed(role: Role, roles: Mapping[str, Role]) -> bool:
    """Whether it is the ego's speed: that of the vehicle that is not the actor, unless the ego acts itself."""
    acts = any(each.actor == EGO and each.role == "start_speed" for each in roles.values())
    return role.role in ("start_speed", "end_speed", "final_speed") and role.actor == EGO if acts else role.role == EGO_SPEED


def _speed_limit(scenario: Path, run: RunSettings) -> float:
    """Greatest speed limit (m/s) of the scenario's roads."""
    from runner.interpreter.road_network import load_roads
    from xosc.document import load
    from xosc.resolve import resolve

    network, _ = load_roads(resolve(load(scenario), catalog_path=run.catalog_path), run)
    limits = [record.speed for road in network.roads.values() for record in road.types if record.speed] if network else []
    if not limits:
        raise UsageError("--domain road: its roads have no speed limit", path=scenario)
    return max(limits)
