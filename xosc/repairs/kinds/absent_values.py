"""Attributes that say that they have no value, in the way of programs that write files."""

from __future__ import annotations

from collections.abc import Iterator

from schemas.remarks import Remark
from schemas.rules.valid_schema import UID
from xosc.node import Node
from xosc.repairs.declared import attributes

BREAKS_SCHEMA = True

_NOTHING = ("", "None", "null", "undefined")


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Leave those out whose type has no such value; where they are required, that is another fault."""
    declared = attributes(version)
    for node in root.iter():
        for name, attribute in declared.get(node.tag, {}).items():
            text = node.element.get(name)
            if text in _NOTHING and (attribute.kind or attribute.values) and text not in attribute.values:
                del node.element.attrib[name]
                yield node.remark(UID, f"{name}={text!r} is no value; the attribute is left out")
