"""Validation against the official XSD: libxml2 decides, quickly; xmlschema explains rejections."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from itertools import islice
from typing import Any, NamedTuple

from lxml import etree

from schemas.common.errors import InvalidFile, UsageError, similar
from schemas.common.plugins import of_element, told
from schemas.common.xml import local_name
from schemas.versions.registry import Schema

_MOST_EXPLAINED = 20_000
"""Elements up to which xmlschema explains. Its time grows with their square; larger documents get
libxml2's messages."""

_with_many_attributes = etree.XPath("boolean(//*[count(@*) > 100])")
"""Of so many, too: it shows all attributes of an element for each that is wrong"""

ChildrenByName = dict[etree._Element, dict[str, list[etree._Element]]]
"""Children of elements, by their tag"""

_MEANINGS = {
    "expression": "an expression ${…}",
    "parameter": "a parameter $name",
    "parameterDeclaration": "a parameter $name",
    "boolean": "true or false",
    "double": "a number",
    "int": "an integer",
    "integer": "an integer",
    "unsignedInt": "an integer from 0 on",
    "unsignedShort": "an integer from 0 to 65535",
    "dateTime": "a date and time like 2024-03-01T12:00:00",
    "string": "text",
}


class Violation(NamedTuple):
    """An element that breaks the schema, and what was expected."""

    element: etree._Element
    message: str


def violations(tree: etree._ElementTree, schema: Schema) -> list[Violation]:
    """All that a document breaks of a schema; empty for a valid one. Raises as `find_violations`
    does."""
    return list(find_violations(tree, schema))


def find_violations(tree: etree._ElementTree, schema: Schema) -> Iterator[Violation]:
    """Yield the schema violations of a document lazily, so that the first is available early.

    Raises:
        UsageError: the XSD itself, which XOSC_SCHEMA_DIR may have supplied, cannot be used.
    """
    compiled = None if schema.xsd_1_1 else _compiled(schema)
    # Most documents are valid: xmlschema takes far longer to say so.
    if compiled is not None and compiled.validate(tree):
        return
    explained = False
    if compiled is None or _can_be_explained(tree):
        with suppress(LookupError, ValueError):  # xmlschema raises both, as for an unknown xsi:type
            for violation in _explained(tree, schema):
                explained = True
                yield violation
    # libxml2's verdict stands where xmlschema finds nothing wrong.
    if compiled is not None and not explained:
        yield from _logged(tree, compiled)


def _can_be_explained(tree: etree._ElementTree) -> bool:
    elements = sum(1 for _ in islice(tree.iter(), _MOST_EXPLAINED + 1))
    return elements <= _MOST_EXPLAINED and not _with_many_attributes(tree)


def brief_violations(tree: etree._ElementTree, schema: Schema) -> list[Violation]:
    """Return the schema violations of a document in libxml2's words, which takes no time;
    `violations` explains more."""
    if schema.xsd_1_1:
        return violations(tree, schema)
    compiled = _compiled(schema)
    compiled.validate(tree)
    return _logged(tree, compiled)


def is_valid(tree: etree._ElementTree, schema: Schema) -> bool:
    """Whether a document breaks nothing of a schema, by libxml2's verdict alone where it can give
    one.

    Raises:
        UsageError: the XSD itself cannot be used.
    """
    if schema.xsd_1_1:
        return next(find_violations(tree, schema), None) is None
    return bool(_compiled(schema).validate(tree))


@cache
def _compiled(schema: Schema) -> etree.XMLSchema:
    try:
        return etree.XMLSchema(schema.tree())
    except (etree.XMLSchemaParseError, InvalidFile) as error:
        raise UsageError(f"the XSD can't be used: {error}", path=schema.path) from None


@cache
def _explainer(schema: Schema) -> Any:
    import xmlschema

    kind = xmlschema.XMLSchema11 if schema.xsd_1_1 else xmlschema.XMLSchema10
    made = bool(schema.differences)
    try:
        # An XSD with differences exists in memory only; its includes are merged in (`whole`).
        source = etree.tostring(schema.tree(), encoding="unicode") if made else str(schema.path)
        return kind(source, allow="local", base_url=str(schema.path.parent))
    except xmlschema.XMLSchemaException as error:
        raise UsageError(f"the XSD can't be used: {error}", path=schema.path) from None


def _explained(tree: etree._ElementTree, schema: Schema) -> Iterator[Violation]:
    explainer = _explainer(schema)
    for error in explainer.iter_errors(tree):
        element = error.elem if error.elem is not None else tree.getroot()
        index = getattr(error, "index", None)
        children = [child for child in element if local_name(child)]
        if (
            getattr(error, "expected", None) is not None
            and index is not None
            and index < len(children)
        ):
            yield Violation(children[index], _unexpected(children[index], error))
        else:
            yield Violation(element, _expected_value(explainer, error) or str(error.reason))


def _unexpected(child: etree._Element, error: Any) -> str:
    plugin = of_element(local_name(child))
    if plugin is not None:
        # A name of the standard that is like it would be a wrong suggestion: this one is meant.
        return (
            f"the element {local_name(child)} is of {told(plugin)}; no version "
            "of the standard has it"
        )
    names = sorted(
        {
            str(particle.local_name)
            for particle in error.expected
            if getattr(particle, "local_name", None)
        }
    )
    expected = f"; expected is {' or '.join(names)}" if names else ""
    guess = similar(local_name(child), names)
    return f"the element {local_name(child)} is not expected here{expected}{guess and f'; {guess}'}"


def _expected_value(explainer: Any, error: Any) -> str | None:
    """A sentence for a value that fits none of the forms which the standard allows for its type."""
    # xmlschema marks this error by its text alone; with another text the reason is kept as it is.
    reason = str(error.reason)
    if not reason.startswith("attribute ") or "value doesn't match any pattern" not in reason:
        return None
    name = reason.removeprefix("attribute ").partition("=")[0]
    declared = explainer.find(error.path) if error.path else None
    kind = getattr(declared.attributes.get(name), "type", None) if declared is not None else None
    members = getattr(kind, "member_types", None)
    if kind is None or not members:
        return None
    # Unions of OpenSCENARIO name expression and parameter first; a sentence begins with the value.
    forms = [
        _MEANINGS.get(member.local_name or "", member.local_name or "another value")
        for member in reversed(members)
    ]
    return (
        f"the attribute {name}={error.obj!r} does not fit its type {kind.local_name}: "
        f"{' or '.join(forms)} is expected"
    )


def _logged(tree: etree._ElementTree, compiled: etree.XMLSchema) -> list[Violation]:
    log: Any = compiled.error_log  # the stubs forget that it iterates
    by_name: ChildrenByName = {}
    return [Violation(at_path(tree, entry.path, by_name), entry.message) for entry in log]


def at_path(tree: etree._ElementTree, path: str | None, by_name: ChildrenByName) -> etree._Element:
    """The element that libxml2 names by a path like /A/B[3]/C, the root where it names none.

    Args:
        by_name: children of the elements that were passed before, filled here: evaluated as XPath,
            n paths to n neighbours would take n² steps.
    """
    element, *steps = tree.getroot(), *(path or "").strip("/").split("/")[1:]
    for step in steps:
        if element not in by_name:
            by_name[element] = _children_by_name(element)
        name, _, number = step.removesuffix("]").partition("[")
        element = by_name[element][name][int(number or 1) - 1]
    return element


def _children_by_name(parent: etree._Element) -> dict[str, list[etree._Element]]:
    """Child elements by the names that paths have: `*` counts all, and stands for a namespace
    without prefix."""
    children: dict[str, list[etree._Element]] = {}
    for child in parent.iterchildren(etree.Element):
        name = f"{child.prefix}:{local_name(child)}" if child.prefix else str(child.tag)
        for pattern in ("*", name):
            children.setdefault(pattern, []).append(child)
    return children
