"""Names of entities and of catalogue entries are unique."""

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.xml import local_name


@rule("asam.net:xosc:1.2.0:reference_control.uniquely_resolvable_entity_references")
def check(document: Document) -> Iterator[Finding]:
    """Names that references resolve to shall be unique: those of entities, and those of the entries of a catalogue."""
    seen: set[str] = set()
    for parent in document.elements("Entities", "Catalog"):
        for element in parent.iterchildren(etree.Element):
            name = document.value(element, "name")
            if name is not None and name in seen:
                yield Finding(element, f"{local_name(element)} {name!r} has the name of another, references to it are ambiguous")
            elif name is not None:
                seen.add(name)
