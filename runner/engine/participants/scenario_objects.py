"""Read the entities of a scenario: objects with their trailers and controllers,
selections; remarks on controllers.

A controller that a scenario never activates has no say (OpenSCENARIO XML 1.3, 6.6); it is a remark
all the same where the scenario leaves open when controllers are active, as most files of version
1.0 do.

Scenarios for CARLA name controllers by their Python module: scenario_runner loads a controller's
Property `module`, one of its own or a file of the user's. Its own for vehicles and pedestrians move
an actor as the scenario's actions say, which is what happens here without them. All else is a
remark.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from pathlib import PurePosixPath

from runner.engine.compile.registry import Context
from runner.engine.participants.declaration import BoundingBox, Declaration, Performance
from runner.engine.participants.entity import Entity
from runner.engine.participants.trailers import train
from schemas.expressions.values import boolean
from xosc.document.node import Node

_KINDS = {"Vehicle": "vehicle", "Pedestrian": "pedestrian", "MiscObject": "miscellaneous"}


def read_entities(node: Node, context: Context) -> None:
    """Enter all scenario objects and selections of an Entities element into the context."""
    for scenario_object in node.children("ScenarioObject"):
        _read_scenario_object(scenario_object, scenario_object.get("name"), context)
    for selection in node.children("EntitySelection"):
        context.selections[selection.get("name")] = _read_selection(selection, context)


def read_object(node: Node, name: str) -> Declaration:
    """Read the declaration of a ScenarioObject, ScenarioObjectTemplate or
    Trailer, without its trailer.
    """
    described = next((child for child in node.children() if child.tag in _KINDS), None)
    if described is None:
        external = node.find("ExternalObjectReference")
        if external is not None:
            raise external.unsupported(
                "objects of an external library can't be loaded; describe the entity in the file"
            )
        raise node.invalid("a Vehicle, Pedestrian, MiscObject or CatalogReference is expected")
    kind, properties = _KINDS[described.tag], _read_properties(described)
    return Declaration(
        name=name,
        kind=kind,
        category=described.get(f"{kind}Category", "")
        if kind != "miscellaneous"
        else described.get("miscObjectCategory", ""),
        box=_read_box(described),
        performance=_read_performance(described.find("Performance")),
        front_axle=_read_front_axle(described, "positionX"),
        max_steering=_read_front_axle(described, "maxSteering"),
        model=described.get("model3d", "") or described.get("name", ""),
        mass=described.finite("mass", 0.0),
        role=described.get("role", "") or properties.get("role", ""),
        properties=properties,
        controllers={
            controller.get("name"): _read_properties(controller)
            for holder in node.children("ObjectController")
            for controller in holder.children("Controller")
        },
        hitch=_read_coupling(described, "TrailerHitch"),
        coupler=_read_coupling(described, "TrailerCoupler"),
        node=described,
    )


def _read_scenario_object(node: Node, name: str, context: Context) -> Entity:
    entity = Entity(read_object(node, name))
    if name in context.declared:
        raise node.invalid(f"the entity name {name!r} is used twice")
    context.declared[name] = entity
    for vehicle in node.children("Vehicle"):
        _read_trailer(vehicle, entity, context)
    return entity


def _read_properties(node: Node) -> dict[str, str]:
    properties = node.find("Properties")
    return (
        {p.get("name"): p.get("value") for p in properties.children("Property")}
        if properties is not None
        else {}
    )


def _read_coupling(node: Node, tag: str) -> float | None:
    coupling = node.find(tag)
    return float(coupling.finite("dx")) if coupling is not None else None


def _read_trailer(vehicle: Node, tractor: Entity, context: Context) -> None:
    """The Trailer of a vehicle: an entity of its own, or a reference to one of the scenario's.

    A trailer that is part of a catalogue entry would have the same name wherever the entry is used;
    it is called after its tractor, with a `+`. An empty reference, which entries leave to a
    parameter, means none. A vehicle without the element Trailer around it is a trailer all the
    same.
    """
    holder = vehicle.find("Trailer")
    if holder is None:
        return
    described = holder.only()
    if described.tag == "Trailer" or described.tag in _KINDS:
        ours = described.path == context.document.path
        whole = described if described.tag == "Trailer" else holder
        trailer = _read_scenario_object(
            whole, described.get("name") if ours else f"{tractor.name}+", context
        )
        _couple(described, tractor, trailer, context)
    elif described.get("entityRef"):
        context.late(lambda: _couple(described, tractor, context.entity(described), context))


def _couple(node: Node, tractor: Entity, trailer: Entity, context: Context) -> None:
    if tractor.declared.hitch is None:
        raise node.invalid(f"{tractor.name!r} has a trailer, but no TrailerHitch")
    if trailer.declared.coupler is None:
        raise node.invalid(f"{trailer.name!r} has no TrailerCoupler, so it can't be towed")
    if trailer.controls.tractor is not None:
        raise node.invalid(
            f"{trailer.name!r} is already the trailer of {trailer.controls.tractor.name!r}"
        )
    if tractor in train(trailer):
        raise node.invalid(
            f"{trailer.name!r} can't be the trailer of {tractor.name!r}, which it tows itself"
        )
    context.declared.couple(tractor, trailer)


_SMALLEST_BOX = 1e-3
"""Least size of the largest dimension of a vehicle's box, m; pedestrians and
objects of catalogues of CARLA are points
"""
_LARGEST_BOX = 1e6
"""Largest size of a box and offset of its centre (m); beyond it sums of
coordinates overflow or lose their decimals
"""


def _read_box(node: Node) -> BoundingBox:
    box = node.find("BoundingBox")
    if box is None:
        raise node.invalid("the element BoundingBox is missing")
    centre, size = box.need("Center"), box.need("Dimensions")
    dimensions = [size.finite(name) for name in ("length", "width", "height")]
    if min(dimensions) < 0.0:
        raise size.invalid("a bounding box must not have negative dimensions")
    if node.tag == "Vehicle" and max(dimensions) < _SMALLEST_BOX:
        raise size.invalid(
            f"a bounding box of {max(dimensions):g} m touches nothing; "
            f"one dimension must be at least {_SMALLEST_BOX:g} m"
        )
    offsets = [centre.finite(name) for name in ("x", "y", "z")]
    if max(*dimensions, *map(abs, offsets)) > _LARGEST_BOX:
        raise size.invalid(
            f"a bounding box must lie within {_LARGEST_BOX:g} m of the object's origin"
        )
    return BoundingBox(*offsets, *dimensions)


def _read_performance(node: Node | None) -> Performance:
    if node is None:
        return Performance()
    values = [node.float(name) for name in ("maxSpeed", "maxAcceleration", "maxDeceleration")]
    rates = [node.float(name, math.inf) for name in ("maxAccelerationRate", "maxDecelerationRate")]
    if min(*values, *rates) < 0.0:
        raise node.invalid("the limits of a vehicle must not be negative")
    return Performance(*values, *rates)


def _read_front_axle(node: Node, attribute: str) -> float:
    axle = node.find("Axles", "FrontAxle")
    return float(axle.finite(attribute)) if axle is not None else 0.0


def _read_selection(node: Node, context: Context) -> list[Entity]:
    members = node.need("Members")
    found: list[Entity] = []
    for member in members.children():
        if member.tag == "EntityRef":
            found += context.entities(member)
        elif member.tag == "ByType":
            kind = member.choice(
                "objectType", ("vehicle", "pedestrian", "miscellaneous", "external")
            )
            found += [
                entity for entity in context.declared.values() if entity.declared.kind == kind
            ]
    return list(dict.fromkeys(found))


EXTERNAL = "external_control"
"""Its actor is driven from outside: the system that is tested."""
_AS_SCRIPTED = {
    "npc_vehicle_control",
    "simple_vehicle_control",
    "vehicle_velocity_control",
    "vehicle_teleport_control",
}
_AS_SCRIPTED |= {"pedestrian_control"}
_STRAIGHT = "vehicle_longitudinal_control"
_REACTIONS = ("consider_obstacles", "consider_trafficlights")


def module_of(controller: Mapping[str, str]) -> str | None:
    """The name of a controller's module, without folders, packages and ending;
    None where its properties have none.
    """
    module = controller.get("module")
    return (
        PurePosixPath(module.replace("\\", "/")).name.removesuffix(".py").rpartition(".")[2]
        if module is not None
        else None
    )


def controller_remarks(
    entities: Iterable[Entity],
    activated: Collection[str],
    driven: Entity | None,
    cruise: float | None,
) -> tuple[str, ...]:
    """Remarks on the controllers that entities have at the end of a run.

    Args:
        entities: all entities of the scenario.
        activated: names of those whose controllers the scenario activates or deactivates at some
            time.
        driven: the one that a system under test has driven, if any: it takes the place of its
            controllers.
        cruise: speed (m/s) that the system was asked for where the scenario says none; None where
            it says one.
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
                text = (
                    f"{entity.name}: the controller {name!r} is not executed: it moves as scripted"
                    if active
                    else ""
                )
            remarks += [text] if text else []
        if entity.controls.activated and not entity.controls.controllers and entity is not driven:
            remarks.append(
                f"{entity.name}: a controller is activated, and the scenario gives it none: it "
                "moves as scripted"
            )
    if driven is not None and cruise is not None:
        asked = f"the system under test is asked for {cruise:.3g} m/s"
        remarks.append(
            f"{driven.name} is driven from outside ({EXTERNAL}), and Init gives "
            f"it no speed: {asked}"
        )
    return tuple(dict.fromkeys(remarks))


def _replaced(name: str, controller: str, properties: Mapping[str, str]) -> str:
    if module_of(properties) == EXTERNAL:
        return ""
    return (
        f"{name}: the system under test takes the place of the controller {controller!r}, which "
        "is not executed"
    )


def _module_remark(name: str, controller: Mapping[str, str]) -> str:
    module = module_of(controller)
    if module == EXTERNAL:
        return (
            f"{name} is to be driven from outside ({EXTERNAL}), and no system under test does "
            "(--sut): it moves as scripted"
        )
    if module == _STRAIGHT:
        return f"{name}: {module} would not steer; it follows its lane"
    if module in _AS_SCRIPTED:
        ignored = [reaction for reaction in _REACTIONS if _is_on(controller.get(reaction, ""))]
        return (
            f"{name}: {' and '.join(ignored)} of {module} is not executed: it moves as scripted"
            if ignored
            else ""
        )
    return f"{name}: the controller {controller['module']} is not executed: it moves as scripted"


def _is_on(text: str) -> bool:
    try:
        return boolean(text.strip().lower())
    except ValueError:
        return False
