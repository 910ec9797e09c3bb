"""Controllers that are referred to exist."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import unknown
from schemas.checks.registry import Finding, rule
from schemas.xml import local_name

UID = "xosc.toolchain:xosc:1.0.0:reference_control.resolvable_controller_reference"

_HOLDERS = {"ObjectController", "AssignControllerAction"}


@rule(UID, kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """A controllerRef must name a controller that an entity has or is assigned, itself or by a catalogue entry."""
    controllers = document.names("ObjectController", "Controller") | {
        entry
        for element, _, entry in document.values("entryName")
        if local_name(element.getparent()) in _HOLDERS  # type: ignore[arg-type]  # a catalogue reference has a parent
    }
    for element, attribute, name in document.values("controllerRef", "objectControllerRef"):
        if name not in controllers:
            yield Finding(element, f"{attribute}: {unknown('controller', name, controllers)}")
