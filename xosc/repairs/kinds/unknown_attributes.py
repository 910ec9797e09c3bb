"""Attributes that no version of the standard knows."""

from __future__ import annotations

from collections.abc import Iterator

from schemas.remarks import Remark
from schemas.rules.valid_schema import UID
from xosc.node import Node
from xosc.repairs.declared import attributes, names_of_attributes

BREAKS_SCHEMA = True


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Leave them out."""
    declared, known = attributes(version), names_of_attributes()
    for node in root.iter():
        for name in [str(each) for each in node.element.attrib] if node.tag in declared else []:
            if name not in known[node.tag] and not name.startswith("{"):
                node.element.attrib.pop(name)
                yield node.remark(UID, f"the attribute {name!r} is in no version of the standard; it is left out")
