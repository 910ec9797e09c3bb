"""Elements that have the name of another one beside them."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from schemas.remarks import Remark
from schemas.rules.unique_names import UID, doubled
from xosc.node import Node

BREAKS_SCHEMA = False


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Leave them as they are: all of them are read, and references to the name are ambiguous."""
    elements = (each for each in root.element.iter(etree.Element) if "$" not in each.get("name", "$"))
    for element, message in doubled((each, each.get("name", "")) for each in elements):
        yield Node(element, root.path).remark(UID, f"{message}; both are read")
