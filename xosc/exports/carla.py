"""Target `carla`: the part of OpenSCENARIO 1.0 that CARLA's scenario_runner reads, worked out, on standalone OpenDRIVE roads.

Source: scenario_runner's page on its OpenSCENARIO support and its parser (0.9.16). What it stops at, leaves out or
reads otherwise is refused (`_REFUSED`), unless it can be expressed in its own way (`carla_changes`); `_IGNORED` gives remarks.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from xosc.document import load, to_bytes
from xosc.exports.carla_changes import change
from xosc.exports.concrete import concrete_scenarios
from xosc.exports.conversion import in_version
from xosc.exports.draft import DEFAULTS, Draft, ExportSettings
from xosc.exports.folder import Folder
from xosc.exports.references import take_roads
from xosc.exports.refusals import Rule, refuse, remarks

TARGETS = {"carla": "the part of 1.0 that CARLA's scenario_runner reads"}
_TRIGGERS = "/OpenSCENARIO/Storyboard/Story"
"""Where triggers are looked at: that of the storyboard's end is not."""
_SIGNAL = "[not(starts-with(@name, 'id=') or starts-with(@name, 'pos='))]"

_REFUSED = (
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
    Rule("//LaneChangeAction[@targetLaneOffset and number(@targetLaneOffset) != 0]", "scenario_runner has no offset here"),
    Rule("//LongitudinalDistanceAction[@timeGap]", "scenario_runner does not have time gaps"),
    Rule("//FollowTrajectoryAction[.//Clothoid or .//Nurbs or .//ClothoidSpline]", "scenario_runner follows polylines only"),
    Rule("//FollowTrajectoryAction//Timing", "scenario_runner follows trajectories without timing"),
    Rule("//Precipitation[@precipitationType='snow']", "CARLA has no snow"),
    Rule(f"//TrafficSignalStateAction{_SIGNAL} | //TrafficSignalCondition{_SIGNAL}", "CARLA's signals are 'id=…' or 'pos=x,y'"),
    Rule("//TrafficSignalController", "scenario_runner reads the first phase of one controller only"),
    Rule("//RelativeObjectPosition", "scenario_runner takes dx and dy as those of the world"),
    Rule("//RoutePosition | //GeoPosition | //TrajectoryPosition", "scenario_runner does not have this position"),
    Rule(
        "//LanePosition/Orientation[not(@type='relative')] | //RoadPosition/Orientation[not(@type='relative')]",
        "scenario_runner takes every orientation as relative here",
    ),
    Rule("//Actors[@selectTriggeringEntities='true' or @selectTriggeringEntities='1']", "scenario_runner does not select actors"),
    Rule("//EntitySelection", "scenario_runner does not have it"),
    Rule("//Event[number(@maximumExecutionCount) > 1]", "scenario_runner's events happen once"),
    Rule(f"{_TRIGGERS}//TriggeringEntities[count(EntityRef) > 1]", "scenario_runner looks at one triggering entity"),
    Rule(f"{_TRIGGERS}//Condition[contains(@conditionEdge, 'alling')]", "scenario_runner does not see conditions end"),
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
_IGNORED = (
    Rule(f"{_TRIGGERS}//Condition[@conditionEdge='rising']", "scenario_runner takes it when it first holds"),
    Rule(f"{_TRIGGERS}//SpeedActionDynamics[@dynamicsShape!='step']", "the shape is that of CARLA's controller"),
    Rule(f"{_TRIGGERS}//LaneChangeActionDynamics[@dynamicsShape!='linear']", "scenario_runner changes lanes linearly"),
    Rule(f"{_TRIGGERS}//LaneOffsetActionDynamics", "the shape is that of CARLA's controller"),
    Rule(f"{_TRIGGERS}//Event[@priority!='parallel']", "scenario_runner does not read priorities"),
    Rule("//ScenarioObject/ObjectController", "scenario_runner does not read it"),
    Rule("//ScenarioObject//BoundingBox", "sizes are those of CARLA's models, by category where none has the name"),
    Rule("//SceneGraphFile", "CARLA makes its scene of the roads"),
)


def export(source: Path, target: str, folder: Folder, settings: ExportSettings = DEFAULTS) -> Sequence[str]:
    """Write a scenario, or that of a distribution with each set of its parameters, for scenario_runner.

    Returns:
        Remarks on what is approximated, or not read.

    Raises:
        Unsupported: scenario_runner can't say it, named with file, line and reason.
        InvalidFile, UsageError: a file can't be read, or not be written.
    """
    if load(source, strict=settings.strict).kind == "catalog":
        return [f"{source}: its entries are part of the scenarios that use them"]
    draft = Draft(folder, settings)
    for name, scenario in concrete_scenarios(source, strict=settings.strict):
        refuse(scenario, _REFUSED)
        draft.note(*scenario.remarks, *remarks(scenario, _IGNORED))
        draft.note(*change(scenario, take_roads(scenario, draft)))
        draft.add(folder.name(scenario.path, f"{name}.xosc"), to_bytes(in_version(scenario, (1, 0), draft)))
    return draft.write()
