"""Routes and trajectories as scenario_runner follows them: waypoints in a line, with times if they count.

scenario_runner 0.9.16 stops at routes: it compares their number of waypoints with times that they do not have. Its default
controller drives by the times of a trajectory whenever there are vertices, so what has no Timing is given to the controller
that does not look at them.
"""

from __future__ import annotations

from collections.abc import Sequence

from lxml import etree

from xosc.document import Document
from xosc.exports.carla.beginning import STORY
from xosc.exports.on_roads.geometry import Place
from xosc.exports.on_roads.shapes import polyline
from xosc.exports.on_roads.starts import actors
from xosc.node import Node

_CONTROLLER = "simple_vehicle_control"
_OVERRIDES = {
    "Throttle": "value", "Brake": "value", "Clutch": "value", "ParkingBrake": "value", "SteeringWheel": "value", "Gear": "number",
}  # fmt: skip


def follow(places: Sequence[Place], *, timed: bool) -> etree._Element:
    """An element RoutingAction that follows a trajectory; with times, if they count, from its start."""
    routing = etree.Element("RoutingAction")
    action = etree.SubElement(routing, "FollowTrajectoryAction")
    reference = etree.SubElement(action, "TrajectoryRef")
    trajectory = etree.SubElement(reference, "Trajectory", name="route", closed="false")
    etree.SubElement(trajectory, "Shape").append(polyline(places))
    time = etree.SubElement(action, "TimeReference")
    if timed:
        etree.SubElement(time, "Timing", domainAbsoluteRelative="relative", scale="1", offset="0")
    else:
        etree.SubElement(time, "None")
    etree.SubElement(action, "TrajectoryFollowingMode", followingMode="position")
    return routing


def times(document: Document) -> None:
    """Times of trajectories as scenario_runner reads them: at all vertices, from the start of the action, as they stand there.

    Raises:
        Unsupported: they count from the beginning of the scenario, and the action may start later.
    """
    for untimed in document.node.iter("FollowTrajectoryAction"):
        for vertex in untimed.iter("Vertex") if untimed.find("TimeReference", "Timing") is None else ():
            vertex.element.set("time", "0")
    for timing in document.node.iter("Timing"):
        action = Node(next(timing.element.iterancestors("FollowTrajectoryAction")), timing.path)
        if timing.get("domainAbsoluteRelative") == "absolute" and not starts_with_scenario(action):
            raise timing.unsupported("scenario_runner's times of trajectories count from the start of the action")
        scale, offset = timing.float("scale"), timing.float("offset")
        for timed in action.iter("Vertex", "ControlPoint"):
            if timed.has("time"):
                timed.element.set("time", repr(timed.float("time") * scale + offset))
        timing.element.attrib.update({"domainAbsoluteRelative": "relative", "scale": "1", "offset": "0"})


def starts_with_scenario(action: Node) -> bool:
    """Whether an action is one of Init that a story does at the beginning."""
    return any(each.tag == "Story" and each.get("name") == STORY for each in action.element.iterancestors())


def steer(document: Document) -> None:
    """Give those who follow trajectories without times a controller that does not look at them; in a document of 1.0."""
    untimed = [each for each in document.node.iter("FollowTrajectoryAction") if each.find("TimeReference", "Timing") is None]
    for entity in dict.fromkeys(name for action in untimed for name in actors(action)):
        for private in document.node.need("Storyboard", "Init").iter("Private"):
            if private.get("entityRef") == entity and not list(private.iter("AssignControllerAction")):
                private.element.append(_assign_controller())
                break


def _assign_controller() -> etree._Element:
    action = etree.Element("PrivateAction")
    both = etree.SubElement(action, "ControllerAction")
    controller = etree.SubElement(etree.SubElement(both, "AssignControllerAction"), "Controller", name=_CONTROLLER)
    properties = etree.SubElement(controller, "Properties")
    etree.SubElement(properties, "Property", name="module", value=_CONTROLLER)
    override = etree.SubElement(both, "OverrideControllerValueAction")
    for tag, value in _OVERRIDES.items():
        etree.SubElement(override, tag, {"active": "false", value: "0"})
    return action
