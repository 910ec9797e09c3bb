"""Attributes whose value is of the type that the standard gives them, in the spelling of other tools."""

from __future__ import annotations

from collections.abc import Iterator

from schemas.remarks import Remark
from schemas.rules.valid_schema import UID
from schemas.values import meant
from xosc.node import Node
from xosc.repairs.declared import attributes

BREAKS_SCHEMA = True


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Write what is meant: `true` for `True`, `2` for `2.0`."""
    declared = attributes(version)
    for node in root.iter():
        for name, attribute in declared.get(node.tag, {}).items():
            text = node.element.get(name)
            if text is None or attribute.kind is None or "$" in text:
                continue
            try:
                value = meant(attribute.kind, text)
            except ValueError:
                continue
            if value != text:
                node.element.set(name, value)
                yield node.remark(UID, f"{name}={text!r} is no {attribute.kind}; {value} is meant")
