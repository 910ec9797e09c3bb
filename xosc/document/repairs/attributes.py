"""Repairs of attributes and names: values that say nothing, other spellings, missing ones, names
declared twice or with a `$`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from difflib import get_close_matches
from functools import cache, lru_cache
from typing import NamedTuple, TypeVar, cast

from lxml import etree

from schemas.checks.structure import SCHEMA_UID, UNIQUE_NAMES_UID, doubled
from schemas.common.remarks import Remark
from schemas.common.xml import canonical
from schemas.expressions.values import meant
from schemas.versions.registry import OPENSCENARIO, available_schemas, schema_for
from xosc.document.node import Node
from xosc.rules.parameters import DECLARED_NAME_UID, UNIQUE_DECLARATIONS_UID

# names ------------------------------------------------------------------------------------------


def correct_declared_names(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Take away the `$` of declared names, which only references have."""
    for node in root.iter("ParameterDeclaration", "VariableDeclaration", "MonitorDeclaration"):
        name = node.get("name", "")
        # With more of them it may be an expression, whose value nobody knows.
        if name.startswith("$") and "$" not in name[1:]:
            node.element.set("name", name[1:])
            yield node.remark(DECLARED_NAME_UID, f"the declared name {name!r} is taken without '$'")


def keep_last_declarations(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Keep the last of declarations that differ and have one name: it replaces those before it."""
    for declarations in root.iter(
        "ParameterDeclarations", "VariableDeclarations", "MonitorDeclarations"
    ):
        last: dict[str, Node] = {}
        for node in declarations.children():
            name = node.get("name", "")
            earlier = last.get(name)
            last[name] = node
            if earlier is not None and canonical(earlier.element) != canonical(node.element):
                yield node.remark(
                    UNIQUE_DECLARATIONS_UID,
                    f"{name!r} is declared twice, first in line {earlier.line}; "
                    "this declaration holds",
                )
                declarations.element.remove(earlier.element)


def tell_repeated_names(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Report siblings with the same name: all are read, and references to the
    name are ambiguous.
    """
    elements = (
        element
        for element in root.element.iter(etree.Element)
        # Of parameters the names are known only when they have values.
        if "$" not in element.get("name", "$")
    )
    for element, message in doubled((element, element.get("name", "")) for element in elements):
        yield Node(element, root.path).remark(UNIQUE_NAMES_UID, f"{message}; both are read")


# declarations of the official XSDs --------------------------------------------------------------


_KINDS = {
    "Boolean": "boolean",
    "Double": "double",
    "Int": "int",
    "Integer": "int",
    "UnsignedInt": "unsignedInt",
    "UnsignedShort": "unsignedShort",
    "DateTime": "dateTime",
}


_ALIKE = 0.9
"""Share of letters that two spellings of a name have in common: nine of ten."""

_LONGEST = 100
"""Characters of a name that are compared"""

T = TypeVar("T")


class Attribute(NamedTuple):
    """An attribute.

    kind: its type, one of `schemas.expressions.values.TYPES`, None for all others. required:
    whether it must be there. values: those of its enumeration, in the spelling of the standard.
    """

    kind: str | None
    required: bool
    values: tuple[str, ...] = ()


class Child(NamedTuple):
    """A child element: place: its number among its siblings, -1 where any will do. required, many:
    whether it must be there, and may be there more than once. type: the name of its type."""

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
    values = {
        kind.get("name"): _values(kind) for kind in tree.iter("{*}simpleType") if kind.get("name")
    }
    return _by_element(tree, lambda body: _attributes(body, values))


@cache
def names(
    read: Callable[[tuple[int, int]], Mapping[str, Iterable[str]]],
) -> dict[str, frozenset[str]]:
    """The names that `attributes` or `children` have in any version, by element name."""
    by_tag: dict[str, frozenset[str]] = {}
    for version in sorted(
        schema.version[:2] for schema in available_schemas() if schema.standard == OPENSCENARIO
    ):
        for tag, declared in read(version).items():
            by_tag[tag] = by_tag.get(tag, frozenset()).union(declared)
    return by_tag


@cache
def is_standard(tag: str) -> bool:
    """Whether any version of the standard has an element of that name; so it is where no XSD is at
    hand."""
    schemas = [schema for schema in available_schemas() if schema.standard == OPENSCENARIO]
    trees = [tree for schema in schemas if (tree := _tree(schema.version[:2])) is not None]
    elements = (element for tree in trees for element in tree.iter("{*}element"))
    return not trees or any(element.get("name") == tag for element in elements)


def similar(name: str, known: Iterable[str]) -> str:
    """The name that differs in capitals or a letter only; "" where there is none."""
    return _similar(name, tuple(known))


@lru_cache(maxsize=4096)
def _similar(name: str, known: tuple[str, ...]) -> str:
    by_lower = {name.lower(): name for name in known}
    close = get_close_matches(name.lower(), by_lower, 1, _ALIKE)
    return by_lower[close[0]] if close else ""


def suggested(name: str, known: Iterable[str]) -> str:
    """Return the hint for an unknown name: the most similar one, or ""."""
    close = get_close_matches(
        name.lower()[:_LONGEST], by_lower := {name.lower(): name for name in known}, 1
    )
    return f"; did you mean {by_lower[close[0]]}?" if close else ""


@cache
def children(version: tuple[int, int]) -> dict[str, dict[str, Child]]:
    """Child elements by the name of their parent, then by their own, for parents that may hold more
    than one of a choice."""
    tree = _tree(version)
    if tree is None:
        return {}
    return _by_element(tree, _content(tree, ("sequence", "all")))


@cache
def content(version: tuple[int, int]) -> dict[str, dict[str, Child]]:
    """Child elements as `children`, for all parents: a choice is only one model more."""
    tree = _tree(version)
    return (
        {}
        if tree is None
        else _by_element(tree, _content(tree, ("sequence", "all", "choice", "group")))
    )


def _content(
    tree: etree._ElementTree, models: tuple[str, ...]
) -> Callable[[etree._Element], dict[str, Child]]:
    """Reads the child elements of a type, of these content models."""
    groups = {group.get("name"): group for group in tree.iter("{*}group") if group.get("name")}

    def declared(body: etree._Element) -> dict[str, Child]:
        particles = [
            groups.get(part.get("ref"), part)
            for part in body
            if etree.QName(part).localname in models
        ]
        return {
            name: child
            for model in particles
            for name, child in _children(model, groups, 0)[0].items()
        }

    return declared


def _tree(version: tuple[int, int]) -> etree._ElementTree | None:
    schema = schema_for(OPENSCENARIO, version)
    return schema.tree() if schema is not None else None


def _by_element(
    tree: etree._ElementTree, read: Callable[[etree._Element], dict[str, T]]
) -> dict[str, dict[str, T]]:
    """Read a property of each element's type, by element name. Elements with several types are left
    out."""
    types = {kind.get("name"): kind for kind in tree.iter("{*}complexType") if kind.get("name")}
    by_name: dict[str, dict[str, T]] = {}
    ambiguous: set[str] = set()
    for element in tree.iter("{*}element"):
        declared = read(types.get(element.get("type"), element))
        if by_name.setdefault(element.get("name") or "", declared) != declared:
            ambiguous.add(element.get("name") or "")
    return {name: declared for name, declared in by_name.items() if name not in ambiguous}


def _attributes(
    body: etree._Element, values: dict[str | None, tuple[str, ...]]
) -> dict[str, Attribute]:
    attributes = {}
    for attribute in body.iter("{*}attribute"):
        kind = (attribute.get("type") or "").split(":")[-1]
        attributes[attribute.get("name") or ""] = Attribute(
            _KINDS.get(kind), attribute.get("use") == "required", values.get(kind, ())
        )
    return attributes


def _values(kind: etree._Element) -> tuple[str, ...]:
    return tuple(str(enumeration.get("value")) for enumeration in kind.iter("{*}enumeration"))


def _children(
    model: etree._Element, groups: dict[str | None, etree._Element], place: int
) -> tuple[dict[str, Child], int]:
    """The children in a sequence, choice, all or group, the first of them at a place; and the place
    behind them."""
    children: dict[str, Child] = {}
    kind, begin, end = etree.QName(model).localname, place, place
    for particle in model.iterchildren("{*}element", "{*}group", "{*}sequence", "{*}choice"):
        # The alternatives of a choice share one place.
        start = begin if kind == "choice" else end
        many = particle.get("maxOccurs", "1") != "1"
        if name := particle.get("name"):
            inside, after = (
                {
                    name: Child(
                        -1 if kind == "all" else start,
                        particle.get("minOccurs") != "0",
                        many,
                        particle.get("type", ""),
                    )
                },
                start + 1,
            )
        else:
            inside, after = _children(groups.get(particle.get("ref"), particle), groups, start)
            inside = {
                name: child._replace(many=child.many or many) for name, child in inside.items()
            }
        children |= inside
        end = max(end, after)
    return children, end


# attributes -------------------------------------------------------------------------------------


NOTHING = ("", "None", "null", "undefined")
"""Values that say so."""
_saying_nothing = etree.XPath(
    f"descendant-or-self::*[@*[{' or '.join(f'. = {text!r}' for text in NOTHING)}]]"
)


def leave_out_absent_values(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Leave out optional attributes that say that they have no value (`None`), where their type has
    no such value."""
    declared = attributes(version)
    for element in cast(list[etree._Element], _saying_nothing(root.element)):
        node = root.at(element)
        for name, attribute in declared.get(node.tag, {}).items():
            text = node.element.get(name)
            # A text may well be empty, or the word None.
            if text in NOTHING and not attribute.required and (attribute.kind or attribute.values):
                del node.element.attrib[name]
                yield node.remark(
                    SCHEMA_UID, f"{name}={text!r} is no value; the attribute is left out"
                )


_FORMER = {("Condition", "edge"): "conditionEdge", ("Gear", "value"): "number"}
"""Names that attributes had before version 1.0, or have in elements beside theirs, by element."""


def correct_attribute_names(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Give attributes that no version of the standard has the name that is nearly theirs; leave out
    the others."""
    declared, known = attributes(version), names(attributes)
    for node in root.iter():
        given = [str(name) for name in node.element.attrib] if node.tag in known else []
        unknown = [name for name in given if not (name in known[node.tag] or name.startswith("{"))]
        # One by one would take a time that grows with the square of their number.
        if len(unknown) > _MOST_CORRECTED:
            yield _left_out_together(node, unknown)
            continue
        for name in unknown:
            value = node.element.attrib.pop(name)
            # An attribute that is there already can't be meant by another one.
            free = [
                name
                for name in declared.get(node.tag, sorted(known[node.tag]))
                if not node.has(name)
            ]
            right = _FORMER.get((node.tag, name), "") or (
                f"{name}Ref" if f"{name}Ref" in free else similar(name, free)
            )
            if right in free:
                node.element.set(right, value)
                yield node.remark(
                    SCHEMA_UID,
                    f"the attribute {name!r} is in no version of the standard; {right!r} is meant",
                )
            else:
                text = (
                    f"the attribute {name!r} is in no version of the standard; it is left out, "
                    "NOT executed"
                )
                yield node.remark(
                    SCHEMA_UID, text + suggested(name, declared.get(node.tag, ())), ignored(node)
                )


_MOST_CORRECTED = 100
"""Unknown attributes of an element up to which each is corrected, or told, by itself"""
_TOLD = 3


def _left_out_together(node: Node, unknown: list[str]) -> Remark:
    """Leave out many unknown attributes of an element; the remark names the first of them."""
    absent = set(unknown)
    # libxml2 searches all attributes before one for its value: only the kept ones are asked for.
    kept = {name: node.element.get(name, "") for name in node.element.attrib if name not in absent}
    node.element.attrib.clear()
    node.element.attrib.update(kept)
    named = ", ".join(map(repr, unknown[:_TOLD]))
    text = (
        f"{len(unknown)} attributes are in no version of the standard, as {named}; "
        "they are left out, NOT executed"
    )
    return node.remark(SCHEMA_UID, text, ignored(node))


_SHORTEST = 3
"""Letters of a value that say which one is meant"""
_CLOSE = 0.85
"""Similarity of a value and another in which letters are missing or changed"""
_NOT_EXECUTED = ("FileHeader", "Properties")
"""Elements whose content describes the file, or is for other tools"""


def ignored(node: Node) -> str:
    """Cause of an inconclusive run where an element, or an attribute of it, is left out; empty
    where nothing is executed."""
    return (
        ""
        if any(
            above.tag in _NOT_EXECUTED for above in (node.element, *node.element.iterancestors())
        )
        else "ignored"
    )


_TYPES = {"bool": "boolean", "float": "double", "str": "string"}
"""Types of parameters by their names in programming languages."""
_UNLIMITED = ("maximumExecutionCount", "-1", "4294967295")
"""A number of executions that other players take as any number, and the greatest that the standard
knows."""


def correct_spellings(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Write values in the spelling of their type: `true` for `True`, `2` for `2.0`, `rising` for
    `Rising`."""
    declared = attributes(version)
    for node in root.iter():
        for name, attribute in declared.get(node.tag, {}).items():
            text = node.element.get(name)
            value = (
                _standard_spelling(name, attribute, text)
                if text is not None and "$" not in text
                else None
            )
            if value is not None and value != text:
                node.element.set(name, value)
                what = (
                    f"no {attribute.kind}"
                    if attribute.kind
                    else f"none of {', '.join(attribute.values)}"
                )
                yield node.remark(SCHEMA_UID, f"{name}={text!r} is {what}; {value} is meant")


def _standard_spelling(name: str, attribute: Attribute, text: str) -> str | None:
    """Return the standard's spelling of an attribute value; None if unknown."""
    if (name, text) == _UNLIMITED[:2]:
        return _UNLIMITED[2]
    if name == "parameterType" and text in _TYPES:
        return _TYPES[text]
    if attribute.values:
        return (
            text
            if text in attribute.values
            else _nearest_value(text.strip().lower(), attribute.values)
        )
    try:
        return meant(attribute.kind, text) if attribute.kind else None
    except ValueError:
        return None


def _nearest_value(text: str, values: Collection[str]) -> str | None:
    """The only value of an enumeration that a text in lower case spells, begins or nearly spells;
    None where there is none."""
    by_lower = {value.lower(): value for value in values}
    alike = [lower for lower in by_lower if lower == text]
    alike = alike or [
        lower for lower in by_lower if len(text) >= _SHORTEST and lower.startswith(text)
    ]
    alike = alike or get_close_matches(text, by_lower, 2, _CLOSE)
    return by_lower[alike[0]] if len(alike) == 1 else None


_DEFAULTS = {
    "0": (
        "Condition/delay", "RelativeObjectPosition/dx", "RelativeObjectPosition/dy",
        "RelativeWorldPosition/dx", "RelativeWorldPosition/dy", "RelativeRoadPosition/ds",
        "RelativeRoadPosition/dt", "RelativeLanePosition/dLane", "RoadPosition/t",
        "FromRoadCoordinates/t", "Center/x", "Center/y", "Center/z", "Timing/offset",
        "TrafficSwarmAction/offset", "MiscObject/mass", "Pedestrian/mass",
    ),
    "1": ("ManeuverGroup/maximumExecutionCount", "Timing/scale"),
    "INF": ("Performance/maxSpeed", "Performance/maxAcceleration", "Performance/maxDeceleration"),
    "none": ("Condition/conditionEdge", "MiscObject/miscObjectCategory"),
    "time": ("SpeedActionDynamics/dynamicsDimension", "LaneChangeActionDynamics/dynamicsDimension"),
    "delta": ("RelativeTargetSpeed/speedTargetValueType",),
    "any": ("TriggeringEntities/triggeringEntitiesRule",),
    "position": ("TrajectoryFollowingMode/followingMode", "SpeedProfileAction/followingMode"),
    "true": ("VisibilityAction/graphics", "VisibilityAction/traffic", "VisibilityAction/sensors"),
    "false": (
        "Actors/selectTriggeringEntities", "Route/closed", "Trajectory/closed",
        "TimeOfDay/animation", "DistanceCondition/freespace", "RelativeDistanceCondition/freespace",
        "TimeHeadwayCondition/freespace", "TimeToCollisionCondition/freespace",
        "LateralDistanceAction/freespace", "LongitudinalDistanceAction/freespace",
        "DistanceCondition/alongRoute", "TimeHeadwayCondition/alongRoute",
        "TimeToCollisionCondition/alongRoute", "LaneOffsetAction/continuous",
        "LateralDistanceAction/continuous", "LongitudinalDistanceAction/continuous",
        "RelativeTargetSpeed/continuous",
    ),
    "": (
        "FileHeader/author", "FileHeader/description", "Story/name", "Act/name",
        "ManeuverGroup/name", "Maneuver/name", "Event/name", "Action/name", "Condition/name",
        "Trajectory/name", "Route/name", "Environment/name",
    ),
    "1970-01-01T00:00:00": ("FileHeader/date",),
}  # fmt: skip
"""Attributes of elements, by the value that changes nothing: later versions have it as default, or
nothing else can be meant."""
_DEFAULT_OF = {name: value for value, names in _DEFAULTS.items() for name in names}
_AT_ONCE = "0"
"""Value of the dynamics of a step, which may omit it."""


def add_missing_attributes(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Add required attributes that have one obvious value."""
    declared = attributes(version)
    for node in root.iter():
        for name, attribute in declared.get(node.tag, {}).items():
            if not attribute.required or node.has(name):
                continue
            value = _DEFAULT_OF.get(f"{node.tag}/{name}")
            if name == "value" and node.get("dynamicsShape", "") == "step":
                value = _AT_ONCE
            if value is not None:
                node.element.set(name, value)
                yield node.remark(
                    SCHEMA_UID, f"the attribute {name!r} is missing; {value!r} is assumed"
                )
