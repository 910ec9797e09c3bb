"""Attributes that say that they have no value, in the way of programs that write files."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from schemas.remarks import Remark
from schemas.rules.valid_schema import UID
from xosc.node import Node
from xosc.repairs.declared import attributes

BREAKS_SCHEMA = True

_NOTHING = ("", "None", "null", "undefined")
_saying_nothing = etree.XPath(f"descendant-or-self::*[@*[{' or '.join(f'. = {text!r}' for text in _NOTHING)}]]")


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Leave out optional ones whose type has no such value."""
    declared = attributes(version)
    for node in root.iter() if _saying_nothing(root.element) else ():
        for name, attribute in declared.get(node.tag, {}).items():
            text = node.element.get(name)
            if text in _NOTHING and not attribute.required and (attribute.kind or attribute.values):
                del node.element.attrib[name]
                yield node.remark(UID, f"{name}={text!r} is no value; the attribute is left out")
