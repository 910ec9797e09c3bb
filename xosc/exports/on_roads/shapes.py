"""Positions and trajectories that a target has no word for, said by places in the world and by polylines."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from functools import partial

from lxml import etree

from xosc.document import Document
from xosc.exports.on_roads.geometry import Geometry, Place
from xosc.exports.on_roads.starts import Start, State, actors
from xosc.node import Node

HOLDERS = ("Position", "TargetPosition", "TargetPositionMaster")
"""Elements that hold one position."""
_NEAR = 1e-3
"""m below which a height is that of a flat road."""


def in_world(document: Document, geometry: Geometry, chosen: Callable[[Node], bool]) -> Iterator[str]:
    """Say positions, where they are fixed, by WorldPosition; a remark for each kind with the first place.

    Args:
        chosen: which positions.
    """
    told: set[str] = set()
    for holder in list(document.node.iter(*HOLDERS)):
        position = holder.only()
        if not chosen(position):
            continue
        place = geometry.place(holder)
        if place is None:
            continue
        if position.tag not in told:
            told.add(position.tag)
            yield f"{position.where}: {position.tag}: it is written as the place in the world that it is"
        holder.element.replace(position.element, world_position(place))


def polylines(
    document: Document, geometry: Geometry, shapes: Collection[str], *, offsets: bool, during: State | None
) -> Iterator[str]:
    """Say trajectories, where they are fixed, by polylines; a remark for each kind with the first place.

    Args:
        shapes: which shapes.
        offsets: also all that are begun at an initialDistanceOffset and have no times, which then begin there.
        during: how an entity is when an action begins: where those that begin where their one actor is are then. None: they
            are written by positions relative to it.
    """
    told: set[str] = set()
    for action in list(document.node.iter("FollowTrajectoryAction")):
        trajectory = next(iter(action.iter("Trajectory")))
        shape, skip = trajectory.need("Shape").only(), 0.0
        if offsets and action.find("TimeReference", "Timing") is None:
            skip = action.float("initialDistanceOffset", 0.0)
        if shape.tag not in shapes and not skip:
            continue
        places, made = _places(action, trajectory, skip, geometry, during)
        if places is None:
            continue
        if skip:
            del action.element.attrib["initialDistanceOffset"]
        if shape.tag not in told:
            told.add(shape.tag)
            yield f"{shape.where}: {shape.tag}: it is written as a polyline of {len(places)} vertices"
        trajectory.need("Shape").element.replace(shape.element, polyline(places, made))


def _places(
    action: Node, trajectory: Node, skip: float, geometry: Geometry, during: State | None
) -> tuple[Sequence[Place] | None, Callable[[Place], etree._Element]]:
    """The places of a trajectory, and how to say each; None where they are not known."""
    fixed, doing = geometry.track(trajectory, skip), actors(action)
    if fixed is not None or len(doing) != 1:
        return fixed, world_position
    if during is None:
        return geometry.track(trajectory, skip, doing[0]), partial(_beside, doing[0])
    start = during(action, doing[0])
    if start is None or start.pose is None:
        return None, world_position
    return geometry.track(trajectory, skip, doing[0], start.pose), world_position


def first_position(start: Start) -> etree._Element:
    """The position with which an entity starts: on its lane where it is in its middle, else in the world."""
    assert start.pose is not None
    if start.centred and start.road is not None:
        return etree.Element("LanePosition", roadId=start.road, laneId=str(start.lane), s=repr(start.s))
    return world_position(Place(*start.pose))


def world_position(place: Place) -> etree._Element:
    """The element WorldPosition of a place; without z where that is the road's, at 0."""
    element = etree.Element("WorldPosition", x=repr(place.x), y=repr(place.y))
    if abs(place.z) > _NEAR:
        element.set("z", repr(place.z))
    if place.h is not None:
        element.set("h", repr(place.h))
    return element


def _beside(entity: str, place: Place) -> etree._Element:
    return etree.Element("RelativeObjectPosition", entityRef=entity, dx=repr(place.x), dy=repr(place.y))


def polyline(places: Sequence[Place], made: Callable[[Place], etree._Element] = world_position) -> etree._Element:
    """The element Polyline of places, the position of each by `made`."""
    element = etree.Element("Polyline")
    for place in places:
        vertex = etree.SubElement(element, "Vertex")
        if place.time is not None:
            vertex.set("time", repr(place.time))
        etree.SubElement(vertex, "Position").append(made(place))
    return element
