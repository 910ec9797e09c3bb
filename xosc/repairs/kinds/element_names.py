"""Child elements whose name is nearly that of one that is not there."""

from __future__ import annotations

from collections.abc import Iterator

from schemas.remarks import Remark
from schemas.rules.valid_schema import UID
from xosc.node import Node
from xosc.repairs.declared import children, meant, names

BREAKS_SCHEMA = True


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Give them that name."""
    declared, known = children(version), names(children)
    for node in list(root.iter()):
        siblings = declared.get(node.tag, {})
        for child in node.children() if siblings else []:
            right = (
                "" if child.tag in known[node.tag] else meant(child.tag, [each for each in siblings if node.find(each) is None])
            )
            if right:
                yield child.remark(UID, f"the element {child.tag} is in no version of the standard; {right} is meant")
                child.element.tag = right
