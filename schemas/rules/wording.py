"""Sentences that several rules say."""

from collections.abc import Iterable, Iterator
from difflib import get_close_matches

from schemas.rules.document import Document
from schemas.rules.registry import Finding

_MOST_COMPARED = 300
"""Names beyond this are not searched for a near one, which takes its time."""


def unknown(what: str, name: str, known: Iterable[str]) -> str:
    """There is no such thing; the nearest name where there is a near one."""
    near = get_close_matches(name[:100], sorted(filter(None, known))[:_MOST_COMPARED], n=1, cutoff=0.7)
    return f"there is no {what} {name!r}" + (f"; did you mean {near[0]!r}?" if near else "")


def negative(document: Document, attributes: Iterable[tuple[str, str]]) -> Iterator[Finding]:
    """A finding for each of these attributes (element name, attribute name) that is a negative number or none at all."""
    for tag, name in attributes:
        for element in document.elements(tag):
            value = document.number(element, name)
            if value is not None and not value >= 0:
                yield Finding(element, f"{name}={element.get(name)!r} is {value:g}, 0 or more is expected")
