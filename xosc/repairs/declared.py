"""Declarations of the official XSDs: types and use of attributes, order of child elements."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from functools import cache
from typing import NamedTuple, TypeVar

from lxml import etree

from schemas.registry import OPENSCENARIO, available_schemas, schema_for

_KINDS = {
    "Boolean": "boolean",
    "Double": "double",
    "Int": "int",
    "Integer": "int",
    "UnsignedInt": "unsignedInt",
    "UnsignedShort": "unsignedShort",
    "DateTime": "dateTime",
}


_CLOSE = 0.9
"""Share of letters that two spellings of a name have in common: nine of ten."""

_LONGEST = 100
"""Characters of a name that are compared"""

T = TypeVar("T")


class Attribute(NamedTuple):
    """An attribute.

    kind: its type, one of `schemas.values.TYPES`, None for all others. required: whether it must be there. values: those of its
    enumeration, in the spelling of the standard.
    """

    kind: str | None
    required: bool
    values: tuple[str, ...] = ()


class Child(NamedTuple):
    """A child element: place: its number among its siblings, -1 where any will do. required, many: whether it must be there, and
    may be there more than once. type: the name of its type."""

    place: int
    required: bool
    many: bool
    type: str = ""


@cache
def attributes(version: tuple[int, int]) -> dict[str, dict[str, Attribute]]:
    """Attributes by element name, then by their own; empty where no XSD is at hand.

    Elements of the same name and of different types, of which OpenSCENARIO has few, are left out.
    """
    tree = _tree(version)
    if tree is None:
        return {}
    values = {each.get("name"): _values(each) for each in tree.iter("{*}simpleType") if each.get("name")}
    return _by_element(tree, lambda body: _attributes(body, values))


@cache
def names(read: Callable[[tuple[int, int]], Mapping[str, Iterable[str]]]) -> dict[str, frozenset[str]]:
    """The names that `attributes` or `children` have in any version, by element name."""
    found: dict[str, frozenset[str]] = {}
    for version in sorted(schema.version[:2] for schema in available_schemas() if schema.standard == OPENSCENARIO):
        for tag, declared in read(version).items():
            found[tag] = found.get(tag, frozenset()).union(declared)
    return found


def similar(name: str, known: Iterable[str]) -> str:
    """The name that differs in capitals or a letter only; "" where there is none."""
    by_lower = {each.lower(): each for each in known}
    close = get_close_matches(name.lower(), by_lower, 1, _CLOSE)
    return by_lower[close[0]] if close else ""


def suggested(name: str, known: Iterable[str]) -> str:
    """Return the hint for an unknown name: the most similar one, or ""."""
    close = get_close_matches(name.lower()[:_LONGEST], by_lower := {each.lower(): each for each in known}, 1)
    return f"; did you mean {by_lower[close[0]]}?" if close else ""


@cache
def children(version: tuple[int, int]) -> dict[str, dict[str, Child]]:
    """Child elements by the name of their parent, then by their own, for parents that may hold more than one of a choice."""
    tree = _tree(version)
    if tree is None:
        return {}
    return _by_element(tree, _content(tree, ("sequence", "all")))


@cache
def content(version: tuple[int, int]) -> dict[str, dict[str, Child]]:
    """Child elements as `children`, for all parents: a choice is only one model more."""
    tree = _tree(version)
    return {} if tree is None else _by_element(tree, _content(tree, ("sequence", "all", "choice", "group")))


def _content(tree: etree._ElementTree, models: tuple[str, ...]) -> Callable[[etree._Element], dict[str, Child]]:
    """Reads the child elements of a type, of these content models."""
    groups = {each.get("name"): each for each in tree.iter("{*}group") if each.get("name")}

    def declared(body: etree._Element) -> dict[str, Child]:
        found = [groups.get(each.get("ref"), each) for each in body if etree.QName(each).localname in models]
        return {name: child for model in found for name, child in _children(model, groups, 0)[0].items()}

    return declared


def _tree(version: tuple[int, int]) -> etree._ElementTree | None:
    schema = schema_for(OPENSCENARIO, version)
    return schema.tree() if schema is not None else None


def _by_element(tree: etree._ElementTree, read: Callable[[etree._Element], dict[str, T]]) -> dict[str, dict[str, T]]:
    """Read a property of each element's type, by element name. Elements with several types are left out."""
    types = {each.get("name"): each for each in tree.iter("{*}complexType") if each.get("name")}
    found: dict[str, dict[str, T]] = {}
    ambiguous: set[str] = set()
    for element in tree.iter("{*}element"):
        declared = read(types.get(element.get("type"), element))
        if found.setdefault(element.get("name") or "", declared) != declared:
            ambiguous.add(element.get("name") or "")
    return {name: declared for name, declared in found.items() if name not in ambiguous}


def _attributes(body: etree._Element, values: dict[str | None, tuple[str, ...]]) -> dict[str, Attribute]:
    found = {}
    for each in body.iter("{*}attribute"):
        kind = (each.get("type") or "").split(":")[-1]
        found[each.get("name") or ""] = Attribute(_KINDS.get(kind), each.get("use") == "required", values.get(kind, ()))
    return found


def _values(kind: etree._Element) -> tuple[str, ...]:
    return tuple(str(each.get("value")) for each in kind.iter("{*}enumeration"))


def _children(model: etree._Element, groups: dict[str | None, etree._Element], place: int) -> tuple[dict[str, Child], int]:
    """The children in a sequence, choice, all or group, the first of them at a place; and the place behind them."""
    found: dict[str, Child] = {}
    kind, begin, end = etree.QName(model).localname, place, place
    for each in model.iterchildren("{*}element", "{*}group", "{*}sequence", "{*}choice"):
        start = begin if kind == "choice" else end
        many = each.get("maxOccurs", "1") != "1"
        if name := each.get("name"):
            inside, after = (
                {name: Child(-1 if kind == "all" else start, each.get("minOccurs") != "0", many, each.get("type", ""))},
                start + 1,
            )
        else:
            inside, after = _children(groups.get(each.get("ref"), each), groups, start)
            inside = {name: child._replace(many=child.many or many) for name, child in inside.items()}
        found |= inside
        end = max(end, after)
    return found, end
