"""No entity selection contains itself."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.graphs import on_cycles
from schemas.checks.registry import Finding, rule


@rule("xosc.toolchain:xosc:1.0.0:reference_control.no_cyclic_entity_selections", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """An EntitySelection must not be a member of itself, directly or through other selections."""
    selections = {selection.get("name") or "": selection for selection in document.elements("EntitySelection")}
    members = {
        name: [member for ref in selection.iter("EntityRef") if (member := document.value(ref, "entityRef"))]
        for name, selection in selections.items()
    }
    for name in on_cycles(members):
        yield Finding(selections[name], f"the entity selection {name!r} is a member of itself")
