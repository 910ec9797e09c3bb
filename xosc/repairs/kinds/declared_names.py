"""Declared names with a `$` before them, which only references have."""

from __future__ import annotations

from collections.abc import Iterator

from schemas.remarks import Remark
from schemas.rules.declared_names import UID
from xosc.node import Node

BREAKS_SCHEMA = False


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Take the `$` away."""
    for node in root.iter("ParameterDeclaration", "VariableDeclaration", "MonitorDeclaration"):
        name = node.get("name", "")
        if name.startswith("$") and "$" not in name[1:]:
            node.element.set("name", name[1:])
            yield node.remark(UID, f"the declared name {name!r} is taken without '$'")
