"""What scenario_runner's parser takes, in our words: a stand-in for tests where
the parser itself is not at hand.

Facts of scenario_runner 0.9.16. `test_exports_carla.py` holds exports against the parser itself
where there is one.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

from lxml import etree

from runner.judging.criteria.criterion import kinds

_STORY = {
    "TeleportAction", "SpeedAction", "LongitudinalDistanceAction", "LaneChangeAction",
    "LaneOffsetAction", "LateralDistanceAction", "SynchronizeAction", "ActivateControllerAction",
    "ControllerAction", "FollowTrajectoryAction", "EntityAction", "EnvironmentAction",
    "ParameterAction", "TrafficSignalStateAction", "TrafficSignalControllerAction",
}  # fmt: skip
_INIT = {
    "TeleportAction", "SpeedAction", "ControllerAction", "LaneOffsetAction",
    "LateralDistanceAction", "FollowTrajectoryAction", "EntityAction", "EnvironmentAction",
    "ParameterAction",
}  # fmt: skip
_GROUPS = {
    "Action", "PrivateAction", "GlobalAction", "LongitudinalAction", "LateralAction",
    "RoutingAction", "InfrastructureAction", "TrafficSignalAction",
}  # fmt: skip
_CONDITIONS = {
    "EndOfRoadCondition", "CollisionCondition", "OffroadCondition", "TimeHeadwayCondition",
    "TimeToCollisionCondition", "AccelerationCondition", "StandStillCondition", "SpeedCondition",
    "RelativeSpeedCondition", "TraveledDistanceCondition", "ReachPositionCondition",
    "DistanceCondition", "RelativeDistanceCondition", "ParameterCondition",
    "SimulationTimeCondition", "TimeOfDayCondition", "StoryboardElementStateCondition",
    "TrafficSignalCondition", "TrafficSignalControllerCondition",
}  # fmt: skip
_POSITIONS = {
    "WorldPosition", "RelativeWorldPosition", "RelativeObjectPosition", "RelativeLanePosition",
    "RelativeRoadPosition", "RoadPosition", "LanePosition",
}  # fmt: skip
_CRITERIA = "Storyboard/StopTrigger"
_DATE = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d")

_NEEDS: dict[str, Callable[[etree._Element], bool]] = {
    "ControllerAction": lambda e: (
        e.find("OverrideControllerValueAction") is not None and e.find(".//Properties") is not None
    ),
    "OverrideControllerValueAction": lambda e: all(child.get("active") == "false" for child in e),
    "LaneChangeAction": lambda e: e.find("LaneChangeTarget/RelativeTargetLane") is not None,
    "LongitudinalDistanceAction": lambda e: "distance" in e.attrib,
    "FollowTrajectoryAction": lambda e: e.find(".//Polyline") is not None,
    "Vertex": lambda e: "time" in e.attrib,
    "RelativeLanePosition": lambda e: "ds" in e.attrib,
    "RelativeRoadPosition": lambda e: "ds" in e.attrib,
    "TimeOfDay": lambda e: _DATE.fullmatch(str(e.get("dateTime"))) is not None,
    "TrafficSignalStateAction": lambda e: str(e.get("name")).startswith(("id=", "pos=")),
    "TrafficSignalCondition": lambda e: str(e.get("name")).startswith(("id=", "pos=")),
    "FileHeader": lambda e: (e.get("revMajor"), e.get("revMinor")) == ("1", "0"),
}
"""What it expects of elements without looking whether it is there."""


def stops_at(root: etree._Element) -> list[str]:
    """What it stops at in a scenario that is valid by the schema of 1.0; nothing
    where it reads all.
    """
    return [f"line {element.sourceline}: {element.tag}" for element in _stops(root)]


def _stops(root: etree._Element) -> Iterator[etree._Element]:
    for holder in (*root.iter("Action"), *root.findall("Storyboard/Init/Actions//PrivateAction")):
        taken = _STORY if holder.tag == "Action" else _INIT
        yield from (action for action in _actions(holder) if action.tag not in taken)
    for place, taken in (
        ("Position", _POSITIONS),
        ("EntityCondition", _CONDITIONS),
        ("ByValueCondition", _CONDITIONS),
    ):
        yield from (
            child for holder in root.iter(place) for child in holder if child.tag not in taken
        )
    for element in root.iter(*_NEEDS):
        if not _NEEDS[str(element.tag)](element):
            yield element
    for condition in root.iterfind(f"{_CRITERIA}//Condition"):
        if str(condition.get("name")).removeprefix("criteria_").casefold() not in kinds():
            yield condition


def _actions(holder: etree._Element) -> Iterator[etree._Element]:
    """The actions inside an element that only groups them."""
    for child in holder:
        yield from _actions(child) if child.tag in _GROUPS else (child,)
