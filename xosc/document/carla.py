"""Differences between scenarios for CARLA's scenario_runner and the standard.

A FileHeader whose description begins with `CARLA:` means CARLA's axes: y points to the right,
headings count clockwise, and lateral values count to the right of the traffic (scenario_runner's
page on OpenSCENARIO, and its parser, September 2025). In such a file

- y, dy, h and the t of a RoadPosition change their signs, and so does the offset of a LanePosition
  on lanes of the right side;
- dx and dy of a RelativeObjectPosition are those of the world;
- ds of a RelativeLanePosition counts with the traffic, positions relative to an entity face as it
  does;
- orientations are relative where they do not say otherwise, and always on lanes and roads;
- a LateralDistanceAction goes to the right.

Whether "to the right" is towards +t is known only when the scenario runs for offsets relative to an
entity and for lane offsets; they are marked with `TO_RIGHT` and left as they are. In any file a
negative distance of a LateralDistanceAction, which the standard does not have, means the left.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite

from schemas.common.remarks import Remark
from xosc.document.node import TO_RIGHT, Node

FLAG = "CARLA:"
_RULE = "xosc.toolchain:xosc:1.0.0:carla.conditions"
FLAG_RULE = "xosc.toolchain:xosc:1.0.0:carla.coordinate_system"
_DISTANCE_RULE = "asam.net:xosc:1.1.0:data_type.distances_are_not_negative"
CRITERION_PREFIX = "criteria_"


def is_criterion(condition: Node) -> bool:
    """Whether a Condition of a StopTrigger is a criterion, by its name and the condition inside.

    That is a ParameterCondition, or a CollisionCondition.
    """
    if not condition.get("name", "").startswith(CRITERION_PREFIX):
        return False
    collision = "ByEntityCondition", "EntityCondition", "CollisionCondition"
    inside = ("ByValueCondition", "ParameterCondition"), collision
    return any(condition.find(*names) is not None for names in inside)


def is_for_carla(scenario: Node) -> bool:
    """Whether a scenario is written for scenario_runner: by its flag, or by criteria in its stop
    triggers."""
    triggers = scenario.iter("StopTrigger")
    return is_mirrored(scenario) or any(
        is_criterion(condition) for trigger in triggers for condition in trigger.iter("Condition")
    )


def is_mirrored(scenario: Node) -> bool:
    """Whether a scenario has CARLA's axes, by its flag."""
    header = scenario.find("FileHeader")
    return header is not None and str(header.get("description", "")).startswith(FLAG)


def to_standard(scenario: Node) -> list[Remark]:
    """Translate the conventions of a scenario for CARLA, in place; attributes have to be literals.

    Returns:
        What was assumed.
    """
    flagged, remarks = is_mirrored(scenario), []
    if is_for_carla(scenario):
        header = scenario.need("FileHeader")
        text = (
            "written for CARLA's scenario_runner: triggers, priorities, speed steps and lane "
            "changes are read as there"
        )
        remarks.append(header.remark(_RULE, text))
    if flagged:
        header = scenario.need("FileHeader")
        for tag, change in _CHANGES.items():
            # Listed, as a change renames elements that the walk has not passed yet.
            for node in list(scenario.iter(tag)):
                change(node)
        # Without the flag: the document is in the standard's axes now, and would be mirrored once
        # more.
        header.element.set("description", header.get("description").removeprefix(FLAG))
        text = (
            f"the description begins with {FLAG!r}: y points to the right and headings count "
            "clockwise, as in CARLA"
        )
        remarks.append(header.remark(FLAG_RULE, text))
    for node in scenario.iter("LateralDistanceAction"):
        remarks += _lateral_distance(node, flagged)
    return remarks


def _negate(node: Node, *names: str) -> None:
    """Change the signs of attributes that are there and are not 0."""
    for name in names:
        value = node.float(name, 0.0)
        # Not 0, of which `-0.0` would be written.
        if value and isfinite(value):
            node.element.set(name, repr(-value))


def _world(position: Node) -> None:
    _negate(position, "y", "h")


def _relative(position: Node) -> None:
    position.element.tag = "RelativeWorldPosition"
    _negate(position, "dy")


def _orientation(orientation: Node) -> None:
    _negate(orientation, "h")
    parent = orientation.parent
    if not orientation.has("type") or (
        parent is not None and parent.tag in ("LanePosition", "RoadPosition")
    ):
        orientation.element.set("type", "relative")


def _road(position: Node) -> None:
    _negate(position, "t")


def _lane(position: Node) -> None:
    # An offset counts to the right there: on left lanes that is towards +t already.
    if position.int("laneId") < 0:
        _negate(position, "offset")


def _relative_lane(position: Node) -> None:
    if position.has("ds") and not position.has("dsLane"):
        position.element.set("dsLane", str(position.element.attrib.pop("ds")))
    _to_right(position)


def _to_right(node: Node) -> None:
    node.element.set(TO_RIGHT, "true")


_CHANGES: dict[str, Callable[[Node], None]] = {
    "WorldPosition": _world,
    "RelativeWorldPosition": _relative,
    "RelativeObjectPosition": _relative,
    "Orientation": _orientation,
    "RoadPosition": _road,
    "LanePosition": _lane,
    "RelativeLanePosition": _relative_lane,
    "RelativeRoadPosition": _to_right,
    "AbsoluteTargetLaneOffset": _to_right,
    "RelativeTargetLaneOffset": _to_right,
}


def _lateral_distance(action: Node, flagged: bool) -> list[Remark]:
    """The side that the sign of a distance means; scenario_runner's positive distances are to the
    right."""
    distance = action.float("distance", None)
    if distance is None or action.has("displacement") or not (flagged or distance < 0.0):
        return []
    side = "left" if distance < 0.0 else "right"
    action.element.set("displacement", f"{side}ToReferencedEntity")
    if distance >= 0.0:
        return []
    action.element.set("distance", repr(-distance))
    return [
        action.remark(
            _DISTANCE_RULE,
            f"distance={distance:g} is negative: {-distance:g} m to the left of the reference",
        )
    ]
