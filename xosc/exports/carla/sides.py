"""Lateral values as CARLA's scenario_runner reads them, whatever the axes: to the right of the lane's traffic, or of the actor.

Those of `xosc.dialects.carla`, marked with `TO_RIGHT`, are so already.
"""

from __future__ import annotations

from collections.abc import Mapping

from xosc.exports.on_roads.starts import Start, actors
from xosc.node import TO_RIGHT, Node

_UNKNOWN = "scenario_runner's value is to the right of the traffic, and which side that is is known only when it runs"


def change_sides(scenario: Node, known: Mapping[str, Start]) -> None:
    """Change signs and attributes, in place.

    Args:
        scenario: root of a worked-out document.
        known: how the entities start.

    Raises:
        Unsupported: the side is not known before the scenario runs.
    """
    for position in scenario.iter("LanePosition"):
        if position.int("laneId") < 0:
            _negate(position, "offset")
    for position in scenario.iter("RelativeLanePosition", "RelativeRoadPosition"):
        if position.has(TO_RIGHT) and position.has("dsLane"):
            position.element.set("ds", str(position.element.attrib.pop("dsLane")))
        elif not position.has(TO_RIGHT) and (position.float("offset", 0.0) or position.float("dt", 0.0)):
            raise position.unsupported(_UNKNOWN)
    for target in scenario.iter("AbsoluteTargetLaneOffset", "RelativeTargetLaneOffset"):
        if not target.has(TO_RIGHT) and target.float("value") and _faces_s(target, known):
            _negate(target, "value")
    for action in scenario.iter("LateralDistanceAction"):
        _lateral_distance(action)


def _negate(node: Node, name: str) -> None:
    if node.float(name, 0.0):
        node.element.set(name, repr(-node.float(name)))


def _faces_s(target: Node, known: Mapping[str, Start]) -> bool:
    """Whether the entities of an action drive on lanes towards +s, as far as where they start says it."""
    sides = {known[name].lane < 0 for name in actors(target) if name in known and known[name].road is not None}
    if len(sides) != 1:
        raise target.unsupported(_UNKNOWN)
    return sides.pop()


def _lateral_distance(action: Node) -> None:
    """A side by the sign of the distance, positive to the right."""
    side = action.element.attrib.pop("displacement", "any")
    if side == "any":
        raise action.unsupported("scenario_runner keeps distances to one side: displacement must say to which")
    if side == "leftToReferencedEntity":
        _negate(action, "distance")
