"""No entity selection contains itself."""

from collections.abc import Iterator

from schemas.rules.document import Document
from schemas.rules.registry import Finding, rule


@rule("xosc.toolchain:xosc:1.0.0:reference_control.no_cyclic_entity_selections", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """An EntitySelection must not be a member of itself, directly or through other selections."""
    members = {
        selection.get("name") or "": {name for ref in selection.iter("EntityRef") if (name := document.value(ref, "entityRef"))}
        for selection in document.elements("EntitySelection")
    }
    for selection in document.elements("EntitySelection"):
        name = selection.get("name") or ""
        reached, pending = set(), list(members[name])
        while pending:
            member = pending.pop()
            if member not in reached:
                reached.add(member)
                pending.extend(members.get(member, ()))
        if name in reached:
            yield Finding(selection, f"the entity selection {name!r} is a member of itself")
