"""Entities that are referred to exist."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import unresolved
from schemas.checks.registry import Finding, rule


@rule("asam.net:xosc:1.2.0:reference_control.resolvable_entity_references", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """A reference to an entity must name a ScenarioObject or an EntitySelection of the scenario."""
    entities = document.names("ScenarioObject", "EntitySelection")
    return unresolved(document, "entity", entities, "entityRef", "masterEntityRef", "trailerRef")
