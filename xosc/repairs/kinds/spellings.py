"""Attributes whose value is of the type that the standard gives them, in the spelling of other tools."""

from __future__ import annotations

from collections.abc import Iterator

from schemas.remarks import Remark
from schemas.rules.valid_schema import UID
from schemas.values import meant
from xosc.node import Node
from xosc.repairs.declared import Attribute, attributes

BREAKS_SCHEMA = True

_TYPES = {"bool": "boolean", "float": "double", "str": "string"}
"""Types of parameters by their names in programming languages."""
_UNLIMITED = ("maximumExecutionCount", "-1", "4294967295")
"""A number of executions that other players take as any number, and the greatest that the standard knows."""


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Write what is meant: `true` for `True`, `2` for `2.0`, `rising` for `Rising`."""
    declared = attributes(version)
    for node in root.iter():
        for name, attribute in declared.get(node.tag, {}).items():
            text = node.element.get(name)
            value = _meant(name, attribute, text) if text is not None and "$" not in text else None
            if value is not None and value != text:
                node.element.set(name, value)
                what = f"no {attribute.kind}" if attribute.kind else f"none of {', '.join(attribute.values)}"
                yield node.remark(UID, f"{name}={text!r} is {what}; {value} is meant")


def _meant(name: str, attribute: Attribute, text: str) -> str | None:
    """What a text stands for as the value of an attribute; None where that is not known."""
    if (name, text) == _UNLIMITED[:2]:
        return _UNLIMITED[2]
    if name == "parameterType" and text in _TYPES:
        return _TYPES[text]
    if attribute.values:
        alike = [value for value in attribute.values if value.lower() == text.strip().lower()]
        return text if text in attribute.values else alike[0] if len(alike) == 1 else None
    try:
        return meant(attribute.kind, text) if attribute.kind else None
    except ValueError:
        return None
