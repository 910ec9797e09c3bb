"""Distances are not negative."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import negative
from schemas.checks.registry import Finding, rule

_DISTANCES = (
    ("LongitudinalDistanceAction", "distance"),
    ("LateralDistanceAction", "distance"),
    ("RelativeClearanceCondition", "distanceForward"),
    ("RelativeClearanceCondition", "distanceBackward"),
)


@rule("asam.net:xosc:1.1.0:data_type.distances_are_not_negative", since=(1, 1))
def check(document: Document) -> Iterator[Finding]:
    """Distances of actions and conditions shall be non-negative; directions are said by other attributes."""
    return negative(document, _DISTANCES)
