"""Storyboard elements that conditions watch exist."""

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.messages import unknown
from schemas.checks.registry import Finding, rule
from schemas.xml import local_name

_TAGS = {
    "story": "Story",
    "act": "Act",
    "maneuverGroup": "ManeuverGroup",
    "maneuver": "Maneuver",
    "event": "Event",
    "action": "Action",
}
_NAMED = set(_TAGS.values())


@rule("asam.net:xosc:1.2.0:reference_control.resolvable_storyboard_element_reference", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """A storyboardElementRef must name exactly one element of the given type, enclosing ones before it (`act::event`)."""
    known: dict[str, list[tuple[str, ...]]] = {tag: [] for tag in _NAMED}
    for storyboard in document.elements("Storyboard"):
        for tag, chain in _walk(document, document, storyboard, ()):
            known[tag].append(chain)
    for element, attribute, reference in document.values("storyboardElementRef"):
        kind = document.value(element, "storyboardElementType") or ""
        chains = known.get(_TAGS.get(kind, ""))
        if chains is None:
            continue
        parts = tuple(reference.split("::"))
        matches = sum(chain[-len(parts) :] == parts for chain in chains)
        if matches == 0:
            yield Finding(element, f"{attribute}: {unknown(kind, reference, [chain[-1] for chain in chains])}")
        elif matches > 1:
            message = f"{matches} {kind} elements are called {reference!r}; say which with the enclosing names, like 'act::name'"
            yield Finding(element, f"{attribute}: {message}", "warning")


def _walk(
    document: Document, source: Document, parent: etree._Element, chain: tuple[str, ...]
) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Element name and chain of names of the storyboard elements below one, those from catalogues included."""
    for child in parent.iterchildren(etree.Element):
        tag = local_name(child)
        if tag == "CatalogReference" and local_name(parent) == "ManeuverGroup" and source is document:
            entry = document.resolvable_entry(child)
            if entry is not None:
                yield from _named(document, document.source(entry), entry.element, chain)
        elif tag in _NAMED:
            yield from _named(document, source, child, chain)


def _named(
    document: Document, source: Document, element: etree._Element, chain: tuple[str, ...]
) -> Iterator[tuple[str, tuple[str, ...]]]:
    own = (*chain, source.value(element, "name") or "")
    yield local_name(element), own
    yield from _walk(document, source, element, own)
