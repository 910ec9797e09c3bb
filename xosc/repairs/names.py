"""Repairs of names: declared with a `$`, declared twice, or that of another element beside."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from schemas.checks.structure import UNIQUE_NAMES_UID, doubled
from schemas.common.remarks import Remark
from schemas.xml import canonical
from xosc.node import Node
from xosc.rules.parameters import DECLARED_NAME_UID, UNIQUE_DECLARATIONS_UID


def correct_declared_names(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Take away the `$` of declared names, which only references have."""
    for node in root.iter("ParameterDeclaration", "VariableDeclaration", "MonitorDeclaration"):
        name = node.get("name", "")
        if name.startswith("$") and "$" not in name[1:]:
            node.element.set("name", name[1:])
            yield node.remark(DECLARED_NAME_UID, f"the declared name {name!r} is taken without '$'")


def keep_last_declarations(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Keep the last of declarations that differ and have one name: it replaces those before it."""
    for declarations in root.iter("ParameterDeclarations", "VariableDeclarations", "MonitorDeclarations"):
        last: dict[str, Node] = {}
        for node in declarations.children():
            name = node.get("name", "")
            earlier = last.get(name)
            last[name] = node
            if earlier is not None and canonical(earlier.element) != canonical(node.element):
                yield node.remark(
                    UNIQUE_DECLARATIONS_UID, f"{name!r} is declared twice, first in line {earlier.line}; this declaration holds"
                )
                declarations.element.remove(earlier.element)


def tell_repeated_names(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Tell of elements with the name of one beside them: all are read, and references to the name are ambiguous."""
    elements = (each for each in root.element.iter(etree.Element) if "$" not in each.get("name", "$"))
    for element, message in doubled((each, each.get("name", "")) for each in elements):
        yield Node(element, root.path).remark(UNIQUE_NAMES_UID, f"{message}; both are read")
