"""The beginning of a scenario for scenario_runner: first positions and speeds; everything else moves to a story.

scenario_runner takes the last Position inside a Private as the start of the entity, and reads only speeds that are absolute and
at once. It waits for the delay of a condition before it evaluates the condition, so delays become times."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lxml import etree

from xosc.document import Document
from xosc.exports.shapes import first_distances, first_position, starts_at_once
from xosc.exports.starts import Geometry, Start
from xosc.names import EGO_NAME
from xosc.node import Node

STORY = "beginning"
_READ = ("TeleportAction", "LaneOffsetAction", "LateralDistanceAction", "AssignControllerAction", "OverrideControllerValueAction")
"""First actions that scenario_runner has."""
_WRAPPERS = ("LongitudinalAction", "LateralAction", "RoutingAction", "ControllerAction")


def begin(document: Document, known: Mapping[str, Start]) -> Iterator[str]:
    """Change the Init of a worked-out scenario, in place; remarks.

    Args:
        known: initial states of all entities, poses included.
    """
    scenario = document.node
    yield from first_distances(document, known)
    for private in list(scenario.need("Storyboard", "Init").iter("Private")):
        start = known.get(private.get("entityRef"))
        if start is not None and start.pose is not None:
            yield from _place(private, start)
            yield from _rest(private, start, scenario)
            if not private.children():
                _remove(private)


def _place(private: Node, start: Start) -> Iterator[str]:
    """The first position: on the lane where it is in its middle, else in the world."""
    holders = [action.need("Position") for action in private.iter("TeleportAction")]
    if not holders:
        private.element.insert(0, _teleport(start))
        yield f"{private.where}: Private: the first position is written as where its actions put {private.get('entityRef')!r}"
        return
    if _is_plain(holders[-1].only()):
        return
    position = holders[-1].only()
    for holder in holders[:-1]:
        _remove(_private_action(holder))
    yield f"{position.where}: {position.tag}: the first position is written as where that is"
    holders[-1].element.replace(position.element, first_position(start))


def _teleport(start: Start) -> etree._Element:
    action = etree.Element("PrivateAction")
    etree.SubElement(etree.SubElement(action, "TeleportAction"), "Position").append(first_position(start))
    return action


def _is_plain(position: Node) -> bool:
    on_lane = position.tag == "LanePosition" and not position.float("offset", 0.0) and position.find("Orientation") is None
    return on_lane or position.tag == "WorldPosition"


def _rest(private: Node, start: Start, scenario: Node) -> Iterator[str]:
    """All other actions: speeds that are set at once become absolute, what scenario_runner does not read here goes on later."""
    for holder in private.children("PrivateAction"):
        action = _inside(holder)
        if action.tag == "SpeedAction":
            yield from _speed(holder, action, start, scenario)
        elif action.tag == "ActivateControllerAction":
            continue
        elif action.tag not in _READ:
            to_story(holder, private.get("entityRef"), scenario)
            yield f"{action.where}: {action.tag}: it is done by a story at the beginning, scenario_runner has it in stories only"


def _speed(holder: Node, action: Node, start: Start, scenario: Node) -> Iterator[str]:
    target, speed = action.need("SpeedActionTarget").only(), start.speed or 0.0
    step = action.need("SpeedActionDynamics").get("dynamicsShape") == "step"
    if step and not target.bool("continuous", False) and speed >= 0.0:
        if target.tag == "RelativeTargetSpeed":
            yield f"{target.where}: {target.tag}: the first speed is written as the {speed:g} m/s that it is"
            target.element.getparent().replace(target.element, etree.Element("AbsoluteTargetSpeed", value=repr(speed)))  # type: ignore[union-attr]
        return
    to_story(holder, holder.parent.get("entityRef"), scenario)  # type: ignore[union-attr]
    yield f"{action.where}: {action.tag}: it is done by a story at the beginning, scenario_runner's first speeds are set at once"


def to_story(holder: Node, entity: str, scenario: Node) -> None:
    """Move a PrivateAction into an event of its own that starts with the scenario."""
    name = f"{STORY} {len(scenario.need('Storyboard').element.findall('Story/Act/ManeuverGroup')) + 1}"
    group = etree.SubElement(etree.Element("none"), "ManeuverGroup", name=name, maximumExecutionCount="1")
    actors = etree.SubElement(group, "Actors", selectTriggeringEntities="false")
    etree.SubElement(actors, "EntityRef", entityRef=entity)
    event = etree.SubElement(etree.SubElement(group, "Maneuver", name=name), "Event", name=name, priority="parallel")
    etree.SubElement(event, "Action", name=name).append(holder.element)
    event.append(_at_beginning())
    act = _act(scenario)
    act.insert(len(act.findall("ManeuverGroup")), group)


def _act(scenario: Node) -> etree._Element:
    """The act of the story of the beginning, which is made before all others."""
    storyboard = scenario.need("Storyboard")
    for story in storyboard.children("Story"):
        if story.get("name", "") == STORY:
            return story.need("Act").element
    story_element = etree.Element("Story", name=STORY)
    storyboard.need("Init").element.addnext(story_element)
    act = etree.SubElement(story_element, "Act", name=STORY)
    act.append(_at_beginning())
    return act


def _at_beginning() -> etree._Element:
    trigger = etree.Element("StartTrigger")
    group = etree.SubElement(trigger, "ConditionGroup")
    condition = etree.SubElement(group, "Condition", name=STORY, delay="0", conditionEdge="none")
    value = etree.SubElement(condition, "ByValueCondition")
    etree.SubElement(value, "SimulationTimeCondition", value="-1", rule="greaterThan")
    return trigger


def _inside(holder: Node) -> Node:
    inner = holder.only()
    while inner.tag in _WRAPPERS:
        inner = inner.children()[0]
    return inner


def _private_action(inner: Node) -> Node:
    node = inner
    while node.tag != "PrivateAction":
        assert node.parent is not None, "first actions are inside a PrivateAction"
        node = node.parent
    return node


def _remove(node: Node) -> None:
    parent = node.element.getparent()
    assert parent is not None
    parent.remove(node.element)


_WAITS = "scenario_runner waits for the delay first, and looks at the condition then"


def no_delays(document: Document, geometry: Geometry | None) -> Iterator[str]:
    """Say delays by times, in place; remarks on those that a run gives.

    Raises:
        Unsupported: the time is not known.
    """
    for condition in list(document.node.iter("Condition")):
        delay, value = condition.float("delay", 0.0), condition.find("ByValueCondition")
        if not delay:
            continue
        time = value.find("SimulationTimeCondition") if value is not None else None
        if time is not None and time.get("rule").startswith("greater"):
            time.element.set("value", repr(time.float("value") + delay))
        else:
            yield _as_run(condition, document.node, geometry)
        condition.element.set("delay", "0")


def _as_run(condition: Node, scenario: Node, geometry: Geometry | None) -> str:
    """The time at which what the condition alone starts begins in a run, where the condition is not about the ego."""
    around = list(condition.element.iterancestors("StartTrigger", "Event", "Act"))
    if geometry is None or not around or around[0].tag != "StartTrigger":
        raise condition.unsupported(_WAITS)
    if starts_at_once(Node(around[0], condition.path), scenario) is False:
        return f"{condition.where}: Condition: its delay is left out, its act never starts"
    begins = geometry.begins(Node(around[1], condition.path))
    entities = [str(each.get("entityRef", "")) for each in condition.element.iter()]
    if begins is None or any(map(EGO_NAME.fullmatch, entities)) or len(around[0].findall("ConditionGroup/Condition")) > 1:
        raise condition.unsupported(_WAITS)
    for child in condition.children():
        condition.element.remove(child.element)
    value = etree.SubElement(condition.element, "ByValueCondition")
    etree.SubElement(value, "SimulationTimeCondition", value=repr(begins), rule="greaterOrEqual")
    return f"{condition.where}: Condition: written as the {begins:g} s at which it holds in a run without a system under test"
