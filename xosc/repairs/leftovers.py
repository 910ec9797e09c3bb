"""What breaks the schema and is no repair's: it is left as it is, and those who need it refuse it."""

from __future__ import annotations

from collections.abc import Iterator

from schemas import validate
from schemas.registry import OPENSCENARIO, schema_for
from schemas.remarks import Remark
from schemas.rules.empty_elements import lacking
from schemas.rules.valid_schema import UID
from xosc.node import Node


def remarks(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """A remark on each violation; elements of the storyboard that are empty are left to those who execute them."""
    schema = schema_for(OPENSCENARIO, version)
    if schema is None:
        return
    for element, message in validate.brief_violations(root.element.getroottree(), schema):
        if not ("Missing child" in message and lacking(element)):
            what = message.removeprefix("Element ").rstrip(". ")
            yield Node(element, root.path).remark(UID, f"{what}; the file is read as it stands")
