"""Lights change in no negative time."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import negative
from schemas.checks.registry import Finding, rule


@rule("asam.net:xosc:1.2.0:data_type.non_negative_transition_time_in_light_state_action", since=(1, 2))
def check(document: Document) -> Iterator[Finding]:
    """The transitionTime of a LightStateAction shall be non-negative."""
    return negative(document, [("LightStateAction", "transitionTime")])
