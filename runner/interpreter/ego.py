"""The ego: how it is found, and from when on a system under test drives it.

The ego is, in this order: the entity named by the caller (`--ego`); the vehicle called `Ego` (any case, also
`EgoVehicle`, `ego_vehicle`, `hero`; of several one with a controller, then the first); the first vehicle whose Property
`type` is `ego_vehicle`, as in files for CARLA; the only vehicle with a controller.
Scenarios without any of these have no ego, and no system under test drives anyone.

A scenario that assigns the ego a controller hands it over by ActivateControllerAction: until then, and in domains that
it deactivates, the ego does what is scripted (OpenSCENARIO XML 1.3, 6.6: controllers are assigned deactivated). A
scenario that never activates a controller of the ego is driven by the system under test from the beginning.

An ego that files for CARLA leave to `external_control`, without a speed in Init, is no ego that stands: the system under test
is asked for `CRUISE` until the scenario says a speed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from runner.actions.controller import AssignControllerAction
from runner.contracts.action import LONGITUDINAL, PrivateAction
from runner.interpreter.drivers import EgoDriver, SystemDriver, WorldDriver, failed
from runner.participants.controllers import EXTERNAL, module_of
from runner.sut.base import WorldDriven, seen
from schemas.common.errors import UsageError
from xosc.names import EGO_NAME

if TYPE_CHECKING:
    from runner.interpreter.compiler import Scenario
    from runner.participants.entity import Entity
    from runner.sut import System

CRUISE = 20.0 / 3.6
"""Speed (m/s) of an ego that is driven from outside: by default that of CARLA's BasicAgent."""


def find_ego(scenario: Scenario, name: str | None) -> Entity | None:
    """The ego of a scenario; None where it has none.

    Raises:
        UsageError: no entity has the given name.
    """
    if name is not None:
        if name not in scenario.entities:
            raise UsageError(f"no entity is called {name!r}; there are {', '.join(scenario.entities)}", path=scenario.path)
        return scenario.entities[name]
    vehicles = [entity for entity in scenario.entities.values() if entity.declared.kind == "vehicle"]
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


def driver_of(scenario: Scenario, ego: Entity, system: System, timestep: float, seed: int) -> EgoDriver:
    """Return the ego's driver for a system under test, which is reset; timestep in s."""
    try:
        system.reset(seen(ego), timestep, seed)
    except Exception as error:
        raise failed(system, error, 0.0) from error
    handed_over = ego.name not in scenario.activated
    if isinstance(system, WorldDriven):
        return WorldDriver(handed_over, _scripted_at_start(scenario, ego))
    return SystemDriver(system, handed_over, cruise_speed(scenario, ego))


def cruise_speed(scenario: Scenario, ego: Entity) -> float | None:
    """Speed (m/s) of an ego that is driven from outside and has no speed to begin with; None for all others."""
    assigned = [
        action.properties
        for actor, element in scenario.storyboard.init
        for action in element.actions
        if actor is ego and isinstance(action, AssignControllerAction)
    ]
    external = any(module_of(each) == EXTERNAL for each in (*assigned, *ego.declared.controllers.values()))
    return CRUISE if external and not _scripted_at_start(scenario, ego) else None


def _scripted_at_start(scenario: Scenario, ego: Entity) -> bool:
    """Whether an initial action says how fast the ego is."""
    elements = [element for actor, element in scenario.storyboard.init if actor is ego]
    private = [action for element in elements for action in element.actions if isinstance(action, PrivateAction)]
    return any(LONGITUDINAL in action.claims() for action in private)
