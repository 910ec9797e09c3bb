"""Motion for scenario_runner: the beginning, routes and trajectories as waypoints in a line, with
times where they count.

scenario_runner takes the last Position inside a Private as the start of the entity, and reads only
speeds that are absolute and at once; everything else moves to a story. It waits for the delay of a
condition before it evaluates the condition, so delays become times.

scenario_runner 0.9.16 stops at routes: it compares their number of waypoints with times that they
do not have. They become trajectories along the lanes. Motion that it has no element for becomes the
trajectory of the actor in a run without a system under test; speeds are then left to the other
actions. Its default controller drives by the times of a trajectory whenever there are vertices, so
a trajectory without Timing is given to the controller that ignores times.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from lxml import etree

from schemas.common.errors import Unsupported
from xosc.document import Document
from xosc.document.carla import is_for_carla
from xosc.document.node import EGO_NAME, Node, meant
from xosc.exports.omissions import leave_out
from xosc.exports.shapes import (
    first_distances,
    first_position,
    polyline,
    starts_at_once,
    world_position,
)
from xosc.exports.starts import InitialState, RoadGeometry, Vertex, actors

# the beginning of a scenario --------------------------------------------------------------------


STORY = "beginning"
_READ = (
    "TeleportAction",
    "LaneOffsetAction",
    "LateralDistanceAction",
    "AssignControllerAction",
    "OverrideControllerValueAction",
)
"""First actions that scenario_runner has."""
_WRAPPERS = ("LongitudinalAction", "LateralAction", "RoutingAction", "ControllerAction")


def begin(document: Document, known: Mapping[str, InitialState]) -> Iterator[str]:
    """Change the Init of a worked-out scenario, in place; remarks.

    Args:
        known: initial states of all entities, poses included.
    """
    scenario = document.node
    yield from first_distances(document, known)
    for private in list(scenario.need("Storyboard", "Init").iter("Private")):
        start = known.get(private.get("entityRef"))
        if start is not None and start.pose is not None:
            yield from _place(private, start)
            yield from _rest(private, start, scenario)
            if not private.children():
                _remove(private)


def _place(private: Node, start: InitialState) -> Iterator[str]:
    """The first position: on the lane where it is in its middle, else in the world."""
    holders = [action.need("Position") for action in private.iter("TeleportAction")]
    if not holders:
        private.element.insert(0, _teleport(start))
        yield (
            f"{private.where}: Private: the first position is written as where its actions put "
            f"{private.get('entityRef')!r}"
        )
        return
    if _is_plain(holders[-1].only()):
        return
    position = holders[-1].only()
    for holder in holders[:-1]:
        _remove(_private_action(holder))
    yield f"{position.where}: {position.tag}: the first position is written as where that is"
    holders[-1].element.replace(position.element, first_position(start))


def _teleport(start: InitialState) -> etree._Element:
    action = etree.Element("PrivateAction")
    etree.SubElement(etree.SubElement(action, "TeleportAction"), "Position").append(
        first_position(start)
    )
    return action


def _is_plain(position: Node) -> bool:
    on_lane = (
        position.tag == "LanePosition"
        and not position.float("offset", 0.0)
        and position.find("Orientation") is None
    )
    return on_lane or position.tag == "WorldPosition"


def _rest(private: Node, start: InitialState, scenario: Node) -> Iterator[str]:
    """Change all other first actions: steps of speed become absolute, actions that scenario_runner
    does not read in Init move to a story."""
    for holder in private.children("PrivateAction"):
        action = _inside(holder)
        if action.tag == "SpeedAction":
            yield from _speed(holder, action, start, scenario)
        elif action.tag == "ActivateControllerAction":
            continue
        elif action.tag not in _READ:
            to_story(holder, private.get("entityRef"), scenario)
            yield (
                f"{action.where}: {action.tag}: it is done by a story at the beginning, "
                "scenario_runner has it in stories only"
            )


def _speed(holder: Node, action: Node, start: InitialState, scenario: Node) -> Iterator[str]:
    target, speed = action.need("SpeedActionTarget").only(), start.speed or 0.0
    step = action.need("SpeedActionDynamics").get("dynamicsShape") == "step"
    if step and not target.bool("continuous", False) and speed >= 0.0:
        if target.tag == "RelativeTargetSpeed":
            yield (
                f"{target.where}: {target.tag}: the first speed is written as the "
                f"{speed:g} m/s that it is"
            )
            absolute = etree.Element("AbsoluteTargetSpeed", value=repr(speed))
            target.element.getparent().replace(target.element, absolute)  # type: ignore[union-attr]
        return
    to_story(holder, holder.parent.get("entityRef"), scenario)  # type: ignore[union-attr]
    yield (
        f"{action.where}: {action.tag}: it is done by a story at the beginning, scenario_runner's "
        "first speeds are set at once"
    )


def to_story(holder: Node, entity: str, scenario: Node) -> None:
    """Move a PrivateAction into an event of its own that starts with the scenario."""
    name = (
        f"{STORY} {len(scenario.need('Storyboard').element.findall('Story/Act/ManeuverGroup')) + 1}"
    )
    group = etree.SubElement(
        etree.Element("none"), "ManeuverGroup", name=name, maximumExecutionCount="1"
    )
    actors = etree.SubElement(group, "Actors", selectTriggeringEntities="false")
    etree.SubElement(actors, "EntityRef", entityRef=entity)
    event = etree.SubElement(
        etree.SubElement(group, "Maneuver", name=name), "Event", name=name, priority="parallel"
    )
    etree.SubElement(event, "Action", name=name).append(holder.element)
    event.append(_at_beginning())
    act = _act(scenario)
    act.insert(len(act.findall("ManeuverGroup")), group)


def _act(scenario: Node) -> etree._Element:
    """The act of the story of the beginning, which is made before all others."""
    storyboard = scenario.need("Storyboard")
    for story in storyboard.children("Story"):
        if story.get("name", "") == STORY:
            return story.need("Act").element
    story_element = etree.Element("Story", name=STORY)
    storyboard.need("Init").element.addnext(story_element)
    act = etree.SubElement(story_element, "Act", name=STORY)
    act.append(_at_beginning())
    return act


def _at_beginning() -> etree._Element:
    trigger = etree.Element("StartTrigger")
    group = etree.SubElement(trigger, "ConditionGroup")
    condition = etree.SubElement(group, "Condition", name=STORY, delay="0", conditionEdge="none")
    value = etree.SubElement(condition, "ByValueCondition")
    # Always true, and of all versions: `greaterOrEqual` came with 1.1.
    etree.SubElement(value, "SimulationTimeCondition", value="-1", rule="greaterThan")
    return trigger


def _inside(holder: Node) -> Node:
    inner = holder.only()
    while inner.tag in _WRAPPERS:
        inner = inner.children()[0]
    return inner


def _private_action(inner: Node) -> Node:
    node = inner
    while node.tag != "PrivateAction":
        assert node.parent is not None, "first actions are inside a PrivateAction"
        node = node.parent
    return node


def _remove(node: Node) -> None:
    parent = node.element.getparent()
    assert parent is not None
    parent.remove(node.element)


_WAITS = "scenario_runner waits for the delay first, and looks at the condition then"


def no_delays(document: Document, geometry: RoadGeometry | None) -> Iterator[str]:
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


def _as_run(condition: Node, scenario: Node, geometry: RoadGeometry | None) -> str:
    """Replace a condition by the time at which its element begins in a run; the remark."""
    around = list(condition.element.iterancestors("StartTrigger", "Event", "Act"))
    if geometry is None or not around or around[0].tag != "StartTrigger":
        raise condition.unsupported(_WAITS)
    if starts_at_once(Node(around[0], condition.path), scenario) is False:
        return f"{condition.where}: Condition: its delay is left out, its act never starts"
    begins = geometry.begins(Node(around[1], condition.path))
    entities = [str(element.get("entityRef", "")) for element in condition.element.iter()]
    if (
        begins is None
        or any(map(EGO_NAME.fullmatch, entities))
        or len(around[0].findall("ConditionGroup/Condition")) > 1
    ):
        raise condition.unsupported(_WAITS)
    # The moment is that of a run without a system under test: conditions on the ego, which depend
    # on the system, are refused above.
    for child in condition.children():
        condition.element.remove(child.element)
    value = etree.SubElement(condition.element, "ByValueCondition")
    etree.SubElement(value, "SimulationTimeCondition", value=repr(begins), rule="greaterOrEqual")
    return (
        f"{condition.where}: Condition: written as the {begins:g} s at which it holds in a run "
        "without a system under test"
    )


# routes and trajectories ------------------------------------------------------------------------


_CONTROLLER = "simple_vehicle_control"
_OVERRIDES = {
    "Throttle": "value", "Brake": "value", "Clutch": "value", "ParkingBrake": "value",
    "SteeringWheel": "value", "Gear": "number",
}  # fmt: skip


def follow(places: Sequence[Vertex], *, timed: bool) -> etree._Element:
    """An element RoutingAction that follows a trajectory; with times, if they count, from its
    start."""
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
    """Times of trajectories as scenario_runner reads them: at all vertices, from the start of the
    action, as they stand there.

    Raises:
        Unsupported: they count from the beginning of the scenario, and the action may start later.
    """
    for untimed in document.node.iter("FollowTrajectoryAction"):
        # 1.0 asks for a time at each vertex; without a Timing none counts.
        for vertex in (
            untimed.iter("Vertex") if untimed.find("TimeReference", "Timing") is None else ()
        ):
            vertex.element.set("time", "0")
    for timing in document.node.iter("Timing"):
        action = Node(next(timing.element.iterancestors("FollowTrajectoryAction")), timing.path)
        if timing.get("domainAbsoluteRelative") == "absolute" and not starts_with_scenario(action):
            raise timing.unsupported(
                "scenario_runner's times of trajectories count from the start of the action"
            )
        scale, offset = timing.float("scale"), timing.float("offset")
        # Timing: the time of a vertex counts as time · scale + offset.
        for timed in action.iter("Vertex", "ControlPoint"):
            if timed.has("time"):
                timed.element.set("time", repr(timed.float("time") * scale + offset))
        timing.element.attrib.update(
            {"domainAbsoluteRelative": "relative", "scale": "1", "offset": "0"}
        )


def starts_with_scenario(action: Node) -> bool:
    """Whether an action is one of Init that a story does at the beginning."""
    return any(
        ancestor.tag == "Story" and ancestor.get("name") == STORY
        for ancestor in action.element.iterancestors()
    )


def steer(document: Document) -> None:
    """Give followers of trajectories without times a controller that ignores them; in a document of
    1.0."""
    untimed = [
        action
        for action in document.node.iter("FollowTrajectoryAction")
        if action.find("TimeReference", "Timing") is None
    ]
    for entity in dict.fromkeys(name for action in untimed for name in actors(action)):
        for private in document.node.need("Storyboard", "Init").iter("Private"):
            # A controller that the scenario assigns itself stays: it may be the system under test.
            if private.get("entityRef") == entity and not list(
                private.iter("AssignControllerAction")
            ):
                private.element.append(_assign_controller())
                break


def _assign_controller() -> etree._Element:
    action = etree.Element("PrivateAction")
    both = etree.SubElement(action, "ControllerAction")
    controller = etree.SubElement(
        etree.SubElement(both, "AssignControllerAction"), "Controller", name=_CONTROLLER
    )
    properties = etree.SubElement(controller, "Properties")
    etree.SubElement(properties, "Property", name="module", value=_CONTROLLER)
    override = etree.SubElement(both, "OverrideControllerValueAction")
    for tag, value in _OVERRIDES.items():
        etree.SubElement(override, tag, {"active": "false", value: "0"})
    return action


_CURVES = ("Clothoid", "ClothoidSpline", "Nurbs")
_MOVING = (
    "RelativeLanePosition",
    "RelativeRoadPosition",
    "RelativeObjectPosition",
    "RoutePosition",
    "TrajectoryPosition",
)
"""Positions that depend on what happens, where they are not in the world by now."""
_ENDS = ("LateralAction", "RoutingAction", "TeleportAction", "SynchronizeAction")
"""Actions that end the motion along a trajectory."""
_KINDS = ("LongitudinalAction", "LateralAction", "RoutingAction")
_DISTANCE = "LongitudinalDistanceAction"
_APART = 0.5
"""m between two vertices at least, where times don't count."""
_JUMP = 2.0
"""Ratio of a displacement to the next one above which it counts as a teleport."""


def trajectories(document: Document, geometry: RoadGeometry) -> Iterator[str]:
    """Say trajectories that depend on what happens, or begin inside, by the way that their actor
    takes, in place; remarks."""
    relative = () if is_for_carla(document.node) else _MOVING
    for action in list(document.node.iter("FollowTrajectoryAction")):
        timing = action.find("TimeReference", "Timing")
        late = (
            timing is not None
            and timing.get("domainAbsoluteRelative") == "absolute"
            and not starts_with_scenario(action)
        )
        if (
            late
            or action.float("initialDistanceOffset", 0.0)
            or any(True for _ in action.iter(*_CURVES, *relative))
        ):
            yield from _as_driven(action, geometry, timed=timing is not None)


def profiles(document: Document, geometry: RoadGeometry) -> Iterator[str]:
    """Replace speed profiles independent of other entities by timed trajectories, if nothing else
    moves the actor; remarks."""
    stories = document.node.need("Storyboard").children("Story")
    for action in [action for story in stories for action in story.iter("SpeedProfileAction")]:
        begin, end, doing = geometry.begins(action), geometry.ends(action), set(actors(action))
        others = [
            geometry.begins(action)
            for story in stories
            for action in story.iter(*_ENDS)
            if doing & set(actors(action))
        ]
        alone = not any(time is not None and (end is None or time < end) for time in others)
        if begin is not None and alone and not action.get("entityRef", ""):
            yield from _as_driven(action, geometry, timed=True)


def kept_distances(document: Document, geometry: RoadGeometry) -> Iterator[str]:
    """Say distances that 1.0 has no word for, kept among others than the ego, by ways and times, in
    place; remarks."""
    scenario = document.node
    for action in [
        action
        for story in scenario.need("Storyboard").children("Story")
        for action in story.iter(_DISTANCE)
    ]:
        begin, doing = _begin(action, geometry), actors(action)
        newer = action.has("timeGap") or action.get("coordinateSystem", "entity") != "entity"
        others = len(doing) == 1 and not any(
            map(EGO_NAME.fullmatch, (doing[0], action.get("entityRef")))
        )
        if begin is None or not newer or not others:
            continue
        end = geometry.ends(action)
        until = min(
            _led(doing[0], begin, scenario, geometry, ("LongitudinalAction", *_ENDS)),
            math.inf if end is None else end,
        )
        yield from _written(action, doing[0], geometry.driven(doing[0], begin, until), timed=True)


def _begin(action: Node, geometry: RoadGeometry) -> float | None:
    """Time (s) at which an action begins in a run; None where it doesn't."""
    first = starts_with_scenario(action) or any(True for _ in action.element.iterancestors("Init"))
    return 0.0 if first else geometry.begins(action)


def _led(
    entity: str, since: float, scenario: Node, geometry: RoadGeometry, kinds: Sequence[str]
) -> float:
    """Time (s), after a given one, at which the next of some kinds of actions leads an entity in a
    run; infinity where none does."""
    others = [
        action
        for story in scenario.need("Storyboard").children("Story")
        for action in story.iter(*kinds)
    ]
    later = (geometry.begins(action) for action in others if entity in actors(action))
    return min((time for time in later if time is not None and time > since), default=math.inf)


def _as_driven(action: Node, geometry: RoadGeometry, *, timed: bool) -> Iterator[str]:
    """Say an action of one actor by its way from the action's begin to its end, where it begins in
    a run; the remark."""
    begin, end, doing = geometry.begins(action), geometry.ends(action), actors(action)
    if begin is None or len(doing) != 1:
        return
    yield from _written(
        action,
        doing[0],
        geometry.driven(doing[0], begin, end if end is not None else math.inf),
        timed=timed,
    )


def _written(action: Node, entity: str, driven: Sequence[Vertex], *, timed: bool) -> Iterator[str]:
    """Say an action by the way of its actor, where there is one; the remark."""
    places, where = _from_its_start(driven), action.where
    if len(places) > 1:
        _replace(action, places if timed else _apart(places), timed=timed)
        yield (
            f"{where}: {action.tag}: written as the way that {entity} takes in a run without a "
            "system under test"
        )


def teleports(document: Document, geometry: RoadGeometry) -> Iterator[str]:
    """Say positions to which stories put an actor, and which depend on what happens, by where they
    are, in place; remarks."""
    if is_for_carla(document.node):
        return
    for story in document.node.need("Storyboard").children("Story"):
        for action in story.iter("TeleportAction"):
            position, doing = action.need("Position").only(), actors(action)
            place = (
                geometry.put(action, doing[0])
                if position.tag in _MOVING and len(doing) == 1
                else None
            )
            if place is not None:
                action.need("Position").element.replace(position.element, world_position(place))
                yield (
                    f"{position.where}: {position.tag}: written as the place where it is in a run "
                    "without a system under test"
                )


def follow_on(action: Node, scenario: Node, geometry: RoadGeometry, refusal: Unsupported) -> str:
    """Say a lateral action or a route by the way that its actor takes from there until another
    action leads it; the remark.

    Raises:
        Unsupported: `refusal`, as it does not begin in the run, jumps, or something waits for its
            end.
    """
    begin, doing = _begin(action, geometry), actors(action)
    jumps = any(child.get("dynamicsShape", "") == "step" for child in action.children())
    if begin is None or len(doing) != 1 or jumps or _is_awaited(action, scenario):
        raise refusal
    places = _apart(
        geometry.driven(doing[0], begin, _led(doing[0], begin, scenario, geometry, _ENDS))
    )
    if len(places) < 2:
        raise refusal
    where = action.where
    _replace(action, places, timed=False)
    return (
        f"{where}: {action.tag}: written as the way that {doing[0]} takes in a run without a "
        "system under test, until its next "
        f"one: {refusal.message}"
    )


def _from_its_start(places: Sequence[Vertex]) -> Sequence[Vertex]:
    """Return the path of an entity teleported onto a trajectory; it begins one step's distance
    before the next place."""
    if (
        len(places) < 3
        or math.dist(places[0][:3], places[1][:3])
        < _JUMP * math.dist(places[1][:3], places[2][:3]) + _APART
    ):
        return places
    x, y, z = (2.0 * a - b for a, b in zip(places[1][:3], places[2][:3], strict=True))
    return [Vertex(x, y, z, None, places[0].time), *places[1:]]


def _is_awaited(action: Node, scenario: Node) -> bool:
    """Whether a condition asks for the end of an action, or of something that it is part of."""
    around = set(action.element.iterancestors())
    states = [
        condition
        for condition in scenario.iter("StoryboardElementStateCondition")
        if condition.get("state") not in ("standbyState", "startTransition")
    ]
    return any(node.element in around for state in states for node in meant(state, scenario))


def _apart(places: Sequence[Vertex]) -> list[Vertex]:
    """Places at some distance from each other, the last one among them."""
    chosen = list(places[:1])
    for place in places[1:]:
        if math.dist(place[:3], chosen[-1][:3]) >= _APART:
            chosen.append(place)
    if len(chosen) > 1:
        chosen[-1] = places[-1]
    return [place._replace(time=0.0) for place in chosen]


def _replace(action: Node, places: Sequence[Vertex], *, timed: bool) -> None:
    holder = next(action.element.iterancestors(*_KINDS))
    parent = holder.getparent()
    assert parent is not None, "it is part of a PrivateAction"
    parent.replace(holder, follow(places, timed=timed))


ROUTES = ("AssignRouteAction", "AcquirePositionAction")
_STOPS = "scenario_runner stops at routes"


def routes(document: Document, geometry: RoadGeometry) -> Iterator[str]:
    """Make trajectories of routes, in place; remarks.

    Raises:
        Unsupported: the way is not known before the scenario runs.
    """
    scenario = document.node
    for action in [action for tag in ROUTES for action in scenario.iter(tag)]:
        try:
            yield _from_the_beginning(action, scenario, geometry)
        except Unsupported as error:
            if _is_left_aside(action, scenario):
                raise
            yield follow_on(action, scenario, geometry, error)


def _is_left_aside(action: Node, scenario: Node) -> bool:
    """Whether its actors go beside their route, or change lanes on it: that leaves a route as it
    is, and ends a trajectory."""
    doing = set(actors(action))
    return any(
        doing & set(actors(lateral)) and not _is_first(lateral)
        for lateral in scenario.iter("LateralAction")
    )


def _from_the_beginning(action: Node, scenario: Node, geometry: RoadGeometry) -> str:
    """Make a trajectory of a route that leads its actors from the beginning on; the remark."""
    ways = {entity: places for entity in actors(action) if (places := geometry.way(action, entity))}
    for entity in actors(action):
        beside = ("LateralAction",) if entity in ways else ()
        _only_way(action, entity, scenario, beside)
    for entity, places in ways.items():
        to_story(Node(_following(places), action.path), entity, scenario)
    leave_out(action, scenario)
    said = (
        f"written as a trajectory from the beginning on, {_STOPS}"
        if ways
        else "left out, the lanes lead that way"
    )
    return f"{action.where}: {action.tag}: {said}"


def _only_way(action: Node, entity: str, scenario: Node, beside: Sequence[str]) -> None:
    """Make sure that nothing else leads an entity: no other route, trajectory or teleport, nor an
    action of these kinds.

    Raises:
        Unsupported: something does.
    """
    others = [
        *scenario.iter(*ROUTES, "FollowTrajectoryAction", *beside),
        *(_teleports(scenario) if beside else ()),
    ]
    for other in others:
        if other.element is not action.element and entity in actors(other):
            if other.tag == "LateralAction" and _is_first(other):
                continue
            raise action.unsupported(
                f"scenario_runner gets the route as a trajectory, which {other.tag} in line "
                f"{other.line} ends"
            )


def _teleports(scenario: Node) -> list[Node]:
    return [
        teleport
        for story in scenario.need("Storyboard").children("Story")
        for teleport in story.iter("TeleportAction")
    ]


def _is_first(action: Node) -> bool:
    return any(ancestor.tag == "Init" for ancestor in action.element.iterancestors())


def _following(places: Sequence[Vertex]) -> etree._Element:
    """An action that follows a trajectory without times."""
    action = etree.Element("PrivateAction")
    action.append(follow(places, timed=False))
    return action
