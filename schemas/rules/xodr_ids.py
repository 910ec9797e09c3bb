"""Ids in a road network are unique."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule


@rule("asam.net:xodr:1.4.0:ids.id_unique_in_class")
def check(document: Document) -> Iterator[Finding]:
    """The ids of roads, of junctions, of controllers and of signals must each be unique."""
    for tag in ("road", "junction", "controller", "signal"):
        seen: set[str] = set()
        for element in document.elements(tag):
            identity = element.get("id")
            if identity is None or (tag == "controller" and element.getparent() is not document.root):
                continue
            if identity in seen:
                yield Finding(element, f"another {tag} has the id {identity!r}")
            seen.add(identity)
