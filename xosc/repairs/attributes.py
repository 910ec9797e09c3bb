"""Repairs of attributes: values that say nothing, names and values in other spellings, required ones that are missing."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from difflib import get_close_matches
from typing import cast

from lxml import etree

from schemas.checks.structure import SCHEMA_UID
from schemas.common.remarks import Remark
from schemas.values import meant
from xosc.node import Node
from xosc.repairs.declared import Attribute, attributes, names, similar, suggested

NOTHING = ("", "None", "null", "undefined")
"""Values that say so."""
_saying_nothing = etree.XPath(f"descendant-or-self::*[@*[{' or '.join(f'. = {text!r}' for text in NOTHING)}]]")


def leave_out_absent_values(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Leave out optional attributes that say that they have no value (`None`), where their type has no such value."""
    declared = attributes(version)
    for element in cast(list[etree._Element], _saying_nothing(root.element)):
        node = root.at(element)
        for name, attribute in declared.get(node.tag, {}).items():
            text = node.element.get(name)
            if text in NOTHING and not attribute.required and (attribute.kind or attribute.values):
                del node.element.attrib[name]
                yield node.remark(SCHEMA_UID, f"{name}={text!r} is no value; the attribute is left out")


_FORMER = {("Condition", "edge"): "conditionEdge", ("Gear", "value"): "number"}
"""Names that attributes had before version 1.0, or have in elements beside theirs, by element."""


def correct_attribute_names(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Give attributes that no version of the standard has the name that is nearly theirs; leave out the others."""
    declared, known = attributes(version), names(attributes)
    for node in root.iter():
        for name in [str(each) for each in node.element.attrib] if node.tag in known else []:
            if name in known[node.tag] or name.startswith("{"):
                continue
            value = node.element.attrib.pop(name)
            free = [each for each in declared.get(node.tag, sorted(known[node.tag])) if not node.has(each)]
            right = _FORMER.get((node.tag, name), "") or (f"{name}Ref" if f"{name}Ref" in free else similar(name, free))
            if right in free:
                node.element.set(right, value)
                yield node.remark(SCHEMA_UID, f"the attribute {name!r} is in no version of the standard; {right!r} is meant")
            else:
                text = f"the attribute {name!r} is in no version of the standard; it is left out, NOT executed"
                yield node.remark(SCHEMA_UID, text + suggested(name, declared.get(node.tag, ())), ignored(node))


_SHORTEST = 3
"""Letters of a value that say which one is meant"""
_CLOSE = 0.85
"""Similarity of a value and another in which letters are missing or changed"""
_NOT_EXECUTED = ("FileHeader", "Properties")
"""Elements whose content describes the file, or is for other tools"""


def ignored(node: Node) -> str:
    """Cause of an inconclusive run where an element, or an attribute of it, is left out; empty where nothing is executed."""
    return "" if any(above.tag in _NOT_EXECUTED for above in node.ancestors()) else "ignored"


_TYPES = {"bool": "boolean", "float": "double", "str": "string"}
"""Types of parameters by their names in programming languages."""
_UNLIMITED = ("maximumExecutionCount", "-1", "4294967295")
"""A number of executions that other players take as any number, and the greatest that the standard knows."""


def correct_spellings(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Write values in the spelling of their type: `true` for `True`, `2` for `2.0`, `rising` for `Rising`."""
    declared = attributes(version)
    for node in root.iter():
        for name, attribute in declared.get(node.tag, {}).items():
            text = node.element.get(name)
            value = _standard_spelling(name, attribute, text) if text is not None and "$" not in text else None
            if value is not None and value != text:
                node.element.set(name, value)
                what = f"no {attribute.kind}" if attribute.kind else f"none of {', '.join(attribute.values)}"
                yield node.remark(SCHEMA_UID, f"{name}={text!r} is {what}; {value} is meant")


def _standard_spelling(name: str, attribute: Attribute, text: str) -> str | None:
    """Return the standard's spelling of an attribute value; None if unknown."""
    if (name, text) == _UNLIMITED[:2]:
        return _UNLIMITED[2]
    if name == "parameterType" and text in _TYPES:
        return _TYPES[text]
    if attribute.values:
        return text if text in attribute.values else _nearest_value(text.strip().lower(), attribute.values)
    try:
        return meant(attribute.kind, text) if attribute.kind else None
    except ValueError:
        return None


def _nearest_value(text: str, values: Collection[str]) -> str | None:
    """The only value of an enumeration that a text in lower case spells, begins or nearly spells; None where there is none."""
    by_lower = {value.lower(): value for value in values}
    alike = [lower for lower in by_lower if lower == text]
    alike = alike or [lower for lower in by_lower if len(text) >= _SHORTEST and lower.startswith(text)]
    alike = alike or get_close_matches(text, by_lower, 2, _CLOSE)
    return by_lower[alike[0]] if len(alike) == 1 else None


_DEFAULTS = {
    "0": (
        "Condition/delay", "RelativeObjectPosition/dx", "RelativeObjectPosition/dy", "RelativeWorldPosition/dx",
        "RelativeWorldPosition/dy", "RelativeRoadPosition/ds", "RelativeRoadPosition/dt", "RelativeLanePosition/dLane",
        "RoadPosition/t", "FromRoadCoordinates/t", "Center/x", "Center/y", "Center/z", "Timing/offset",
        "TrafficSwarmAction/offset", "MiscObject/mass", "Pedestrian/mass",
    ),
    "1": ("ManeuverGroup/maximumExecutionCount", "Timing/scale"),
    "INF": ("Performance/maxSpeed", "Performance/maxAcceleration", "Performance/maxDeceleration"),
    "none": ("Condition/conditionEdge", "MiscObject/miscObjectCategory"),
    "time": ("SpeedActionDynamics/dynamicsDimension", "LaneChangeActionDynamics/dynamicsDimension"),
    "delta": ("RelativeTargetSpeed/speedTargetValueType",),
    "any": ("TriggeringEntities/triggeringEntitiesRule",),
    "position": ("TrajectoryFollowingMode/followingMode", "SpeedProfileAction/followingMode"),
    "true": ("VisibilityAction/graphics", "VisibilityAction/traffic", "VisibilityAction/sensors"),
    "false": (
        "Actors/selectTriggeringEntities", "Route/closed", "Trajectory/closed", "TimeOfDay/animation",
        "DistanceCondition/freespace", "RelativeDistanceCondition/freespace", "TimeHeadwayCondition/freespace",
        "TimeToCollisionCondition/freespace", "LateralDistanceAction/freespace", "LongitudinalDistanceAction/freespace",
        "DistanceCondition/alongRoute", "TimeHeadwayCondition/alongRoute", "TimeToCollisionCondition/alongRoute",
        "LaneOffsetAction/continuous", "LateralDistanceAction/continuous", "LongitudinalDistanceAction/continuous",
        "RelativeTargetSpeed/continuous",
    ),
    "": (
        "FileHeader/author", "FileHeader/description", "Story/name", "Act/name", "ManeuverGroup/name", "Maneuver/name",
        "Event/name", "Action/name", "Condition/name", "Trajectory/name", "Route/name", "Environment/name",
    ),
    "1970-01-01T00:00:00": ("FileHeader/date",),
}  # fmt: skip
"""Attributes of elements, by the value that changes nothing: later versions have it as default, or nothing else can be meant."""
_DEFAULT_OF = {name: value for value, names in _DEFAULTS.items() for name in names}
_AT_ONCE = "0"
"""Value of the dynamics of a step, which may omit it."""


def add_missing_attributes(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Add required attributes whose value is obvious."""
    declared = attributes(version)
    for node in root.iter():
        for name, attribute in declared.get(node.tag, {}).items():
            if not attribute.required or node.has(name):
                continue
            value = _DEFAULT_OF.get(f"{node.tag}/{name}")
            if name == "value" and node.get("dynamicsShape", "") == "step":
                value = _AT_ONCE
            if value is not None:
                node.element.set(name, value)
                yield node.remark(SCHEMA_UID, f"the attribute {name!r} is missing; {value!r} is assumed")
