"""Entities get a position."""

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule

UID = "xosc.toolchain:xosc:1.0.0:storyboard.entities_get_a_position"

_PLACING = ("TeleportAction", "FollowTrajectoryAction")
_TRAILERS = ("TrailerRef", "ConnectTrailerAction")


@rule(UID, level="warning", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """An entity should be put somewhere by an action: without one it never appears.

    Which entities trigger an event is known in a run only, so a scenario that selects these as actors is not looked at, nor one
    whose actions place selections of entities, or entities that it does not declare.
    """
    if any(document.value(actors, "selectTriggeringEntities") not in ("false", "0") for actors in document.elements("Actors")):
        return
    entities, placed = document.names("ScenarioObject"), set(_placed(document))
    if not placed <= entities:
        return
    for entity in document.elements("ScenarioObject"):
        name = document.value(entity, "name")
        if name is not None and name not in placed:
            yield Finding(entity, f"no action gives the entity {name!r} a position: it never appears")


def _placed(document: Document) -> Iterator[str | None]:
    """Names of the entities that actions put somewhere, and of trailers."""
    for private in document.elements("Private"):
        if _places(document, private):
            yield document.value(private, "entityRef")
    for action in document.elements("EntityAction"):
        if action.find("AddEntityAction") is not None:
            yield document.value(action, "entityRef")
    for group in document.elements("ManeuverGroup"):
        if _places(document, group):
            yield from (document.value(actor, "entityRef") for actor in group.iterfind("Actors/EntityRef"))
    for trailer in document.elements(*_TRAILERS):
        yield document.value(trailer, "trailerRef") or document.value(trailer, "entityRef")


def _places(document: Document, element: etree._Element) -> bool:
    """Whether an element, or a maneuver of a catalogue in it, has an action that puts an entity somewhere."""
    entries = [document.resolvable_entry(reference) for reference in element.iterchildren("CatalogReference")]
    inside = [element, *(entry.element for entry in entries if entry is not None)]
    return any(next(each.iter(*_PLACING), None) is not None for each in inside)
