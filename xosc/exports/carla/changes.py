"""What scenario_runner says differently, or not without what is known from the beginning of the scenario.

Each change is made in place, in a worked-out document of version 1.1 or later; what can't be said is refused.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

from lxml import etree

from schemas.xml import parse
from xosc.dialects.carla import FLAG
from xosc.document import Document
from xosc.exports.carla.sides import change_sides
from xosc.exports.on_roads.starts import Start, State, actors, target_speed
from xosc.names import EGO_NAME
from xosc.node import TO_RIGHT, Node

HERO = "hero"
"""Name that CARLA's agents look for."""

_TO_SECONDS = len("2026-01-01T00:00:00")
_ALONG_ROADS = ("road", "lane")
_SLOPES = {"linear": 1.0, "sinusoidal": math.pi / 2, "cubic": 1.5}
"""Greatest rate of a shape by its mean rate."""
_Elements = list[etree._Element]


def change(document: Document, known: Mapping[str, Start], state: State, network: Path | None) -> list[str]:
    """Make all changes; remarks on those that are approximations.

    Args:
        known: how everybody starts.
        state: how they are when an action begins.
        network: the file of its roads; None where it has none.

    Raises:
        Unsupported: something can't be said, named with file and line.
    """
    roads = _roads(network)
    change_sides(document.node, known)
    for node in list(document.node.iter("RelativeLanePosition")):
        if not node.has(TO_RIGHT):
            _on_lane(node, known, roads)
    remarks = [_speed(node, state) for node in reversed(list(document.node.iter("SpeedAction")))]
    for node in document.node.iter("RelativeDistanceCondition"):
        if node.get("coordinateSystem", "") in _ALONG_ROADS:  # scenario_runner's s and t are those of the road
            del node.element.attrib["coordinateSystem"]
    for node in document.node.iter("TimeHeadwayCondition", "TimeToCollisionCondition", "DistanceCondition"):
        if node.get("coordinateSystem", "") in _ALONG_ROADS and node.get("relativeDistanceType", "") == "longitudinal":
            del node.element.attrib["coordinateSystem"], node.element.attrib["relativeDistanceType"]
            node.element.set("alongRoute", "true")
    remarks += [_stop(document), _hero(document)]
    header = document.node.need("FileHeader")
    if not header.get("description", "").removeprefix(FLAG):  # scenario_runner takes it as the scenario's name
        header.element.set("description", header.get("description", "") + document.path.stem)
    for node in document.node.iter("TimeOfDay"):  # scenario_runner reads neither fractions nor time zones
        node.element.set("dateTime", node.get("dateTime")[:_TO_SECONDS])
    return [remark for remark in remarks if remark]


def _on_lane(position: Node, known: Mapping[str, Start], roads: _Elements) -> None:
    """The lane that a first position comes to: scenario_runner measures ds with the traffic, the standard with the road."""
    private = next((each for each in position.element.iterancestors() if each.tag == "Private"), None)
    start = known[private.get("entityRef", "")] if private is not None else Start()
    lengths = {road.get("id"): float(road.get("length", "0")) for road in roads}
    if start.road is None or not 0.0 <= start.s <= lengths.get(start.road, 0.0):
        raise position.unsupported("scenario_runner measures ds with the traffic of a lane, and here that is not known")
    for attribute in list(position.element.attrib):
        del position.element.attrib[attribute]
    position.element.tag = "LanePosition"
    position.element.attrib.update({"roadId": start.road, "laneId": str(start.lane), "s": repr(start.s)})


def _roads(network: Path | None) -> _Elements:
    return list(parse(network).getroot().iter("road")) if network is not None else []


def _speed(action: Node, state: State) -> str:
    """A rate as the time that it takes: scenario_runner reads every number that is no distance as a time."""
    dynamics = action.need("SpeedActionDynamics")
    if dynamics.get("dynamicsDimension") != "rate" or dynamics.get("dynamicsShape") == "step":
        return ""
    speeds = {(state(action, name) or Start()).speed for name in actors(action)}
    speed = next(iter(speeds)) if len(speeds) == 1 else None
    rate, target = abs(dynamics.float("value")), target_speed(action, state)
    if target is None or speed is None or (not rate and not math.isclose(target, speed)):
        raise dynamics.unsupported("scenario_runner reads the rate as a time, and what time it takes is known only when it runs")
    time = abs(target - speed) / rate * _SLOPES[dynamics.get("dynamicsShape")] if rate else 0.0
    dynamics.element.attrib.update({"dynamicsDimension": "time", "value": repr(time)})
    return f"{dynamics.where}: {dynamics.tag}: the rate is written as the {time:g} s that it takes from {speed:g} m/s"


def _stop(document: Document) -> str:
    """scenario_runner looks for criteria in the storyboard's StopTrigger, and for nothing else."""
    trigger = document.node.find("Storyboard", "StopTrigger")
    others = [group for group in trigger.children() if not _criteria(group)] if trigger is not None else []
    if trigger is None or not others:
        return ""
    for group in others:
        trigger.element.remove(group.element)
    return f"{trigger.where}: StopTrigger: left out, a run ends when all acts have"


def _criteria(group: Node) -> bool:
    return all(condition.get("name", "").startswith("criteria_") for condition in group.children())


def _hero(document: Document) -> str:
    """Name the ego as CARLA's agents look for it, and mark it as scenario_runner does."""
    objects = list(document.node.iter("ScenarioObject"))
    named = [each for each in objects if each.find("Vehicle") is not None and EGO_NAME.fullmatch(each.get("name"))]
    for each in objects:
        vehicle = each.find("Vehicle")
        if vehicle is not None:
            holder = vehicle.element.find("Properties")
            holder = etree.SubElement(vehicle.element, "Properties") if holder is None else holder
            for said in holder.findall("Property[@name='type']"):
                holder.remove(said)
            kind = "ego_vehicle" if each.element in [ego.element for ego in named[:1]] else "simulation"
            holder.insert(0, etree.Element("Property", name="type", value=kind))
    if not named:
        return f"{document.path}: no vehicle is called Ego or hero: CARLA runs it without an ego"
    old = named[0].get("name")
    if old != HERO and any(each.get("name") == HERO for each in objects):
        raise named[0].unsupported(f"the ego must be called {HERO}, which is the name of another entity")
    named[0].element.set("name", HERO)
    for element in document.root.iter():
        for attribute in ("entityRef", "masterEntityRef"):
            if element.get(attribute) == old:
                element.set(attribute, HERO)
    return ""
