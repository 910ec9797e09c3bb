"""Delays of conditions as times: scenario_runner waits for the delay before it looks at the condition."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from xosc.document import Document
from xosc.exports.on_roads.distances import starts_at_once
from xosc.exports.on_roads.geometry import Geometry
from xosc.names import EGO_NAME
from xosc.node import Node

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
