"""Messages that several rules share."""

from collections.abc import Iterable, Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding
from schemas.errors import nearest


def unknown(what: str, name: str, known: Iterable[str]) -> str:
    """There is no such thing; the nearest name, or all that there are."""
    return f"there is no {what} {name!r}; {nearest(name, sorted(known))}"


def unresolved(document: Document, what: str, known: Iterable[str], *attributes: str, where: str = "") -> Iterator[Finding]:
    """A finding for each attribute with one of these names whose value is none of the known names of what it refers to."""
    known = frozenset(known)
    for element, attribute, name in document.values(*attributes):
        if name not in known:
            yield Finding(element, f"{attribute}: {unknown(what, name, known)}{where}")


def negative(document: Document, attributes: Iterable[tuple[str, str]]) -> Iterator[Finding]:
    """A finding for each of these attributes (element name, attribute name) that is a negative number or none at all."""
    for tag, name in attributes:
        for element in document.elements(tag):
            value = document.number(element, name)
            if value is not None and not value >= 0:
                yield Finding(element, f"{name}={element.get(name)!r} is {value:g}, 0 or more is expected")
