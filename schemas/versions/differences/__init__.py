"""XSDs of versions that no dependency brings: the XSD of an earlier version with a described
difference applied.

A difference is a file of this folder, named `STANDARD-EARLIER-LATER.txt`, with a line for each
change:

    Motion @ speed_longitudinal: Double?  an optional attribute
                                          (without `?` a required one, with `=1` one of this value)
    Vertex > Motion: Motion?              a child element at the end of the content: `?` at most 1,
                                          `*` any number, `+` one or more, `{2,}` two or more,
                                          without a sign exactly one
    TrafficDistribution ^ choice 2        the content is a choice that may be made twice
    outline / cornerRoad: cornerRoad+     an alternative of the choice within the content
    outline * 0 1                         that choice is made at most once
    Role | construction other             values of an enumeration
    t_place + t_grZero e_contactPoint     a value of one of these types
    Interpolation                         a type without content
    t_junction_direct < t_junction        the type is defined anew, as an extension of the other
    t_junction ~ abstract                 the type is only extended
    t_header - offset license             removed children, attributes, keys or groups
    boundary ? segment: t_lane if @type='lane'
                                          the type of a child under a condition
                                          (without `if`: in all other cases)
    group & t_header t_license            the group, any number of times, ends the content of these
    OBJECT ! not(@radius and @width)      an assertion (XPath 2.0)
    OpenDRIVE = k_path: junction/crossPath @id
                                          a key; with `> k_road` behind it a reference to that key

Several attributes or children are separated by commas. A type that the earlier version lacks is
made where it is first named; what is there by the same name is replaced in its place. Enumerations
of OpenSCENARIO take a parameter, as all of them do. Source of the differences: the official XSDs
compared, which tests repeat.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from lxml import etree

from schemas.common.xml import parse

_FOLDER = Path(__file__).parent
_FILE = re.compile(r"(\w+)-(\d+)\.(\d+)\.(\d+)-(\d+)\.(\d+)\.(\d+)\.txt")

ATTRIBUTE, CHILD, ALTERNATIVE, VALUES, GROUP = "@", ">", "/", "|", "&"
_UNION = "+"
_XSD_1_1 = "!?"
"""Signs whose meaning needs XSD 1.1."""

_XSD = "{http://www.w3.org/2001/XMLSchema}"
_OCCURS = {
    "": {},
    "?": {"minOccurs": "0"},
    "*": {"minOccurs": "0", "maxOccurs": "unbounded"},
    "+": {"maxOccurs": "unbounded"},
}
_KEYS = ("key", "keyref")
_MODELS = tuple(f"{_XSD}{name}" for name in ("sequence", "choice", "all"))
_LINE = re.compile(r"(\w+)(?: +([@>^|/!<~?&*=+-]) +(.+))?")
_DECLARED = re.compile(r"(\w+): ([\w:]+)([?*+]|\{\d+,\d*\}|=\w+)?")
_CONDITIONAL = re.compile(r"(\w+): (\w+)(?: if (.+))?")
_KEY = re.compile(r"(\w+): (\S+) (\S+)(?: > (\w+))?")


class Difference(NamedTuple):
    """Difference between a version of a standard and an earlier one.

    Attributes:
        standard: the standard's root element.
        version: the later version: major, minor, patch.
        base: the earlier one.
        path: the file that describes it.
    """

    standard: str
    version: tuple[int, int, int]
    base: tuple[int, int, int]
    path: Path

    def lines(self) -> Iterator[tuple[str, str, str]]:
        """Type, sign and rest of each line; a type without content has neither sign nor rest."""
        for line in filter(
            None, map(str.strip, self.path.read_text(encoding="utf-8").splitlines())
        ):
            parts = _LINE.fullmatch(line)
            assert parts is not None, line
            name, sign, rest = parts.groups(default="")
            yield name, sign, rest

    @property
    def xsd_1_1(self) -> bool:
        """Whether the result needs an XSD 1.1 processor, if the earlier version does not."""
        return any(sign and sign in _XSD_1_1 for _, sign, _ in self.lines())


@cache
def known_differences() -> tuple[Difference, ...]:
    """All differences, each after those that it may build on."""
    differences = []
    for path in _FOLDER.iterdir():
        if parts := _FILE.fullmatch(path.name):
            standard, *numbers = parts.groups()
            a, b, c, d, e, f = map(int, numbers)
            differences.append(Difference(standard, (d, e, f), (a, b, c), path))
    # As tuples: by standard, then by the later version.
    return tuple(sorted(differences))


def additions(difference: Difference) -> Iterator[tuple[str, str, str]]:
    """Type, sign and name of each addition; values of an enumeration are added once, under the name
    "values"."""
    told: set[str] = set()
    for name, sign, rest in difference.lines():
        if sign in (ATTRIBUTE, CHILD):
            yield from ((name, sign, _declaration(text)[0]) for text in rest.split(", "))
        elif sign == VALUES and name not in told:
            told.add(name)
            yield name, sign, "values"


def applied(difference: Difference, base: etree._ElementTree) -> etree._ElementTree:
    """The XSD of the later version, from that of the earlier one, which is not changed."""
    tree = copy.deepcopy(base)
    root = tree.getroot()
    for name, sign, rest in difference.lines():
        if sign == GROUP:
            for word in rest.split():
                _end_with_group(_type(root, word), name)
        elif sign in (ATTRIBUTE, CHILD, ALTERNATIVE):
            for part in rest.split(", "):
                _CHANGE[sign](_type(root, name), part)
        else:
            _CHANGE[sign](
                _type(root, name, "simpleType" if sign in (VALUES, _UNION) else "complexType"), rest
            )
    return tree


def whole(path: Path) -> etree._ElementTree:
    """An XSD with the files beside it that it includes in place of these inclusions."""
    tree, known = parse(path), {path.name}
    root = tree.getroot()
    while (include := next(root.iterchildren(f"{_XSD}include"), None)) is not None:
        # Each file once, as files may include each other; none from another folder.
        name = include.get("schemaLocation") or ""
        if name not in known and "/" not in name and "\\" not in name:
            known.add(name)
            for element in list(parse(path.parent / name).getroot()):
                root.append(element)
        root.remove(include)
    for include in list(root.iterchildren(f"{_XSD}include")):
        root.remove(include)
    # XML Schema allows these only before all other components.
    ahead = [
        element
        for element in root
        if element.tag in (f"{_XSD}import", f"{_XSD}redefine", f"{_XSD}override")
    ]
    for element in reversed(ahead):
        root.insert(0, element)
    return tree


def _type(root: etree._Element, name: str, tag: str = "complexType") -> etree._Element:
    """The named type, or that of the global element of this name; made where there is neither."""
    found = next(
        (element for element in root.iterchildren(f"{_XSD}{tag}") if element.get("name") == name),
        None,
    )
    if found is None:
        found = next(
            (
                element.find(f"{_XSD}{tag}")
                for element in root.iterchildren(f"{_XSD}element")
                if element.get("name") == name
            ),
            None,
        )
    return found if found is not None else etree.SubElement(root, f"{_XSD}{tag}", {"name": name})


def _content(kind: etree._Element) -> etree._Element:
    """The element that holds the children and attributes of a type: the extension, where it extends
    another type."""
    extension = kind.find(f"{_XSD}complexContent/{_XSD}extension")
    return kind if extension is None else extension


def _model(kind: etree._Element) -> etree._Element:
    """The sequence or choice of a type's children, made where there is none."""
    content = _content(kind)
    model = next(content.iterchildren(*_MODELS), None)
    if model is None:
        model = etree.Element(f"{_XSD}sequence")
        content.insert(0, model)
    return model


def _choice(kind: etree._Element) -> etree._Element:
    """The choice within the content of a type, made where there is none."""
    choice = next(_content(kind).iter(f"{_XSD}choice"), None)
    return choice if choice is not None else etree.SubElement(_model(kind), f"{_XSD}choice")


def _take(content: etree._Element, name: str, *tags: str) -> int | None:
    """Remove the declaration of that name; its place among the others, None where there is none."""
    found = next(
        (
            element
            for element in content
            if name in (element.get("name"), element.get("ref"))
            and element.tag[len(_XSD) :] in tags
        ),
        None,
    )
    if found is None:
        return None
    place = content.index(found)
    content.remove(found)
    return place


def _add_attribute(kind: etree._Element, rest: str) -> None:
    name, value, occurs = _declaration(rest)
    use = {} if occurs == "?" else {"use": "required"}
    fixed = {"fixed": occurs[1:]} if occurs.startswith("=") else {}
    content = _content(kind)
    _take(content, name, "attribute")
    added = etree.Element(f"{_XSD}attribute", {"name": name, "type": value, **use, **fixed})
    # XML Schema 1.1: assertions follow all attributes.
    first = next(content.iterchildren(f"{_XSD}assert"), None)
    content.insert(len(content) if first is None else content.index(first), added)


def _declare(model: etree._Element, rest: str) -> None:
    name, value, occurs = _declaration(rest)
    place = _take(model, name, "element")
    if occurs.startswith("{"):
        least, most = occurs[1:-1].split(",")
        times = {"minOccurs": least, "maxOccurs": most or "unbounded"}
    else:
        times = _OCCURS[occurs]
    model.insert(
        len(model) if place is None else place,
        etree.Element(f"{_XSD}element", {"name": name, "type": value, **times}),
    )


def _end_with_group(kind: etree._Element, name: str) -> None:
    model = _model(kind)
    _take(model, name, "group")
    etree.SubElement(model, f"{_XSD}group", {"ref": name, **_OCCURS["*"]})


def _set_choice(kind: etree._Element, rest: str) -> None:
    least, most = rest.split()
    _choice(kind).attrib.update({"minOccurs": least, "maxOccurs": most})


def _remove(kind: etree._Element, rest: str) -> None:
    content = _content(kind)
    for name in rest.split():
        # Keys stand in the element around a type. The element around a global type is the schema,
        # whose own declarations are not meant.
        for holder in (
            kind.getparent(),
            content,
            *content.iterchildren(*_MODELS),
            *content.iter(f"{_XSD}choice"),
        ):
            if holder is not None and holder.tag != f"{_XSD}schema":
                _take(holder, name, "attribute", "element", "group", *_KEYS)


def _define_anew(kind: etree._Element, rest: str) -> None:
    del kind[:]
    etree.SubElement(
        etree.SubElement(kind, f"{_XSD}complexContent"), f"{_XSD}extension", {"base": rest}
    )


def _condition(kind: etree._Element, rest: str) -> None:
    parts = _CONDITIONAL.fullmatch(rest)
    assert parts is not None, rest
    name, value, test = parts.groups()
    child = next(element for element in _model(kind) if element.get("name") == name)
    etree.SubElement(
        child,
        f"{_XSD}alternative",
        {"type": value} if test is None else {"test": test, "type": value},
    )


def _add_key(kind: etree._Element, rest: str) -> None:
    parts = _KEY.fullmatch(rest)
    assert parts is not None, rest
    name, selector, field, refer = parts.groups()
    element = kind.getparent()
    assert element is not None
    _take(element, name, *_KEYS)
    key = etree.SubElement(
        element,
        f"{_XSD}{'keyref' if refer else 'key'}",
        {"name": name, **({"refer": refer} if refer else {})},
    )
    etree.SubElement(key, f"{_XSD}selector", {"xpath": selector})
    etree.SubElement(key, f"{_XSD}field", {"xpath": field})


def _change_model(kind: etree._Element, rest: str) -> None:
    name, times = rest.split()
    model = _model(kind)
    model.tag = f"{_XSD}{name}"
    model.set("maxOccurs", times)


def _add_values(kind: etree._Element, rest: str) -> None:
    restriction = next(kind.iter(f"{_XSD}restriction"), None)
    if restriction is None and not _takes_parameters(kind):
        restriction = etree.SubElement(
            kind, f"{_XSD}restriction", {"base": f"{kind.prefix}:string"}
        )
    if restriction is None:
        union = etree.SubElement(kind, f"{_XSD}union")
        for base in ("parameter", f"{kind.prefix}:string"):
            restriction = etree.SubElement(
                etree.SubElement(union, f"{_XSD}simpleType"), f"{_XSD}restriction", {"base": base}
            )
        assert restriction is not None
    for value in rest.split():
        etree.SubElement(restriction, f"{_XSD}enumeration", {"value": value})


def _takes_parameters(kind: etree._Element) -> bool:
    """Whether the standard lets parameters stand for values: OpenSCENARIO."""
    return any(
        element.get("name") == "parameter"
        for element in kind.itersiblings(f"{_XSD}simpleType", preceding=True)
    )


def _declaration(text: str) -> tuple[str, str, str]:
    """Name, type and occurrence in the text of a declaration."""
    parts = _DECLARED.fullmatch(text)
    assert parts is not None, text
    name, kind, occurs = parts.groups(default="")
    return name, kind, occurs


_CHANGE: dict[str, Callable[[etree._Element, str], object]] = {
    ATTRIBUTE: _add_attribute,
    CHILD: lambda kind, rest: _declare(_model(kind), rest),
    ALTERNATIVE: lambda kind, rest: _declare(_choice(kind), rest),
    VALUES: _add_values,
    _UNION: lambda kind, rest: etree.SubElement(kind, f"{_XSD}union", {"memberTypes": rest}),
    "*": _set_choice,
    "^": _change_model,
    "-": _remove,
    "<": _define_anew,
    "~": lambda kind, rest: kind.set(rest, "true"),
    "?": _condition,
    "!": lambda kind, rest: etree.SubElement(_content(kind), f"{_XSD}assert", {"test": rest}),
    "=": _add_key,
    "": lambda kind, rest: None,
}
"""Makers of changes by the sign between the type and the rest of the line."""
