"""The ego: how it is found, and how a system under test drives it.

The ego is, in this order: the entity named by the caller (`--ego`); the vehicle called `Ego` (any case, also
`EgoVehicle`, `ego_vehicle`, `hero`; of several one with a controller, then the first); the only vehicle with a controller.
Scenarios without any of these have no ego, and no system under test drives anyone.

A scenario that assigns the ego a controller hands it over by ActivateControllerAction: until then, and in domains that
it deactivates, the ego does what is scripted (OpenSCENARIO XML 1.3, 6.6: controllers are assigned deactivated). A
scenario that never activates a controller of the ego is driven by the system under test from the beginning.

While the system drives, the scripted speed (speed actions included) is what it is asked for, `Observation.demand`.
Where it answers with no acceleration of its own, the ego has exactly that speed; after an intervention it returns
to it at no more than its `Performance` or 3.5 m/s² allow. Scripted lateral motion is followed unless the system steers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from runner.contracts.action import LATERAL, LONGITUDINAL, PrivateAction
from runner.motion.steering import SteeredMotion
from runner.sut import System, system_name
from runner.sut.base import Control, Observation, SystemUnderTest, WorldDriven
from runner.worlds.base import Wish
from schemas.errors import ToolchainError, UsageError
from xosc.ego import EGO_NAME

if TYPE_CHECKING:
    from runner.interpreter.compiler import Scenario
    from runner.interpreter.simulation import Simulation
    from runner.participants.entity import Entity

_RETURN = 3.5
"""Greatest acceleration with which the ego returns to its scripted speed after an intervention, m/s²"""
_SAME = 1e-9
_GRAVITY = 9.81
_PEDAL = 8.0
"""Most that a fully pressed pedal gives, m/s²; less where the vehicle's Performance is less"""


def find_ego(scenario: Scenario, name: str | None) -> Entity | None:
    """The ego of a scenario; None where it has none.

    Raises:
        UsageError: no entity has the given name.
    """
    if name is not None:
        if name not in scenario.entities:
            raise UsageError(f"no entity is called {name!r}; there are {', '.join(scenario.entities)}", path=scenario.path)
        return scenario.entities[name]
    vehicles = [entity for entity in scenario.entities.values() if entity.kind == "vehicle"]
    named = [entity for entity in vehicles if EGO_NAME.fullmatch(entity.name)]
    if named:
        return next((entity for entity in named if entity.controllers), named[0])
    controlled = [entity for entity in vehicles if entity.controllers]
    return controlled[0] if len(controlled) == 1 else None


def drive_ego(sim: Simulation, ego: Entity | None, system: SystemUnderTest | WorldDriven | None) -> None:
    """Let a system under test drive the ego for this run."""
    if ego is not None and system is not None:
        try:
            system.reset(ego, sim.dt, sim.seed)
        except Exception as error:
            raise _failed(system, error, sim) from error
        handed_over = ego.name not in sim.scenario.activated
        if isinstance(system, WorldDriven):
            ego.system = WorldDriver(handed_over, _scripted_at_start(sim.scenario, ego))
        else:
            ego.system = Driver(system, handed_over, sim)


def _scripted_at_start(scenario: Scenario, ego: Entity) -> bool:
    """Whether an initial action says how fast the ego is."""
    elements = [element for actor, element in scenario.storyboard.init if actor is ego]
    private = [action for element in elements for action in element.actions if isinstance(action, PrivateAction)]
    return any(LONGITUDINAL in action.claims() for action in private)


class _HandedOver:
    """Which control domains of the ego a system under test has.

    Args:
        handed_over: whether it drives from the beginning.
    """

    def __init__(self, handed_over: bool) -> None:
        self.longitudinal = handed_over
        self.lateral = handed_over

    def hand_over(self, domains: Mapping[str, bool]) -> None:
        """Let the system drive, or no longer drive, in control domains (ActivateControllerAction)."""
        self.longitudinal = domains.get("longitudinal", self.longitudinal)
        self.lateral = domains.get("lateral", self.lateral)


class WorldDriver(_HandedOver):
    """Lets the world's own driver drive the ego, as far as the scenario leaves it to it.

    A scripted lateral action takes the ego back for as long as it runs, and so does a speed backwards. The scripted speed,
    once there is any, is what the driver wants, and may exceed speed limits; before, the driver goes by the limits. With
    the longitudinal domain alone, it keeps its lane; with the lateral domain alone, it has exactly the scripted speed.
    Where the world can't drive the ego, or lets go of it at the end of its roads, the ego goes on as scripted until it is
    handed over anew.

    Args:
        handed_over: whether it drives from the beginning.
        scripted: whether the scenario says from the beginning how fast the ego is.
    """

    def __init__(self, handed_over: bool, scripted: bool) -> None:
        super().__init__(handed_over)
        self._scripted = scripted
        self._returning = False
        self._refused = False
        self._wish: Wish | None = None

    def speed(self, ego: Entity, demand: float, sim: Simulation) -> float:
        """Hand the ego over where it is the driver's; else its speed (m/s) at the end of this step."""
        if not self._wanted(ego):
            self._refused = False
        elif not self._refused:
            if sim.drive(ego):
                self._wish = None
                self._returning = True
                self.guide(ego, sim)
                return demand
            self._refused = True
        if self._returning:
            speed = returning(ego, demand, sim.dt)
            self._returning = abs(speed - demand) >= _SAME
            return speed
        return demand

    def guide(self, ego: Entity, sim: Simulation) -> None:
        """Tell the world's driver what the scenario asks of the ego, or take it back."""
        if not self._wanted(ego):
            self._take_back(ego, sim)
            return
        self._scripted = self._scripted or ego.demand != 0.0 or LONGITUDINAL in ego.controls
        wish = Wish(ego.demand if self._scripted else None, not self.longitudinal, self.lateral)
        if wish != self._wish:
            self._wish = wish
            sim.world.ask(ego, wish)

    def lost(self, ego: Entity, sim: Simulation) -> None:
        """The world has let go of the ego."""
        self._refused = True
        self._take_back(ego, sim)
        sim.world.add(ego)

    def _wanted(self, ego: Entity) -> bool:
        """Whether the ego is the driver's: handed over, not moved sideways by an action, and not reversing."""
        scripted = LATERAL in ego.controls or ego.next_offset is not None or ego.demand < 0.0 or ego.speed < 0.0
        return (self.longitudinal or self.lateral) and not scripted

    def _take_back(self, ego: Entity, sim: Simulation) -> None:
        sim.take_back(ego)
        if not self._scripted:
            ego.demand = ego.speed


class Driver(_HandedOver):
    """Turns the controls of a system under test into the ego's motion.

    Args:
        system: the system under test.
        handed_over: whether it drives from the beginning.
    """

    def __init__(self, system: SystemUnderTest, handed_over: bool, sim: Simulation) -> None:
        super().__init__(handed_over)
        self.system = system
        self._intervening = False
        self._steered = SteeredMotion(sim)

    def speed(self, ego: Entity, demand: float, sim: Simulation) -> float:
        """Speed of the ego at the end of this step, m/s; turns the wheels where the system steers."""
        control = self._ask(ego, demand, sim) if self.longitudinal or self.lateral else Control()
        if self.lateral and control.steering is not None:
            self._steered.steer(ego, control.steering)
        else:
            self._steered.release(ego)
        control = _overridden(control, ego) if self.longitudinal else Control()
        if control.acceleration is not None:
            return self._intervene(ego, control.acceleration, control.reason, sim)
        if not self._intervening:
            return demand
        speed = returning(ego, demand, sim.dt)
        if abs(speed - demand) < _SAME:
            self._intervening = False
            sim.note("interventionEnd", ego.name, "back at the scripted speed")
        return speed

    def _ask(self, ego: Entity, demand: float, sim: Simulation) -> Control:
        """The system's answer, checked."""
        others = [e for e in sim.entities.values() if e is not ego and e.active and e.placed and e.visible["sensors"]]
        try:
            control = self.system.control(Observation(sim.time, ego, others, demand, sim.network, sim.environment), sim.dt)
            if not isinstance(control, Control):
                raise TypeError(f"control() returned {control!r}, a runner.sut.Control is expected")
            for value in (control.acceleration, control.steering):
                if value is not None and not math.isfinite(value):
                    raise ValueError(f"control() returned {control}, finite numbers are expected")
        except Exception as error:
            raise _failed(self.system, error, sim) from error
        return control

    def _intervene(self, ego: Entity, acceleration: float, reason: str, sim: Simulation) -> float:
        """Speed after a step of the system's acceleration, m/s: a change of the direction of travel ends in standstill."""
        if not self._intervening:
            self._intervening = True
            sim.note("interventionStart", ego.name, reason)
        limits = ego.performance
        grip = _GRAVITY * sim.environment.friction
        speed = ego.speed + max(-min(limits.max_deceleration, grip), min(limits.max_acceleration, grip, acceleration)) * sim.dt
        return min(max(speed, 0.0), max(limits.max_speed, ego.speed)) if ego.speed >= 0.0 else min(speed, 0.0)


def _failed(system: System, error: Exception, sim: Simulation) -> ToolchainError:
    """An error of a system under test, which is named."""
    if isinstance(error, ToolchainError):
        return error
    return ToolchainError(
        f"the system under test {system_name(system)} failed at {sim.time:.2f} s: {type(error).__name__}: {error}"
    )


def returning(ego: Entity, demand: float, dt: float) -> float:
    """Speed (m/s) after dt (s) on the way back to the scripted speed, when something else has driven the ego."""
    limits, change = ego.performance, demand - ego.speed
    faster = change * ego.speed >= 0.0
    most = dt * (min(_RETURN, limits.max_acceleration) if faster else limits.max_deceleration)
    return ego.speed + max(-most, min(most, change))


def _overridden(control: Control, ego: Entity) -> Control:
    """The system's control with the pedals that OverrideControllerValueAction holds in place of its own."""
    pedals = ego.overrides
    if not pedals.keys() & {"Throttle", "Brake", "ParkingBrake"}:
        return control
    limits, own = ego.performance, control.acceleration or 0.0
    forwards, backwards = max(own, 0.0), max(-own, 0.0)
    if "Throttle" in pedals:
        forwards = pedals["Throttle"] * min(limits.max_acceleration, _PEDAL)
    if "Brake" in pedals:
        backwards = pedals["Brake"] * min(limits.max_deceleration, _PEDAL)
    backwards = max(backwards, pedals.get("ParkingBrake", 0.0) * min(limits.max_deceleration, _PEDAL))
    if control.acceleration is None and forwards == backwards == 0.0:
        return control
    return replace(control, acceleration=forwards - backwards, reason="overridden controller inputs")
