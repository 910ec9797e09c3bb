"""Attributes that say that they have no value, in the way of programs that write files."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

from lxml import etree

from schemas.remarks import Remark
from schemas.rules.valid_schema import UID
from xosc.node import Node
from xosc.repairs.declared import attributes

BREAKS_SCHEMA = True

NOTHING = ("", "None", "null", "undefined")
"""Values that say so."""
_saying_nothing = etree.XPath(f"descendant-or-self::*[@*[{' or '.join(f'. = {text!r}' for text in NOTHING)}]]")


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Leave out optional ones whose type has no such value."""
    declared = attributes(version)
    for element in cast(list[etree._Element], _saying_nothing(root.element)):
        node = root.at(element)
        for name, attribute in declared.get(node.tag, {}).items():
            text = node.element.get(name)
            if text in NOTHING and not attribute.required and (attribute.kind or attribute.values):
                del node.element.attrib[name]
                yield node.remark(UID, f"{name}={text!r} is no value; the attribute is left out")
