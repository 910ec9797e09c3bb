"""Attributes whose name no version of the standard has."""

from __future__ import annotations

from collections.abc import Iterator

from schemas.remarks import Remark
from schemas.rules.valid_schema import UID
from xosc.node import Node
from xosc.repairs.declared import attributes, meant, names

BREAKS_SCHEMA = True

_FORMER = {("Condition", "edge"): "conditionEdge", ("Gear", "value"): "number"}
"""Names that attributes had before version 1.0, or have in elements beside theirs, by element."""


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Give them the name that they nearly have, or that came in the place of theirs; leave out the others."""
    declared, known = attributes(version), names(attributes)
    for node in root.iter():
        for name in [str(each) for each in node.element.attrib] if node.tag in known else []:
            if name in known[node.tag] or name.startswith("{"):
                continue
            value = node.element.attrib.pop(name)
            free = [each for each in declared.get(node.tag, sorted(known[node.tag])) if not node.has(each)]
            right = _FORMER.get((node.tag, name), "") or (f"{name}Ref" if f"{name}Ref" in free else meant(name, free))
            if right in free:
                node.element.set(right, value)
                yield node.remark(UID, f"the attribute {name!r} is in no version of the standard; {right!r} is meant")
            else:
                yield node.remark(UID, f"the attribute {name!r} is in no version of the standard; it is left out")
