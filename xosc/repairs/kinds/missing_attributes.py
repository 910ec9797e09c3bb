"""Required attributes that are missing, and whose value is obvious."""

from __future__ import annotations

from collections.abc import Iterator

from schemas.remarks import Remark
from schemas.rules.valid_schema import UID
from xosc.node import Node
from xosc.repairs.declared import attributes

BREAKS_SCHEMA = True

_OBVIOUS = {
    "0": (
        "Condition/delay", "RelativeObjectPosition/dx", "RelativeObjectPosition/dy", "RelativeWorldPosition/dx",
        "RelativeWorldPosition/dy", "RelativeRoadPosition/ds", "RelativeRoadPosition/dt", "RelativeLanePosition/dLane",
        "RoadPosition/t", "FromRoadCoordinates/t", "Center/x", "Center/y", "Center/z", "Timing/offset",
        "TrafficSwarmAction/offset", "MiscObject/mass", "Pedestrian/mass",
    ),
    "1": ("ManeuverGroup/maximumExecutionCount", "Timing/scale"),
    "INF": ("Performance/maxSpeed", "Performance/maxAcceleration", "Performance/maxDeceleration"),
    "none": ("Condition/conditionEdge", "MiscObject/miscObjectCategory"),
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
        "Event/name", "Action/name", "Condition/name", "Trajectory/name", "Route/name",
    ),
    "1970-01-01T00:00:00": ("FileHeader/date",),
}  # fmt: skip
"""Attributes of elements, by the value that changes nothing: later versions have it as default, or nothing else can be meant."""
_VALUES = {name: value for value, names in _OBVIOUS.items() for name in names}
_AT_ONCE = {"value": "0", "dynamicsDimension": "time"}
"""What the dynamics of a step need not say."""


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Add them."""
    declared = attributes(version)
    for node in root.iter():
        for name, attribute in declared.get(node.tag, {}).items():
            if not attribute.required or node.has(name):
                continue
            value = _VALUES.get(f"{node.tag}/{name}")
            if value is None and node.get("dynamicsShape", "") == "step":
                value = _AT_ONCE.get(name)
            if value is not None:
                node.element.set(name, value)
                yield node.remark(UID, f"the attribute {name!r} is missing; {value!r} is assumed")
