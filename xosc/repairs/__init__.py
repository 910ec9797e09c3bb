"""Repairs of documents as they are loaded.

The kinds of repairs are the modules of `xosc.repairs.kinds` (see `schemas.discovery`): each has a function
`repair(root, version)` that changes the tree where something has one sensible meaning, and yields a remark on each change.
What has no such meaning is left to those who refuse it.
"""

from __future__ import annotations

from schemas import discovery
from schemas.remarks import Remark
from xosc.node import Node


def repair(root: Node, version: tuple[int, int]) -> list[Remark]:
    """Make all repairs in a document of that version of the standard, in place."""
    return [remark for kind in discovery.load("xosc.repairs.kinds") for remark in kind.repair(root, version)]
