"""Target `esmini`: scenarios that esmini plays as they are meant, in their own version up to 1.3,
with parameters and catalogues.

Source: esmini 3.6.0, its documents and probe runs. What it would stop at, leave out or read
otherwise is refused (`_REFUSED`); what it does not read, and no motion depends on, stays and is
reported as a remark (`_IGNORED`).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from schemas.common.fates import kept, lost
from xosc.distributions import ParameterSpace
from xosc.document import Document, load
from xosc.exports import DOCUMENT_FIELDS
from xosc.exports.concrete import in_version
from xosc.exports.draft import DEFAULTS, Draft, ExportSettings, Folder
from xosc.exports.omissions import Rule, refuse, remarks
from xosc.exports.references import catalog_name
from xosc.exports.standard import as_written, distribution, scenario, write_sets
from xosc.resolve import resolve

TARGETS = {"esmini": "scenarios that esmini plays as they are meant"}
FATES = {
    "esmini": {
        **dict.fromkeys(DOCUMENT_FIELDS, kept()),
        "followingMode": lost("refused: esmini ignores `follow`"),
    }
}
"""Fates of the fields of a scenario"""
_REFUSED = (
    *(
        Rule(f"//{tag}", "esmini does not have this action")
        for tag in (
            "AnimationAction", "SetMonitorAction", "TrafficSourceAction", "TrafficSinkAction",
            "TrafficStopAction", "TrafficAreaAction", "TrafficSignalControllerAction",
            "ParameterModifyAction",
        )
    ),
    Rule("//ParameterAction/ModifyAction", "esmini does not have this action"),
    *(
        Rule(f"//TrafficSwarmAction//{tag}", "esmini does not read it in swarms")
        for tag in ("TrafficDefinition", "TrafficDistribution", "DirectionOfTravelDistribution",
            "InitialSpeedRange")
    ),
    Rule("//LightType/UserDefinedLight", "esmini has the lights of vehicles only"),
    Rule("//VisibilityAction/SensorReferenceSet", "esmini does not have it"),
    Rule("//AssignControllerAction/@activateAnimation/..",
        "esmini's controllers have no animation"),
    Rule(
        "//RoutingAction/*[not(self::AssignRouteAction or self::FollowTrajectoryAction or "
        "self::AcquirePositionAction or "
        "self::RandomRouteAction or self::PreferredLaneLayerAction)]",
        "esmini does not have this action",
    ),
    Rule("//Route[@closed='true' or @closed='1']", "esmini's routes are open"),
    Rule("//Waypoint[@routeStrategy='random']", "esmini finds no random ways"),
    Rule("//LateralDistanceAction[@displacement='any']", "esmini stops at displacement 'any'"),
    Rule("//*[@dynamicsShape][@followingMode='follow']", "esmini ignores followingMode"),
    *(
        Rule(f"//{tag}Condition", "esmini does not have this condition, and decides without it")
        for tag in ("RelativeAngle", "TimeOfDay", "UserDefinedValue", "TrafficSignalController")
    ),
    Rule("//GeoPosition", "esmini does not have this position"),
    Rule("//RoutePosition//FromCurrentEntity", "esmini does not have this position"),
    Rule("//Actors[@selectTriggeringEntities='true' or @selectTriggeringEntities='1']",
        "esmini ignores it"),
    Rule("//EntitySelection | //ExternalObjectReference", "esmini does not have it"),
    Rule("//TrafficSignalController", "esmini has no phases of signals"),
    Rule("//*[@alongRoute='true' or @alongRoute='1'][not(@coordinateSystem)]",
        "esmini measures in a straight line"),
    *(
        Rule(f"//ParameterDeclaration[@parameterType='{kind}']",
            "esmini has no parameters of that type")
        for kind in ("dateTime", "unsignedInt", "unsignedShort")
    ),
    Rule("//MonitorDeclaration", "esmini has no monitors"),
)  # fmt: skip
_IGNORED = (
    Rule("//*[@coordinateSystem='lane']", "esmini measures along the road instead of the lane"),
    Rule(
        "//*[@routingAlgorithm and @routingAlgorithm!='undefined']",
        "esmini does not read routingAlgorithm",
    ),
    Rule(
        "//LaneOffsetAction[@continuous='true' or @continuous='1']",
        "esmini ends it when the offset is reached",
    ),
    Rule("//RoadCondition[@wetness] | //DomeImage", "esmini does not read it"),
    Rule("//UsedArea | //CustomContent", "esmini does not read it"),
    Rule("//ConstraintGroup", "esmini does not check constraints"),
    Rule(
        "//Event[@priority='skip']",
        "a skipped event stays in standby in esmini, and is not counted",
    ),
    Rule(
        "/OpenSCENARIO/Storyboard[not(StopTrigger/ConditionGroup)]",
        "without a StopTrigger esmini goes on for ever",
    ),
)
_NEWEST = (1, 3)
"""Version that esmini reads."""
_SETS = "a scenario is written for each set of parameters: esmini has no stochastic distributions"


def export(
    source: Path, target: str, folder: Folder, settings: ExportSettings = DEFAULTS
) -> Sequence[str]:
    """Write a scenario, catalogue or distribution for esmini, with all that it refers to.

    Returns:
        Remarks on what esmini does not read.

    Raises:
        Unsupported: esmini would not play it as it is meant, named with file, line and reason.
        InvalidFile, UsageError: a file can't be read, or not be written.
    """
    document, draft = load(source, strict=settings.strict), Draft(folder, settings)
    # The rules are about scenarios; an entry of a catalogue is checked where it is used.
    if document.kind == "catalog":
        draft.note(*document.remarks)
        draft.add(
            catalog_name(source, folder),
            as_written(in_version(document, min(document.version, _NEWEST), draft)),
        )
        return draft.write()
    version = min(document.version, _NEWEST)
    if document.kind == "scenario":
        _check(document, draft)
        return scenario(document, version, draft)
    # A distribution plays its scenario, which is what esmini has to read.
    _check(load(ParameterSpace(source).scenario, strict=settings.strict), draft)
    if document.node.find("ParameterValueDistribution", "Deterministic") is not None:
        return distribution(document, version, draft)
    return write_sets(document, version, draft, _SETS)


def _check(document: Document, draft: Draft) -> None:
    """Remarks on a scenario as it stands, and with catalogue entries and values in the place of the
    references to them."""
    both = (document, resolve(document, **draft.settings.resolving))
    for form in both:
        refuse(form, _REFUSED)
    for form in both:
        draft.note(*remarks(form, _IGNORED))
