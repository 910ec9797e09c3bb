"""Scenarios with a value in one field each, for exports of documents: a base,
and what a field adds to it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from lxml import etree

ROADS = Path(__file__).parents[1] / "conformance" / "roads"

Root = etree._Element


class Field(NamedTuple):
    """A field: texts of the base that it replaces, and its value in a file that was written."""

    changes: Mapping[str, str]
    read: Callable[[Root], object]


def values(path: str, *names: str) -> Callable[[Root], object]:
    """Reads attributes of elements, as numbers where they are some."""

    def read(root: Root) -> object:
        return [tuple(_number(each.get(name)) for name in names) for each in root.iterfind(path)]

    return read


def _number(text: str | None) -> float | str | None:
    try:
        return round(float(text), 6) if text is not None else None
    except ValueError:
        return text


def written(folder: Path, field: Field) -> Path:
    """Write the base with a field."""
    text = BASE.format(road=ROADS / "straight.xodr")
    for old, new in field.changes.items():
        assert old in text, old
        text = text.replace(old, new, 1)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "case.xosc"
    path.write_text(text, encoding="utf-8")
    return path


_TIME = """<Condition name="at 1 s" delay="0" conditionEdge="none"><ByValueCondition>
<SimulationTimeCondition value="1" rule="greaterThan"/></ByValueCondition></Condition>"""
_CAR = """<ScenarioObject name="{name}"><Vehicle name="car" vehicleCategory="car"{role}>
<BoundingBox><Center x="1.5" y="0" z="0.75"/><Dimensions width="2" length="5" height="1.5"/></BoundingBox>
<Performance maxSpeed="70" maxAcceleration="10" maxDeceleration="10"/>
<Axles><FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.8" positionX="3" positionZ="0.3"/>
<RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.8" positionX="0" positionZ="0.3"/></Axles>
<Properties/></Vehicle>{more}</ScenarioObject>"""
_CONTROLLER = """<ObjectController><Controller name="driver"><Properties>
<Property name="kind" value="careful"/></Properties></Controller></ObjectController>"""
_PLACE = """<PrivateAction><TeleportAction><Position>{place}</Position></TeleportAction></PrivateAction>"""
_START = '<LanePosition roadId="1" laneId="-1" s="100"/>'
_SPEED = """<PrivateAction><LongitudinalAction><SpeedAction><SpeedActionDynamics dynamicsShape="{shape}"
 value="{time}" dynamicsDimension="time"{mode}/><SpeedActionTarget><AbsoluteTargetSpeed value="{value}"/></SpeedActionTarget>
</SpeedAction></LongitudinalAction></PrivateAction>"""
_ACTION = _SPEED.format(shape="linear", time=2, value=15, mode="")

BASE = f"""<?xml version="1.0"?>
<OpenSCENARIO>
<FileHeader revMajor="1" revMinor="4" date="2026-01-01T00:00:00" author="tests" description="matrix"/>
<ParameterDeclarations/>
<CatalogLocations/>
<RoadNetwork><LogicFile filepath="{{road}}"/></RoadNetwork>
<Entities>{_CAR.format(name="Ego", role="", more="")}{
    _CAR.format(name="Other", role="", more="")
}</Entities>
<Storyboard><Init><Actions>
<Private entityRef="Ego">{_PLACE.format(place=_START)}{
    _SPEED.format(shape="step", time=0, value=10, mode="")
}</Private>
<Private entityRef="Other">{_PLACE.format(place='<LanePosition roadId="1" laneId="-2" s="150"/>')}
{_SPEED.format(shape="step", time=0, value=8, mode="")}</Private>
</Actions></Init>
<Story name="story"><Act name="act"><ManeuverGroup name="group" maximumExecutionCount="1">
<Actors selectTriggeringEntities="false"><EntityRef entityRef="Other"/></Actors>
<Maneuver name="maneuver"><Event name="event" priority="parallel"><Action name="action">{
    _ACTION
}</Action>
<StartTrigger><ConditionGroup>{
    _TIME
}</ConditionGroup></StartTrigger></Event></Maneuver></ManeuverGroup>
<StartTrigger><ConditionGroup>{
    _TIME.replace("at 1 s", "at 0 s").replace('value="1"', 'value="0"')
}</ConditionGroup></StartTrigger>
</Act></Story>
<StopTrigger><ConditionGroup>{
    _TIME.replace("at 1 s", "end").replace('value="1"', 'value="6"')
}</ConditionGroup></StopTrigger>
</Storyboard>
</OpenSCENARIO>
"""


def _event(condition: str) -> dict[str, str]:
    group, end = "<ConditionGroup>{}</ConditionGroup>", "</StartTrigger></Event>"
    return {group.format(_TIME) + end: group.format(condition) + end}


def _routing(inside: str) -> dict[str, str]:
    return {_ACTION: f"<PrivateAction><RoutingAction>{inside}</RoutingAction></PrivateAction>"}


def _trajectory(shape: str) -> dict[str, str]:
    return _routing(
        '<FollowTrajectoryAction><TrajectoryRef><Trajectory name="way" closed="false">'
        f"<Shape>{shape}</Shape></Trajectory></TrajectoryRef><TimeReference><Timing "
        'domainAbsoluteRelative="absolute" offset="0" scale="1"/></TimeReference>'
        '<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction>'
    )


def _vertex(time: float, x: float) -> str:
    return (
        f'<Vertex time="{time}"><Position><WorldPosition x="{x}" y="-5.25" z="0" h="0" p="0" '
        'r="0"/></Position></Vertex>'
    )


_DISTANCE = """<Condition name="near" delay="0" conditionEdge="none"><ByEntityCondition>
<TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="Ego"/></TriggeringEntities>
<EntityCondition><RelativeDistanceCondition entityRef="Other" relativeDistanceType="longitudinal" value="45"
 freespace="false" rule="lessThan" coordinateSystem="road"/></EntityCondition></ByEntityCondition></Condition>"""
_GLOBAL = "<GlobalAction>{}</GlobalAction>"
_ENVIRONMENT = """<EnvironmentAction><Environment name="wet"><TimeOfDay animation="false" dateTime="2026-06-01T12:00:00"/>
<Weather fractionalCloudCover="fourOktas"><Sun azimuth="1" elevation="1" illuminance="50000"/><Fog visualRange="800"/>
<Precipitation precipitationType="rain" precipitationIntensity="3"/></Weather>
<RoadCondition frictionScaleFactor="0.8"/></Environment></EnvironmentAction>"""
_LIGHT = """<PrivateAction><AppearanceAction><LightStateAction><LightType><VehicleLight vehicleLightType="brakeLights"/></LightType>
<LightState mode="on"/></LightStateAction></AppearanceAction></PrivateAction>"""

_LANE_CHANGE = """<PrivateAction><LateralAction><LaneChangeAction>
<LaneChangeActionDynamics dynamicsShape="cubic" value="3" dynamicsDimension="time"/>
<LaneChangeTarget><AbsoluteTargetLane value="-1"/></LaneChangeTarget>
</LaneChangeAction></LateralAction></PrivateAction>"""
_WAYPOINT = """<Waypoint routeStrategy="shortest"><Position>
<LanePosition roadId="1" laneId="-2" s="{}"/></Position></Waypoint>"""
_ROUTE = f"""<AssignRouteAction><Route name="route" closed="false">
{_WAYPOINT.format(160)}{_WAYPOINT.format(400)}</Route></AssignRouteAction>"""
_VERTICES = f"<Polyline>{_vertex(1, 158)}{_vertex(5, 200)}</Polyline>"
_COLOUR = '<Properties><Property name="colour" value="red"/></Properties>'
_COUNT = """<VariableDeclarations><VariableDeclaration name="Count" variableType="int" value="3"/>
</VariableDeclarations><CatalogLocations/>"""
_PARAMETER = """<ParameterDeclarations>
<ParameterDeclaration name="Speed" parameterType="double" value="15"/></ParameterDeclarations>"""
_VALUE = '<AbsoluteTargetSpeed value="{}"/>'
_NAMED = ("Story", "Act", "ManeuverGroup", "Maneuver", "Event", "Action")
_INIT = ".//Init/Actions/Private[@entityRef='Other']//"
_STORY = ".//Story//Event/Action//"
_RISING = _TIME.replace('conditionEdge="none"', 'conditionEdge="rising"')
_DELAYED = _TIME.replace('delay="0"', 'delay="1.5"')


def _declared(value: str) -> dict[str, str]:
    """Have the story's speed be a parameter, or an expression of it."""
    return {"<ParameterDeclarations/>": _PARAMETER, _VALUE.format(15): _VALUE.format(value)}


def _speed(**attributes: object) -> dict[str, str]:
    return {_ACTION: _SPEED.format(**{"time": 2, "value": 15, "mode": "", **attributes})}


def both(*reads: Callable[[Root], object]) -> Callable[[Root], object]:
    """Reads several values."""
    return lambda root: [read(root) for read in reads]


def vehicles(root: Root) -> object:
    """Names and categories, sorted."""
    found = [(each.getparent(), each.get("vehicleCategory")) for each in root.iter("Vehicle")]
    return sorted((str(above.get("name")), kind) for above, kind in found if above is not None)


def priorities(root: Root) -> object:
    """Of events; `overwrite` is the earlier name of `override`."""
    return [
        str(each.get("priority")).replace("overwrite", "override") for each in root.iter("Event")
    ]


FIELDS: dict[str, Field] = {
    "names and categories": Field({}, vehicles),
    "bounding boxes": Field({}, values(".//BoundingBox/*", "x", "length", "width", "height")),
    "performance": Field(
        {}, values(".//Vehicle/Performance", "maxSpeed", "maxAcceleration", "maxDeceleration")
    ),
    "roles": Field(
        {'vehicleCategory="car">': 'vehicleCategory="car" role="police">'},
        lambda root: [
            each.get("role")
            or next(iter(each.xpath("Properties/Property[@name='role']/@value")), None)
            for each in root.iterfind(".//Vehicle")
        ],
    ),
    "properties": Field(
        {"<Properties/>": _COLOUR}, values(".//Vehicle/Properties/Property", "name", "value")
    ),
    "controllers": Field(
        {"</Vehicle></ScenarioObject>": f"</Vehicle>{_CONTROLLER}</ScenarioObject>"},
        values(".//ObjectController/Controller", "name"),
    ),
    "initial places": Field(
        {}, values(_INIT + "TeleportAction//LanePosition", "roadId", "laneId", "s")
    ),
    "initial speeds": Field({}, values(_INIT + "AbsoluteTargetSpeed", "value")),
    "parameters": Field(
        _declared("$Speed"),
        both(
            values("ParameterDeclarations/ParameterDeclaration", "name", "value"),
            values(_STORY + "AbsoluteTargetSpeed", "value"),
        ),
    ),
    "expressions": Field(
        _declared("${$Speed + 1}"), values(_STORY + "AbsoluteTargetSpeed", "value")
    ),
    "variables": Field(
        {"<CatalogLocations/>": _COUNT}, values(".//VariableDeclaration", "name", "value")
    ),
    "stories, acts, groups, events": Field(
        {}, lambda root: [each.get("name") for tag in _NAMED for each in root.iter(tag)]
    ),
    "priorities": Field({'priority="parallel"': 'priority="override"'}, priorities),
    "times of triggers": Field({}, values(".//Event//SimulationTimeCondition", "value", "rule")),
    "distances of triggers": Field(
        _event(_DISTANCE),
        values(".//Event//RelativeDistanceCondition", "value", "rule", "relativeDistanceType"),
    ),
    "edges": Field(_event(_RISING), values(".//Event//Condition", "conditionEdge")),
    "delays": Field(_event(_DELAYED), values(".//Event//Condition", "delay")),
    "end": Field({}, values("Storyboard/StopTrigger//SimulationTimeCondition", "value")),
    "shapes of transitions": Field(
        _speed(shape="cubic"), values(_STORY + "SpeedActionDynamics", "dynamicsShape", "value")
    ),
    "followingMode": Field(
        _speed(shape="linear", mode=' followingMode="follow"'),
        values(_STORY + "SpeedActionDynamics", "followingMode"),
    ),
    "lane changes": Field(
        {_ACTION: _LANE_CHANGE},
        both(
            values(_STORY + "LaneChangeActionDynamics", "value", "dynamicsDimension"),
            values(_STORY + "AbsoluteTargetLane", "value"),
        ),
    ),
    "routes": Field(_routing(_ROUTE), values(".//Waypoint//LanePosition", "roadId", "laneId", "s")),
    "polylines": Field(
        _trajectory(_VERTICES),
        both(values(".//Vertex", "time"), values(".//Vertex//WorldPosition", "x", "y")),
    ),
    "weather": Field(
        {_ACTION: _GLOBAL.format(_ENVIRONMENT)},
        both(values(".//Fog", "visualRange"), values(".//RoadCondition", "frictionScaleFactor")),
    ),
    "lights of vehicles": Field(
        {_ACTION: _LIGHT}, values(".//LightStateAction/LightState", "mode")
    ),
}
"""Fields with what they add to the base."""
