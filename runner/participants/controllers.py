"""What is said of controllers that a scenario for CARLA names by their Python module, and that are not executed here.

scenario_runner loads a controller's Property `module`: one of its own, or a file of the user's. Its own for vehicles and
pedestrians move an actor as the scenario's actions say, which is what happens here without them. All else is a remark.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
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


def controller_remarks(entities: Iterable[Entity], driven: Entity | None, cruise: float | None) -> tuple[str, ...]:
    """Remarks on the controllers that entities have at the end of a run.

    Args:
        entities: all entities of the scenario.
        driven: the one that a system under test has driven, if any: it takes the place of its controllers.
        cruise: speed (m/s) that the system was asked for where the scenario says none; None where it says one.
    """
    others = (entity for entity in entities if entity is not driven)
    found = [(entity, each) for entity in others for each in entity.controls.controllers.values()]
    remarks = [text for entity, each in found if (text := _remark(entity.name, each))]
    if driven is not None and cruise is not None:
        asked = f"the system under test is asked for {cruise:.3g} m/s"
        remarks.append(f"{driven.name} is driven from outside ({EXTERNAL}), and Init gives it no speed: {asked}")
    return tuple(dict.fromkeys(remarks))


def _remark(name: str, controller: Mapping[str, str]) -> str:
    module = module_of(controller)
    if module == EXTERNAL:
        return f"{name} is to be driven from outside ({EXTERNAL}), and no system under test does (--sut): it moves as scripted"
    if module == _STRAIGHT:
        return f"{name}: {module} would not steer; it follows its lane"
    if module in _AS_SCRIPTED:
        ignored = [reaction for reaction in _REACTIONS if _is_on(controller.get(reaction, ""))]
        return f"{name}: {' and '.join(ignored)} of {module} is not executed: it moves as scripted" if ignored else ""
    return f"{name}: the controller {controller['module']} is not executed: it moves as scripted" if module is not None else ""


def _is_on(text: str) -> bool:
    try:
        return boolean(text.strip().lower())
    except ValueError:
        return False
