"""Every element and attribute that is read by its name is one of the standard: a
misspelt name would never be found.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from schemas.versions.registry import available_schemas

ROOT = Path(__file__).parents[2]
READERS = sorted(
    path
    for folder in ("runner", "xosc")
    for path in (ROOT / folder).rglob("*.py")
    if "xosc.document.node import" in path.read_text()
)
FAMILIES = ("action", "condition", "position")
ATTRIBUTE = {"has", "get", "float", "finite", "int", "bool", "choice", "file"}
ELEMENT = {"children", "find", "need", "iter"}
OTHERS = {
    "runner/systems/drivers.py": {"ParkingBrake"},
    "runner/engine/participants/scenario_objects.py": {"module"},
    "xosc/listing/__init__.py": {"duplicates"},
    "xosc/document/repairs/attributes.py": {"maxOccurs", "minOccurs", "ref", "use"},
}
"""Names that files read of mappings and XSDs: pedals, properties of CARLA's
controllers, columns of an index, attributes
"""


class Standard(NamedTuple):
    """Attributes and children by element name, those of all versions together."""

    attributes: dict[str, set[str]]
    children: dict[str, set[str]]


@cache
def standard() -> Standard:
    found = Standard(defaultdict(set), defaultdict(set))
    for schema in available_schemas():
        tree = schema.tree()
        types = {each.get("name"): each for each in tree.iter("{*}complexType") if each.get("name")}
        for element in tree.iter("{*}element"):
            body = types.get(element.get("type") or "", element)
            found.attributes[element.get("name") or ""] |= {
                each.get("name") or "" for each in body.iter("{*}attribute")
            }
            found.children[element.get("name") or ""] |= {
                each.get("name") or "" for each in body.iter("{*}element")
            }
    return found


def calls(tree: ast.AST) -> Iterator[tuple[ast.Call, str, list[str]]]:
    """Each call that reads something by its name, with the method and the literals."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            method = node.func.attr
            arguments = (
                node.args[:1] if method in ATTRIBUTE else node.args if method in ELEMENT else []
            )
            names = [
                each.value
                for each in arguments
                if isinstance(each, ast.Constant) and isinstance(each.value, str)
            ]
            if names and "{" not in names[0]:  # else a path in the tree of an XSD or a road
                yield node, method, names


def executed(tree: ast.AST) -> Iterator[tuple[list[str], ast.FunctionDef]]:
    """The `from_xml` of each registered class, with the elements that it is registered for."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef):
            entries = [
                each
                for each in node.decorator_list
                if isinstance(each, ast.Call) and getattr(each.func, "id", "") in FAMILIES
            ]
            elements = [
                str(name.value).split("/")[-1]
                for entry in entries
                for name in entry.args
                if isinstance(name, ast.Constant)
            ]
            for method in node.body:
                if elements and isinstance(method, ast.FunctionDef) and method.name == "from_xml":
                    yield elements, method


@pytest.mark.parametrize("path", READERS, ids=lambda path: str(path.relative_to(ROOT)))
def test_what_is_read_by_name_is_in_the_standard(path):
    attributes = set().union(*standard().attributes.values())
    unknown = {
        name: f"{path}:{call.lineno}: .{method}({name!r})"
        for call, method, names in calls(ast.parse(path.read_text(encoding="utf-8")))
        for name in names
        if name not in (attributes if method in ATTRIBUTE else standard().attributes)
    }
    others = OTHERS.get(path.relative_to(ROOT).as_posix(), set())
    assert [where for name, where in unknown.items() if name not in others] == []
    assert others <= set(unknown)


def test_what_executes_an_element_reads_what_the_element_has():
    wrong, read = [], 0
    for path in READERS:
        for elements, function in executed(ast.parse(path.read_text(encoding="utf-8"))):
            for call, method, names in calls(function):
                assert isinstance(call.func, ast.Attribute)
                if getattr(call.func.value, "id", "") == "node":
                    read += 1
                    known = standard().attributes if method in ATTRIBUTE else standard().children
                    if not any(_leads(element, names, known) for element in elements):
                        wrong.append(
                            f"{path}:{call.lineno}: {' or '.join(elements)} .{method}{tuple(names)}"
                        )
    assert wrong == []
    assert read > 60


def _leads(element: str, names: list[str], known: dict[str, set[str]]) -> bool:
    """Whether an element has an attribute of that name, or a child that has a
    child …; alternatives count as steps, too.
    """
    first, *rest = names
    if first not in known[element]:
        return False
    return not rest or _leads(first, rest, known) or all(name in known[element] for name in rest)
