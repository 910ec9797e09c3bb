"""Actions and lateral values as scenario_runner reads them, and what it stops at, leaves out, reads
otherwise or accepts.

Each change is made in place, in a worked-out document of version 1.1 or later; what scenario_runner
cannot express is refused. Lateral values are positive to the right of the lane's traffic, or of the
actor; values of `xosc.document.carla`, marked with `TO_RIGHT`, are so already. A lane change counts
lanes to the left of the actor itself, over a distance; others become the trajectory of their actor
in a run.

Sources: scenario_runner's page on OpenSCENARIO support, and its parser (0.9.16);
`get_waypoint_xodr` and the OpenDRIVE parser of CARLA 0.9.16.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from copy import deepcopy
from itertools import pairwise
from pathlib import Path

from lxml import etree

from schemas.common.errors import Unsupported, nearest
from schemas.common.xml import parse
from xosc.document import Document
from xosc.document.carla import FLAG, is_criterion
from xosc.document.node import EGO_NAME, TO_RIGHT, Node
from xosc.document.road_files import RoadFile
from xosc.exports.carla.ways import follow_on
from xosc.exports.omissions import Rule, leave_out
from xosc.exports.starts import InitialState, RoadGeometry, State, actors, beside, target_speed

# what scenario_runner 0.9.16 stops at, leaves out, reads otherwise or accepts -------------------


_TRIGGERS = "/OpenSCENARIO/Storyboard/Story"
"""Path of the triggers that are checked; the stop trigger of the storyboard is not."""
_SIGNAL = "[not(starts-with(@name, 'id=') or starts-with(@name, 'pos='))]"
_MAY_END = (
    "[@conditionEdge='falling' or not(ByValueCondition/SimulationTimeCondition[starts-with(@rule, "
    "'greater')])]"
)
"""A time that has been reached stays so: it has no other edge than that."""
ASIDE = 0.1
"""m from the lane's middle, where CARLA's controller ends lane changes, that it keeps to."""

REFUSED = (
    *(
        Rule(f"//Init//{tag}", "scenario_runner has it in stories only")
        for tag in (
            "LaneChangeAction", "LongitudinalDistanceAction", "RoutingAction", "SynchronizeAction",
            "InfrastructureAction",
        )
    ),
    Rule("//Init//SpeedActionDynamics[@dynamicsShape!='step']",
        "scenario_runner sets first speeds at once"),
    Rule("//Init//RelativeTargetSpeed", "scenario_runner's first speeds are absolute"),
    Rule("//Init//AbsoluteTargetSpeed[number(@value) < 0]",
        "scenario_runner's first speeds are not negative"),
    Rule("//AssignRouteAction | //AcquirePositionAction", "scenario_runner 0.9.16 stops at routes"),
    Rule("//VisibilityAction | //TrafficAction", "scenario_runner does not have this action"),
    Rule("//UserDefinedAction", "scenario_runner would run its text as a command of the shell"),
    Rule("//ActivateControllerAction", "scenario_runner would switch CARLA's autopilot"),
    Rule(
        "//AssignControllerAction[not(Controller/Properties/Property[@name='module'])]",
        "scenario_runner's controllers are Python modules, which the property 'module' names",
    ),
    Rule("//OverrideControllerValueAction/*[@active='true' or @active='1']",
        "scenario_runner does not override controllers"),
    Rule("//LongitudinalDistanceAction[@timeGap]", "scenario_runner does not have time gaps"),
    Rule("//FollowTrajectoryAction[.//Clothoid or .//Nurbs or .//ClothoidSpline]",
        "scenario_runner follows polylines only"),
    Rule("//Timing[@domainAbsoluteRelative='absolute']",
        "scenario_runner's times count from the start of the action"),
    Rule("//Timing[number(@scale)!=1 or number(@offset)!=0]",
        "scenario_runner reads the times of trajectories as they stand"),
    Rule(f"//TrafficSignalStateAction{_SIGNAL} | //TrafficSignalCondition{_SIGNAL}",
        "CARLA's signals are 'id=…' or 'pos=x,y'"),
    Rule("//TrafficSignalController",
        "scenario_runner reads the first phase of one controller only"),
    Rule(
        "//RelativeObjectPosition[number(@dx) != 0 or number(@dy) != 0]",
        "scenario_runner takes dx and dy as those of the world"
    ),
    Rule("//RoutePosition | //GeoPosition | //TrajectoryPosition",
        "scenario_runner does not have this position"),
    Rule(
        "//LanePosition/Orientation[not(@type='relative')] | "
        "//RoadPosition/Orientation[not(@type='relative')]",
        "scenario_runner takes every orientation as relative here",
    ),
    Rule("//Actors[@selectTriggeringEntities='true' or @selectTriggeringEntities='1']",
        "scenario_runner does not select actors"),
    Rule("//EntitySelection", "scenario_runner does not have it"),
    Rule("//Event[number(@maximumExecutionCount) > 1]", "scenario_runner's events happen once"),
    Rule(f"{_TRIGGERS}//TriggeringEntities[count(EntityRef) > 1]",
        "scenario_runner looks at one triggering entity"),
    Rule(f"{_TRIGGERS}//Condition[contains(@conditionEdge, 'alling')]{_MAY_END}",
        "scenario_runner does not see conditions end"),
    Rule(f"{_TRIGGERS}//DistanceCondition[@freespace='true' or @freespace='1']",
        "scenario_runner does not read freespace"),
    Rule(f"{_TRIGGERS}//UserDefinedValueCondition", "scenario_runner does not have this condition"),
    Rule(
        f"{_TRIGGERS}//StoryboardElementStateCondition[@state='runningState' or "
        "@state='standbyState' or @state='skipTransition' "
        "or @storyboardElementType='story' or @storyboardElementType='maneuverGroup']",
        "scenario_runner sees the beginning and the end of acts, maneuvers, events and actions",
    ),
    Rule("//Act/StopTrigger/ConditionGroup[count(Condition) > 1]",
        "scenario_runner stops when one of them holds"),
    *(
        Rule(f"//Vehicle[@vehicleCategory='{category}']", "CARLA has no such vehicle")
        for category in ("trailer", "semitrailer", "train", "tram")
    ),
    Rule("//Trailer | //TrailerHitch | //TrailerCoupler", "CARLA has no trailers"),
)  # fmt: skip
IGNORED = (
    Rule(
        f"{_TRIGGERS}//Condition[@conditionEdge='rising']",
        "scenario_runner takes it when it first holds",
    ),
    Rule(
        f"{_TRIGGERS}//SpeedActionDynamics[@dynamicsShape!='step']",
        "the shape is that of CARLA's controller",
    ),
    Rule(
        f"{_TRIGGERS}//LaneChangeActionDynamics[@dynamicsShape!='linear']",
        "scenario_runner changes lanes linearly",
    ),
    Rule("//LaneChangeAction[@targetLaneOffset]", "scenario_runner has no offset here"),
    Rule(f"{_TRIGGERS}//LaneOffsetActionDynamics", "the shape is that of CARLA's controller"),
    Rule(f"{_TRIGGERS}//Event[@priority!='parallel']", "scenario_runner does not read priorities"),
    Rule("//ScenarioObject/ObjectController", "scenario_runner does not read it"),
    Rule(
        "//ScenarioObject//BoundingBox",
        "sizes are those of CARLA's models, by category where none has the name",
    ),
    Rule("//Precipitation[@precipitationType='snow']", "CARLA shows no snow"),
    Rule("//SceneGraphFile", "CARLA makes its scene of the roads"),
)


_BEFORE_THE_END = 0.01
"""Distance (m) from the end of a road to CARLA's last position on it"""


def need_map(document: Document, network: RoadFile | None) -> None:
    """Refuse, before anything else, a scenario without roads.

    Raises:
        Unsupported: it has none.
    """
    if network is None:
        raise (document.node.find("RoadNetwork") or document.node).unsupported(
            "scenario_runner plays on a map, and this scenario names none: name one in "
            "RoadNetwork/LogicFile "
            "(--road auto makes straight roads where positions name roads)"
        )


def need_entities(document: Document) -> None:
    """Refuse a scenario with references to entities that it does not have, at which scenario_runner
    stops.

    Raises:
        InvalidFile: there is one; the first is named with file and line.
    """
    declared = {
        entity.get("name")
        for entity in document.node.need("Entities").children("ScenarioObject", "EntitySelection")
    }
    for node in document.node.iter():
        for name in (node.get("entityRef", None), node.get("masterEntityRef", None)):
            if name is not None and name not in declared:
                raise node.invalid(
                    f"there is no entity {name!r}; {nearest(name, map(str, declared))}"
                )


def settle(document: Document, network: Path | None) -> Iterator[str]:
    """Move positions at the end of a road, or beyond it, to the last place that CARLA has there;
    remarks on that.

    Raises:
        Unsupported: CARLA can't make a map of the roads.
    """
    where = document.node.find("RoadNetwork") or document.node
    assert network is not None, "need_map has been asked"
    roads = parse(network).getroot()
    if any(junction.get("type") == "direct" for junction in roads.iter("junction")):
        raise where.unsupported("CARLA stops at roads with direct junctions")
    names = [road.get("id", "") for road in roads.iter("road")]
    if not all(name.isdecimal() for name in names):
        raise where.unsupported("CARLA reads ids of roads as numbers, and some here are none")
    lengths = {road.get("id"): float(road.get("length", "0")) for road in roads.iter("road")}
    for position in document.node.iter("LanePosition", "RoadPosition"):
        yield from _within(position, lengths.get(position.get("roadId")))


def _within(position: Node, length: float | None) -> Iterator[str]:
    s = position.float("s")
    if length is not None and s >= length:
        position.element.set("s", repr(max(length - _BEFORE_THE_END, 0.0)))
        yield (
            f"{position.where}: {position.tag}: CARLA's road ends at s={length:g}; "
            f"{_BEFORE_THE_END:g} m before that is written"
        )


# changes ----------------------------------------------------------------------------------------


_UNKNOWN = (
    "scenario_runner's value is to the right of the traffic, and which side that is is known only "
    "when it runs"
)


def change_sides(scenario: Node, known: Mapping[str, InitialState]) -> None:
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
        elif not position.has(TO_RIGHT) and (
            position.float("offset", 0.0) or position.float("dt", 0.0)
        ):
            raise position.unsupported(_UNKNOWN)
    for target in scenario.iter("AbsoluteTargetLaneOffset", "RelativeTargetLaneOffset"):
        if not target.has(TO_RIGHT) and target.float("value") and _faces_s(target, known):
            _negate(target, "value")
    for action in scenario.iter("LateralDistanceAction"):
        _lateral_distance(action)


def _negate(node: Node, name: str) -> None:
    if node.float(name, 0.0):
        node.element.set(name, repr(-node.float(name)))


def _faces_s(target: Node, known: Mapping[str, InitialState]) -> bool:
    """Whether the entities of an action drive towards +s, by the lanes that they start on."""
    sides = {
        known[name].lane < 0
        for name in actors(target)
        if name in known and known[name].road is not None
    }
    if len(sides) != 1:
        raise target.unsupported(_UNKNOWN)
    return sides.pop()


def _lateral_distance(action: Node) -> None:
    """A side by the sign of the distance, positive to the right."""
    side = action.element.attrib.pop("displacement", "any")
    if side == "any":
        raise action.unsupported(
            "scenario_runner keeps distances to one side: displacement must say to which"
        )
    if side == "leftToReferencedEntity":
        _negate(action, "distance")


HERO = "hero"
"""Name that CARLA's agents look for."""

_TO_SECONDS = len("2026-01-01T00:00:00")
_ALONG_ROADS = ("road", "lane")
_SLOPES = {"linear": 1.0, "sinusoidal": math.pi / 2, "cubic": 1.5}
"""Greatest rate of a shape by its mean rate."""
_Elements = list[etree._Element]


def change(
    document: Document, known: Mapping[str, InitialState], state: State, network: Path | None
) -> list[str]:
    """Make all changes; remarks on those that are approximations.

    Args:
        known: initial states of all entities.
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
        # scenario_runner's s and t are those of the road.
        if node.get("coordinateSystem", "") in _ALONG_ROADS:
            del node.element.attrib["coordinateSystem"]
    for node in document.node.iter(
        "TimeHeadwayCondition", "TimeToCollisionCondition", "DistanceCondition"
    ):
        if (
            node.get("coordinateSystem", "") in _ALONG_ROADS
            and node.get("relativeDistanceType", "") == "longitudinal"
        ):
            del node.element.attrib["coordinateSystem"], node.element.attrib["relativeDistanceType"]
            node.element.set("alongRoute", "true")
    remarks += [_stop(document), _hero(document)]
    header = document.node.need("FileHeader")
    # scenario_runner takes the description as the name of the scenario.
    if not header.get("description", "").removeprefix(FLAG):
        header.element.set("description", header.get("description", "") + document.path.stem)
    # scenario_runner reads neither fractions of seconds nor time zones.
    for node in document.node.iter("TimeOfDay"):
        node.element.set("dateTime", node.get("dateTime")[:_TO_SECONDS])
    return [remark for remark in remarks if remark]


def _on_lane(position: Node, known: Mapping[str, InitialState], roads: _Elements) -> None:
    """The lane that a first position comes to: scenario_runner measures ds with the traffic, the
    standard with the road."""
    private = next(
        (ancestor for ancestor in position.element.iterancestors() if ancestor.tag == "Private"),
        None,
    )
    start = known[private.get("entityRef", "")] if private is not None else InitialState()
    lengths = {road.get("id"): float(road.get("length", "0")) for road in roads}
    if start.road is None or not 0.0 <= start.s <= lengths.get(start.road, 0.0):
        raise position.unsupported(
            "scenario_runner measures ds with the traffic of a lane, and here that is not known"
        )
    for attribute in list(position.element.attrib):
        del position.element.attrib[attribute]
    position.element.tag = "LanePosition"
    position.element.attrib.update(
        {"roadId": start.road, "laneId": str(start.lane), "s": repr(start.s)}
    )


def _roads(network: Path | None) -> _Elements:
    return list(parse(network).getroot().iter("road")) if network is not None else []


def _speed(action: Node, state: State) -> str:
    """Time of a change with a rate: scenario_runner reads each number that is not a distance as a
    time."""
    dynamics = action.need("SpeedActionDynamics")
    if dynamics.get("dynamicsDimension") != "rate" or dynamics.get("dynamicsShape") == "step":
        return ""
    speeds = {(state(action, name) or InitialState()).speed for name in actors(action)}
    speed = next(iter(speeds)) if len(speeds) == 1 else None
    rate, target = abs(dynamics.float("value")), target_speed(action, state)
    if target is None or speed is None or (not rate and not math.isclose(target, speed)):
        raise dynamics.unsupported(
            "scenario_runner reads the rate as a time, and what time it takes is "
            "known only when it runs"
        )
    time = abs(target - speed) / rate * _SLOPES[dynamics.get("dynamicsShape")] if rate else 0.0
    dynamics.element.attrib.update({"dynamicsDimension": "time", "value": repr(time)})
    return (
        f"{dynamics.where}: {dynamics.tag}: the rate is written as the {time:g} s that it takes "
        f"from {speed:g} m/s"
    )


def _stop(document: Document) -> str:
    """End each act at the times at which the storyboard's StopTrigger ends the run; scenario_runner
    looks for criteria there only."""
    trigger = document.node.find("Storyboard", "StopTrigger")
    others = (
        [group for group in trigger.children() if not _criteria(group)]
        if trigger is not None
        else []
    )
    if trigger is None or not others:
        return ""
    timed = [group for group in others if _of_time(group)]
    for act in document.node.iter("Act"):
        for group in timed:
            stop = act.element.find("StopTrigger")
            stop = etree.SubElement(act.element, "StopTrigger") if stop is None else stop
            stop.append(deepcopy(group.element))
    for group in others:
        trigger.element.remove(group.element)
    if len(timed) == len(others):
        return (
            f"{trigger.where}: StopTrigger: its times end the acts, a run ends when all acts have"
        )
    return f"{trigger.where}: StopTrigger: left out but for times, a run ends when all acts have"


def _of_time(group: Node) -> bool:
    conditions = group.children("Condition")
    return len(conditions) == 1 and any(conditions[0].iter("SimulationTimeCondition"))


def _criteria(group: Node) -> bool:
    return all(is_criterion(condition) for condition in group.children("Condition"))


def _hero(document: Document) -> str:
    """Name the ego as CARLA's agents look for it, and mark it as scenario_runner does."""
    objects = list(document.node.iter("ScenarioObject"))
    named = [
        entity
        for entity in objects
        if entity.find("Vehicle") is not None and EGO_NAME.fullmatch(entity.get("name"))
    ]
    for entity in objects:
        vehicle = entity.find("Vehicle")
        if vehicle is not None:
            holder = vehicle.element.find("Properties")
            holder = etree.SubElement(vehicle.element, "Properties") if holder is None else holder
            for said in holder.findall("Property[@name='type']"):
                holder.remove(said)
            kind = (
                "ego_vehicle"
                if entity.element in [ego.element for ego in named[:1]]
                else "simulation"
            )
            holder.insert(0, etree.Element("Property", name="type", value=kind))
    if not named:
        return f"{document.path}: no vehicle is called Ego or hero: CARLA runs it without an ego"
    old = named[0].get("name")
    if old != HERO and any(entity.get("name") == HERO for entity in objects):
        raise named[0].unsupported(
            f"the ego must be called {HERO}, which is the name of another entity"
        )
    named[0].element.set("name", HERO)
    for element in document.root.iter():
        for attribute in ("entityRef", "masterEntityRef"):
            if element.get(attribute) == old:
                element.set(attribute, HERO)
    return ""


def change_lanes(
    document: Document, state: State, network: Path | None, geometry: RoadGeometry | None
) -> Iterator[str]:
    """Make the changes, in place; remarks on those that are approximations.

    Args:
        state: how entities are when an action begins.
        network: the file of the roads; None where there are none.
        geometry: the scenario on its roads; None refuses values that only a run gives.

    Raises:
        Unsupported: something can't be said, named with file and line.
    """
    left_hand = network is not None and any(
        road.get("rule") == "LHT" for road in parse(network).getroot().iter("road")
    )
    # Backwards: the lane at the beginning of an action is read from the actions before it, which
    # are then still as written.
    for action in reversed(list(document.node.iter("LaneChangeAction"))):
        try:
            yield from _change(action, document.node, state, left_hand, geometry)
        except Unsupported as error:
            if geometry is None:
                raise
            yield follow_on(action, document.node, geometry, error)


def _change(
    action: Node, scenario: Node, state: State, left_hand: bool, geometry: RoadGeometry | None
) -> Iterator[str]:
    doing = actors(action)
    if len(doing) != 1:
        raise action.unsupported("scenario_runner changes lanes of one entity, which Init places")
    if abs(action.float("targetLaneOffset", 0.0)) > ASIDE:
        raise action.unsupported("scenario_runner has no offset here")
    now, target = state(action, doing[0]) or InitialState(), action.need("LaneChangeTarget").only()
    steps = target.int("value")
    if target.get("entityRef", None) != doing[0]:
        steps = _steps(target, now, state(action, target.get("entityRef", "")), left_hand)
        if not steps:
            leave_out(action, scenario)
            yield f"{action.where}: LaneChangeAction: left out, its actor is on that lane"
            return
    yield from _over_distance(action, doing[0], now, geometry)
    target.element.tag = "RelativeTargetLane"
    target.element.attrib.update({"entityRef": doing[0], "value": str(steps)})


def _steps(target: Node, now: InitialState, other: InitialState | None, left_hand: bool) -> int:
    """Return the number of lanes to its own left that an entity on a known lane changes."""
    unknown = "scenario_runner counts lanes from the actor's own, which is known only when it runs"
    if now.road is None or (
        target.tag != "AbsoluteTargetLane" and (other is None or other.road != now.road)
    ):
        raise target.unsupported(unknown)
    # In right-hand traffic lanes with negative ids lead towards +s, so that +t is to the left
    # there.
    facing = 1 if (now.lane < 0) != left_hand else -1
    if target.tag == "AbsoluteTargetLane" or other is None:
        lane = target.int("value")
    else:
        lane = (
            beside(other.lane, facing * target.int("value")) if target.int("value") else other.lane
        )
    if lane * now.lane <= 0:
        raise target.unsupported(
            "scenario_runner changes to other lanes of the same direction only"
        )
    return facing * (lane - now.lane)


def _over_distance(
    action: Node, actor: str, now: InitialState, geometry: RoadGeometry | None
) -> Iterator[str]:
    """Distance of a change: of a time by the speed, of a rate by a run."""
    dynamics = action.need("LaneChangeActionDynamics")
    dimension, value = dynamics.get("dynamicsDimension"), dynamics.float("value")
    if dimension == "distance":
        return
    if dimension == "time" and now.speed:
        distance = value * now.speed
        yield (
            f"{dynamics.where}: {dynamics.tag}: the time is written as the {distance:g} m that "
            f"{now.speed:g} m/s make of it"
        )
    else:
        driven = _driven(action, actor, geometry) if geometry is not None else 0.0
        if not driven:
            raise dynamics.unsupported(
                "scenario_runner changes lanes over a distance, which is not known here"
            )
        distance = driven
        yield (
            f"{dynamics.where}: {dynamics.tag}: the {dimension} is written as the {distance:g} m "
            "that it takes in a run "
            "without a system under test"
        )
    dynamics.element.attrib.update({"dynamicsDimension": "distance", "value": repr(distance)})


def _driven(action: Node, actor: str, geometry: RoadGeometry) -> float:
    """Return the distance (m) along the road that the actor drives in a run after an action ends; 0
    if it stands."""
    begin, end = geometry.begins(action), geometry.ends(action)
    places = geometry.driven(actor, begin, end) if begin is not None and end is not None else []
    return sum(math.dist(a[:3], b[:3]) for a, b in pairwise(places))
