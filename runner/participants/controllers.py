"""Remarks on controllers: none is executed, because they are programs outside of the scenario.

A controller that a scenario never activates has no say (OpenSCENARIO XML 1.3, 6.6); it is a remark all the same where the
scenario leaves open when controllers are active, as most files of version 1.0 do.

Scenarios for CARLA name controllers by their Python module: scenario_runner loads a controller's Property `module`, one of its
own or a file of the user's. Its own for vehicles and pedestrians move an actor as the scenario's actions say, which is what
happens here without them. All else is a remark.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from schemas.values import boolean

if TYPE_CHECKING:
    from runner.participants.entity import Entity

EXTERNAL = "external_control"
"""Its actor is driven from outside: the system that is tested."""
_AS_SCRIPTED = {"npc_vehicle_control", "simple_vehicle_control", "vehicle_velocity_control", "vehicle_teleport_control"}
_AS_SCRIPTED |= {"pedestrian_control"}
_STRAIGHT = "vehicle_longitudinal_control"
_REACTIONS = ("consider_obstacles", "consider_trafficlights")


def module_of(controller: Mapping[str, str]) -> str | None:
    """The name of a controller's module, without folders, packages and ending; None where its properties have none."""
    module = controller.get("module")
    return PurePosixPath(module.replace("\\", "/")).name.removesuffix(".py").rpartition(".")[2] if module is not None else None


def controller_remarks(
    entities: Iterable[Entity], activated: Collection[str], driven: Entity | None, cruise: float | None
) -> tuple[str, ...]:
    """Remarks on the controllers that entities have at the end of a run.

    Args:
        entities: all entities of the scenario.
        activated: names of those whose controllers the scenario activates or deactivates at some time.
        driven: the one that a system under test has driven, if any: it takes the place of its controllers.
        cruise: speed (m/s) that the system was asked for where the scenario says none; None where it says one.
    """
    remarks = []
    for entity in entities:
        active = entity.controls.activated or entity.name not in activated
        for name, controller in entity.controls.controllers.items():
            if entity is driven:
                text = _replaced(entity.name, name, controller)
            elif module_of(controller) is not None:
                text = _module_remark(entity.name, controller)
            else:
                text = f"{entity.name}: the controller {name!r} is not executed: it moves as scripted" if active else ""
            remarks += [text] if text else []
        if entity.controls.activated and not entity.controls.controllers and entity is not driven:
            remarks.append(f"{entity.name}: a controller is activated, and the scenario gives it none: it moves as scripted")
    if driven is not None and cruise is not None:
        asked = f"the system under test is asked for {cruise:.3g} m/s"
        remarks.append(f"{driven.name} is driven from outside ({EXTERNAL}), and Init gives it no speed: {asked}")
    return tuple(dict.fromkeys(remarks))


def _replaced(name: str, controller: str, properties: Mapping[str, str]) -> str:
    if module_of(properties) == EXTERNAL:
        return ""
    return f"{name}: the system under test takes the place of the controller {controller!r}, which is not executed"


def _module_remark(name: str, controller: Mapping[str, str]) -> str:
    module = module_of(controller)
    if module == EXTERNAL:
        return f"{name} is to be driven from outside ({EXTERNAL}), and no system under test does (--sut): it moves as scripted"
    if module == _STRAIGHT:
        return f"{name}: {module} would not steer; it follows its lane"
    if module in _AS_SCRIPTED:
        ignored = [reaction for reaction in _REACTIONS if _is_on(controller.get(reaction, ""))]
        return f"{name}: {' and '.join(ignored)} of {module} is not executed: it moves as scripted" if ignored else ""
    return f"{name}: the controller {controller['module']} is not executed: it moves as scripted"


def _is_on(text: str) -> bool:
    try:
        return boolean(text.strip().lower())
    except ValueError:
        return False
