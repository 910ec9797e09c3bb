"""Phases of traffic signals last no negative time."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import negative
from schemas.checks.registry import Finding, rule


@rule("asam.net:xosc:1.2.0:data_type.positive_duration_in_phase")
def check(document: Document) -> Iterator[Finding]:
    """The duration of a Phase of a TrafficSignalController shall be non-negative."""
    return negative(document, [("Phase", "duration")])
