"""Manoeuvres of the library: table by actor, change and place, and the logical scenario of each."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from generation.space.logical import roads
from generation.space.logical.roads import Geometry, Limits, header, scenario_tags
from recognition.catalogue.writing import storyboard
from recognition.labels import Label
from recognition.labels.maneuvers.parameters import (
    DECLARED,
    JERK,
    PARAMETERS,
    declared_name,
)
from schemas.common.errors import UsageError
from xosc.document import Document
from xosc.writing import maneuvers
from xosc.writing.maneuvers import Conditions, TriggerCondition
from xosc.writing.tags import Tag

EGO = "Ego"


@dataclass(frozen=True)
class LogicalManeuver:
    """A manoeuvre of an actor near the ego, or of the ego behind a leader.

    Attributes:
        description: what happens.
        actor: whose parameters the seven are.
        leader: vehicle ahead of the ego at the start.
        ego_lane, leader_lane: "left" or "right" of the geometry's lanes, where the ego and the
            leader are at the beginning.
        change: lanes to the left that the actor changes: +1, −1, or 0 for none.
        geometries: where it makes sense.
        label, urban_label: the class of it for the ego on motorways, and elsewhere; None where it
            is none of the 17.
        braking: limits of the speeds at and after the end, m/s, where the actor slows down whatever
            the road.
        ahead: vehicle ahead of the leader in its lane, at a speed of its own.
        beside: vehicle beside the leader in the other lane, with its speeds.
        turns: whether the leader turns off afterwards.
        jerk: default (m/s³) of an actor with a jerk; None for changes of speed with discontinuous
            accelerations.
        pace: default speed of the slower one, as a share of the faster one's.
        dense: greatest default speed (m/s) before the manoeuvre, where traffic is dense; None for
            that of the geometry.
    """

    description: str
    actor: str
    leader: str
    ego_lane: str
    leader_lane: str
    change: int
    geometries: tuple[str, ...]
    label: Label | None = None
    urban_label: Label | None = None
    braking: Limits | None = None
    ahead: str | None = None
    beside: str | None = None
    turns: bool = False
    jerk: float | None = None
    pace: float = 0.85
    dense: float | None = None


JUNCTIONS = ("four_way_intersection", "t_junction")
EVERYWHERE = ("highway", "sharp_curve", "narrow_road", *JUNCTIONS)
MANEUVERS = {
    "free_cruise": LogicalManeuver(
        "The ego drives freely, its leader far ahead slows down a little",
        "Lead", "Lead", "right", "right", 0, ("free_highway",), Label.FREE_CRUISE, pace=1.0,
    ),
    "car_following": LogicalManeuver(
        "The ego follows a leader that slows down a little",
        "Lead", "Lead", "right", "right", 0, ("highway",), Label.CAR_FOLLOWING, pace=1.0,
    ),
    "braking_leader": LogicalManeuver(
        "The ego's leader brakes a little, as suddenly as its jerk says",
        "Lead", "Lead", "right", "right", 0, ("highway",), Label.CAR_FOLLOWING, jerk=3.0, pace=1.0,
    ),
    "cut_in": LogicalManeuver(
        "A vehicle cuts in from the left in front of the ego",
        "CutIn", "CutIn", "right", "left", -1, EVERYWHERE, Label.CUT_IN, Label.URBAN_CUT_IN,
    ),
    "cut_out": LogicalManeuver(
        "The ego's leader leaves its lane to the left, in front of a slower vehicle",
        "CutOut", "CutOut", "right", "right", 1, EVERYWHERE, Label.CUT_OUT, Label.URBAN_CUT_OUT,
        ahead="Slow",
    ),
    "lane_change_left": LogicalManeuver(
        "The ego changes to the left behind a leader",
        EGO, "Lead", "right", "right", 1, EVERYWHERE, Label.LANE_CHANGE_LEFT,
        Label.LANE_CHANGE_LEFT,
    ),
    "lane_change_right": LogicalManeuver(
        "The ego changes to the right behind a leader",
        EGO, "Lead", "left", "left", -1, EVERYWHERE, Label.LANE_CHANGE_RIGHT,
        Label.LANE_CHANGE_RIGHT,
    ),
    "congestion": LogicalManeuver(
        "The ego's leader brakes at the end of a queue that fills both lanes",
        "Lead", "Lead", "right", "right", 0, EVERYWHERE, braking=(0.0, 10.0), beside="Queue",
        dense=16.0,
    ),
    "merging": LogicalManeuver(
        "A vehicle merges in front of the ego",
        "Merging", "Merging", "left", "right", 1, ("on_ramp",), Label.CUT_IN,
    ),
    "diverging": LogicalManeuver(
        "The ego's leader leaves the motorway",
        "Diverging", "Diverging", "left", "left", -1, ("off_ramp",), Label.CUT_OUT,
    ),
    "ramp_entering": LogicalManeuver(
        "The ego enters a motorway behind a leader on it",
        EGO, "Lead", "right", "left", 1, ("on_ramp",), Label.RAMP_ENTERING, pace=1.0,
    ),
    "ramp_exiting": LogicalManeuver(
        "The ego leaves a motorway behind a leader that stays on it",
        EGO, "Lead", "left", "left", -1, ("exit_lane",), Label.RAMP_EXITING, pace=1.0,
    ),
    "turn_off": LogicalManeuver(
        "The ego's leader brakes and turns off to the right",
        "TurnOff", "TurnOff", "right", "right", 0, JUNCTIONS, braking=(2.0, 8.0), turns=True,
    ),
}  # fmt: skip
"""Manoeuvres by name."""


_BOXES = 4.5
"""Distance (m) of the reference points of two catalogue cars that touch bumper to bumper"""
_EVADED = 10.0
"""Gap (m) to the vehicle in front of which the leader left its lane, when it has left"""


@dataclass(frozen=True)
class ManeuverScenario:
    """A manoeuvre on a geometry.

    Attributes:
        name: of the scenario.
        situation: the manoeuvre in a word or two.
        maneuver, geometry: what and where.
    """

    name: str
    situation: str
    maneuver: LogicalManeuver
    geometry: Geometry

    @property
    def tags(self) -> list[Tag]:
        """Tags of the scenario."""
        label = self.maneuver.label if self.geometry.is_motorway else self.maneuver.urban_label
        return scenario_tags(self.name, self.situation, label, self.geometry.map.tags, ("car",))

    def document(self, path: Path, road: str) -> Document:
        """The scenario.

        Args:
            path: the file that it is to become.
            road: the road file, relative to it.
        """
        names = [EGO, *self._others()]
        kinds = ("Controller", *(["Route"] if self.maneuver.turns else []), "Vehicle")
        return maneuvers.scenario(
            path,
            header(f"{self.maneuver.description}, {self.geometry.description}", self.tags),
            road=road,
            entities={name: maneuvers.reference(roads.VEHICLE, "car") for name in names},
            init={name: self._init(name) for name in names},
            maneuvers=[(actor, self._maneuver(actor, lanes)) for actor, lanes in self._changes()]
            + self._turn(),
            parameters=self._parameters(),
            catalogs={kind: roads.DIRECTORIES[kind] for kind in kinds},
            stop=self._stop(),
            controllers={EGO: roads.SYSTEM},
        )

    def defaults(self) -> dict[str, float]:
        """Values of the actor's parameters, by the names of their declarations."""
        place, braking = self.geometry, self.maneuver.braking
        start = self._kept if self.maneuver.actor != EGO else self._ego_speed
        # A little slower than before: a default without any change would show nothing of it.
        end = braking[0] if braking else round(0.95 * start, 1)
        jerk = [] if self.maneuver.jerk is None else [self.maneuver.jerk]
        values = (place.gap, start, 3.0, end, 4.0, end, 5.0, *jerk)
        return {
            declared_name(self.maneuver.actor, role): value
            for role, value in zip(self._declared, values, strict=True)
        }

    @property
    def _declared(self) -> tuple[str, ...]:
        """Roles of the actor's parameters."""
        return (*PARAMETERS, *([] if self.maneuver.jerk is None else [JERK]))

    @property
    def _kept(self) -> float:
        """Speed of slower vehicles by default, m/s."""
        return round(self.maneuver.pace * self._ego_speed, 1)

    @property
    def _ego_speed(self) -> float:
        """Speed of the ego by default, m/s."""
        fastest = self.maneuver.dense
        return self.geometry.ego_speed if fastest is None else min(fastest, self.geometry.ego_speed)

    def _others(self) -> list[str]:
        maneuver = self.maneuver
        return [
            name for name in (maneuver.leader, maneuver.ahead, maneuver.beside) if name is not None
        ]

    def _parameters(self) -> list[Any]:
        """Return the parameters of the actor, and the constant speeds of the others."""
        limits: dict[str, Limits] = {
            parameter.name: (parameter.low, parameter.high) for parameter in DECLARED.values()
        }
        slow, place = self.maneuver.braking or self.geometry.speeds, self.geometry
        limits |= {
            "Gap_m": place.gaps,
            "StartSpeed_mps": place.speeds,
            "EndSpeed_mps": slow,
            "FinalSpeed_mps": slow,
        }
        actor = self.maneuver.actor
        declared = [
            (name, value, limits[name.removeprefix(f"{actor}_")])
            for name, value in self.defaults().items()
        ]
        if actor != EGO:
            # The speed of the vehicle that does not act: the actor has its own three.
            declared.append((f"{EGO}_Speed_mps", self._ego_speed, place.speeds))
        else:
            declared.append((f"{self.maneuver.leader}_Speed_mps", self._kept, place.speeds))
        if self.maneuver.ahead:
            declared.append(
                (
                    f"{self.maneuver.ahead}_Speed_mps",
                    round(0.6 * self._ego_speed, 1),
                    # It may stand: that is what the leader evades.
                    (0.0, place.speeds[1]),
                )
            )
        return [
            maneuvers.parameter(
                name, "double", value, [[("greaterOrEqual", low), ("lessOrEqual", high)]]
            )
            for name, value, (low, high) in declared
        ]

    # expressions: names of parameters, and terms of them, without the ${ } around

    @cached_property
    def _roles(self) -> dict[str, str]:
        """The actor's parameters by role."""
        return {role: f"${declared_name(self.maneuver.actor, role)}" for role in self._declared}

    @property
    def _settled(self) -> dict[str, str]:
        """The same, with a rest time in which the last change of speed is comfortable."""
        return self._roles | {"rest_time": storyboard.settling(self._roles)}

    def _role(self, role: str) -> str:
        return self._roles[role]

    def _speed(self, name: str) -> str:
        """Constant speed until the manoeuvre begins."""
        if name == self.maneuver.beside:
            name = self.maneuver.leader
        return self._role("start_speed") if name == self.maneuver.actor else f"${name}_Speed_mps"

    @property
    def _opening(self) -> str:
        """Speed by which leader and ego move apart."""
        return f"({self._speed(self.maneuver.leader)} - {self._speed(EGO)})"

    @property
    def _delay(self) -> str:
        """Time until the manoeuvre begins."""
        # Side by side no gap has to be kept before, so that the start alone decides.
        if self.maneuver.ego_lane != self.maneuver.leader_lane:
            return self._role("start_time")
        return storyboard.approach(self._role("start_time"), self._role("gap"), self._opening)

    @property
    def _way(self) -> str:
        """Way of the actor during the manoeuvre."""
        return (
            f"({self._role('start_speed')} + {self._role('end_speed')}) / 2 * "
            f"{self._role('duration')}"
        )

    # parts of the scenario

    def _init(self, name: str) -> list[Any]:
        return [maneuvers.teleport(self._place(name)), maneuvers.speed(self._speed(name))]

    def _place(self, name: str) -> Any:
        place, side = self.geometry, self.geometry.side
        lanes = {"left": place.left, "right": place.right}
        own, leaders = (lanes[lane] for lane in (self.maneuver.ego_lane, self.maneuver.leader_lane))
        if name == EGO:
            behind = f"{self._role('gap')} + {_BOXES} + {self._speed(EGO)} * ({self._delay})"
            # Before a junction the manoeuvre ends at the spot: as far from it as its own way is
            # long.
            end = f" + {self._way}" if place.ends_there else ""
            return maneuvers.lane_position(
                place.road, own, f"${{{place.spot}{end} {'-' if side > 0 else '+'} ({behind})}}"
            )
        ahead = f"{self._role('gap')} + {_BOXES} - {self._opening} * ({self._delay})"
        if name == self.maneuver.ahead:
            ahead += f" + {_BOXES} + {self._clearance(name)}"
        lane = (
            next(lane for lane in lanes.values() if lane != leaders)
            if name == self.maneuver.beside
            else leaders
        )
        return maneuvers.relative_lane_position(
            EGO, lane - own, f"${{{'' if side > 0 else '-'}({ahead})}}"
        )

    def _clearance(self, name: str) -> str:
        """Initial gap to the one ahead that the leader evades at the last moment."""
        speed = self._speed(name)
        during = f"max({self._way} - {speed} * {self._role('duration')}, 0)"
        return (
            f"{_EVADED} + {during} + max({self._speed(self.maneuver.leader)} - {speed}, 0) * "
            f"({self._delay})"
        )

    def _changes(self) -> list[tuple[str, int]]:
        """Return the vehicles that change speed, each with the number of lanes it moves to the
        left."""
        changes = [(self.maneuver.actor, self.maneuver.change)]
        return changes + ([(self.maneuver.beside, 0)] if self.maneuver.beside else [])

    def _maneuver(self, actor: str, lanes: int) -> Any:
        events = storyboard.events(
            f"{actor} changes",
            f"{actor} settles",
            self._settled,
            actor,
            lanes,
            self._start(),
            roads.SPEED_SHAPE,
        )
        return maneuvers.maneuver(f"{actor} maneuver", events)

    def _turn(self) -> list[tuple[str, Any]]:
        """The leader's route, where it turns off."""
        if not self.maneuver.turns:
            return []
        # When the library is written, not in a run: a manoeuvre on a geometry that has no such way.
        if self.geometry.turn is None:
            raise UsageError(f"a vehicle can't turn off {self.geometry.description}")
        return [roads.take_route(self.maneuver.leader, self.geometry.file, self.geometry.turn)]

    def _start(self) -> list[TriggerCondition]:
        """Start trigger: the time is over and the gap reached.

        A change of speed with a jerk begins earlier, by half the time in which its acceleration
        builds up: so it is about where the one without would be.
        """
        delay, gap = self._delay, storyboard.trigger_gap(self._role("gap"), self._opening)
        if self.maneuver.jerk is not None:
            change = f"abs({self._role('end_speed')} - {self._role('start_speed')})"
            early = f"{change} / (2 * {self._role('duration')} * {self._role(JERK)})"
            # The gap as well: closing vehicles are nearer when the change is to begin earlier.
            delay, gap = (
                f"max({delay} - {early}, 0)",
                f"{gap} + max(0 - {self._opening}, 0) * {early}",
            )
        return [
            storyboard.started(f"${{{delay}}}"),
            storyboard.gap_reached(EGO, self.maneuver.leader, f"${{{gap}}}"),
        ]

    def _stop(self) -> Conditions:
        """Stop trigger: a collision of the ego, or the scene's end."""
        collisions = [[maneuvers.collision(EGO, name)] for name in self._others()]
        return [*collisions, *storyboard.ends(f"{self.maneuver.actor} changes", self._settled)]
