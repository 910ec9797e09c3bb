"""Conditions are not delayed into the past."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import negative
from schemas.checks.registry import Finding, rule


@rule("asam.net:xosc:1.0.0:data_type.condition_delay_not_negative")
def check(document: Document) -> Iterator[Finding]:
    """The delay of a Condition shall be non-negative."""
    return negative(document, [("Condition", "delay")])
