"""Distances that are set at once when a scenario begins: the first positions and speeds that come of them."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence

from lxml import etree

from xosc.document import Document
from xosc.exports.omissions import leave_out
from xosc.exports.on_roads.shapes import first_position
from xosc.exports.on_roads.starts import Start, actors
from xosc.node import Node


def to_init(document: Document) -> Iterator[str]:
    """Have Init set distances that stories set at once at time 0, leave out those that are never set, in place; remarks."""
    scenario = document.node
    privates = {node.get("entityRef"): node for node in scenario.need("Storyboard", "Init").iter("Private")}
    for story in scenario.need("Storyboard").children("Story"):
        for action in list(story.iter("LongitudinalDistanceAction")):
            starts, doing = starts_at_once(action, scenario), actors(action)
            if starts is False:
                yield f"{action.where}: {action.tag}: left out, its act never starts"
            elif starts and _at_once(action) and doing and privates.keys() >= set(doing):
                yield f"{action.where}: {action.tag}: Init sets it instead, at the same time"
                for name in doing:
                    holder = etree.SubElement(privates[name].element, "PrivateAction")
                    etree.SubElement(holder, "LongitudinalAction").append(copy.deepcopy(action.element))
            else:
                continue
            leave_out(action, scenario)


def _at_once(action: Node) -> bool:
    return not action.bool("continuous") and action.find("DynamicConstraints") is None


def starts_at_once(action: Node, scenario: Node) -> bool | None:
    """Whether the event and the act around an element start at time 0, whatever happens; False: never, None: that depends."""
    around = [Node(each, action.path).find("StartTrigger") for each in action.element.iterancestors("Event", "Act")]
    groups = [trigger.children("ConditionGroup") for trigger in around if trigger is not None]
    return _all([_any([_all([_holds(each, scenario) for each in group.children()]) for group in trigger]) for trigger in groups])


def _all(held: Sequence[bool | None]) -> bool | None:
    return False if False in held else None if None in held else True


def _any(held: Sequence[bool | None]) -> bool | None:
    return True if True in held else None if None in held else False


def _holds(condition: Node, scenario: Node) -> bool | None:
    """Whether a condition holds at time 0; False: at no time, None: that depends."""
    time = condition.find("ByValueCondition", "SimulationTimeCondition")
    parameter = condition.find("ByValueCondition", "ParameterCondition")
    if condition.float("delay", 0.0) or condition.get("conditionEdge", "none") != "none":
        return None
    if time is not None:
        begun = {"greaterThan": time.float("value") < 0.0, "greaterOrEqual": time.float("value") <= 0.0}
        return begun.get(time.get("rule")) or None
    if parameter is None or parameter.get("rule") != "equalTo":
        return None
    if any(each.get("parameterRef") == parameter.get("parameterRef") for each in scenario.iter("ParameterAction")):
        return None
    declared = scenario.find("ParameterDeclarations")
    for each in declared.children() if declared is not None else ():
        if each.get("name") == parameter.get("parameterRef"):
            return bool(each.get("value") == parameter.get("value"))
    return None


def first_distances(document: Document, known: Mapping[str, Start]) -> Iterator[str]:
    """Say distances that Init sets at once by the first positions and speeds that come of them; a remark for each.

    Args:
        known: how everybody starts, poses included.
    """
    for private in document.node.need("Storyboard", "Init").iter("Private"):
        start = known.get(private.get("entityRef"), Start())
        holders = [teleport.need("Position") for teleport in private.iter("TeleportAction")]
        for action in list(private.iter("LongitudinalDistanceAction")):
            if start.pose is None or not holders or not _at_once(action):
                continue
            yield f"{action.where}: {action.tag}: left out, the first position has the distance"
            holders[-1].element.replace(holders[-1].only().element, first_position(start))
            private.element.remove(next(each for each in action.element.iterancestors("PrivateAction")))
            for target in private.iter("AbsoluteTargetSpeed"):  # who keeps a distance has the other one's speed
                target.element.set("value", repr(start.speed))
