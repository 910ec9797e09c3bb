"""The ego: its entity, from when on a system under test drives it, and its drivers.

The ego is, in this order: the entity named by the caller (`--ego`); the vehicle called `Ego` (any
case, also `EgoVehicle`, `ego_vehicle`, `hero`; of several one with a controller, then the first);
the first vehicle whose Property `type` is `ego_vehicle`, as in files for CARLA; the only vehicle
with a controller. Scenarios without any of these have no ego, and no system under test drives
anyone.

A scenario that assigns the ego a controller hands it over by ActivateControllerAction: until then,
and in domains that it deactivates, the ego does what is scripted (OpenSCENARIO XML 1.3, 6.6:
controllers are assigned deactivated). A scenario that never activates a controller of the ego is
driven by the system under test from the beginning.

An ego that files for CARLA leave to `external_control`, without a speed in Init, is no ego that
stands: the system under test is asked for `CRUISE` until the scenario says a speed.

While a driver has the ego, the scripted speed (speed actions included) is what it is asked for,
`Observation.target_speed`. Where it answers with no acceleration of its own, the ego has exactly
that speed; after an intervention it returns to it at no more than its `Performance` or 3.5 m/s²
allow. Scripted lateral motion is followed unless the system steers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from runner.engine.actions.controller import AssignControllerAction
from runner.engine.compile.element import LATERAL, LONGITUDINAL, PrivateAction
from runner.engine.participants.declaration import BoundingBox, Performance
from runner.engine.participants.rows import RunRows
from runner.engine.participants.scenario_objects import EXTERNAL, module_of
from runner.engine.storyboard.driver import Decision, EgoDriver
from runner.engine.worlds.base import DriverRequest
from runner.engine.worlds.signals_ahead import StopLine, stop_line
from runner.systems import System, system_name
from runner.systems.arrays import BatchObservation, BatchParticipants, objects
from runner.systems.base import (
    PEDAL,
    RAISED,
    Control,
    Observation,
    Pose,
    SystemFailure,
    SystemUnderTest,
    SystemUnderTestError,
    WorldDriven,
    plain,
    seen,
)
from schemas.common.errors import ToolchainError, UsageError, blame, nearest
from schemas.expressions.columns import NotInArrays
from xosc.document.node import EGO_NAME

if TYPE_CHECKING:
    from collections.abc import Mapping

    from runner.engine.compile.array_protocols import ArrayRun
    from runner.engine.compile.compiler import Scenario
    from runner.engine.compile.protocols import Run
    from runner.engine.participants.entity import Entity
    from runner.engine.participants.rows import EntityRows
    from runner.engine.worlds.signals_ahead import SignalAhead
    from runner.systems.arrays import ArraySystem
    from schemas.common.array_types import BoolArray, FloatArray, IntArray


CRUISE = 20.0 / 3.6
"""Speed (m/s) of an ego that is driven from outside: by default that of CARLA's BasicAgent."""


def find_ego(scenario: Scenario, name: str | None) -> Entity | None:
    """The ego of a scenario; None where it has none.

    Raises:
        UsageError: no entity has the given name.
    """
    if name is not None:
        if name not in scenario.entities:
            raise UsageError(
                f"no entity is called {name!r}; {nearest(name, scenario.entities)}",
                path=scenario.path,
            )
        return scenario.entities[name]
    vehicles = [
        entity for entity in scenario.entities.values() if entity.declared.kind == "vehicle"
    ]
    named = [entity for entity in vehicles if EGO_NAME.fullmatch(entity.name)]
    if named:
        return next((entity for entity in named if entity.declared.controllers), named[0])
    called = [entity for entity in vehicles if is_called_ego(entity)]
    if called:
        return called[0]
    controlled = [entity for entity in vehicles if entity.declared.controllers]
    return controlled[0] if len(controlled) == 1 else None


def is_called_ego(entity: Entity) -> bool:
    """Whether a file for CARLA says that this is an ego: there may be several."""
    return entity.declared.properties.get("type") == "ego_vehicle"


def driver_of(
    scenario: Scenario, ego: Entity, system: System, timestep: float, seed: int
) -> EgoDriver:
    """Reset a system under test, and return the ego's driver for it; timestep in s."""
    try:
        system.reset(seen(ego), timestep, seed)
    except RAISED as error:
        raise failed(system, error, 0.0) from error
    handed_over = ego.name not in scenario.activated
    if isinstance(system, WorldDriven):
        return WorldDriver(handed_over, scripted_at_start(scenario, ego))
    return SystemDriver(system, handed_over, cruise_speed(scenario, ego))


def cruise_speed(scenario: Scenario, ego: Entity) -> float | None:
    """Speed (m/s) of an ego that is driven from outside and has no speed to begin with; None for
    all others."""
    assigned = [
        action.properties
        for actor, element in scenario.storyboard.init
        for action in element.actions
        if actor is ego and isinstance(action, AssignControllerAction)
    ]
    external = any(
        module_of(controller) == EXTERNAL
        for controller in (*assigned, *ego.declared.controllers.values())
    )
    return CRUISE if external and not scripted_at_start(scenario, ego) else None


def scripted_at_start(scenario: Scenario, ego: Entity) -> bool:
    """Whether an initial action sets the ego's speed."""
    elements = [element for actor, element in scenario.storyboard.init if actor is ego]
    private = [
        action
        for element in elements
        for action in element.actions
        if isinstance(action, PrivateAction)
    ]
    return any(LONGITUDINAL in action.claims() for action in private)


_RETURN = 3.5
"""Greatest acceleration with which the ego returns to its scripted speed after an intervention,
m/s²"""
_SAME = 1e-9
_GRAVITY = 9.81
_PEDALS = ("Throttle", "Brake", "ParkingBrake")
_OFF = 1.0
"""Distance (m), beside that of 1 g in a step, of a pose from where the ego would be at its speed:
farther no vehicle comes"""
_UNLIKE = 1.0
"""Difference (m/s) of a pose's speed and that of the displacement above which they contradict each
other"""


_HARDEST = 2.0 * _GRAVITY
"""Change of speed (m/s²), beside `_UNLIKE`, that no vehicle exceeds between two poses"""
_SLIDING = 3.0
"""Speed (m/s) across the heading above which a pose slides: lane changes with wheels reach 2 m/s,
along their headings"""
_SLIP = math.tan(math.radians(10.0))
"""Ratio of speeds across and along the heading below which tyres hold: their side forces are
largest at about 10 degrees"""
_SLIDING_TIME = 0.5
"""Time (s) for which poses slide until no vehicle does so"""


class WorldDriver(EgoDriver):
    """Lets the world's own driver drive the ego where the scenario leaves it free.

    A scripted lateral action takes the ego back for as long as it runs, and so does a speed
    backwards. The scripted speed, once there is any, is the driver's desired speed, and may exceed
    speed limits; before, the driver goes by the limits. With the longitudinal domain alone, it
    keeps its lane; with the lateral domain alone, it has exactly the scripted speed. Where the
    world can't drive the ego, or lets go of it at the end of its roads, the ego goes on as scripted
    until it is handed over anew.

    Args:
        handed_over: whether it drives from the beginning.
        scripted: whether the scenario says from the beginning how fast the ego is.
    """

    def __init__(self, handed_over: bool, scripted: bool) -> None:
        super().__init__(handed_over)
        self.scripted = scripted
        self._returning = False
        self._refused = False

    def request(self, ego: Entity) -> DriverRequest | None:
        """The scripted speed, unless the ego is handed over to the scenario or the world has
        refused it."""
        controls = ego.controls
        moved = (
            LATERAL in controls.owners
            or controls.target_offset is not None
            or controls.target_speed < 0.0
            or ego.speed < 0.0
        )
        if moved or not (self.longitudinal or self.lateral):
            # The scenario has the ego: the next handover asks the world anew.
            self._refused = False
            return None
        if self._refused:
            return None
        self.scripted = (
            self.scripted or controls.target_speed != 0.0 or LONGITUDINAL in controls.owners
        )
        return DriverRequest(
            controls.target_speed if self.scripted else None, not self.longitudinal, self.lateral
        )

    def answer(self, driven: bool) -> None:
        """Note the world's answer: once it has driven the ego, that returns to
        the scripted speed.
        """
        self._returning = self._returning or driven
        self._refused = not driven
        if driven:
            self.count(self.longitudinal, self.lateral)

    def decide(self, ego: Entity, run: Run) -> Decision:
        """The scripted speed, or the way back to it."""
        target = ego.controls.target_speed
        if not self._returning:
            return Decision(target)
        speed = returning(ego, target, run.dt)
        self._returning = abs(speed - target) >= _SAME
        return Decision(speed)


class SystemDriver(EgoDriver):
    """Turns the controls of a system under test into requests for the ego's motion.

    Args:
        system: the system under test.
        handed_over: whether it drives from the beginning.
        cruise: speed (m/s) that it is asked for until the scenario says one; None for that of the
            scenario from the beginning.
    """

    def __init__(
        self, system: SystemUnderTest, handed_over: bool, cruise: float | None = None
    ) -> None:
        super().__init__(handed_over)
        self.system = system
        self._cruise = cruise
        self._intervening = False
        # From standstill to its cruise speed as after an intervention: at once would be a jump.
        self._returning = cruise is not None
        self._sliding = 0.0
        self.implausible = ""
        """Sentence on the first pose that no vehicle reaches; empty where there is none"""

    def decide(self, ego: Entity, run: Run) -> Decision:
        """The system's pose, or its acceleration and steering within the ego's limits; the scripted
        speed where it gives none."""
        target = self._target(ego)
        control = self._ask(ego, target, run) if self.longitudinal or self.lateral else Control()
        if isinstance(control, Pose):
            self.count(True, True)
            return self._put(ego, control, run)
        steering = control.steering if self.lateral else None
        # Pedals that the scenario holds are no command of the system.
        self.count(self.longitudinal and not _held(ego), steering is not None)
        control = _overridden(control, ego) if self.longitudinal else Control()
        if control.acceleration is not None:
            return Decision(
                self._intervene(ego, control.acceleration, control.reason, run), steering
            )
        if not self._returning:
            return Decision(target, steering)
        speed = returning(ego, target, run.dt)
        if abs(speed - target) < _SAME:
            self._returning = False
            if self._intervening:
                self._intervening = False
                run.note("interventionEnd", ego.name, "back at the scripted speed")
        return Decision(speed, steering)

    def _target(self, ego: Entity) -> float:
        """Speed that the system is asked for, m/s."""
        controls = ego.controls
        if controls.target_speed != 0.0 or LONGITUDINAL in controls.owners:
            self._cruise = None
        return controls.target_speed if self._cruise is None else self._cruise

    def _ask(self, ego: Entity, target: float, run: Run) -> Control | Pose:
        """The system's answer, checked."""
        try:
            answer = plain(self.system.control(observe(run, ego, target), run.dt))
            if isinstance(answer, Pose) and not (self.longitudinal and self.lateral):
                domain = "longitudinal" if self.longitudinal else "lateral"
                raise ValueError(
                    "control() returned a Pose, which needs both domains; the scenario hands "
                    f"over the {domain} one"
                )
        except RAISED as error:
            raise failed(self.system, error, run.time) from error
        return answer

    def _put(self, ego: Entity, pose: Pose, run: Run) -> Decision:
        """The pose as it is, with its speed; the first one that no vehicle reaches is noted."""
        self._begin(ego, pose.reason, run)
        dt, c, s = run.dt, math.cos(pose.h), math.sin(pose.h)
        dx, dy = pose.x - ego.x, pose.y - ego.y
        along, aside = (dx * c + dy * s) / dt, (dy * c - dx * s) / dt
        speed = along if pose.speed is None else pose.speed
        # At speed some slip is normal, when parking some sideways speed: the greater bound counts.
        slides = abs(aside) > max(_SLIDING, _SLIP * abs(along))
        self._sliding = self._sliding + dt if slides else 0.0
        if not self.implausible:
            self.implausible = self._implausibility(ego, dx, dy, speed, run)
            if self.implausible:
                run.note("implausiblePose", ego.name, f"{self.implausible}: no vehicle moves so")
        return Decision(speed, pose=pose)

    def _implausibility(self, ego: Entity, dx: float, dy: float, speed: float, run: Run) -> str:
        """A sentence on a displacement (m) or speed (m/s) of a step that no vehicle reaches; empty
        for a plausible one."""
        dt, then = run.dt, f"{run.time + run.dt:.2f} s"
        off = math.hypot(dx - ego.vx * dt, dy - ego.vy * dt)
        before, now, moved = abs(ego.speed), abs(speed), math.hypot(dx, dy) / dt
        if off > _OFF + _GRAVITY * dt * dt:
            return f"{ego.name} is put {off:.2f} m from where it would be at {then}"
        # The displacement has to fit a speed between those at both ends of the step.
        if not min(before, now) - _UNLIKE <= moved <= max(before, now) + _UNLIKE:
            return (
                f"{ego.name} is put {moved * dt:.2f} m further at {then}, at a speed of "
                f"{speed:.2f} m/s"
            )
        if abs(speed - ego.speed) > _UNLIKE + _HARDEST * dt:
            return (
                f"{ego.name} changes its speed from {ego.speed:.2f} to {speed:.2f} m/s within a "
                f"step at {then}"
            )
        # Half a step is rounding: the time is a sum of steps.
        if self._sliding > _SLIDING_TIME - dt / 2:
            return (
                f"{ego.name} has moved sideways at more than {_SLIDING:g} m/s for "
                f"{_SLIDING_TIME:g} s at {then}"
            )
        return ""

    def _intervene(self, ego: Entity, acceleration: float, reason: str, run: Run) -> float:
        """Speed after a step of the system's acceleration, m/s: a change of the direction of travel
        ends in standstill."""
        self._begin(ego, reason, run)
        limits = ego.declared.performance
        # No acceleration beyond the grip of the road, whatever the Performance says.
        grip = _GRAVITY * run.environment.friction
        speed = (
            ego.speed
            + max(
                -min(limits.max_deceleration, grip),
                min(limits.max_acceleration, grip, acceleration),
            )
            * run.dt
        )
        return (
            min(max(speed, 0.0), max(limits.max_speed, ego.speed))
            if ego.speed >= 0.0
            else min(speed, 0.0)
        )

    def _begin(self, ego: Entity, reason: str, run: Run) -> None:
        """Log the beginning of an intervention."""
        if not self._intervening:
            self._intervening = self._returning = True
            run.note("interventionStart", ego.name, reason)


class ArraySystemDriver(RunRows):
    """`SystemDriver` in many runs at once: the ego's speed by a system under test; it does not
    steer here.

    Args:
        system: the system under test; it is reset.
        scenario: the compiled scenario.
        ego: the ego.
        n: number of runs.
        timestep: s.
        seed: of each run.

    Attributes:
        commanded: steps in which it was in command of the ego (n,).

    Raises:
        NotInArrays: traffic lights may be lit, or the ego's speed is not said.
    """

    def __init__(
        self,
        system: ArraySystem,
        scenario: Scenario,
        ego: Entity,
        n: int,
        timestep: float,
        seed: int,
    ) -> None:
        if scenario.signals.lit:
            raise NotInArrays("traffic lights are shown to systems in single runs only")
        if cruise_speed(scenario, ego) is not None:
            raise NotInArrays(f"{ego.name} is driven from outside at no speed of the scenario")
        self._system, self._ego, self._network = system, ego, scenario.network
        handed_over = ego.name not in scenario.activated
        self._domains = {name: np.full(n, handed_over) for name in (LONGITUDINAL, LATERAL)}
        self._runs, self._returning = np.arange(n), np.zeros(n, bool)
        self.commanded = np.zeros(n, np.int64)
        self._settings = timestep, np.full(n, seed)
        self._constant: dict[str, Any] = {}

    def take(self, kept: BoolArray) -> None:
        """Keep some runs only."""
        super().take(kept)
        self._domains = {name: values[kept] for name, values in self._domains.items()}
        self._constant = {}

    def hand_over(self, rows: BoolArray, domains: Mapping[str, bool]) -> None:
        """Let it drive, or no longer drive, in control domains, in some runs (n,)."""
        for name, values in self._domains.items():
            if name in domains:
                values[rows] = domains[name]

    def begin(self, run: ArrayRun) -> None:
        """Reset the system, for all runs."""
        timestep, seeds = self._settings
        egos = BatchParticipants(**_constants([run.ego], run.n, ()), **_state([run.ego], ()))
        self._system.reset(egos, timestep, seeds)

    def decide(self, run: ArrayRun, ego: EntityRows) -> FloatArray:
        """Speeds (n,) at the end of the step: by the system's accelerations within the ego's
        limits, or the scripted ones."""
        longitudinal = self._domains[LONGITUDINAL]
        asked = longitudinal | self._domains[LATERAL]
        wanted, accelerates = np.zeros(run.n), np.zeros(run.n, bool)
        if asked.any():
            rows = np.flatnonzero(asked)
            answers = self._system.control(self._observations(run, ego, rows), run.dt)
            # The interpreter plays these: it can steer, and names a system that gives no answer.
            alone = answers.unanswered | answers.steers
            if len(rows) == run.n:
                wanted, accelerates = answers.acceleration, answers.accelerates
            else:
                wanted[rows], accelerates[rows] = answers.acceleration, answers.accelerates
            if alone.any():
                run.leave(np.isin(np.arange(run.n), rows[alone]))
            self.commanded += asked & run.going
            accelerates = accelerates & longitudinal
        limits, target, dt = ego.declared.performance, ego.target_speed, run.dt
        grip = _GRAVITY * run.environment.friction
        # No acceleration beyond the grip of the road, whatever the Performance says.
        least, most = -min(limits.max_deceleration, grip), min(limits.max_acceleration, grip)
        speed = ego.speed + np.maximum(least, np.minimum(most, wanted)) * dt
        # An ego that the scenario made faster than its Performance may keep
        # its speed, not gain any.
        forward = np.minimum(np.maximum(speed, 0.0), np.maximum(limits.max_speed, ego.speed))
        driven = np.where(ego.speed >= 0.0, forward, np.minimum(speed, 0.0))
        was, left = self._returning, target
        self._returning = accelerates
        if was.any():
            back = returning_arrays(ego, target, dt)
            self._returning = accelerates | (was & (np.abs(back - target) >= _SAME))
            left = np.where(was, back, target)
        found: FloatArray = np.where(accelerates, driven, left)
        return found

    def _observations(self, run: ArrayRun, ego: EntityRows, rows: IntArray) -> BatchObservation:
        n = run.n
        others = [entity for entity in run.entities.values() if entity is not ego]
        # The same objects in each step: a system in another process is sent them once.
        if not self._constant:
            nobody: Any = objects([""] * n)
            self._constant = {
                "ego": _constants([ego], n, ()),
                "others": _constants(others, n, (len(others),)),
                "environment": (None, np.empty(0)),
                "network": np.full(n, self._network, object),
                "stop_line": StopLine(nobody, np.full(n, np.inf)),  # type: ignore[arg-type]
                "signals": objects([()] * n),
            }
        if self._constant["environment"][0] is not run.environment:
            self._constant["environment"] = run.environment, objects([run.environment] * n)
        found = BatchObservation(
            self._runs,
            np.full(n, run.time),
            BatchParticipants(**self._constant["ego"], **_state([ego], ())),
            BatchParticipants(**self._constant["others"], **_state(others, (len(others), n))),
            ego.target_speed,
            self._constant["network"],
            self._constant["environment"][1],
            self._constant["stop_line"],
            self._constant["signals"],
        )
        return found if len(rows) == n else found.take(rows)


_MOVING = (
    "x", "y", "z", "h", "pitch", "roll", "speed", "acceleration", "vx", "vy", "ax", "ay",
    "odometer",
)  # fmt: skip


def _state(rows: Sequence[EntityRows], shape: tuple[int, ...]) -> dict[str, Any]:
    """Fields of participants that change from step to step."""
    return {
        name: np.array([getattr(row, name) for row in rows]).reshape(shape)
        if len(rows) != 1
        else getattr(rows[0], name).reshape(shape or -1)
        for name in _MOVING
    }


def _constants(rows: Sequence[EntityRows], n: int, shape: tuple[int, ...]) -> dict[str, Any]:
    """Fields of participants that stay, for n runs."""
    people = [seen(row.entity) for row in rows]
    shape = (*shape, n)

    def spread(values: Sequence[Any], kind: Any = float) -> Any:
        column = objects(values) if kind is object else np.array(values, kind)
        # Views, not copies: arrays of observations may be read-only.
        return np.broadcast_to(column.reshape(-1, 1) if len(shape) > 1 else column, shape)

    constants: dict[str, Any] = {
        name: spread([getattr(participant, name) for participant in people], object)
        for name in ("name", "kind", "category", "lights", "overrides")
    }
    for name in ("front_axle", "max_steering", "mass"):
        constants[name] = spread([getattr(participant, name) for participant in people])
    for name, kind in (("box", BoundingBox), ("performance", Performance)):
        columns = list(zip(*(getattr(participant, name) for participant in people), strict=True))
        constants[name] = (
            kind(*(spread(column) for column in columns))
            if people
            else kind(
                *(np.zeros(shape) for _ in kind._fields)  # type: ignore[arg-type]
            )
        )
    constants["present"] = np.broadcast_to(np.array(True), shape)
    return constants


def observe(run: Run, ego: Entity, target: float) -> Observation:
    """Return the driver's current observation for a target speed (m/s)."""
    others = [
        seen(e)
        for e in run.entities.values()
        if e is not ego and e.active and e.placed and e.visible["sensors"]
    ]
    signals = _signals(run, ego)
    line = stop_line(signals, abs(ego.speed))
    return Observation(
        run.time, seen(ego), others, target, run.roads.network, run.environment, line, signals
    )


def _signals(run: Run, ego: Entity) -> Sequence[SignalAhead]:
    """Return the traffic lights on the ego's way."""
    point = run.roads.road_point(ego) if run.signals.lit else None
    if point is None or run.roads.network is None:
        return ()
    along = (
        ego.direction > 0
        if ego.on_lane
        else math.cos(ego.h - run.roads.network.pose(point).h) >= 0.0
    )
    # In reverse the lights on its way are those behind it.
    return run.signals.ahead(point, along == (ego.speed >= 0.0), ego.controls.route)


def failed(system: System, error: BaseException, time: float) -> ToolchainError:
    """Error of a named system under test at a simulation time (s)."""
    if isinstance(error, ToolchainError):
        # Errors of a kind of their own, as a wrong file, keep it: the exit code follows from it.
        if type(error) is not ToolchainError:
            return error
        return SystemUnderTestError(
            error.message, path=error.path, line=error.line, element=error.element
        )
    told = str(error) if isinstance(error, SystemFailure) else blame(error, type(system).__module__)
    return SystemUnderTestError(
        f"the system under test {system_name(system)} failed at {time:.2f} s: {told}"
    )


def returning(ego: Entity, target: float, dt: float) -> float:
    """Speed (m/s) after dt (s) on the way back to the target speed (m/s), when something else has
    driven the ego."""
    limits, change = ego.declared.performance, target - ego.speed
    # Faster again gently, as drivers do; slower as hard as the car can, or the gap ahead would go.
    faster = change * ego.speed >= 0.0
    most = dt * (min(_RETURN, limits.max_acceleration) if faster else limits.max_deceleration)
    return ego.speed + max(-most, min(most, change))


def returning_arrays(ego: EntityRows, target: FloatArray, dt: float) -> FloatArray:
    """`returning` in many runs (n,)."""
    limits, change = ego.declared.performance, target - ego.speed
    faster = min(_RETURN, limits.max_acceleration)
    most = dt * np.where(change * ego.speed >= 0.0, faster, limits.max_deceleration)
    return ego.speed + np.maximum(-most, np.minimum(most, change))


def _held(ego: Entity) -> bool:
    """Whether OverrideControllerValueAction holds a pedal of the ego."""
    pedals = ego.controls.overrides
    return bool(pedals) and not pedals.keys().isdisjoint(_PEDALS)


def _overridden(control: Control, ego: Entity) -> Control:
    """The system's control with the pedals that OverrideControllerValueAction holds in place of its
    own."""
    if not _held(ego):
        return control
    pedals = ego.controls.overrides
    limits, own = ego.declared.performance, control.acceleration or 0.0
    forwards, backwards = max(own, 0.0), max(-own, 0.0)
    if "Throttle" in pedals:
        forwards = pedals["Throttle"] * min(limits.max_acceleration, PEDAL)
    if "Brake" in pedals:
        backwards = pedals["Brake"] * min(limits.max_deceleration, PEDAL)
    backwards = max(
        backwards, pedals.get("ParkingBrake", 0.0) * min(limits.max_deceleration, PEDAL)
    )
    # Released pedals and no answer: the scenario's speed applies.
    if control.acceleration is None and forwards == backwards == 0.0:
        return control
    return replace(
        control, acceleration=forwards - backwards, reason="overridden controller inputs"
    )
