"""Private actions have actors."""

from collections.abc import Iterator

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
        if document.value(actors, "selectTriggeringEntities") not in ("true", "1", None):
            yield Finding(actors, f"the private actions of the maneuver group {group.get('name')!r} have no actor")
