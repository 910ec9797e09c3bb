"""Entities, controllers, traffic signals, catalogues and other files that are referred to exist;
actions have actors."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path, PurePosixPath, PureWindowsPath

from lxml import etree

from schemas.catalogs import DIRECTORIES, ENTRIES, REFERENCES, NoEntry, locate
from schemas.checks.document import CheckedDocument
from schemas.checks.registry import Finding, negative, on_cycles, rule, unknown, unresolved
from schemas.common.policy import current
from schemas.common.storage import in_any_case, similar_file
from schemas.common.xml import local_name


@rule("asam.net:xosc:1.2.0:reference_control.resolvable_entity_references", kinds=("scenario",))
def entity_exists(document: CheckedDocument) -> Iterator[Finding]:
    """A reference to an entity must name a ScenarioObject or an EntitySelection of the scenario."""
    # Selections count as entities: members are checked by the same attribute in their EntityRef.
    entities = document.names("ScenarioObject", "EntitySelection")
    return unresolved(document, "entity", entities, "entityRef", "masterEntityRef", "trailerRef")


CONTROLLER_UID = "xosc.toolchain:xosc:1.0.0:reference_control.resolvable_controller_reference"

_HOLDERS = {"ObjectController", "AssignControllerAction"}


@rule(CONTROLLER_UID, kinds=("scenario",))
def controller_exists(document: CheckedDocument) -> Iterator[Finding]:
    """A controllerRef must name a controller that an entity has or is assigned, itself or by a
    catalogue entry."""
    # The catalogue may not be at hand: the name of the entry is then all that is known of it.
    controllers = document.names("ObjectController", "Controller") | {
        entry
        for element, _, entry in document.values("entryName")
        if local_name(element.getparent()) in _HOLDERS  # type: ignore[arg-type]  # a catalogue reference has a parent
    }
    for element, attribute, name in document.values("controllerRef", "objectControllerRef"):
        if name not in controllers:
            yield Finding(element, f"{attribute}: {unknown('controller', name, controllers)}")


@rule(
    "asam.net:xosc:1.2.0:reference_control.uniquely_resolvable_entity_references",
    level="warning",
    since=(1, 2),
)
def catalog_entries_have_own_names(document: CheckedDocument) -> Iterator[Finding]:
    """Entries of a catalogue shall have names of their own, or references to them are ambiguous."""
    return _ambiguous(document, "Catalog")


@rule(
    "xosc.toolchain:xosc:1.0.0:reference_control.entities_have_names_of_their_own",
    kinds=("scenario",),
)
def entities_have_own_names(document: CheckedDocument) -> Iterator[Finding]:
    """Entities shall have names of their own, or references to them are ambiguous."""
    return _ambiguous(document, "Entities")


def _ambiguous(document: CheckedDocument, holder: str) -> Iterator[Finding]:
    seen: set[str] = set()
    for parent in document.elements(holder):
        for element in parent.iterchildren(etree.Element):
            name = document.value(element, "name")
            if name is not None and name in seen:
                yield Finding(
                    element,
                    f"{local_name(element)} {name!r} has the name of another, references to it "
                    "are ambiguous",
                )
            # Undecidable names may differ: nothing is said of them.
            elif name is not None:
                seen.add(name)


@rule(
    "xosc.toolchain:xosc:1.0.0:reference_control.no_cyclic_entity_selections", kinds=("scenario",)
)
def selections_are_not_cyclic(document: CheckedDocument) -> Iterator[Finding]:
    """An EntitySelection must not be a member of itself, directly or through other selections."""
    selections = {
        selection.get("name") or "": selection for selection in document.elements("EntitySelection")
    }
    # Selections of one name are another rule's fault; the last one stands for them here.
    members = {
        name: [
            member
            for ref in selection.iter("EntityRef")
            if (member := document.value(ref, "entityRef"))
        ]
        for name, selection in selections.items()
    }
    for name in on_cycles(members):
        yield Finding(selections[name], f"the entity selection {name!r} is a member of itself")


ENTITY_POSITION_UID = "xosc.toolchain:xosc:1.0.0:storyboard.entities_get_a_position"

_PLACING = ("TeleportAction", "FollowTrajectoryAction")
_TRAILERS = ("TrailerRef", "ConnectTrailerAction")


@rule(ENTITY_POSITION_UID, level="warning", kinds=("scenario",))
def entity_gets_a_position(document: CheckedDocument) -> Iterator[Finding]:
    """An entity should be put somewhere by an action: without one it never appears.

    Which entities trigger an event is known in a run only, so a scenario that selects these as
    actors is not looked at, nor one whose actions place selections of entities, or entities that it
    does not declare.
    """
    if any(
        # Also where a parameter without a value decides it.
        document.value(actors, "selectTriggeringEntities") not in ("false", "0")
        for actors in document.elements("Actors")
    ):
        return
    entities, placed = document.names("ScenarioObject"), set(_placed(document))
    # A selection or an undeclared name may be any of the entities.
    if not placed <= entities:
        return
    for entity in document.elements("ScenarioObject"):
        name = document.value(entity, "name")
        if name is not None and name not in placed:
            yield Finding(
                entity, f"no action gives the entity {name!r} a position: it never appears"
            )


def _placed(document: CheckedDocument) -> Iterator[str | None]:
    """Names of the entities that actions put somewhere, and of trailers."""
    for private in document.elements("Private"):
        if _places(document, private):
            yield document.value(private, "entityRef")
    for action in document.elements("EntityAction"):
        # AddEntityAction has a position, whatever else places entities.
        if action.find("AddEntityAction") is not None:
            yield document.value(action, "entityRef")
    for group in document.elements("ManeuverGroup"):
        if _places(document, group):
            yield from (
                document.value(actor, "entityRef") for actor in group.iterfind("Actors/EntityRef")
            )
    for trailer in document.elements(*_TRAILERS):
        # A trailer is put behind its tractor. TrailerRef has entityRef, ConnectTrailerAction
        # trailerRef.
        yield document.value(trailer, "trailerRef") or document.value(trailer, "entityRef")


def _places(document: CheckedDocument, element: etree._Element) -> bool:
    """Whether an element, or a maneuver of a catalogue in it, has an action that puts an entity
    somewhere, or may have: a maneuver that is not at hand has any."""
    inside = [element]
    for reference in element.iterchildren("CatalogReference"):
        entry = document.resolvable_entry(reference)
        if entry is None:
            return True
        inside.append(entry.element)
    return any(next(part.iter(*_PLACING), None) is not None for part in inside)


ACTORS_UID = "asam.net:xosc:1.2.0:reference_control.valid_actor_reference_in_private_actions"


@rule(ACTORS_UID, kinds=("scenario",))
def private_actions_have_actors(document: CheckedDocument) -> Iterator[Finding]:
    """A ManeuverGroup with private actions must have actors, named or selected as the triggering
    entities."""
    for group in document.elements("ManeuverGroup"):
        actors = group.find("Actors")
        if (
            actors is None
            or actors.find("EntityRef") is not None
            # Global actions need no actor.
            or group.find(".//PrivateAction") is None
        ):
            continue
        what = f"the private actions of the maneuver group {group.get('name')!r} have no actor"
        selected = document.value(actors, "selectTriggeringEntities")
        # None: a parameter without a value decides, and nothing can be said.
        if selected not in ("true", "1", None):
            yield Finding(actors, what)
        elif selected is not None and not _is_triggered_by_entities(group):
            yield Finding(actors, f"{what}: no entity triggers its start")


def _is_triggered_by_entities(group: etree._Element) -> bool:
    """Whether a condition by entity is part of what starts a maneuver group's act or events."""
    act = group.getparent()
    # Of the act as a whole: triggering entities of its start are those of all its groups.
    return act is None or act.find(".//StartTrigger//TriggeringEntities") is not None


KEPT_LANE_OFFSET_UID = "xosc.toolchain:xosc:1.0.0:actions.kept_lane_offset_is_from_another_entity"


@rule(KEPT_LANE_OFFSET_UID, kinds=("scenario",))
def kept_lane_offset_is_from_another_entity(document: CheckedDocument) -> Iterator[Finding]:
    """A continuous LaneOffsetAction must not keep an offset from its own actor's: that would run
    away."""
    for action in document.elements("LaneOffsetAction"):
        target = action.find("LaneOffsetTarget/RelativeTargetLaneOffset")
        if (
            target is None
            or document.value(action, "continuous") not in ("true", "1")
            # An offset of 0 from oneself stays where it is.
            or not document.number(target, "value")
        ):
            continue
        name = document.value(target, "entityRef")
        if name is not None and name in _actors(document, action):
            yield Finding(target, f"{name!r} can't keep an offset from its own lane offset")


OTHER_ENTITY_UID = "xosc.toolchain:xosc:1.0.0:reference_control.relation_is_to_another_entity"


@rule(OTHER_ENTITY_UID, kinds=("scenario",), level="warning")
def relation_is_to_another_entity(document: CheckedDocument) -> Iterator[Finding]:
    """A condition must not compare an entity with itself, and a lane change must not lead into its
    actor's own lane.

    Such a condition has the same value at all times, and such a lane change does nothing.
    """
    for triggering in document.elements("TriggeringEntities"):
        names = {
            document.value(reference, "entityRef") for reference in triggering.iterfind("EntityRef")
        }
        for condition in triggering.iterfind("../EntityCondition/*"):
            name = document.value(condition, "entityRef")
            # With others beside it the condition compares these with it, and can change.
            if name is not None and names == {name}:
                yield Finding(condition, f"{name!r} is compared with itself, which never changes")
    for action in document.elements("LaneChangeAction"):
        target = action.find("LaneChangeTarget/RelativeTargetLane")
        if (
            target is not None
            and document.number(target, "value") == 0
            # With an offset the action does something: it moves within the lane.
            and action.get("targetLaneOffset", "0") in ("0", "0.0")
        ):
            name = document.value(target, "entityRef")
            if name is not None and _actors(document, action) - {None} == {name}:
                yield Finding(
                    target, f"{name!r} is to change into the lane that it is in, which does nothing"
                )


def _actors(document: CheckedDocument, action: etree._Element) -> set[str | None]:
    """Names of the entities that a private action is for."""
    # The nearest of the two: actions of Init have their actor in Private, others in the group.
    for above in action.iterancestors("Private", "ManeuverGroup"):
        return {
            document.value(actor, "entityRef")
            for actor in (above, *above.iterfind("Actors/EntityRef"))
        }
    return set()


# traffic signals --------------------------------------------------------------------------------


SIGNAL_UID = "asam.net:xosc:1.0.0:reference_control.traffic_signal_state_references"


@rule(SIGNAL_UID, kinds=("scenario",))
def signal_exists(document: CheckedDocument) -> Iterator[Finding]:
    """The signals of a TrafficSignalState and of a TrafficSignalCondition must exist in the road
    network."""
    # One rule for both by ASAM, though the attributes differ.
    yield from _unknown_signals(document, "TrafficSignalState", "trafficSignalId")
    yield from _unknown_signals(document, "TrafficSignalCondition", "name")


@rule(
    "asam.net:xosc:1.2.0:reference_control.resolvable_signal_id_in_traffic_signal_state_action",
    kinds=("scenario",),
)
def signal_of_action_exists(document: CheckedDocument) -> Iterator[Finding]:
    """The name of a TrafficSignalStateAction must be the id of a signal in the road network."""
    yield from _unknown_signals(document, "TrafficSignalStateAction", "name")


def _unknown_signals(document: CheckedDocument, tag: str, attribute: str) -> Iterator[Finding]:
    network = document.road_network
    # Without a readable road network nothing is known of signals: its own rule tells that.
    for element in document.elements(tag) if network else ():
        name = document.value(element, attribute)
        if network and name is not None and name not in network.signals:
            yield Finding(
                element,
                f"{attribute}: {unknown('signal', name, network.signals)} in {network.path.name}",
            )


@rule(
    "asam.net:xosc:1.2.0:reference_control.resolvable_traffic_signal_controller_by_traffic_signal_controller_ref",
    kinds=("scenario",),
)
def signal_controller_exists(document: CheckedDocument) -> Iterator[Finding]:
    """A trafficSignalControllerRef must name a TrafficSignalController of the scenario's
    RoadNetwork."""
    controllers = document.names("TrafficSignalController")
    return unresolved(
        document, "traffic signal controller", controllers, "trafficSignalControllerRef"
    )


@rule(
    "asam.net:xosc:1.0.0:reference_control.traffic_signal_controller_references",
    kinds=("scenario",),
)
def signal_controllers_refer_to_others(document: CheckedDocument) -> Iterator[Finding]:
    """The reference of a TrafficSignalController shall name another TrafficSignalController, and
    not lead back to itself."""
    controllers = {
        document.value(controller, "name"): controller
        for controller in document.elements("TrafficSignalController")
    }
    references = {
        name: document.value(controller, "reference") for name, controller in controllers.items()
    }
    for name, reference in references.items():
        if reference is not None and reference not in controllers:
            message = (
                "reference: "
                f"{unknown('traffic signal controller', reference, filter(None, controllers))}"
            )
            yield Finding(controllers[name], message)
    for name in on_cycles(
        {
            name: [reference] if reference is not None else []
            for name, reference in references.items()
        }
    ):
        yield Finding(controllers[name], f"the traffic signal controller {name!r} refers to itself")


@rule("xosc.toolchain:xosc:1.0.0:reference_control.resolvable_phase_reference", kinds=("scenario",))
def phase_exists(document: CheckedDocument) -> Iterator[Finding]:
    """The phase of an action or a condition on a traffic signal controller must be one of that
    controller's phases."""
    phases = {
        document.value(controller, "name"): {
            document.value(phase, "name") or "" for phase in controller.iter("Phase")
        }
        for controller in document.elements("TrafficSignalController")
    }
    for element, _, controller in document.values("trafficSignalControllerRef"):
        phase = document.value(element, "phase")
        # An unknown controller is told by the rule on its name.
        if controller in phases and phase is not None and phase not in phases[controller]:
            yield Finding(
                element,
                f"phase: {unknown('phase', phase, phases[controller])} of the controller "
                f"{controller!r}",
            )


@rule("asam.net:xosc:1.2.0:data_type.positive_duration_in_phase")
def phase_duration_is_not_negative(document: CheckedDocument) -> Iterator[Finding]:
    """The duration of a Phase of a TrafficSignalController shall be non-negative."""
    return negative(document, [("Phase", "duration")])


# catalogues and other files ---------------------------------------------------------------------


@rule(DIRECTORIES, level="warning", kinds=("scenario",))
def catalog_directory_exists(document: CheckedDocument) -> Iterator[Finding]:
    """A catalogue location must name an existing folder, relative to the scenario.

    A warning: templates list locations that they do not use, and libraries that have been moved are
    found by their name.
    """
    for element in document.elements("Directory"):
        name = document.value(element, "path")
        if name is None:
            continue
        try:
            fault = locate(document.file(name), document.path, document.catalog_path).assumed
        except (OSError, ValueError):
            fault = f"there is no folder {name!r}"
        if fault:
            location = local_name(element.getparent())  # type: ignore[arg-type]  # a Directory is in a location
            yield Finding(element, f"{location}: {fault}")


@rule(ENTRIES, kinds=("scenario",))
def catalog_entry_exists(document: CheckedDocument) -> Iterator[Finding]:
    """A CatalogReference must name an entry of a catalogue in one of the catalogue locations.

    Where a catalogue location is not there the entry may be in it, and this is a warning.
    """
    for element in document.elements(*REFERENCES):
        try:
            entry = document.entry(element)
        except NoEntry as error:
            yield Finding(element, str(error), "warning" if error.undecided else None)
            continue
        # A catalogue is found by the name of its file too, as other players do: a remark, no fault.
        if entry is not None and entry.catalog != document.value(element, "catalogName"):
            message = (
                f"{Path(entry.path).name} has the entry, but its catalogue is called "
                f"{entry.catalog!r}"
            )
            yield Finding(element, message, "warning")


@rule("xosc.toolchain:xosc:1.0.0:parameters.assigned_parameter_is_declared", kinds=("scenario",))
def assigned_parameter_is_declared(document: CheckedDocument) -> Iterator[Finding]:
    """A ParameterAssignment of a CatalogReference must name a parameter that the catalogue entry
    declares."""
    for reference in document.elements(*REFERENCES):
        entry = document.resolvable_entry(reference)
        if entry is None:
            continue
        for assignment in reference.iter("ParameterAssignment"):
            # Files of version 1.0 write the name with a `$`.
            name = (assignment.get("parameterRef") or "").removeprefix("$")
            if name not in entry.parameters:
                yield Finding(
                    assignment,
                    f"parameterRef: {unknown('parameter', name, entry.parameters)} in the "
                    "catalogue entry",
                )


_LEVELS = {
    "LogicFile": "error",
    "ScenarioFile": "error",
    "SceneGraphFile": "warning",
    "File": "warning",
}


@rule("xosc.toolchain:xosc:1.0.0:reference_control.resolvable_file_reference")
def referred_file_exists(document: CheckedDocument) -> Iterator[Finding]:
    """A file that is referred to must exist, relative to the referring file; a road network may be
    in a folder asked for.

    Models for graphics and animations are only warned about, since a run can do without them; so
    are absolute paths, which may exist on the machine that they are meant for.
    """
    # The road and the scenario are needed to say anything; models of graphics are not.
    for tag, level in _LEVELS.items():
        for element in document.elements(tag):
            name = document.value(element, "filepath")
            if name and not _exists(document, tag, name):
                # By both kinds of paths: files come from systems other than this one.
                absolute = PurePosixPath(name).is_absolute() or PureWindowsPath(name).is_absolute()
                # Before any look at the disk: not even the names in such folders may be told.
                if not current().allows(document.file(name)):
                    yield Finding(
                        element,
                        f"{tag}: {name!r} {current().outside}, which --untrusted refuses",
                        "error",
                    )
                    continue
                place = "" if absolute else f" in {document.path.parent}"
                yield Finding(
                    element,
                    f"{tag}: there is no file {name!r}{place}{_instead(document.file(name))}",
                    "warning" if absolute else level,
                )


def _instead(path: Path) -> str:
    """End of the message for a missing file: what the path is, or which file may be meant."""
    alike = in_any_case(path)
    # It finds folders too, and of a folder the path itself.
    if alike is not None and alike.is_dir():
        return ": this is a folder"
    if alike is not None:
        return f"; {alike} differs in upper and lower case"
    meant = similar_file(path)
    return f"; {meant.strip()}" if meant else ""


def _exists(document: CheckedDocument, tag: str, name: str) -> bool:
    return document.road_file(name) is not None if tag == "LogicFile" else document.has_file(name)
