"""Names that are declared twice and differently."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from schemas.remarks import Remark
from schemas.rules.unique_declarations import UID
from xosc.node import Node

BREAKS_SCHEMA = False


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Keep the last, which replaces those before it."""
    for declarations in root.iter("ParameterDeclarations", "VariableDeclarations", "MonitorDeclarations"):
        last: dict[str, Node] = {}
        for node in declarations.children():
            name = node.get("name", "")
            earlier = last.get(name)
            last[name] = node
            if earlier is not None and _text(earlier) != _text(node):
                yield node.remark(UID, f"{name!r} is declared twice, first in line {earlier.line}; this declaration holds")
                declarations.element.remove(earlier.element)


def _text(node: Node) -> bytes:
    return etree.tostring(node.element, method="c14n", with_tail=False)
