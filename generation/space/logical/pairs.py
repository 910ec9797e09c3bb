"""Logical scenarios with two adversaries at once: table of pairs, their scenario, recorded units as
its parameters."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from generation.space.density.roles import AHEAD, BEGINS, BEHIND, EGO_SPEED, Role
from generation.space.logical import roads
from generation.space.logical.maneuvers import EGO
from generation.space.logical.roads import GEOMETRIES, ROADS, header, scenario_tags
from recognition.catalogue.writing import storyboard
from recognition.labels import Label
from recognition.labels.maneuvers.parameters import BRAKING, CUT_IN, PARAMETERS, declared_name
from recognition.labels.maneuvers.units import (
    LENGTH,
    MOST_LAG,
    Exposure,
    Followed,
    PairedUnits,
    Samples,
    followed,
    pairs,
)
from schemas.common.array_types import BoolArray, FloatArray
from xosc.document import Document
from xosc.writing import maneuvers
from xosc.writing.maneuvers import Conditions, Reaction
from xosc.writing.tags import Tag


@dataclass(frozen=True)
class AdversaryPart:
    """Part of one of two adversaries.

    Attributes:
        actor: its name. lane: of the geometry's road, where it begins. change: lanes to the left
            that it changes.
        kind: of recorded units that are such manoeuvres.
    """

    actor: str
    lane: int
    change: int
    kind: str


@dataclass(frozen=True)
class Follower:
    """Adversary behind the ego that keeps its distance, as fast as its reaction and its brakes
    allow.

    Attributes:
        actor: its name.
    """

    actor: str


@dataclass(frozen=True)
class Pair:
    """Two adversaries around the ego.

    Attributes:
        description: what happens.
        ego_lane: where the ego drives.
        first: actor ahead of the ego, the nearer of two. second: actor ahead of the first, or
            behind the ego.
    """

    description: str
    ego_lane: int
    first: AdversaryPart
    second: AdversaryPart | Follower

    @property
    def parts(self) -> tuple[AdversaryPart, ...]:
        """Parts ahead of the ego."""
        return (self.first,) if isinstance(self.second, Follower) else (self.first, self.second)

    @property
    def actors(self) -> tuple[str, str]:
        """Names of the two."""
        return self.first.actor, self.second.actor


PAIRS = {
    "cut_in_before_braking_leader": Pair(
        "A vehicle cuts in from the left in front of the ego, behind a leader that brakes",
        -2, AdversaryPart("CutIn", -1, -1, CUT_IN), AdversaryPart("Lead", -2, 0, BRAKING),
    ),
    "squeezed": Pair(
        "Two vehicles cut in in front of the ego, from the left and from the right",
        -2, AdversaryPart("Left", -1, -1, CUT_IN), AdversaryPart("Right", -3, 1, CUT_IN),
    ),
    "merge_beside_tail_gater": Pair(
        "A vehicle merges from the right in front of the ego, behind which a tail-gater drives",
        -2, AdversaryPart("Merging", -3, 1, CUT_IN), Follower("TailGater"),
    ),
}  # fmt: skip
"""By name."""


LEAD_IN = MOST_LAG
"""Time (s) from the scene's start to the beginning of the first manoeuvre"""
BEGIN = "Begin_s"
"""Name of the time from the scene's start to the beginning of the second manoeuvre, after the
actor's name"""
ROLES = ("gap", "start_speed", "end_speed", "duration", "final_speed", "rest_time")
"""The parameters of each of the two, by role"""
_PLACE = GEOMETRIES["highway"]
_EVER = 1000.0
"""A gap (m) that is never exceeded: what the one does may hold up the ego, and the other one acts
all the same"""
_SETTLED = 5.0
"""Time (s) that is played after both manoeuvres"""
REACTION = Reaction(acceleration=3.0, deceleration=7.59, jerk=3.6)
"""Reaction of a follower: it brakes with 0.774 g, as the careful driver of UN Regulation 157 does,
and loses as much speed until then as that driver, who reacts after 0.75 s and needs 0.6 s to full
braking: the jerk is 7.59 / (2 · (0.75 + 0.6 / 2))"""
_FOLLOWED = (0.5, 50.0)
"""Limits of a follower's gap (m)"""
_DEFAULTS = {
    "gap": 15.0,
    "start_speed": 24.0,
    "end_speed": 22.0,
    "duration": 4.0,
    "final_speed": 22.0,
    "rest_time": 4.0,
}


@dataclass(frozen=True)
class PairScenario:
    """Two adversaries on a straight motorway.

    Attributes:
        name: of the scenario. pair: roles of the two.
        without: name of a passive adversary: it keeps its lane, and its speed unless a vehicle
            follows the ego, as a change then ends the scene; a follower of the ego is absent. None
            for none.
    """

    name: str
    pair: Pair
    without: str | None = None

    file = _PLACE.file
    """Name of the road's file in `xodr/library`"""

    @property
    def tags(self) -> list[Tag]:
        """Tags of the scenario."""
        return scenario_tags(
            self.name, self.name.replace("_", " "), Label.CUT_IN, ROADS[self.file].tags, ("car",)
        )

    @property
    def follower(self) -> str | None:
        """Name of the ego's follower; None without one."""
        second = self.pair.second
        return (
            second.actor if isinstance(second, Follower) and self.without != second.actor else None
        )

    def document(self, path: Path, road: str) -> Document:
        """The scenario.

        Args:
            path: the file that it is to become.
            road: the road file, relative to it.
        """
        parts, follower = self.pair.parts, self.follower
        init = {EGO: self._ego(), **{part.actor: self._init(part) for part in parts}}
        if follower is not None:
            init[follower] = self._follow(follower)
        return maneuvers.scenario(
            path,
            header(f"{self.pair.description}, {_PLACE.description}", self.tags),
            road=road,
            entities={name: maneuvers.reference(roads.VEHICLE, "car") for name in init},
            init=init,
            maneuvers=[
                (part.actor, self._maneuver(part))
                for part in parts
                # With a follower the one ahead needs its event, by whose end the scene ends.
                if part.actor != self.without or follower
            ],
            parameters=self._parameters(),
            catalogs={kind: roads.DIRECTORIES[kind] for kind in ("Controller", "Vehicle")},
            stop=self._stop(),
            controllers={EGO: roads.SYSTEM},
        )

    def defaults(self) -> dict[str, float]:
        """Values of the parameters, by the names of their declarations."""
        values = {
            declared_name(part.actor, role): value
            for part in self.pair.parts
            for role, value in _DEFAULTS.items()
        }
        second = self.pair.second
        if isinstance(second, Follower):
            values[declared_name(second.actor, "gap")] = _DEFAULTS["gap"]
        else:
            values[f"{second.actor}_{BEGIN}"] = LEAD_IN + 1.0
        return {**values, f"{EGO}_Speed_mps": 25.0}

    def _parameters(self) -> list[Any]:
        limits = {
            parameter.name: (parameter.low, parameter.high) for parameter in PARAMETERS.values()
        } | {BEGIN: (0.0, LEAD_IN + MOST_LAG)}
        limits |= dict.fromkeys(
            ("StartSpeed_mps", "EndSpeed_mps", "FinalSpeed_mps", "Speed_mps"), _PLACE.speeds
        )
        limits["Gap_m"] = _PLACE.gaps
        declared = [
            (name, value, limits[name.partition("_")[2]]) for name, value in self.defaults().items()
        ]
        if isinstance(self.pair.second, Follower):
            gap = declared_name(self.pair.second.actor, "gap")
            declared = [
                (name, value, _FOLLOWED if name == gap else ends) for name, value, ends in declared
            ]
        return [
            maneuvers.parameter(
                name, "double", value, [[("greaterOrEqual", low), ("lessOrEqual", high)]]
            )
            for name, value, (low, high) in declared
        ]

    # terms

    @cached_property
    def _terms(self) -> dict[str, dict[str, str]]:
        """The parameters of each by role."""
        return {
            part.actor: {role: f"${declared_name(part.actor, role)}" for role in ROLES}
            for part in self.pair.parts
        }

    def _begin(self, part: AdversaryPart) -> str:
        return str(LEAD_IN) if part is self.pair.first else f"${part.actor}_{BEGIN}"

    def _opening(self, part: AdversaryPart) -> str:
        return f"({self._terms[part.actor]['start_speed']} - ${EGO}_Speed_mps)"

    # parts of the scenario

    def _ego(self) -> list[Any]:
        s = (
            f"${{{_PLACE.spot} - ({self._terms[self.pair.first.actor]['gap']} + {LENGTH} + "
            f"${EGO}_Speed_mps * {LEAD_IN})}}"
        )
        place = maneuvers.lane_position(_PLACE.road, self.pair.ego_lane, s)
        return [maneuvers.teleport(place), maneuvers.speed(f"${EGO}_Speed_mps")]

    def _init(self, part: AdversaryPart) -> list[Any]:
        """Return initial actions that give the parameters' gaps once the first manoeuvre begins."""
        # Gaps add up from the ego on, with a length between each two.
        gaps = [
            self._terms[nearer.actor]["gap"]
            for nearer in self.pair.parts[: self.pair.parts.index(part) + 1]
        ]
        ahead = f"{' + '.join(gaps)} + {len(gaps) * LENGTH} - {self._opening(part)} * {LEAD_IN}"
        place = maneuvers.relative_lane_position(
            EGO, part.lane - self.pair.ego_lane, f"${{{ahead}}}"
        )
        return [maneuvers.teleport(place), maneuvers.speed(self._terms[part.actor]["start_speed"])]

    def _follow(self, follower: str) -> list[Any]:
        """Return actions that keep the parameter's gap to the ego at the ego's speed."""
        gap = f"${declared_name(follower, 'gap')}"
        place = maneuvers.relative_lane_position(EGO, 0, f"${{-({gap} + {LENGTH})}}")
        return [
            maneuvers.teleport(place),
            maneuvers.speed(f"${EGO}_Speed_mps"),
            maneuvers.keep_distance(EGO, gap, REACTION),
        ]

    def _maneuver(self, part: AdversaryPart) -> Any:
        actor, begin = part.actor, self._begin(part)
        start = [
            storyboard.started(f"${{{begin}}}"),
            # Always true: the scene has the form of those with one adversary, which wait for a gap.
            storyboard.gap_reached(EGO, actor, f"${{{_EVER}}}"),
        ]
        lanes = part.change if actor != self.without else 0
        terms = self._terms[actor]
        events = storyboard.events(
            f"{actor} changes",
            f"{actor} settles",
            terms | {"rest_time": storyboard.settling(terms)},
            actor,
            lanes,
            start,
            roads.SPEED_SHAPE,
        )
        return maneuvers.maneuver(f"{actor} maneuver", events)

    def _stop(self) -> Conditions:
        """Stop trigger: a collision of the ego, or some time after both manoeuvres."""
        parts = self.pair.parts
        ends = [f"{self._begin(part)} + {self._terms[part.actor]['duration']}" for part in parts]
        # A passive adversary ahead has no event whose end could end the scene.
        last = parts[-1] if parts[-1].actor != self.without else parts[0]
        whole = f"max({', '.join(ends)})" if len(ends) > 1 else ends[0]
        done = storyboard.changed(
            f"{last.actor} changes", f"${{{whole} + {_SETTLED} - ({ends[parts.index(last)]})}}"
        )
        follower = self.follower
        others = [*(part.actor for part in parts), *([follower] if follower is not None else [])]
        collisions = [[maneuvers.collision(EGO, name)] for name in others]
        # A bound by time as well: an actor that is held up never ends its event.
        return [*collisions, [done], [maneuvers.simulation_time(f"${{{whole} + {2 * _SETTLED}}}")]]


_STEP, _AFTER = 0.25, 5.0
"""Time step in which the two are looked at, and for how long after both manoeuvres, s"""
_CROSSED = 0.5
"""Share of a lane change from which one is in the new lane"""


class Alone(NamedTuple):
    """All units of the kind of what an adversary does: values (n,) by parameter, roles of these,
    the recording of each (n,)."""

    values: dict[str, FloatArray]
    roles: dict[str, Role]
    recordings: NDArray[np.str_]


@dataclass(frozen=True, eq=False)
class PairUnits(ABC):
    """Recorded pairs of what two adversaries do.

    Attributes:
        every: all units, of pairs or not.
        first: role of the first one.
    """

    every: Samples
    first: AdversaryPart

    @property
    def parts(self) -> tuple[AdversaryPart, ...]:
        """Parts ahead of the ego."""
        return (self.first,)

    @property
    def alone(self) -> list[Alone]:
        """Parameters of each acting adversary; gap and speed of the ego are
        those of the first one.
        """
        return [_alone(self.every, part, nearest=part is self.first) for part in self.parts]

    @property
    def known(self) -> float:
        """Share of such pairs in recordings whose parameters could be estimated."""
        return float(np.prod([_known(self.every, part.kind) for part in self.parts]))

    @property
    def exposure(self) -> Mapping[str, Exposure]:
        """Exposure of all recordings in which pairs were sought, by their names; none where it is
        not known."""
        return self.every.exposure

    @property
    @abstractmethod
    def kind(self) -> str:
        """Kinds of the units, for people."""

    @property
    @abstractmethod
    def recordings(self) -> NDArray[np.str_]:
        """Recording of each pair (n,)."""

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
        """Return a mask of rows without overlap of vehicles (n,).

        Args:
            values: (n,) of all parameters.
        """


def pair_units(samples: Samples, pair: Pair) -> PairUnits:
    """The pairs among units."""
    second = pair.second
    if isinstance(second, Follower):
        return BehindUnits(samples, pair.first, second, followed(samples, pair.first.kind))
    return AheadUnits(
        samples, pair.first, second, pair.ego_lane, pairs(samples, pair.first.kind, second.kind)
    )


def _known(samples: Samples, kind: str) -> float:
    """Share of the units of a kind whose parameters could be estimated, by the counts of the
    exposure; 1 without these."""
    counted = Exposure.total(samples.exposure.values()).counts.get(kind, 0)
    return float((samples.kinds == kind).sum()) / counted if counted else 1.0


@dataclass(frozen=True, eq=False)
class AheadUnits(PairUnits):
    """Pairs of two actors ahead of the ego.

    Attributes:
        second: role of the second one. ego_lane: where the ego drives. units: the pairs.
    """

    second: AdversaryPart
    ego_lane: int
    units: PairedUnits

    @property
    def kind(self) -> str:
        """Kinds of the two."""
        return f"{self.first.kind} with {self.second.kind}"

    @property
    def parts(self) -> tuple[AdversaryPart, ...]:
        """Parts ahead of the ego."""
        return self.first, self.second

    @property
    def recordings(self) -> NDArray[np.str_]:
        """Recording of each pair (n,)."""
        return self.units.first.recordings

    @property
    def values(self) -> dict[str, FloatArray]:
        """Values (n,) by parameter; both actors have those of the same pair."""
        second = self.second.actor
        values = _acting(self.first.actor, self.units.first) | _acting(second, self.units.second)
        values[declared_name(second, "gap")] = self.units.ahead
        values[f"{second}_{BEGIN}"] = LEAD_IN + self.units.lag
        values[f"{EGO}_Speed_mps"] = self.units.first.ego_speeds
        return values

    @property
    def roles(self) -> dict[str, Role]:
        """Roles of the parameters; when the second one begins is no nuisance, but decides what
        happens."""
        first, second = self.first.actor, self.second.actor
        roles = {
            declared_name(actor, role): Role(actor, role)
            for actor in (first, second)
            for role in ROLES
        }
        roles[declared_name(second, "gap")] = Role(second, AHEAD)
        return {
            **roles,
            f"{second}_{BEGIN}": Role(second, BEGINS),
            f"{EGO}_Speed_mps": Role(first, EGO_SPEED),
        }

    def apart(self, values: Mapping[str, FloatArray]) -> BoolArray:
        """Return a mask of rows without overlap (n,): the two in one lane, and the ego with a
        leader at the start.

        Args:
            values: (n,) of all parameters.
        """
        first, second, ego = self.first.actor, self.second.actor, values[f"{EGO}_Speed_mps"]
        begins = np.full(len(ego), LEAD_IN), values[f"{second}_{BEGIN}"]
        ends = [
            begin + values[declared_name(actor, "duration")]
            for actor, begin in zip((first, second), begins, strict=True)
        ]
        # One clock for all rows, as long as the longest: rows that end before go on at their last
        # speed.
        time = np.arange(0.0, float(np.max(ends, initial=0.0)) + _AFTER, _STEP)
        ways = [
            _way(actor, values, begin, time)
            for actor, begin in zip((first, second), begins, strict=True)
        ]
        speeds = [values[declared_name(actor, "start_speed")] for actor in (first, second)]
        # At the scene's start: the parameter is the gap when the first manoeuvre begins.
        gap = values[declared_name(second, "gap")] - (speeds[1] - speeds[0]) * LEAD_IN
        # From then on both are in one lane, where they can overlap.
        together = np.maximum(
            *(begin + _CROSSED * (end - begin) for begin, end in zip(begins, ends, strict=True))
        )
        # A second one that keeps its lane is in it from the start.
        if not self.second.change:
            together = begins[0] + _CROSSED * (ends[0] - begins[0])
        kept = np.all((gap[:, None] + ways[1] - ways[0] > 0.0) | (time < together[:, None]), axis=1)
        # A leader is in the ego's lane from the start, before the first one has cut in between.
        if self.second.lane == self.ego_lane:
            leading = (
                values[declared_name(first, "gap")] + LENGTH + values[declared_name(second, "gap")]
            )
            kept &= leading - (speeds[1] - ego) * LEAD_IN > 0.0
        return kept


@dataclass(frozen=True, eq=False)
class BehindUnits(PairUnits):
    """Pairs of an actor ahead of the ego and a follower of it.

    Attributes:
        second: follower. units: units of the first one, with the gap of the second one behind the
            ego.
    """

    second: Follower
    units: Followed

    @property
    def kind(self) -> str:
        """The first one's."""
        return f"{self.first.kind} before one who is followed"

    @property
    def recordings(self) -> NDArray[np.str_]:
        """Recording of each pair (n,)."""
        return self.units.units.recordings

    @property
    def values(self) -> dict[str, FloatArray]:
        """Values (n,) by parameter."""
        values = _acting(self.first.actor, self.units.units)
        values[declared_name(self.second.actor, "gap")] = self.units.behind
        return {**values, f"{EGO}_Speed_mps": self.units.units.ego_speeds}

    @property
    def roles(self) -> dict[str, Role]:
        """Roles of the parameters."""
        first, second = self.first.actor, self.second.actor
        roles = {declared_name(first, role): Role(first, role) for role in ROLES}
        return {
            **roles,
            declared_name(second, "gap"): Role(second, BEHIND),
            f"{EGO}_Speed_mps": Role(first, EGO_SPEED),
        }

    def apart(self, values: Mapping[str, FloatArray]) -> BoolArray:
        """Mask of rows in which one adversary is ahead of the ego and the other one behind: here
        all."""
        return np.ones(len(values[f"{EGO}_Speed_mps"]), bool)


def _alone(every: Samples, part: AdversaryPart, nearest: bool) -> Alone:
    units = every.of_kind(part.kind)
    values = _acting(part.actor, units)
    roles = {declared_name(part.actor, role): Role(part.actor, role) for role in ROLES}
    if nearest:
        values[f"{EGO}_Speed_mps"], roles[f"{EGO}_Speed_mps"] = (
            units.ego_speeds,
            Role(part.actor, EGO_SPEED),
        )
    else:
        del values[declared_name(part.actor, "gap")], roles[declared_name(part.actor, "gap")]
    return Alone(values, roles, units.recordings)


def _acting(actor: str, samples: Samples) -> dict[str, FloatArray]:
    """Values (n,) of the parameters of one actor."""
    table = dict(zip(PARAMETERS, samples.theta.T, strict=True))
    return {declared_name(actor, role): table[role] for role in ROLES}


def _way(
    actor: str, values: Mapping[str, FloatArray], begin: FloatArray, time: FloatArray
) -> FloatArray:
    """Return the distance (n, k) of an actor at times (k,): constant speed, then two consecutive
    changes of speed."""
    duration, rest = (values[declared_name(actor, role)] for role in ("duration", "rest_time"))
    speeds = [
        values[declared_name(actor, role)] for role in ("start_speed", "end_speed", "final_speed")
    ]
    change, settle = (
        # By lines: overlap is a matter of metres, which half cosines do not change.
        np.clip((time - start[:, None]) / np.maximum(length, _STEP)[:, None], 0.0, 1.0)
        for start, length in ((begin, duration), (begin + duration, rest))
    )
    speed = (
        speeds[0][:, None]
        + change * (speeds[1] - speeds[0])[:, None]
        + settle * (speeds[2] - speeds[1])[:, None]
    )
    # Trapezoidal rule: the sum counts the first and the last speed in full.
    return np.cumsum(speed, axis=1) * _STEP - 0.5 * _STEP * (speed + speed[:, :1])
