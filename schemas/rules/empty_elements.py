"""Elements of the storyboard hold what they are there for."""

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.xml import local_name

UID = "xosc.toolchain:xosc:1.0.0:storyboard.elements_are_not_empty"

_PARTS = {
    "Story": ("Act",),
    "Act": ("ManeuverGroup",),
    "ManeuverGroup": ("Maneuver", "CatalogReference"),
    "Maneuver": ("Event",),
    "Event": ("Action",),
    "Action": ("GlobalAction", "UserDefinedAction", "PrivateAction"),
    "Private": ("PrivateAction",),
    "ConditionGroup": ("Condition",),
}
_CHOICES = (
    "PrivateAction", "GlobalAction", "UserDefinedAction",
    "LongitudinalAction", "LateralAction", "RoutingAction", "ControllerAction", "AppearanceAction", "TrailerAction",
    "EntityAction", "ParameterAction", "VariableAction", "MonitorAction", "InfrastructureAction", "TrafficSignalAction",
    "TrafficAction",
)  # fmt: skip


@rule(UID)
def check(document: Document) -> Iterator[Finding]:
    """A story, act, maneuver group, maneuver, event, action or condition group must not be empty.

    A maneuver group without maneuvers is information: the XSD allows it, as the XSDs before 1.3 allow an action without content.
    """
    for element in document.elements(*_PARTS):
        parts = _PARTS[local_name(element)]
        if not any(local_name(child) in parts for child in element.iterchildren(etree.Element)):
            level = "info" if local_name(element) == "ManeuverGroup" else None
            yield Finding(element, f"{' or '.join(parts)} is expected inside", level)
    for element in document.elements(*_CHOICES):
        if next(element.iterchildren(etree.Element), None) is None:
            yield Finding(element, "an action is expected inside")
