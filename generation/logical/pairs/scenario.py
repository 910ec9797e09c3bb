"""How two adversaries become a scenario: six parameters of each who acts, when the second one begins, and the ego's speed.

Everyone keeps its speed until the manoeuvre begins, the first one's `LEAD_IN` seconds after the scene. Gaps hold at that time:
from the ego to the first one, and from the first one to the second, so that no values have the two in each other's place.

One who follows the ego has one parameter: the gap that it keeps, at the ego's speed. `REACTION` says how well it can.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from generation.logical import catalogs
from generation.logical.geometries import GEOMETRIES
from generation.logical.header import header, scenario_tags
from generation.logical.maneuvers import EGO
from generation.logical.pairs.table import Follower, Pair, Part
from generation.logical.roads import ROADS
from recognition.labels import Label
from recognition.maneuvers.parameters import PARAMETERS, declared_name
from recognition.maneuvers.scenario import storyboard
from recognition.maneuvers.units.pairs import LENGTH, MOST_LAG
from xosc import maneuvers
from xosc.document import Document
from xosc.maneuvers import Conditions, Reaction
from xosc.tags import Tag

LEAD_IN = MOST_LAG
"""Time (s) from the scene's start to the beginning of the first manoeuvre"""
BEGIN = "Begin_s"
"""Name of the time from the scene's start to the beginning of the second manoeuvre, after the actor's name"""
ROLES = ("gap", "start_speed", "end_speed", "duration", "final_speed", "rest_time")
"""The parameters of each of the two, by role"""
_PLACE = GEOMETRIES["highway"]
_EVER = 1000.0
"""A gap (m) that is never exceeded: what the one does may hold up the ego, and the other one acts all the same"""
_AFTER = 5.0
"""Time (s) that is played after both manoeuvres"""
REACTION = Reaction(acceleration=3.0, deceleration=7.59, jerk=3.6)
"""What one who follows can do: it brakes with 0.774 g, as the careful driver of UN Regulation 157 does, and loses as much speed
until then as that driver, who reacts after 0.75 s and needs 0.6 s to full braking: the jerk is 7.59 / (2 · (0.75 + 0.6 / 2))"""
_FOLLOWED = (0.5, 50.0)
"""Limits of the gap (m) of one who follows"""
_DEFAULTS = {"gap": 15.0, "start_speed": 24.0, "end_speed": 22.0, "duration": 4.0, "final_speed": 22.0, "rest_time": 4.0}


@dataclass(frozen=True)
class PairScenario:
    """Two adversaries on a straight motorway.

    Attributes:
        name: of the scenario. pair: who does what.
        without: name of an adversary who does nothing instead: it keeps its lane, and its speed unless someone follows the ego,
            as a change then ends the scene; one who would follow the ego is not there. None for none.
    """

    name: str
    pair: Pair
    without: str | None = None

    file = _PLACE.file
    """Name of the road's file in `xodr/library`"""

    @property
    def tags(self) -> list[Tag]:
        """Tags of the scenario."""
        return scenario_tags(self.name, self.name.replace("_", " "), Label.CUT_IN, ROADS[self.file].tags, ("car",))

    @property
    def follower(self) -> str | None:
        """Name of the one who follows the ego; None where nobody does."""
        second = self.pair.second
        return second.actor if isinstance(second, Follower) and self.without != second.actor else None

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
            entities={name: maneuvers.reference(catalogs.VEHICLE, "car") for name in init},
            init=init,
            maneuvers=[(part.actor, self._maneuver(part)) for part in parts if part.actor != self.without or follower],
            parameters=self._parameters(),
            catalogs={kind: catalogs.DIRECTORIES[kind] for kind in ("Controller", "Vehicle")},
            stop=self._stop(),
            controllers={EGO: catalogs.SYSTEM},
        )

    def defaults(self) -> dict[str, float]:
        """Values of the parameters, by the names of their declarations."""
        found = {declared_name(part.actor, role): value for part in self.pair.parts for role, value in _DEFAULTS.items()}
        second = self.pair.second
        if isinstance(second, Follower):
            found[declared_name(second.actor, "gap")] = _DEFAULTS["gap"]
        else:
            found[f"{second.actor}_{BEGIN}"] = LEAD_IN + 1.0
        return {**found, f"{EGO}_Speed_mps": 25.0}

    def _parameters(self) -> list[Any]:
        limits = {each.name: (each.low, each.high) for each in PARAMETERS.values()} | {BEGIN: (0.0, LEAD_IN + MOST_LAG)}
        limits |= dict.fromkeys(("StartSpeed_mps", "EndSpeed_mps", "FinalSpeed_mps", "Speed_mps"), _PLACE.speeds)
        limits["Gap_m"] = _PLACE.gaps
        declared = [(name, value, limits[name.partition("_")[2]]) for name, value in self.defaults().items()]
        if isinstance(self.pair.second, Follower):
            gap = declared_name(self.pair.second.actor, "gap")
            declared = [(name, value, _FOLLOWED if name == gap else ends) for name, value, ends in declared]
        return [
            maneuvers.parameter(name, "double", value, [[("greaterOrEqual", low), ("lessOrEqual", high)]])
            for name, value, (low, high) in declared
        ]

    # terms

    @cached_property
    def _terms(self) -> dict[str, dict[str, str]]:
        """The parameters of each by role."""
        return {part.actor: {role: f"${declared_name(part.actor, role)}" for role in ROLES} for part in self.pair.parts}

    def _begin(self, part: Part) -> str:
        return str(LEAD_IN) if part is self.pair.first else f"${part.actor}_{BEGIN}"

    def _opening(self, part: Part) -> str:
        return f"({self._terms[part.actor]['start_speed']} - ${EGO}_Speed_mps)"

    # parts of the scenario

    def _ego(self) -> list[Any]:
        s = f"${{{_PLACE.spot} - ({self._terms[self.pair.first.actor]['gap']} + {LENGTH} + ${EGO}_Speed_mps * {LEAD_IN})}}"
        place = maneuvers.lane_position(_PLACE.road, self.pair.ego_lane, s)
        return [maneuvers.teleport(place), maneuvers.speed(f"${EGO}_Speed_mps")]

    def _init(self, part: Part) -> list[Any]:
        """Where the gaps are as long as the parameters say once the first one begins."""
        gaps = [self._terms[each.actor]["gap"] for each in self.pair.parts[: self.pair.parts.index(part) + 1]]
        ahead = f"{' + '.join(gaps)} + {len(gaps) * LENGTH} - {self._opening(part)} * {LEAD_IN}"
        place = maneuvers.relative_lane_position(EGO, part.lane - self.pair.ego_lane, f"${{{ahead}}}")
        return [maneuvers.teleport(place), maneuvers.speed(self._terms[part.actor]["start_speed"])]

    def _follow(self, follower: str) -> list[Any]:
        """Where its gap to the ego is as long as the parameter says, as fast as the ego, and from then on keeping that."""
        gap = f"${declared_name(follower, 'gap')}"
        place = maneuvers.relative_lane_position(EGO, 0, f"${{-({gap} + {LENGTH})}}")
        return [maneuvers.teleport(place), maneuvers.speed(f"${EGO}_Speed_mps"), maneuvers.keep_distance(EGO, gap, REACTION)]

    def _maneuver(self, part: Part) -> Any:
        actor, begin = part.actor, self._begin(part)
        start = [storyboard.started(f"${{{begin}}}"), storyboard.gap_reached(EGO, actor, f"${{{_EVER}}}")]
        lanes = part.change if actor != self.without else 0
        events = storyboard.events(f"{actor} changes", f"{actor} settles", self._terms[actor], actor, lanes, start)
        return maneuvers.maneuver(f"{actor} maneuver", events)

    def _stop(self) -> Conditions:
        """At a collision of the ego, or some time after both manoeuvres."""
        parts = self.pair.parts
        ends = [f"{self._begin(part)} + {self._terms[part.actor]['duration']}" for part in parts]
        last = parts[-1] if parts[-1].actor != self.without else parts[0]
        whole = f"max({', '.join(ends)})" if len(ends) > 1 else ends[0]
        done = storyboard.changed(f"{last.actor} changes", f"${{{whole} + {_AFTER} - ({ends[parts.index(last)]})}}")
        follower = self.follower
        others = [*(part.actor for part in parts), *([follower] if follower is not None else [])]
        collisions = [[maneuvers.collision(EGO, name)] for name in others]
        return [*collisions, [done], [maneuvers.simulation_time(f"${{{whole} + {2 * _AFTER}}}")]]
