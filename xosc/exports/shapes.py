"""Positions, trajectories, initial distances and synchronised arrivals in terms that every target
has.

Positions and trajectories become world positions and polylines; initial distances become positions
and speeds. Synchronised arrivals without steady states and tolerances get earlier targets. An actor
that holds the final speed v for a distance d before its target has this speed at d before the
target, d/v before the master arrives. The master is then v' · d/v away from its own target, where
v' is its speed when the action begins. Triggers on the end of the action get a delay of d/v."""

from __future__ import annotations

import copy
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial

from lxml import etree

from xosc.document import Document
from xosc.document.node import Node, meant
from xosc.exports.omissions import leave_out
from xosc.exports.starts import InitialState, RoadGeometry, State, Vertex, actors

HOLDERS = ("Position", "TargetPosition", "TargetPositionMaster")
"""Elements that hold one position."""
_NEAR = 1e-3
"""m below which a height is that of a flat road."""


def in_world(
    document: Document, geometry: RoadGeometry, chosen: Callable[[Node], bool]
) -> Iterator[str]:
    """Say positions, where they are fixed, by WorldPosition; a remark for each kind with the first
    place.

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
            yield (
                f"{position.where}: {position.tag}: it is written as the place in "
                "the world that it is"
            )
        holder.element.replace(position.element, world_position(place))


def polylines(
    document: Document,
    geometry: RoadGeometry,
    shapes: Collection[str],
    *,
    offsets: bool,
    during: State | None,
) -> Iterator[str]:
    """Say trajectories, where they are fixed, by polylines; a remark for each kind with the first
    place.

    Args:
        shapes: which shapes.
        offsets: also all that are begun at an initialDistanceOffset and have no times, which then
            begin there.
        during: how an entity is when an action begins: where those that begin where their one actor
            is are then. None: they are written by positions relative to it.
    """
    told: set[str] = set()
    for action in list(document.node.iter("FollowTrajectoryAction")):
        trajectory = next(iter(action.iter("Trajectory")))
        shape, skip = trajectory.need("Shape").only(), 0.0
        if offsets and action.find("TimeReference", "Timing") is None:
            skip = action.float("initialDistanceOffset", 0.0)
        # The shape can be said; only an offset needs its vertices.
        if shape.tag not in shapes and not skip:
            continue
        places, made = _places(action, trajectory, skip, geometry, during)
        # It depends on the run: left as it is, and refused by the version's own schema.
        if places is None:
            continue
        if skip:
            del action.element.attrib["initialDistanceOffset"]
        if shape.tag not in told:
            told.add(shape.tag)
            yield (
                f"{shape.where}: {shape.tag}: it is written as a polyline of {len(places)} vertices"
            )
        trajectory.need("Shape").element.replace(shape.element, polyline(places, made))


def _places(
    action: Node, trajectory: Node, skip: float, geometry: RoadGeometry, during: State | None
) -> tuple[Sequence[Vertex] | None, Callable[[Vertex], etree._Element]]:
    """Places of a trajectory, None if unknown, and the maker of an element for each."""
    fixed, doing = geometry.track(trajectory, skip), actors(action)
    # Of several actors one polyline beside each would need as many actions.
    if fixed is not None or len(doing) != 1:
        return fixed, world_position
    if during is None:
        return geometry.track(trajectory, skip, doing[0]), partial(_beside, doing[0])
    start = during(action, doing[0])
    if start is None or start.pose is None:
        return None, world_position
    return geometry.track(trajectory, skip, doing[0], start.pose), world_position


def first_position(start: InitialState) -> etree._Element:
    """The position with which an entity starts: on its lane where it is in its middle, else in the
    world."""
    assert start.pose is not None
    if start.centred and start.road is not None:
        return etree.Element(
            "LanePosition", roadId=start.road, laneId=str(start.lane), s=repr(start.s)
        )
    return world_position(Vertex(*start.pose))


def world_position(place: Vertex) -> etree._Element:
    """The element WorldPosition of a place; without z where that is the road's, at 0."""
    element = etree.Element("WorldPosition", x=repr(place.x), y=repr(place.y))
    if abs(place.z) > _NEAR:
        element.set("z", repr(place.z))
    if place.h is not None:
        element.set("h", repr(place.h))
    return element


def _beside(entity: str, place: Vertex) -> etree._Element:
    return etree.Element(
        "RelativeObjectPosition", entityRef=entity, dx=repr(place.x), dy=repr(place.y)
    )


def polyline(
    places: Sequence[Vertex], made: Callable[[Vertex], etree._Element] = world_position
) -> etree._Element:
    """The element Polyline of places, the position of each by `made`."""
    element = etree.Element("Polyline")
    for place in places:
        vertex = etree.SubElement(element, "Vertex")
        if place.time is not None:
            vertex.set("time", repr(place.time))
        etree.SubElement(vertex, "Position").append(made(place))
    return element


def to_init(document: Document) -> Iterator[str]:
    """Move distances that stories set at time 0 into Init and remove those that are never set, in
    place; remarks."""
    scenario = document.node
    privates = {
        node.get("entityRef"): node for node in scenario.need("Storyboard", "Init").iter("Private")
    }
    for story in scenario.need("Storyboard").children("Story"):
        for action in list(story.iter("LongitudinalDistanceAction")):
            starts, doing = starts_at_once(action, scenario), actors(action)
            if starts is False:
                yield f"{action.where}: {action.tag}: left out, its act never starts"
            elif starts and _at_once(action) and doing and privates.keys() >= set(doing):
                yield f"{action.where}: {action.tag}: Init sets it instead, at the same time"
                for name in doing:
                    holder = etree.SubElement(privates[name].element, "PrivateAction")
                    etree.SubElement(holder, "LongitudinalAction").append(
                        copy.deepcopy(action.element)
                    )
            else:
                continue
            leave_out(action, scenario)


def _at_once(action: Node) -> bool:
    return not action.bool("continuous") and action.find("DynamicConstraints") is None


def starts_at_once(action: Node, scenario: Node) -> bool | None:
    """Whether the event and the act around an element start at time 0, whatever happens; False:
    never, None: that depends."""
    around = [
        Node(ancestor, action.path).find("StartTrigger")
        for ancestor in action.element.iterancestors("Event", "Act")
    ]
    groups = [trigger.children("ConditionGroup") for trigger in around if trigger is not None]
    return _all(
        [
            _any(
                [
                    _all([_holds(condition, scenario) for condition in group.children()])
                    for group in trigger
                ]
            )
            for trigger in groups
        ]
    )


def _all(held: Sequence[bool | None]) -> bool | None:
    # Three-valued logic: one that never holds decides for all, whatever is not known of the others.
    return False if False in held else None if None in held else True


def _any(held: Sequence[bool | None]) -> bool | None:
    return True if True in held else None if None in held else False


def _holds(condition: Node, scenario: Node) -> bool | None:
    """Whether a condition holds at time 0; False: at no time, None: that depends."""
    time = condition.find("ByValueCondition", "SimulationTimeCondition")
    parameter = condition.find("ByValueCondition", "ParameterCondition")
    # An edge, or a delay, needs a time before: nothing with one holds at time 0.
    if condition.float("delay", 0.0) or condition.get("conditionEdge", "none") != "none":
        return None
    if time is not None:
        begun = {
            "greaterThan": time.float("value") < 0.0,
            "greaterOrEqual": time.float("value") <= 0.0,
        }
        # False now, it may hold later: not decided.
        return begun.get(time.get("rule")) or None
    if parameter is None or parameter.get("rule") != "equalTo":
        return None
    if any(
        action.get("parameterRef") == parameter.get("parameterRef")
        for action in scenario.iter("ParameterAction")
    ):
        return None
    declared = scenario.find("ParameterDeclarations")
    for declaration in declared.children() if declared is not None else ():
        if declaration.get("name") == parameter.get("parameterRef"):
            return bool(declaration.get("value") == parameter.get("value"))
    return None


def first_distances(document: Document, known: Mapping[str, InitialState]) -> Iterator[str]:
    """Say distances that Init sets at once by the first positions and speeds that come of them; a
    remark for each.

    Args:
        known: initial states of all entities, poses included.
    """
    for private in document.node.need("Storyboard", "Init").iter("Private"):
        start = known.get(private.get("entityRef"), InitialState())
        holders = [teleport.need("Position") for teleport in private.iter("TeleportAction")]
        for action in list(private.iter("LongitudinalDistanceAction")):
            if start.pose is None or not holders or not _at_once(action):
                continue
            yield f"{action.where}: {action.tag}: left out, the first position has the distance"
            holders[-1].element.replace(holders[-1].only().element, first_position(start))
            private.element.remove(
                next(ancestor for ancestor in action.element.iterancestors("PrivateAction"))
            )
            # Keeping a distance implies the other entity's speed.
            for target in private.iter("AbsoluteTargetSpeed"):
                target.element.set("value", repr(start.speed))


_STEADY = ("TargetDistanceSteadyState", "TargetTimeSteadyState")
_TOLERANCES = ("targetTolerance", "targetToleranceMaster")
_ENDED = ("endTransition", "completeState")
_UNKNOWN = (
    "the version has no steady states, and where the master is when this one begins is known only "
    "when it runs"
)


def earlier(document: Document, geometry: RoadGeometry) -> Iterator[str]:
    """Move targets back by steady states and tolerances, which are left out, in place; a remark for
    each action.

    Raises:
        Unsupported: it is not known by how much, or a position can't be moved back.
    """
    for action in document.node.iter("SynchronizeAction"):
        steady = next((state for tag in _STEADY for state in action.iter(tag)), None)
        if steady is None and not any(action.has(name) for name in _TOLERANCES):
            continue
        # While the final speed is held both drive on: each target lies that way before the written
        # one.
        way, time = _held(action, steady, geometry) if steady is not None else (0.0, 0.0)
        master_way = time * abs(_speed(action, geometry) or 0.0)
        # A tolerance ends the action when the target is that near: without it the target has to be
        # nearer.
        own, masters = (float(action.element.attrib.pop(name, "0")) for name in _TOLERANCES)
        _back(action.need("TargetPosition").only(), way + own, geometry)
        _back(action.need("TargetPositionMaster").only(), master_way + masters, geometry)
        if steady is not None:
            speed = action.need("FinalSpeed").only().element
            # An element without content may hold no line breaks either.
            speed.text = None
            for child in list(speed):
                speed.remove(child)
            _wait(action, time, document.node)
        yield (
            f"{action.where}: SynchronizeAction: its targets are written {way + own:g} m and, for "
            "the master, "
            f"{master_way + masters:g} m earlier, where the steady state or the tolerance begins"
        )


def _wait(action: Node, time: float, scenario: Node) -> None:
    """Have conditions that wait for the end of an action wait for a time (s) longer, by which it
    now ends earlier, in place.

    Raises:
        Unsupported: what they wait for has other actions too.
    """
    around = set(action.element.iterancestors())
    for condition in scenario.iter("Condition") if time else ():
        for state in condition.iter("StoryboardElementStateCondition"):
            awaited = [node for node in meant(state, scenario) if node.element in around]
            if not awaited or state.get("state") not in _ENDED:
                continue
            # The end of an event is that of its last action: the delay would be right for one of
            # them only.
            if any(len(list(node.iter("Action"))) > 1 for node in awaited):
                raise state.unsupported(
                    f"what it waits for would end {time:g} s earlier, but for its other actions"
                )
            condition.element.set("delay", repr(condition.float("delay", 0.0) + time))


def _held(action: Node, steady: Node, geometry: RoadGeometry) -> tuple[float, float]:
    """Distance (m) and time (s) for which the final speed is held."""
    final = action.need("FinalSpeed").only()
    speed, relation = final.float("value"), final.get("speedTargetValueType", "")
    if relation:
        master = _speed(action, geometry)
        if master is None:
            raise steady.unsupported(_UNKNOWN)
        speed = master * speed if relation == "factor" else master + speed
    if steady.tag == "TargetTimeSteadyState":
        return max(speed, 0.0) * steady.float("time"), steady.float("time")
    distance = steady.float("distance")
    if distance and (speed <= 0.0 or _speed(action, geometry) is None):
        raise steady.unsupported(_UNKNOWN)
    return distance, distance / speed if distance else 0.0


def _speed(action: Node, geometry: RoadGeometry) -> float | None:
    """The master's speed (m/s) when the action begins."""
    master = geometry.during(action, action.get("masterEntityRef"))
    return master.speed if master is not None else None


def _back(position: Node, distance: float, geometry: RoadGeometry) -> None:
    """Move a position a distance (m) back on its trajectory, its route or its lane."""
    # Nothing held: the position stays as it is written, and of any kind.
    if not distance:
        return
    along, name, facing = position, "s", 1
    if position.tag == "RoutePosition":
        name = "pathS"
        along = next((node for node in position.iter() if node.has(name)), position)
    elif position.tag == "LanePosition":
        facing = geometry.direction(position.get("roadId"), position.int("laneId"))
    elif position.tag != "TrajectoryPosition":
        raise position.unsupported(
            f"the target would have to be {distance:g} m earlier, and "
            f"{position.tag} has no way back"
        )
    moved = along.float(name) - facing * distance
    if moved < 0.0:
        raise position.unsupported(
            f"the target would have to be {distance:g} m earlier, where its way has not begun yet"
        )
    along.element.set(name, repr(moved))
