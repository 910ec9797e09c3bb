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
    "TriggeringEntities": ("EntityRef",),
    "CollisionCondition": ("EntityRef", "ByType"),
}
CHOICES = (
    "PrivateAction", "GlobalAction", "UserDefinedAction",
    "LongitudinalAction", "LateralAction", "RoutingAction", "ControllerAction", "AppearanceAction", "TrailerAction",
    "EntityAction", "ParameterAction", "VariableAction", "MonitorAction", "InfrastructureAction", "TrafficSignalAction",
    "TrafficAction",
)  # fmt: skip
"""Elements that hold one action of several kinds."""


@rule(UID)
def check(document: Document) -> Iterator[Finding]:
    """A story, act, maneuver group, maneuver, event, action, condition group or collision condition must not be empty.

    A maneuver group without maneuvers is information: the XSD allows it, as the XSDs before 1.3 allow an action without content.
    """
    for element in document.elements(*_PARTS, *CHOICES):
        missing = lacking(element)
        if missing:
            level = "info" if local_name(element) == "ManeuverGroup" else None
            yield Finding(element, f"{missing} is expected inside", level)


def lacking(element: etree._Element) -> str:
    """What is missing in an element that is empty by this rule; "" where it is not."""
    parts = _PARTS.get(local_name(element), ())
    inside = [local_name(child) for child in element.iterchildren(etree.Element)]
    if parts and not any(name in parts for name in inside):
        return " or ".join(parts)
    return "an action" if local_name(element) in CHOICES and not inside else ""
