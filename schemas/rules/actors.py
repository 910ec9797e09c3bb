"""Private actions have actors."""

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule

UID = "asam.net:xosc:1.2.0:reference_control.valid_actor_reference_in_private_actions"


@rule(UID, kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """A ManeuverGroup with private actions must have actors, named or selected as the triggering entities."""
    for group in document.elements("ManeuverGroup"):
        actors = group.find("Actors")
        if actors is None or actors.find("EntityRef") is not None or group.find(".//PrivateAction") is None:
            continue
        what = f"the private actions of the maneuver group {group.get('name')!r} have no actor"
        selected = document.value(actors, "selectTriggeringEntities")
        if selected not in ("true", "1", None):
            yield Finding(actors, what)
        elif selected is not None and not _is_triggered_by_entities(group):
            yield Finding(actors, f"{what}: no entity triggers its start")


def _is_triggered_by_entities(group: etree._Element) -> bool:
    """Whether a condition by entity is part of what starts a maneuver group's act or events."""
    act = group.getparent()
    return act is None or act.find(".//StartTrigger//TriggeringEntities") is not None
