"""Names of entities and of catalogue entries are unique."""

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.xml import local_name


@rule("asam.net:xosc:1.2.0:reference_control.uniquely_resolvable_entity_references", level="warning", since=(1, 2))
def check(document: Document) -> Iterator[Finding]:
    """Entries of a catalogue shall have names of their own, or references to them are ambiguous."""
    return _ambiguous(document, "Catalog")


@rule("xosc.toolchain:xosc:1.0.0:reference_control.entities_have_names_of_their_own", kinds=("scenario",))
def check_entities(document: Document) -> Iterator[Finding]:
    """Entities shall have names of their own, or references to them are ambiguous."""
    return _ambiguous(document, "Entities")


def _ambiguous(document: Document, holder: str) -> Iterator[Finding]:
    seen: set[str] = set()
    for parent in document.elements(holder):
        for element in parent.iterchildren(etree.Element):
            name = document.value(element, "name")
            if name is not None and name in seen:
                yield Finding(element, f"{local_name(element)} {name!r} has the name of another, references to it are ambiguous")
            elif name is not None:
                seen.add(name)
