"""Compile a resolved OpenSCENARIO document: elements become runtime objects, all references are
checked.

The result can be run again and again: what a run changes of it is reset before the next one.
Everything that is not executed is refused here, by name, file and line.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runner.engine.compile import registry
from runner.engine.compile.element import (
    Action,
    ByEntityCondition,
    Condition,
    PrivateAction,
    VaryingAction,
    VaryingPosition,
)
from runner.engine.participants.entity import Entities, Entity
from runner.engine.participants.scenario_objects import read_entities
from runner.engine.storyboard.departures import absence
from runner.engine.storyboard.story_elements import ActionElement
from runner.engine.storyboard.storyboard import (
    Act,
    Event,
    Maneuver,
    ManeuverGroup,
    Story,
    Storyboard,
    check_actors,
    placeable,
)
from runner.engine.storyboard.triggers import OneShotCondition, TimedCondition, Trigger
from runner.engine.worlds.surroundings import TrafficSignals
from schemas.checks.structure import SCHEMA_UID
from schemas.common.errors import nearest
from schemas.common.remarks import Remark, Remarks, with_ignored
from schemas.expressions.columns import is_reading
from schemas.expressions.values import MARK
from xosc.document.carla import FLAG_RULE
from xosc.document.node import Node
from xosc.rules.references import ACTORS_UID, OTHER_ENTITY_UID, SIGNAL_UID
from xosc.rules.storyboard import EMPTY_ELEMENTS_UID

if TYPE_CHECKING:
    from runner.engine.compile.element import Position
    from runner.engine.compile.protocols import Run, StoryboardElement
    from schemas.common.errors import ToolchainError
    from xodr.graph.network import RoadNetwork
    from xosc.resolve import Resolved
    from xosc.resolve.parameters import ParameterDeclaration

WRAPPERS = {
    "PrivateAction",
    "LongitudinalAction",
    "LateralAction",
    "ControllerAction",
    "RoutingAction",
    "AppearanceAction",
    "TrailerAction",
    "GlobalAction",
    "EntityAction",
    "ParameterAction",
    "VariableAction",
    "MonitorAction",
    "InfrastructureAction",
    "TrafficSignalAction",
    "TrafficAction",
    "UserDefinedAction",
}
"""Elements that only group the action inside them; an action may look at `Node.parent` for their
attributes."""

_PRIORITIES = ("overwrite", "override", "parallel", "skip")


@dataclass(frozen=True, eq=False)
class Scenario:
    """Compiled scenario, for any number of consecutive runs.

    Declarations, actions, conditions and positions stay as they are. The entities' states, the
    storyboard's states and the signals' states are a run's, and `reset` makes them what they were
    before.
    """

    path: Path
    version: tuple[int, int]
    network: RoadNetwork | None
    entities: Entities
    storyboard: Storyboard
    parameters: Mapping[str, Any] = field(default_factory=dict)
    variables: Mapping[str, Any] = field(default_factory=dict)
    monitors: Mapping[str, bool] = field(default_factory=dict)
    activated: frozenset[str] = frozenset()
    """names of entities whose controller the scenario activates or deactivates at some time"""
    signals: TrafficSignals = field(default_factory=TrafficSignals)
    violations: tuple[ToolchainError, ...] = ()
    """parameter values outside their constraint groups, where that is allowed"""
    observers: tuple[Callable[[Run], None], ...] = ()
    """called at the end of each step, for conditions that watch what goes on before they are asked
    """
    remarks: tuple[Remark, ...] = ()
    """what was assumed in the scenario's files and in its road network"""

    def reset(self) -> None:
        """Restore the state before a run."""
        self.entities.reset()
        self.storyboard.reset()
        self.signals.reset()


class ScenarioContext:
    """Context in which the classes of the registries are built, with checked references.

    Args:
        document: the resolved document.
        network: its road network, if it names one.
        strict: refuse repairs.
    """

    def __init__(
        self, document: Resolved, network: RoadNetwork | None, strict: bool = False
    ) -> None:
        self.document = document
        self.version = document.version
        self.network = network
        self.declared = Entities()
        self.selections: dict[str, list[Entity]] = {}
        self.parameters = _initial_values(document.parameters)
        self.variables = _initial_values(document.variables)
        self.monitors: dict[str, bool] = dict(document.monitors)
        self.parameter_types = {name: p.type for name, p in document.parameters.items()}
        self.variable_types = {name: v.type for name, v in document.variables.items()}
        self.signals = TrafficSignals.from_xml(
            document.node.find("RoadNetwork", "TrafficSignals"), network
        )
        self.storyboard = Storyboard()
        self.remarks = Remarks(strict)
        self.remarks.add(*map(_executed, document.remarks))
        self.remarks.note(
            *(network.remarks if network is not None else ())
        )  # where strict, it was read without repairs
        self._late: list[Callable[[], None]] = []
        self.many = is_reading()
        """whether the document is read for many parameter sets"""
        self.observers: list[Callable[[Run], None]] = (
            [self.signals.advance] if self.signals.controllers else []
        )

    def late(self, check: Callable[[], None]) -> None:
        """Have something done once the whole storyboard stands (references to
        storyboard elements).
        """
        self._late.append(check)

    def each_step(self, observe: Callable[[Run], None]) -> None:
        """Have something called at the end of each step of the run."""
        self.observers.append(observe)

    def finish(self) -> None:
        """Make the deferred checks."""
        for check in self._late:
            check()

    def repair(self, node: Node, rule: str, text: str, cause: str = "") -> None:
        """Go on with the one sensible meaning of an element that breaks a rule, with a remark;
        refused where strict."""
        self.remarks.add(node.remark(rule, text, cause))

    def need_network(self, node: Node) -> RoadNetwork:
        """The road network, for elements that make no sense without one."""
        if self.network is None:
            raise node.invalid(
                "the position needs a road network, and the scenario names none: name one in "
                "RoadNetwork/LogicFile, "
                "or let --road auto make straight roads"
            )
        return self.network

    def storyboard_elements(self) -> list[StoryboardElement]:
        """All named storyboard elements read so far, in document order."""
        return list(self.storyboard.elements())

    # references -----------------------------------------------------------------------------

    def entities(self, node: Node, attribute: str = "entityRef") -> list[Entity]:
        """The entity, or the members of the entity selection, that an attribute names."""
        name = node.get(attribute)
        if name in self.declared:
            return [self.declared[name]]
        if name in self.selections:
            return self.selections[name]
        raise node.invalid(
            f"{attribute}={name!r} is neither an entity nor an entity selection of this scenario; "
            + nearest(name, (*self.declared, *self.selections))
        )

    def entity(self, node: Node, attribute: str = "entityRef") -> Entity:
        """The single entity that an attribute names."""
        name = node.get(attribute)
        if name not in self.declared:
            raise node.invalid(f"{attribute}={name!r} is not an entity of this scenario")
        return self.declared[name]

    def triggering_entities(self, node: Node) -> list[Entity]:
        """Members of a TriggeringEntities element, selections expanded, each once."""
        found = [
            entity
            for reference in node.children("EntityRef")
            for entity in self.entities(reference)
        ]
        return list(dict.fromkeys(found))

    # families -------------------------------------------------------------------------------

    def actions(self, node: Node) -> list[Action]:
        """The actions inside an Action, PrivateAction or GlobalAction element; one with nothing
        inside does nothing.

        Public files hold an empty Action on purpose. An empty PrivateAction, or wrapper inside it,
        is an unfinished action.
        """
        nested: list[Action] = []
        pending = node.children()
        if not pending:
            text = f"{_named(node)}: an action is expected inside; without one it does nothing"
            self.repair(node, EMPTY_ELEMENTS_UID, text, "" if node.tag == "Action" else "empty")
        for child in pending:
            nested += self.actions(child) if child.tag in WRAPPERS else [self._action(child)]
        return nested

    def condition(self, node: Node) -> Condition:
        """The condition inside a Condition element."""
        by = node.only()
        if by.tag == "ByValueCondition":
            return self._build(registry.condition, by.only())
        triggering = by.need("TriggeringEntities")
        every = triggering.choice("triggeringEntitiesRule", ("any", "all")) == "all"
        inner = by.need("EntityCondition").only()
        entities = self.triggering_entities(triggering)
        if not triggering.children("EntityRef"):
            truth = "always" if every else "never"
            self.repair(
                triggering,
                EMPTY_ELEMENTS_UID,
                "an element EntityRef is expected inside; without one the "
                f"condition is {truth} true",
                "empty",
            )
        elif (other := inner.get("entityRef", "")) and {entity.name for entity in entities} == {
            other
        }:
            self.repair(
                inner, OTHER_ENTITY_UID, f"{other!r} is compared with itself, which never changes"
            )
        return ByEntityCondition(entities, every, self._build(registry.condition, inner))

    def timed_condition(self, node: Node) -> TimedCondition:
        """The condition that a Condition element is, with its edge and delay."""
        kind = OneShotCondition if self.document.for_carla else TimedCondition
        return kind.from_xml(node, self.condition(node))

    def position(self, node: Node) -> Position:
        """The position inside an element that holds exactly one (Position, TargetPosition, …)."""
        inside = node.only()
        if self._varies(inside):
            return VaryingPosition(inside, partial(self._rebuilt, registry.position))
        position: Position = self._build(registry.position, inside)
        return position

    def _action(self, node: Node) -> Action:
        if self._varies(node) and getattr(_class(registry.action, node), "run_by_run", False):
            return VaryingAction(node, partial(self._rebuilt, registry.action))
        action: Action = self._build(registry.action, node)
        return action

    def _varies(self, node: Node) -> bool:
        """Whether an element has numbers that vary between the parameter sets
        for which it is read.
        """
        return self.many and any(
            MARK in text for part in node.iter() for text in part.element.attrib.values()
        )

    def _rebuilt(self, family: registry.Registry, node: Node) -> tuple[Any, bool]:
        """The object of an element whose numbers have changed, and whether it was repaired."""
        kept, self.remarks = self.remarks, Remarks(self.remarks.strict)
        try:
            return self._build(family, node), bool(self.remarks.found)
        finally:
            self.remarks = kept

    def _build(self, family: registry.Registry, node: Node) -> Any:
        return _class(family, node).from_xml(node, self)


def _initial_values(declared: Mapping[str, ParameterDeclaration]) -> dict[str, Any]:
    """Initial values by name; columns where they vary between the sets for which the document is
    read."""
    return {
        name: parameter.value if parameter.column is None else parameter.column
        for name, parameter in declared.items()
    }


def _class(family: registry.Registry, node: Node) -> type[registry.FromXml]:
    parent = node.element.getparent()
    return family.find(node, str(parent.tag) if parent is not None else None)


def compile_scenario(
    document: Resolved, network: RoadNetwork | None, strict: bool = False
) -> Scenario:
    """Compile a resolved scenario document.

    Args:
        document: of kind `scenario`, with every attribute a literal.
        network: the road network of its LogicFile, or None.
        strict: refuse what is otherwise repaired with a remark.

    Raises:
        InvalidFile: a reference leads nowhere, a value is out of its range.
        Unsupported: an element is not executed by this runner; named with file and line.
    """
    with with_ignored(map(_executed, document.remarks)):
        context = ScenarioContext(document, network, strict)
        _check_signals(context)
        _check_mirror(context)
        read_entities(document.node.need("Entities"), context)
        _read_storyboard(document.node.need("Storyboard"), context)
        check_actors(context.storyboard)
        context.finish()
        _check_presence(context)
    return Scenario(
        path=document.path,
        version=document.version,
        network=network,
        entities=context.declared,
        storyboard=context.storyboard,
        parameters=context.parameters,
        variables=context.variables,
        monitors=context.monitors,
        activated=_activated(context.storyboard),
        signals=context.signals,
        violations=document.violations,
        observers=tuple(context.observers),
        remarks=context.remarks.found,
    )


def _executed(remark: Remark) -> Remark:
    """A remark on a document; an element beyond the standard that an extension registered is
    executed, not ignored."""
    if remark.cause != "ignored":
        return remark
    for family in (registry.action, registry.condition, registry.position):
        family.load()
        if remark.element in family.classes:
            text = (
                f"the element {remark.element} is in no version of the standard here; it is "
                "executed as an extension"
            )
            return replace(remark, message=text, cause="")
    return remark


def _check_signals(context: ScenarioContext) -> None:
    """Have a remark on each state of a signal that no road has."""
    network = context.network
    for state in context.document.node.iter("TrafficSignalState"):
        name = state.get("trafficSignalId", "")
        if network is not None and name not in network.signals:
            context.repair(
                state,
                SIGNAL_UID,
                f"{network.path.name} has no signal {name!r}; its state has no effect",
            )


def _check_mirror(context: ScenarioContext) -> None:
    """Have a remark where all positions of a scenario with CARLA's axes fit the roads without them
    only."""
    network, document = context.network, context.document
    positions = list(document.node.iter("WorldPosition")) if document.mirrored else []
    if network is None or not positions:
        return
    places = [(position.finite("x"), position.finite("y")) for position in positions]
    if any(_on_road(network, x, y) for x, y in places):
        return
    if all(_on_road(network, x, -y) for x, y in places):
        text = (
            "y is read as pointing to the right, as the description begins with 'CARLA:': so all "
            "WorldPositions are off the roads, which they are on as they stand"
        )
        context.remarks.note(positions[0].remark(FLAG_RULE, text, "misplaced"))


def _on_road(network: RoadNetwork, x: float, y: float) -> bool:
    return network.on_road(network.locate(x, y))


def _check_presence(context: ScenarioContext) -> None:
    """Have a remark on each entity that the stories or the stop trigger refer to, and that no
    action can place."""
    places = placeable(context.storyboard)
    if places is None:
        return
    parts = context.document.node.need("Storyboard").children("Story", "StopTrigger")
    names = {
        node.get(name, "")
        for part in parts
        for node in part.iter()
        for name in ("entityRef", "masterEntityRef")
    }
    needed = {
        entity
        for name in names
        for entity in context.selections.get(name, (context.declared.get(name),))
        if entity
    }
    for entity in context.declared.values():
        if entity in needed - places and entity.controls.tractor is None:
            context.remarks.note(absence(context.document.path, entity, "absent"))


def _activated(storyboard: Storyboard) -> frozenset[str]:
    found = {actor.name for actor, element in storyboard.init if actor and _activates(element)}
    for act in storyboard.acts:
        for event in act.events:
            if any(
                isinstance(element, ActionElement) and _activates(element)
                for element in event.children
            ):
                found |= {actor.name for actor in event.group.actors}
    return frozenset(found)


def _activates(element: ActionElement) -> bool:
    return any(
        isinstance(action, PrivateAction) and action.activates_controller
        for action in element.actions
    )


def _read_storyboard(node: Node, context: ScenarioContext) -> None:
    board = context.storyboard
    _read_init(node.need("Init"), context)
    for story_node in node.children("Story"):
        story = Story(story_node.get("name", ""), None)
        board.stories.append(story)
        for act_node in _parts(story_node, "Act", context):
            _read_act(act_node, story, context)
    board.stop_trigger = Trigger.from_xml(node.find("StopTrigger"), context)
    board.ends_with_stories = context.document.for_carla and board.stop_trigger is None


def _read_init(node: Node, context: ScenarioContext) -> None:
    actions = node.find("Actions")
    for group in actions.children() if actions is not None else []:
        if group.tag == "Private":
            actors = context.entities(group)
            for private in _parts(group, "PrivateAction", context):
                wrapped = context.actions(private)
                context.storyboard.init += [
                    (actor, _initial(wrapped, actor, private)) for actor in actors if wrapped
                ]
        elif group.tag in ("GlobalAction", "UserDefinedAction"):
            wrapped = context.actions(group)
            context.storyboard.init += [(None, _initial(wrapped, None, group))] if wrapped else []
        else:
            raise group.unsupported("this element of Init/Actions is not known to the runner")


def _initial(actions: list[Action], actor: Entity | None, node: Node) -> ActionElement:
    """Actions of the Init section as one element; it has no name in the file, the event log needs
    one."""
    what = "+".join(type(action).__name__ for action in actions)
    name = f"Init::{actor.name}::{what}" if actor is not None else f"Init::{what}"
    return ActionElement(name, None, actions, node=node)


def _read_act(node: Node, story: Story, context: ScenarioContext) -> None:
    act = Act(node.get("name", ""), story)
    for group_node in _parts(node, "ManeuverGroup", context):
        references, select_triggering = _actors(group_node, context)
        actors = list(dict.fromkeys(entity for members in references for entity in members))
        group = ManeuverGroup(
            group_node.get("name", ""),
            act,
            _maximum(group_node, context),
            actors,
            select_triggering,
        )
        whole = any(len(members) > 1 for members in references)
        for maneuver_node in _parts(group_node, "Maneuver", context):
            maneuver = Maneuver(maneuver_node.get("name", ""), group)
            for event_node in _parts(maneuver_node, "Event", context):
                _read_event(event_node, maneuver, whole, context)
    act.trigger = Trigger.from_xml(node.find("StartTrigger"), context)
    act.stop_trigger = Trigger.from_xml(node.find("StopTrigger"), context)
    if act.stop_trigger is not None and context.document.for_carla:
        act.stop_trigger.take_any()


def _actors(group: Node, context: ScenarioContext) -> tuple[list[list[Entity]], bool]:
    """The members of each entity or selection that a ManeuverGroup names, and whether it selects
    the triggering entities."""
    node = group.need("Actors")
    references = [context.entities(reference) for reference in node.children("EntityRef")]
    select_triggering = bool(node.bool("selectTriggeringEntities", False))
    selects = select_triggering and _is_triggered_by_entities(group)
    if not any(references) and not selects and next(group.iter("PrivateAction"), None) is not None:
        context.repair(
            node,
            ACTORS_UID,
            f"{_named(group)}: its private actions have no actor; they do nothing",
            "no-actor",
        )
    return references, select_triggering


def _is_triggered_by_entities(group: Node) -> bool:
    """Whether a condition by entity is part of what starts a maneuver group's act or events."""
    triggers = group.parent.iter("StartTrigger") if group.parent is not None else ()
    return any(next(trigger.iter("TriggeringEntities"), None) is not None for trigger in triggers)


def _named(node: Node) -> str:
    """An element in a message, with its name where it has one."""
    return f"{node.tag} {node.get('name')!r}" if node.has("name") else node.tag


def _parts(node: Node, tag: str, context: ScenarioContext) -> list[Node]:
    """Return the children of a storyboard element that must have some. Without it ends as soon as
    it starts, untested."""
    parts = node.children(tag)
    if not parts:
        context.repair(
            node,
            EMPTY_ELEMENTS_UID,
            f"{_named(node)}: an element {tag} is expected inside; without one it does nothing",
            "" if tag == "Maneuver" else "empty",  # a ManeuverGroup may be empty
        )
    return parts


def _read_event(node: Node, maneuver: Maneuver, whole: bool, context: ScenarioContext) -> None:
    priority = node.choice("priority", _PRIORITIES)
    chosen = "parallel" if context.document.for_carla else priority
    event = Event(node.get("name", ""), maneuver, chosen, _maximum(node, context), node.where)
    for action_node in _parts(node, "Action", context):
        ActionElement(
            action_node.get("name", ""), event, context.actions(action_node), whole, action_node
        )
    event.trigger = Trigger.from_xml(node.find("StartTrigger"), context)


def _maximum(node: Node, context: ScenarioContext) -> int:
    """Most executions; none at all, which the standard has not, is taken for one."""
    maximum = int(node.int("maximumExecutionCount", 1))
    if maximum < 0:
        raise node.invalid(f"maximumExecutionCount={maximum} must not be negative")
    if maximum == 0:
        context.remarks.note(
            node.remark(
                SCHEMA_UID,
                f"{_named(node)}: maximumExecutionCount=0 is no number of executions; 1 is meant",
            )
        )
    return max(maximum, 1)
