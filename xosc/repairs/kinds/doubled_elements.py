"""Child elements that may be there once, and are there several times."""

from __future__ import annotations

from collections.abc import Iterator

from schemas.remarks import Remark
from schemas.rules.valid_schema import UID
from xosc.node import Node
from xosc.repairs.declared import children

BREAKS_SCHEMA = True

_LISTS = ("ParameterDeclarations", "VariableDeclarations", "MonitorDeclarations", "Entities", "Properties")


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Put lists together, and keep the first of others."""
    declared = children(version)
    for node in list(root.iter()):
        first: dict[str, Node] = {}
        for child in node.children():
            allowed = declared.get(node.tag, {}).get(child.tag)
            if allowed is None or allowed.many or first.setdefault(child.tag, child).element is child.element:
                continue
            if child.tag in _LISTS:
                first[child.tag].element.extend(child.element)
                meaning = "what is in both is read"
            else:
                meaning = f"that of line {first[child.tag].line} is read"
            node.element.remove(child.element)
            yield child.remark(UID, f"a second element {child.tag}; {meaning}")
