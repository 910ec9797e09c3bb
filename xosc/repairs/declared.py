"""What the official XSDs declare of attributes: their types, and whether they must be there."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from lxml import etree

from schemas.registry import OPENSCENARIO, schema_for
from schemas.xml import parse

_KINDS = {
    "Boolean": "boolean",
    "Double": "double",
    "Int": "int",
    "Integer": "int",
    "UnsignedInt": "unsignedInt",
    "UnsignedShort": "unsignedShort",
    "DateTime": "dateTime",
}


class Attribute(NamedTuple):
    """An attribute: its type, one of `schemas.values.TYPES` (None for all others), and whether it must be there."""

    kind: str | None
    required: bool


@cache
def attributes(version: tuple[int, int]) -> dict[str, dict[str, Attribute]]:
    """Attributes by element name, then by their own; empty where no XSD is at hand.

    Elements of the same name and of different types, of which OpenSCENARIO has few, are left out.
    """
    schema = schema_for(OPENSCENARIO, version)
    if schema is None:
        return {}
    tree = parse(schema.path)
    types = {each.get("name"): each for each in tree.iter("{*}complexType") if each.get("name")}
    found: dict[str, dict[str, Attribute]] = {}
    ambiguous: set[str] = set()
    for element in tree.iter("{*}element"):
        declared = _attributes(types.get(element.get("type"), element))
        if found.setdefault(element.get("name") or "", declared) != declared:
            ambiguous.add(element.get("name") or "")
    return {name: declared for name, declared in found.items() if name not in ambiguous}


def _attributes(body: etree._Element) -> dict[str, Attribute]:
    return {
        each.get("name") or "": Attribute(_KINDS.get((each.get("type") or "").split(":")[-1]), each.get("use") == "required")
        for each in body.iter("{*}attribute")
    }
