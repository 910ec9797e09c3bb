"""Conditions are not delayed into the past."""

from collections.abc import Iterator

from schemas.rules.document import Document
from schemas.rules.registry import Finding, rule
from schemas.rules.wording import negative


@rule("asam.net:xosc:1.0.0:data_type.condition_delay_not_negative")
def check(document: Document) -> Iterator[Finding]:
    """The delay of a Condition shall be non-negative."""
    return negative(document, [("Condition", "delay")])
