"""Transitions take no negative time, distance or rate."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import negative
from schemas.checks.registry import Finding, rule


@rule("xosc.toolchain:xosc:1.0.0:data_type.transition_value_is_not_negative", level="warning")
def check(document: Document) -> Iterator[Finding]:
    """The value of TransitionDynamics, a time, a distance or a rate by its dimension, must be non-negative.

    A warning: players commonly take the magnitude of a negative rate.
    """
    return negative(document, [(tag, "value") for tag in ("SpeedActionDynamics", "LaneChangeActionDynamics")])
