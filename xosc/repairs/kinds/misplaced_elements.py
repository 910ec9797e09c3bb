"""Child elements in another order than that of the standard, which gives none a meaning by it."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from schemas.remarks import Remark
from schemas.rules.valid_schema import UID
from xosc.node import Node
from xosc.repairs.declared import children

BREAKS_SCHEMA = True


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Put them in order; those of the same name stay in theirs."""
    declared = children(version)
    for node in list(root.iter()):
        siblings = declared.get(node.tag, {})
        inside = [each for each in node.children() if each.tag in siblings]
        places = [siblings[each.tag].place for each in inside]
        late = next((number for number, (before, after) in enumerate(pairwise(places)) if after < before), None)
        if late is None:
            continue
        first, second = inside[late], inside[late + 1]
        for each in sorted(inside, key=lambda each: siblings[each.tag].place):
            node.element.append(each.element)
        yield second.remark(UID, f"the element {second.tag} comes after {first.tag}; it is read as if it came before")
