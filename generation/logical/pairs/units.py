"""Recorded pairs of units as values of the parameters of `generation.logical.pairs.scenario`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from generation.density.roles import AHEAD, BEGINS, EGO_SPEED, Role
from generation.logical.maneuvers import EGO
from generation.logical.pairs.scenario import BEGIN, LEAD_IN, ROLES
from generation.logical.pairs.table import Pair
from recognition.maneuvers.parameters import PARAMETERS, declared_name
from recognition.maneuvers.units.pairs import LENGTH, Pairs
from xodr.array_types import BoolArray, FloatArray

_STEP, _AFTER = 0.25, 5.0
"""Time step in which the two are looked at, and for how long after both manoeuvres, s"""
_CROSSED = 0.5
"""Share of a lane change from which one is in the new lane"""


@dataclass(frozen=True, eq=False)
class PairUnits:
    """Recorded pairs of what two adversaries do.

    Attributes:
        pair: who does what. units: the pairs.
    """

    pair: Pair
    units: Pairs

    @property
    def values(self) -> dict[str, FloatArray]:
        """Values (n,) by parameter; both actors have those of the same pair."""
        first, second = self.pair.first.actor, self.pair.second.actor
        found: dict[str, FloatArray] = {}
        for actor, samples in ((first, self.units.first), (second, self.units.second)):
            table = dict(zip(PARAMETERS, samples.theta.T, strict=True))
            found |= {declared_name(actor, role): table[role] for role in ROLES}
        found[declared_name(second, "gap")] = self.units.ahead
        found[f"{second}_{BEGIN}"] = LEAD_IN + self.units.lag
        found[f"{EGO}_Speed_mps"] = self.units.first.ego_speeds
        return found

    @property
    def roles(self) -> dict[str, Role]:
        """Roles of the parameters; when the second one begins is no nuisance, but decides what happens."""
        first, second = self.pair.first.actor, self.pair.second.actor
        found = {declared_name(actor, role): Role(actor, role) for actor in (first, second) for role in ROLES}
        found[declared_name(second, "gap")] = Role(second, AHEAD)
        return {**found, f"{second}_{BEGIN}": Role(second, BEGINS), f"{EGO}_Speed_mps": Role(first, EGO_SPEED)}

    def apart(self, values: Mapping[str, FloatArray]) -> BoolArray:
        """Where nobody drives through another one (n,): the two, once they are in one lane, the ego and a leader at the start.

        Args:
            values: (n,) of all parameters.
        """
        first, second, ego = self.pair.first.actor, self.pair.second.actor, values[f"{EGO}_Speed_mps"]
        begins = np.full(len(ego), LEAD_IN), values[f"{second}_{BEGIN}"]
        ends = [begin + values[declared_name(actor, "duration")] for actor, begin in zip((first, second), begins, strict=True)]
        time = np.arange(0.0, float(np.max(ends, initial=0.0)) + _AFTER, _STEP)
        ways = [_way(actor, values, begin, time) for actor, begin in zip((first, second), begins, strict=True)]
        speeds = [values[declared_name(actor, "start_speed")] for actor in (first, second)]
        gap = values[declared_name(second, "gap")] - (speeds[1] - speeds[0]) * LEAD_IN
        together = np.maximum(*(begin + _CROSSED * (end - begin) for begin, end in zip(begins, ends, strict=True)))
        if not self.pair.second.change:
            together = begins[0] + _CROSSED * (ends[0] - begins[0])
        kept = np.all((gap[:, None] + ways[1] - ways[0] > 0.0) | (time < together[:, None]), axis=1)
        if self.pair.second.lane == self.pair.ego_lane:
            leading = values[declared_name(first, "gap")] + LENGTH + values[declared_name(second, "gap")]
            kept &= leading - (speeds[1] - ego) * LEAD_IN > 0.0
        return kept


def _way(actor: str, values: Mapping[str, FloatArray], begin: FloatArray, time: FloatArray) -> FloatArray:
    """How far (n, k) an actor has come at times (k,): constant speed, then two changes of speed one after the other."""
    duration, rest = (values[declared_name(actor, role)] for role in ("duration", "rest_time"))
    speeds = [values[declared_name(actor, role)] for role in ("start_speed", "end_speed", "final_speed")]
    change, settle = (
        np.clip((time - start[:, None]) / np.maximum(length, _STEP)[:, None], 0.0, 1.0)
        for start, length in ((begin, duration), (begin + duration, rest))
    )
    speed = speeds[0][:, None] + change * (speeds[1] - speeds[0])[:, None] + settle * (speeds[2] - speeds[1])[:, None]
    return np.cumsum(speed, axis=1) * _STEP - 0.5 * _STEP * (speed + speed[:, :1])
