"""Durations are not negative."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import negative
from schemas.checks.registry import Finding, rule

UID = "xosc.toolchain:xosc:1.0.0:data_type.durations_and_radii_are_not_negative"

_DURATIONS = (
    ("StandStillCondition", "duration"),
    ("EndOfRoadCondition", "duration"),
    ("OffroadCondition", "duration"),
    ("OffRoadCondition", "duration"),
    ("LongitudinalDistanceAction", "timeGap"),
    ("AnimationAction", "animationDuration"),
    ("TrafficSignalController", "delay"),
    ("SpeedProfileEntry", "time"),
    ("TrafficSwarmAction", "innerRadius"),
    ("TrafficSwarmAction", "semiMajorAxis"),
    ("TrafficSwarmAction", "semiMinorAxis"),
)


@rule(UID)
def check(document: Document) -> Iterator[Finding]:
    """Durations, time gaps, delays and radii must be non-negative."""
    return negative(document, _DURATIONS)
