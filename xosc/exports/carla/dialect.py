"""Elements that scenario_runner 0.9.16 stops at, leaves out, reads otherwise or accepts, and CARLA's map of a road network.

Sources: scenario_runner's page on OpenSCENARIO support, and its parser; `get_waypoint_xodr` and the OpenDRIVE parser of CARLA
0.9.16."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from schemas.common.errors import nearest
from schemas.xml import parse
from xosc.document import Document
from xosc.exports.omissions import Rule
from xosc.node import Node
from xosc.roads import RoadFile

_TRIGGERS = "/OpenSCENARIO/Storyboard/Story"
"""Path of the triggers that are checked; the stop trigger of the storyboard is not."""
_SIGNAL = "[not(starts-with(@name, 'id=') or starts-with(@name, 'pos='))]"
_MAY_END = "[@conditionEdge='falling' or not(ByValueCondition/SimulationTimeCondition[starts-with(@rule, 'greater')])]"
"""A time that has been reached stays so: it has no other edge than that."""
ASIDE = 0.1
"""m from the lane's middle, where CARLA's controller ends lane changes, that it keeps to."""

REFUSED = (
    *(
        Rule(f"//Init//{tag}", "scenario_runner has it in stories only")
        for tag in (
            "LaneChangeAction", "LongitudinalDistanceAction", "RoutingAction", "SynchronizeAction", "InfrastructureAction",
        )
    ),
    Rule("//Init//SpeedActionDynamics[@dynamicsShape!='step']", "scenario_runner sets first speeds at once"),
    Rule("//Init//RelativeTargetSpeed", "scenario_runner's first speeds are absolute"),
    Rule("//Init//AbsoluteTargetSpeed[number(@value) < 0]", "scenario_runner's first speeds are not negative"),
    Rule("//AssignRouteAction | //AcquirePositionAction", "scenario_runner 0.9.16 stops at routes"),
    Rule("//VisibilityAction | //TrafficAction", "scenario_runner does not have this action"),
    Rule("//UserDefinedAction", "scenario_runner would run its text as a command of the shell"),
    Rule("//ActivateControllerAction", "scenario_runner would switch CARLA's autopilot"),
    Rule(
        "//AssignControllerAction[not(Controller/Properties/Property[@name='module'])]",
        "scenario_runner's controllers are Python modules, which the property 'module' names",
    ),
    Rule("//OverrideControllerValueAction/*[@active='true' or @active='1']", "scenario_runner does not override controllers"),
    Rule("//LongitudinalDistanceAction[@timeGap]", "scenario_runner does not have time gaps"),
    Rule("//FollowTrajectoryAction[.//Clothoid or .//Nurbs or .//ClothoidSpline]", "scenario_runner follows polylines only"),
    Rule("//Timing[@domainAbsoluteRelative='absolute']", "scenario_runner's times count from the start of the action"),
    Rule("//Timing[number(@scale)!=1 or number(@offset)!=0]", "scenario_runner reads the times of trajectories as they stand"),
    Rule(f"//TrafficSignalStateAction{_SIGNAL} | //TrafficSignalCondition{_SIGNAL}", "CARLA's signals are 'id=…' or 'pos=x,y'"),
    Rule("//TrafficSignalController", "scenario_runner reads the first phase of one controller only"),
    Rule(
        "//RelativeObjectPosition[number(@dx) != 0 or number(@dy) != 0]", "scenario_runner takes dx and dy as those of the world"
    ),
    Rule("//RoutePosition | //GeoPosition | //TrajectoryPosition", "scenario_runner does not have this position"),
    Rule(
        "//LanePosition/Orientation[not(@type='relative')] | //RoadPosition/Orientation[not(@type='relative')]",
        "scenario_runner takes every orientation as relative here",
    ),
    Rule("//Actors[@selectTriggeringEntities='true' or @selectTriggeringEntities='1']", "scenario_runner does not select actors"),
    Rule("//EntitySelection", "scenario_runner does not have it"),
    Rule("//Event[number(@maximumExecutionCount) > 1]", "scenario_runner's events happen once"),
    Rule(f"{_TRIGGERS}//TriggeringEntities[count(EntityRef) > 1]", "scenario_runner looks at one triggering entity"),
    Rule(f"{_TRIGGERS}//Condition[contains(@conditionEdge, 'alling')]{_MAY_END}", "scenario_runner does not see conditions end"),
    Rule(f"{_TRIGGERS}//DistanceCondition[@freespace='true' or @freespace='1']", "scenario_runner does not read freespace"),
    Rule(f"{_TRIGGERS}//UserDefinedValueCondition", "scenario_runner does not have this condition"),
    Rule(
        f"{_TRIGGERS}//StoryboardElementStateCondition[@state='runningState' or @state='standbyState' or @state='skipTransition' "
        "or @storyboardElementType='story' or @storyboardElementType='maneuverGroup']",
        "scenario_runner sees the beginning and the end of acts, maneuvers, events and actions",
    ),
    Rule("//Act/StopTrigger/ConditionGroup[count(Condition) > 1]", "scenario_runner stops when one of them holds"),
    *(
        Rule(f"//Vehicle[@vehicleCategory='{category}']", "CARLA has no such vehicle")
        for category in ("trailer", "semitrailer", "train", "tram")
    ),
    Rule("//Trailer | //TrailerHitch | //TrailerCoupler", "CARLA has no trailers"),
)  # fmt: skip
IGNORED = (
    Rule(f"{_TRIGGERS}//Condition[@conditionEdge='rising']", "scenario_runner takes it when it first holds"),
    Rule(f"{_TRIGGERS}//SpeedActionDynamics[@dynamicsShape!='step']", "the shape is that of CARLA's controller"),
    Rule(f"{_TRIGGERS}//LaneChangeActionDynamics[@dynamicsShape!='linear']", "scenario_runner changes lanes linearly"),
    Rule("//LaneChangeAction[@targetLaneOffset]", "scenario_runner has no offset here"),
    Rule(f"{_TRIGGERS}//LaneOffsetActionDynamics", "the shape is that of CARLA's controller"),
    Rule(f"{_TRIGGERS}//Event[@priority!='parallel']", "scenario_runner does not read priorities"),
    Rule("//ScenarioObject/ObjectController", "scenario_runner does not read it"),
    Rule("//ScenarioObject//BoundingBox", "sizes are those of CARLA's models, by category where none has the name"),
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
            "scenario_runner plays on a map, and this scenario names none: name one in RoadNetwork/LogicFile "
            "(--road auto makes straight roads where positions name roads)"
        )


def need_entities(document: Document) -> None:
    """Refuse a scenario with references to entities that it does not have, at which scenario_runner stops.

    Raises:
        InvalidFile: there is one; the first is named with file and line.
    """
    declared = {each.get("name") for each in document.node.need("Entities").children("ScenarioObject", "EntitySelection")}
    for node in document.node.iter():
        for name in (node.get("entityRef", None), node.get("masterEntityRef", None)):
            if name is not None and name not in declared:
                raise node.invalid(f"there is no entity {name!r}; {nearest(name, map(str, declared))}")


def settle(document: Document, network: Path | None) -> Iterator[str]:
    """Move positions at the end of a road, or beyond it, to the last place that CARLA has there; remarks on that.

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
        yield f"{position.where}: {position.tag}: CARLA's road ends at s={length:g}; {_BEFORE_THE_END:g} m before that is written"
