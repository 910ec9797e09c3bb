"""Entities and controllers that are referred to exist, have names of their own and get a position; actions have actors."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.findings import on_cycles, unknown, unresolved
from schemas.checks.registry import Finding, rule
from schemas.xml import local_name


@rule("asam.net:xosc:1.2.0:reference_control.resolvable_entity_references", kinds=("scenario",))
def entity_exists(document: Document) -> Iterator[Finding]:
    """A reference to an entity must name a ScenarioObject or an EntitySelection of the scenario."""
    entities = document.names("ScenarioObject", "EntitySelection")
    return unresolved(document, "entity", entities, "entityRef", "masterEntityRef", "trailerRef")


CONTROLLER_UID = "xosc.toolchain:xosc:1.0.0:reference_control.resolvable_controller_reference"

_HOLDERS = {"ObjectController", "AssignControllerAction"}


@rule(CONTROLLER_UID, kinds=("scenario",))
def controller_exists(document: Document) -> Iterator[Finding]:
    """A controllerRef must name a controller that an entity has or is assigned, itself or by a catalogue entry."""
    controllers = document.names("ObjectController", "Controller") | {
        entry
        for element, _, entry in document.values("entryName")
        if local_name(element.getparent()) in _HOLDERS  # type: ignore[arg-type]  # a catalogue reference has a parent
    }
    for element, attribute, name in document.values("controllerRef", "objectControllerRef"):
        if name not in controllers:
            yield Finding(element, f"{attribute}: {unknown('controller', name, controllers)}")


@rule("asam.net:xosc:1.2.0:reference_control.uniquely_resolvable_entity_references", level="warning", since=(1, 2))
def catalog_entries_have_own_names(document: Document) -> Iterator[Finding]:
    """Entries of a catalogue shall have names of their own, or references to them are ambiguous."""
    return _ambiguous(document, "Catalog")


@rule("xosc.toolchain:xosc:1.0.0:reference_control.entities_have_names_of_their_own", kinds=("scenario",))
def entities_have_own_names(document: Document) -> Iterator[Finding]:
    """Entities shall have names of their own, or references to them are ambiguous."""
    return _ambiguous(document, "Entities")


def _ambiguous(document: Document, holder: str) -> Iterator[Finding]:
    seen: set[str] = set()
    for parent in document.elements(holder):
        for element in parent.iterchildren(etree.Element):
            name = document.value(element, "name")
            if name is not None and name in seen:
                yield Finding(element, f"{local_name(element)} {name!r} has the name of another, references to it are ambiguous")
            elif name is not None:
                seen.add(name)


@rule("xosc.toolchain:xosc:1.0.0:reference_control.no_cyclic_entity_selections", kinds=("scenario",))
def selections_are_not_cyclic(document: Document) -> Iterator[Finding]:
    """An EntitySelection must not be a member of itself, directly or through other selections."""
    selections = {selection.get("name") or "": selection for selection in document.elements("EntitySelection")}
    members = {
        name: [member for ref in selection.iter("EntityRef") if (member := document.value(ref, "entityRef"))]
        for name, selection in selections.items()
    }
    for name in on_cycles(members):
        yield Finding(selections[name], f"the entity selection {name!r} is a member of itself")


ENTITY_POSITION_UID = "xosc.toolchain:xosc:1.0.0:storyboard.entities_get_a_position"

_PLACING = ("TeleportAction", "FollowTrajectoryAction")
_TRAILERS = ("TrailerRef", "ConnectTrailerAction")


@rule(ENTITY_POSITION_UID, level="warning", kinds=("scenario",))
def entity_gets_a_position(document: Document) -> Iterator[Finding]:
    """An entity should be put somewhere by an action: without one it never appears.

    Which entities trigger an event is known in a run only, so a scenario that selects these as actors is not looked at, nor one
    whose actions place selections of entities, or entities that it does not declare.
    """
    if any(document.value(actors, "selectTriggeringEntities") not in ("false", "0") for actors in document.elements("Actors")):
        return
    entities, placed = document.names("ScenarioObject"), set(_placed(document))
    if not placed <= entities:
        return
    for entity in document.elements("ScenarioObject"):
        name = document.value(entity, "name")
        if name is not None and name not in placed:
            yield Finding(entity, f"no action gives the entity {name!r} a position: it never appears")


def _placed(document: Document) -> Iterator[str | None]:
    """Names of the entities that actions put somewhere, and of trailers."""
    for private in document.elements("Private"):
        if _places(document, private):
            yield document.value(private, "entityRef")
    for action in document.elements("EntityAction"):
        if action.find("AddEntityAction") is not None:
            yield document.value(action, "entityRef")
    for group in document.elements("ManeuverGroup"):
        if _places(document, group):
            yield from (document.value(actor, "entityRef") for actor in group.iterfind("Actors/EntityRef"))
    for trailer in document.elements(*_TRAILERS):
        yield document.value(trailer, "trailerRef") or document.value(trailer, "entityRef")


def _places(document: Document, element: etree._Element) -> bool:
    """Whether an element, or a maneuver of a catalogue in it, has an action that puts an entity somewhere."""
    entries = [document.resolvable_entry(reference) for reference in element.iterchildren("CatalogReference")]
    inside = [element, *(entry.element for entry in entries if entry is not None)]
    return any(next(each.iter(*_PLACING), None) is not None for each in inside)


ACTORS_UID = "asam.net:xosc:1.2.0:reference_control.valid_actor_reference_in_private_actions"


@rule(ACTORS_UID, kinds=("scenario",))
def private_actions_have_actors(document: Document) -> Iterator[Finding]:
    """A ManeuverGroup with private actions must have actors, named or selected as the triggering entities."""
    for group in document.elements("ManeuverGroup"):
        actors = group.find("Actors")
        if actors is None or actors.find("EntityRef") is not None or group.find(".//PrivateAction") is None:
            continue
        what = f"the private actions of the maneuver group {group.get('name')!r} have no actor"
        selected = document.value(actors, "selectTriggeringEntities")
        if selected not in ("true", "1", None):
            yield Finding(actors, what)
        elif selected is not None and not _is_triggered_by_entities(group):
            yield Finding(actors, f"{what}: no entity triggers its start")


def _is_triggered_by_entities(group: etree._Element) -> bool:
    """Whether a condition by entity is part of what starts a maneuver group's act or events."""
    act = group.getparent()
    return act is None or act.find(".//StartTrigger//TriggeringEntities") is not None


KEPT_LANE_OFFSET_UID = "xosc.toolchain:xosc:1.0.0:actions.kept_lane_offset_is_from_another_entity"


@rule(KEPT_LANE_OFFSET_UID, kinds=("scenario",))
def kept_lane_offset_is_from_another_entity(document: Document) -> Iterator[Finding]:
    """A continuous LaneOffsetAction must not keep an offset from its own actor's: that would run away."""
    for action in document.elements("LaneOffsetAction"):
        target = action.find("LaneOffsetTarget/RelativeTargetLaneOffset")
        if target is None or document.value(action, "continuous") not in ("true", "1") or not document.number(target, "value"):
            continue
        name = document.value(target, "entityRef")
        if name is not None and name in _actors(document, action):
            yield Finding(target, f"{name!r} can't keep an offset from its own lane offset")


def _actors(document: Document, action: etree._Element) -> set[str | None]:
    """Names of the entities that a private action is for."""
    for above in action.iterancestors("Private", "ManeuverGroup"):
        return {document.value(actor, "entityRef") for actor in (above, *above.iterfind("Actors/EntityRef"))}
    return set()
