"""Recorded pairs of units as values of the parameters of `generation.logical.pairs.scenario`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from generation.density.roles import AHEAD, BEGINS, BEHIND, EGO_SPEED, Role
from generation.logical.maneuvers import EGO
from generation.logical.pairs.scenario import BEGIN, LEAD_IN, ROLES
from generation.logical.pairs.table import Follower, Pair, Part
from recognition.maneuvers.parameters import PARAMETERS, declared_name
from recognition.maneuvers.units.exposure import Exposure
from recognition.maneuvers.units.pairs import LENGTH, Followed, Pairs, followed, pairs
from recognition.maneuvers.units.samples import Samples
from xodr.array_types import BoolArray, FloatArray

_STEP, _AFTER = 0.25, 5.0
"""Time step in which the two are looked at, and for how long after both manoeuvres, s"""
_CROSSED = 0.5
"""Share of a lane change from which one is in the new lane"""


class Alone(NamedTuple):
    """All units of the kind of what an adversary does: values (n,) by parameter, roles of these, the recording of each (n,)."""

    values: dict[str, FloatArray]
    roles: dict[str, Role]
    recordings: NDArray[np.str_]


@dataclass(frozen=True, eq=False)
class PairUnits(ABC):
    """Recorded pairs of what two adversaries do.

    Attributes:
        every: all units, of pairs or not.
        first: who does what, as the first one.
    """

    every: Samples
    first: Part

    @property
    def parts(self) -> tuple[Part, ...]:
        """What is done ahead of the ego."""
        return (self.first,)

    @property
    def alone(self) -> list[Alone]:
        """Of each adversary who acts; gap and speed of the ego are those of the first one."""
        return [_alone(self.every, part, nearest=part is self.first) for part in self.parts]

    @property
    def known(self) -> float:
        """Share of such pairs in recordings whose parameters could be estimated."""
        return float(np.prod([_known(self.every, part.kind) for part in self.parts]))

    @property
    def exposure(self) -> Mapping[str, Exposure]:
        """Of all recordings that pairs were sought in, by their names; none where it is not known."""
        return self.every.exposure

    @property
    @abstractmethod
    def kind(self) -> str:
        """Kinds of the units, for people."""

    @property
    @abstractmethod
    def recordings(self) -> NDArray[np.str_]:
        """Of each pair (n,)."""

    @property
    @abstractmethod
    def values(self) -> dict[str, FloatArray]:
        """Values (n,) by parameter; both actors have those of the same pair."""

    @property
    @abstractmethod
    def roles(self) -> dict[str, Role]:
        """Roles of the parameters."""

    @abstractmethod
    def apart(self, values: Mapping[str, FloatArray]) -> BoolArray:
        """Where nobody drives through another one (n,).

        Args:
            values: (n,) of all parameters.
        """


def pair_units(samples: Samples, pair: Pair) -> PairUnits:
    """The pairs among units."""
    second = pair.second
    if isinstance(second, Follower):
        return BehindUnits(samples, pair.first, second, followed(samples, pair.first.kind))
    return AheadUnits(samples, pair.first, second, pair.ego_lane, pairs(samples, pair.first.kind, second.kind))


def _known(samples: Samples, kind: str) -> float:
    """Share of the units of a kind whose parameters could be estimated, by the counts of the exposure; 1 without these."""
    counted = Exposure.total(samples.exposure.values()).counts.get(kind, 0)
    return float((samples.kinds == kind).sum()) / counted if counted else 1.0


@dataclass(frozen=True, eq=False)
class AheadUnits(PairUnits):
    """Pairs of two who act ahead of the ego.

    Attributes:
        second: who does what, as the second one. ego_lane: where the ego drives. units: the pairs.
    """

    second: Part
    ego_lane: int
    units: Pairs

    @property
    def kind(self) -> str:
        """Kinds of the two."""
        return f"{self.first.kind} with {self.second.kind}"

    @property
    def parts(self) -> tuple[Part, ...]:
        """What is done ahead of the ego."""
        return self.first, self.second

    @property
    def recordings(self) -> NDArray[np.str_]:
        """Of each pair (n,)."""
        return self.units.first.recordings

    @property
    def values(self) -> dict[str, FloatArray]:
        """Values (n,) by parameter; both actors have those of the same pair."""
        second = self.second.actor
        found = _acting(self.first.actor, self.units.first) | _acting(second, self.units.second)
        found[declared_name(second, "gap")] = self.units.ahead
        found[f"{second}_{BEGIN}"] = LEAD_IN + self.units.lag
        found[f"{EGO}_Speed_mps"] = self.units.first.ego_speeds
        return found

    @property
    def roles(self) -> dict[str, Role]:
        """Roles of the parameters; when the second one begins is no nuisance, but decides what happens."""
        first, second = self.first.actor, self.second.actor
        found = {declared_name(actor, role): Role(actor, role) for actor in (first, second) for role in ROLES}
        found[declared_name(second, "gap")] = Role(second, AHEAD)
        return {**found, f"{second}_{BEGIN}": Role(second, BEGINS), f"{EGO}_Speed_mps": Role(first, EGO_SPEED)}

    def apart(self, values: Mapping[str, FloatArray]) -> BoolArray:
        """Where nobody drives through another one (n,): the two, once they are in one lane, the ego and a leader at the start.

        Args:
            values: (n,) of all parameters.
        """
        first, second, ego = self.first.actor, self.second.actor, values[f"{EGO}_Speed_mps"]
        begins = np.full(len(ego), LEAD_IN), values[f"{second}_{BEGIN}"]
        ends = [begin + values[declared_name(actor, "duration")] for actor, begin in zip((first, second), begins, strict=True)]
        time = np.arange(0.0, float(np.max(ends, initial=0.0)) + _AFTER, _STEP)
        ways = [_way(actor, values, begin, time) for actor, begin in zip((first, second), begins, strict=True)]
        speeds = [values[declared_name(actor, "start_speed")] for actor in (first, second)]
        gap = values[declared_name(second, "gap")] - (speeds[1] - speeds[0]) * LEAD_IN
        together = np.maximum(*(begin + _CROSSED * (end - begin) for begin, end in zip(begins, ends, strict=True)))
        if not self.second.change:
            together = begins[0] + _CROSSED * (ends[0] - begins[0])
        kept = np.all((gap[:, None] + ways[1] - ways[0] > 0.0) | (time < together[:, None]), axis=1)
        if self.second.lane == self.ego_lane:
            leading = values[declared_name(first, "gap")] + LENGTH + values[declared_name(second, "gap")]
            kept &= leading - (speeds[1] - ego) * LEAD_IN > 0.0
        return kept


@dataclass(frozen=True, eq=False)
class BehindUnits(PairUnits):
    """Pairs of one who acts ahead of the ego and one who follows it.

    Attributes:
        second: who follows. units: what the first one does, and how far behind the ego the second one is.
    """

    second: Follower
    units: Followed

    @property
    def kind(self) -> str:
        """The first one's."""
        return f"{self.first.kind} before one who is followed"

    @property
    def recordings(self) -> NDArray[np.str_]:
        """Of each pair (n,)."""
        return self.units.units.recordings

    @property
    def values(self) -> dict[str, FloatArray]:
        """Values (n,) by parameter."""
        found = _acting(self.first.actor, self.units.units)
        found[declared_name(self.second.actor, "gap")] = self.units.behind
        return {**found, f"{EGO}_Speed_mps": self.units.units.ego_speeds}

    @property
    def roles(self) -> dict[str, Role]:
        """Roles of the parameters."""
        first, second = self.first.actor, self.second.actor
        found = {declared_name(first, role): Role(first, role) for role in ROLES}
        return {**found, declared_name(second, "gap"): Role(second, BEHIND), f"{EGO}_Speed_mps": Role(first, EGO_SPEED)}

    def apart(self, values: Mapping[str, FloatArray]) -> BoolArray:
        """Everywhere: one is ahead of the ego, the other one behind."""
        return np.ones(len(values[f"{EGO}_Speed_mps"]), bool)


def _alone(every: Samples, part: Part, nearest: bool) -> Alone:
    units = every.of_kind(part.kind)
    values = _acting(part.actor, units)
    roles = {declared_name(part.actor, role): Role(part.actor, role) for role in ROLES}
    if nearest:
        values[f"{EGO}_Speed_mps"], roles[f"{EGO}_Speed_mps"] = units.ego_speeds, Role(part.actor, EGO_SPEED)
    else:
        del values[declared_name(part.actor, "gap")], roles[declared_name(part.actor, "gap")]
    return Alone(values, roles, units.recordings)


def _acting(actor: str, samples: Samples) -> dict[str, FloatArray]:
    """Values (n,) of the parameters of one who acts."""
    table = dict(zip(PARAMETERS, samples.theta.T, strict=True))
    return {declared_name(actor, role): table[role] for role in ROLES}


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
