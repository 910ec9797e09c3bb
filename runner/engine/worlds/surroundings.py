"""Surroundings while a scenario runs: weather, time of day and road condition; traffic signals and
their controllers.

A controller goes round its phases (OpenSCENARIO XML 1.3, 6.11). One with a `delay` and a
`reference` begins its first phase that long after the referenced one, as if both had always been
running. A TrafficSignalStateAction sets a signal until its controller's next phase sets it anew; a
TrafficSignalControllerAction makes the controller go on from a phase.

`TrafficSignals` owns the state and the aspect of each signal (`runner.engine.worlds.aspects`):
drivers, criteria and pages read them.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from itertools import accumulate
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from runner.engine.worlds.aspects import SEMANTICS, Aspect, aspect_of
from runner.engine.worlds.signals_ahead import SignalAhead, SignalHorizon
from schemas.expressions.values import typed
from xosc.document.node import Node

if TYPE_CHECKING:
    from runner.engine.participants.entity import Guide
    from runner.engine.worlds.base import World
    from xodr.graph.network import RoadNetwork
    from xodr.model import RoadPoint, Signal


@dataclass(frozen=True, slots=True)
class Environment:
    """State of the surroundings; every part keeps its last value until an action sets it.

    Args:
        name: of the last Environment applied.
        friction: RoadCondition frictionScaleFactor, 1 for a dry road.
        weather: attributes of Weather and its children, as `Precipitation.precipitationType`, as
            the file has them.
        day: the time of day set last, if any; `set_at` (s) is when that was, `running` whether it
            moves with the simulation.
    """

    name: str = ""
    friction: float = 1.0
    weather: Mapping[str, str] = field(default_factory=dict)
    day: datetime | None = None
    set_at: float = 0.0
    running: bool = False

    def after(self, node: Node, time: float) -> Environment:
        """Return the state after applying an Environment element at a simulation time (s)."""
        changes: dict[str, Any] = {"name": node.get("name")}
        clock = node.find("TimeOfDay")
        if clock is not None:
            changes |= {
                "day": read_date(clock, "dateTime"),
                "set_at": time,
                "running": clock.bool("animation"),
            }
        weather = node.find("Weather")
        if weather is not None:
            changes["weather"] = MappingProxyType(
                {
                    (str(key) if part.tag == weather.tag else f"{part.tag}.{key!s}"): str(value)
                    for part in weather.iter()
                    for key, value in part.element.attrib.items()
                }
            )
        road = node.find("RoadCondition")
        if road is not None:
            changes["friction"] = road.finite("frictionScaleFactor")
            if changes["friction"] < 0.0:
                raise road.invalid("frictionScaleFactor must not be negative")
        return replace(self, **changes)

    def time_of_day(self, time: float) -> datetime | None:
        """The date and time at a simulation time (s); None while no action has set any."""
        if self.day is None or not self.running:
            return self.day
        return self.day + timedelta(seconds=time - self.set_at)


def read_date(node: Node, attribute: str) -> datetime:
    """An attribute of type dateTime; without a time zone it is UTC."""
    try:
        value = typed("dateTime", node.get(attribute))
    except ValueError as error:
        raise node.invalid(f"{attribute}: {error}") from None
    assert isinstance(value, datetime)
    return value


_EPSILON = 1e-9
_AT = 2.0
"""Largest distance (m) of a traffic light from the place that names it, as in CARLA's
scenario_runner."""


class Phase(NamedTuple):
    """A phase: how long it lasts (s), the states that it puts signals into, by signal id, and what
    they mean, if it says so."""

    name: str
    duration: float
    states: dict[str, str]
    semantics: str | None = None


class SignalController:
    """A cycle of phases.

    Args:
        name: its name.
        phases: in order.
        begin: time (s) at which the first phase begins, or virtually began.
    """

    def __init__(self, name: str, phases: tuple[Phase, ...], begin: float = 0.0) -> None:
        self.name = name
        self.phases = phases
        self.begin = self._declared_begin = begin
        self._ends = list(accumulate(phase.duration for phase in phases))

    def reset(self) -> None:
        """Begin as declared."""
        self.begin = self._declared_begin

    def at(self, time: float) -> Phase | None:
        """The phase at a time (s); None where there are no phases."""
        if not self.phases:
            return None
        total, elapsed = self._ends[-1], time - self.begin + _EPSILON
        if 0.0 < total < math.inf:
            elapsed %= total
        return self.phases[min(bisect_right(self._ends, max(elapsed, 0.0)), len(self.phases) - 1)]

    def go_to(self, phase: str, time: float) -> None:
        """Start a phase at a time (s); the cycle continues from there."""
        index = next(i for i, candidate in enumerate(self.phases) if candidate.name == phase)
        self.begin = time - (self._ends[index - 1] if index else 0.0)


class SignalRun(Protocol):
    """Used part of a run for traffic signals."""

    @property
    def time(self) -> float:
        """Simulation time, s."""
        ...

    @property
    def world(self) -> World:
        """The simulator, whose traffic sees the signals."""
        ...

    def note(self, kind: str, subject: str, text: str = "") -> None:
        """Write a line of the event log."""
        ...


class TrafficSignals:
    """All signal states of one run. States are written as in the scenario.

    Args:
        controllers: those that the scenario declares.
        network: the roads, whose signals may be named too; None where there are none.
    """

    def __init__(
        self, controllers: tuple[SignalController, ...] = (), network: RoadNetwork | None = None
    ) -> None:
        self.controllers = {controller.name: controller for controller in controllers}
        self.states: dict[str, str] = {}
        """state of each signal that has one, by its id"""
        self.history: list[tuple[float, str, str]] = []
        """Changes of states: time (s), signal, state."""
        self.phases: dict[str, str] = {}
        """name of the present phase of each controller"""
        self._present: dict[str, Phase] = {}
        self.aspects: dict[str, Aspect | None] = {}
        """aspect of each signal that has a state; None where that is not understood"""
        self._network = network
        self._horizon = SignalHorizon(network) if network is not None else None

    def reset(self) -> None:
        """Restore the state before a run: no signal has a state."""
        for controller in self.controllers.values():
            controller.reset()
        for table in (self.states, self.phases, self._present, self.aspects):
            table.clear()
        self.history.clear()

    @classmethod
    def from_xml(cls, node: Node | None, network: RoadNetwork | None) -> TrafficSignals:
        """Read a TrafficSignals element, if there is one.

        Raises:
            InvalidFile: two controllers have one name.
        """
        nodes: dict[str, Node] = {}
        for child in node.children("TrafficSignalController") if node is not None else ():
            if nodes.setdefault(child.get("name"), child) is not child:
                raise child.invalid(
                    f"another traffic signal controller is called {child.get('name')!r}, too; "
                    "names must differ"
                )
        controllers = tuple(
            SignalController(
                name,
                tuple(_read_phase(phase, name, network) for phase in child.children("Phase")),
                _begin(child, nodes),
            )
            for name, child in nodes.items()
        )
        return cls(controllers, network)

    # references ----------------------------------------------------------------------------

    def signal(self, node: Node, attribute: str) -> str:
        """The signal id that an attribute names: by the id, or as in files for CARLA by `id=…` or
        the place in `pos=x,y`.

        Raises:
            InvalidFile: neither the road network nor a controller has such a signal.
        """
        name = str(node.get(attribute)).removeprefix("id=")
        if name.startswith("pos="):
            return self._at(node, name)
        controlled = (
            name in phase.states
            for controller in self.controllers.values()
            for phase in controller.phases
        )
        if self._network is not None and name not in self._network.signals and not any(controlled):
            raise node.invalid(
                f"{attribute}={name!r} is not a signal of the road network "
                f"{self._network.path.name}"
            )
        return name

    def _at(self, node: Node, name: str) -> str:
        """The traffic light at a place in CARLA's axes, of which y points to the right."""
        try:
            x, y = (float(text) for text in name.removeprefix("pos=").split(","))
        except ValueError:
            raise node.invalid(f"{name!r} is no place: pos=x,y is expected, in m") from None
        lights = (
            [signal for signal in self._network.signals.values() if signal.dynamic]
            if self._network is not None
            else []
        )
        away = {signal.id: self._distance(signal, x, -y) for signal in lights}
        nearest = min(away, key=away.__getitem__, default=None)
        if nearest is None or away[nearest] > _AT:
            where = (
                f"the nearest is {nearest!r}, {away[nearest]:.1f} m away"
                if nearest is not None
                else "the roads have none"
            )
            raise node.invalid(f"no traffic light is at {name.removeprefix('pos=')}: {where}")
        return nearest

    def _distance(self, signal: Signal, x: float, y: float) -> float:
        assert self._network is not None
        pose = self._network.roads[signal.road_id].pose(signal.s, signal.t)
        return math.hypot(pose.x - x, pose.y - y)

    def phase(self, node: Node) -> tuple[str, str]:
        """The names of the controller and its phase that `trafficSignalControllerRef` and `phase`
        give."""
        name, phase = node.get("trafficSignalControllerRef"), node.get("phase")
        if name not in self.controllers:
            raise node.invalid(
                f"trafficSignalControllerRef={name!r} is not a traffic signal "
                "controller of this scenario"
            )
        if phase not in {candidate.name for candidate in self.controllers[name].phases}:
            raise node.invalid(
                f"phase={phase!r} is not a phase of the traffic signal controller {name!r}"
            )
        return name, phase

    # the run -------------------------------------------------------------------------------

    def advance(self, run: SignalRun) -> None:
        """Bring all controllers to the run's time; changes go to the event log."""
        for name, controller in self.controllers.items():
            phase = controller.at(run.time)
            if phase is not None and self._present.get(name) is not phase:
                self._present[name] = phase
                self.phases[name] = phase.name
                run.note("trafficSignalPhase", name, phase.name)
                for signal, state in phase.states.items():
                    self.set_state(run, signal, state, phase.semantics)

    def set_state(
        self, run: SignalRun, signal: str, state: str, semantics: str | None = None
    ) -> None:
        """Put a signal into a state; the semantics of its phase, where there are some, decide on
        the aspect."""
        aspect = aspect_of(state) if semantics is None else SEMANTICS[semantics]
        if signal not in self.states or (self.states[signal], self.aspects[signal]) != (
            state,
            aspect,
        ):
            self.states[signal], self.aspects[signal] = state, aspect
            shown = state if semantics is None else str(SEMANTICS[semantics])
            self.history.append((run.time, signal, shown))
            understood = run.world.signal(signal, shown) and aspect is not None
            run.note(
                "trafficSignal",
                signal,
                state if understood else f"{state} (not understood by drivers)",
            )

    @property
    def lit(self) -> bool:
        """Whether the roads have any traffic light for vehicles."""
        return self._horizon is not None and not self._horizon.empty

    def ahead(self, point: RoadPoint, forward: bool, guide: Guide | None) -> list[SignalAhead]:
        """The traffic lights on the way ahead of the ego, see
        `runner.engine.worlds.signals_ahead.SignalHorizon`."""
        if self._horizon is None:
            return []
        return self._horizon.ahead(point, forward, guide, self.states, self.aspects)

    def set_phase(self, run: SignalRun, controller: str, phase: str) -> None:
        """Let a controller go on from a phase; the signals of that phase are set even if it was in
        it already."""
        self.controllers[controller].go_to(phase, run.time)
        self._present.pop(controller, None)
        self.advance(run)


def _read_phase(node: Node, controller: str, network: RoadNetwork | None) -> Phase:
    duration = float(node.float("duration"))
    if duration < 0.0:
        raise node.invalid(f"duration={duration:g} must not be negative")
    semantics = node.choice("semantics", SEMANTICS, None)
    states: dict[str, str] = {}
    for group in node.children(
        "TrafficSignalGroupState", "TrafficeSignalGroupState"
    ):  # the second is 1.2's own spelling
        states |= dict.fromkeys(_group(group, controller, network), group.get("state"))
    for state in node.children("TrafficSignalState"):
        states[state.get("trafficSignalId")] = state.get("state")
    if semantics is not None and not states:
        states = dict.fromkeys(_controlled(node, controller, network), str(SEMANTICS[semantics]))
    return Phase(node.get("name"), duration, states, semantics)


def _controlled(phase: Node, controller: str, network: RoadNetwork | None) -> list[str]:
    """The signals of a controller, where a phase gives them a meaning and no states: of its other
    phases, or its group."""
    others = phase.parent.iter("TrafficSignalState") if phase.parent is not None else ()
    named = dict.fromkeys(state.get("trafficSignalId") for state in others)
    return list(named) or list(_group(phase, controller, network))


def _group(node: Node, controller: str, network: RoadNetwork | None) -> tuple[str, ...]:
    """Signals of the road network's controller that the scenario's controller is named after."""
    for group in network.controllers.values() if network is not None else ():
        if controller in (group.id, group.name):
            return group.signals
    raise node.invalid(
        f"the road network has no controller {controller!r} whose signals could "
        "be put into the state"
    )


def _begin(node: Node, nodes: dict[str, Node]) -> float:
    """Time at which a controller's first phase begins: its delay and those of the controllers it
    refers to."""
    total, passed, current = 0.0, set(), node
    while True:
        delay, reference = current.finite("delay", 0.0), current.get("reference", None)
        if delay < 0.0:
            raise current.invalid(f"delay={delay:g} must not be negative")
        if reference is None:
            return total
        passed.add(current.get("name"))
        if reference not in nodes:
            raise current.invalid(
                f"reference={reference!r} is not a traffic signal controller of this scenario"
            )
        if reference in passed:
            raise current.invalid(f"the traffic signal controller {reference!r} refers to itself")
        total += delay
        current = nodes[reference]
