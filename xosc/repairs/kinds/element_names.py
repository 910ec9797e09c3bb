"""Child elements whose name is nearly that of one that is not there, or the name of its type."""

from __future__ import annotations

from collections.abc import Iterator

from schemas.remarks import Remark
from schemas.rules.valid_schema import UID
from xosc.node import Node
from xosc.repairs.declared import Child, children, meant, names

BREAKS_SCHEMA = True


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Give them that name."""
    declared, known = children(version), names(children)
    for node in list(root.iter()):
        siblings = declared.get(node.tag, {})
        for child in node.children() if siblings else []:
            absent = {name: each for name, each in siblings.items() if node.find(name) is None}
            right = "" if child.tag in known[node.tag] else meant(child.tag, absent) or _of_type(child.tag, absent)
            if right:
                yield child.remark(UID, f"the element {child.tag} is in no version of the standard; {right} is meant")
                child.element.tag = right


def _of_type(name: str, absent: dict[str, Child]) -> str:
    """The only element of the type of that name; "" where there is none, or more than one."""
    found = [each for each, child in absent.items() if child.type == name]
    return found[0] if len(found) == 1 else ""
