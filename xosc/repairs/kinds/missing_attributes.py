"""Required attributes that are missing, and whose value is obvious."""

from __future__ import annotations

from collections.abc import Iterator

from schemas.remarks import Remark
from schemas.rules.valid_schema import UID
from xosc.node import Node
from xosc.repairs.declared import attributes

BREAKS_SCHEMA = True

_OBVIOUS = {
    ("Condition", "delay"): "0",
    ("Condition", "conditionEdge"): "none",
    ("TriggeringEntities", "triggeringEntitiesRule"): "any",
    ("ManeuverGroup", "maximumExecutionCount"): "1",
    ("RelativeObjectPosition", "dx"): "0",
    ("RelativeObjectPosition", "dy"): "0",
    ("RelativeWorldPosition", "dx"): "0",
    ("RelativeWorldPosition", "dy"): "0",
    ("RelativeRoadPosition", "ds"): "0",
    ("RelativeRoadPosition", "dt"): "0",
    ("RelativeLanePosition", "dLane"): "0",
    ("RoadPosition", "t"): "0",
    ("FromRoadCoordinates", "t"): "0",
    ("Center", "x"): "0",
    ("Center", "y"): "0",
    ("Center", "z"): "0",
    ("Timing", "offset"): "0",
    ("Timing", "scale"): "1",
    ("TrajectoryFollowingMode", "followingMode"): "position",
    ("SpeedProfileAction", "followingMode"): "position",
    ("TimeOfDay", "animation"): "false",
    ("Actors", "selectTriggeringEntities"): "false",
    ("Route", "closed"): "false",
    ("Trajectory", "closed"): "false",
    ("FileHeader", "author"): "",
    ("FileHeader", "description"): "",
    ("FileHeader", "date"): "1970-01-01T00:00:00",
}
"""Values that change nothing: later versions have them as defaults, or there is nothing else that the absence could say."""
_AT_ONCE = {"value": "0", "dynamicsDimension": "time"}
"""What the dynamics of a step need not say."""


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Add them."""
    declared = attributes(version)
    for node in root.iter():
        for name, attribute in declared.get(node.tag, {}).items():
            if not attribute.required or node.has(name):
                continue
            value = _OBVIOUS.get((node.tag, name))
            if value is None and node.get("dynamicsShape", "") == "step":
                value = _AT_ONCE.get(name)
            if value is not None:
                node.element.set(name, value)
                yield node.remark(UID, f"the attribute {name!r} is missing; {value!r} is assumed")
