"""Changes of scenarios and roads by their XSD: what it declares in other numbers and places, with
other values and namespaces.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from functools import cache
from random import Random
from typing import NamedTuple

from lxml import etree

from schemas.versions.registry import available_schemas

XSD = "{http://www.w3.org/2001/XMLSchema}"
NUMBERS = (
    *(
        "NaN",
        "nan",
        "INF",
        "-INF",
        "Infinity",
        "1e400",
        "-1e400",
        "1e-400",
        "-0",
        "1e308",
        "5e-324",
        "9" * 400,
        "0" * 5000 + "1",
    ),
    *(
        "2147483648",
        "-2147483649",
        "4294967296",
        "18446744073709551616",
        "9007199254740993",
        "1e15",
        "-1",
        "0",
        "1e-9",
        "0x1p3",
    ),
)
FORGED = (
    *(
        "::error file=a::forged",
        "x\n::set-output name=a::b",
        "##[error]forged",
        "##vso[task.complete]",
        "\u2028::error::x",
    ),
    *(
        "=cmd|' /C calc'!A0",
        "+1+1",
        "-2+3",
        "@SUM(A1)",
        "\t=1+1",
        "x\r\n=1",
        "<script>alert(1)</script>",
        "]]>",
        "a\u202eb",
        "\x7f",
    ),
    *(
        "`$(touch x)`",
        "'; touch x; '",
        '"; rm -rf .; "',
        "../../x",
        "a/b",
        "CON",
        "%n%s",
        "{0}",
        "$",
        "${1+",
        "x" * 300,
    ),
)
"""Names that mean something to a CI service, a spreadsheet, a browser, a shell,
a file system or a terminal
"""
_FOREIGN = (
    "http://example.org/other",
    "relative/uri",
    "",
    "urn:x",
    "http://www.w3.org/2001/XMLSchema-instance",
)
_COUNTS = (1, 2, 20, 300, 2000)
_MANY = (50, 500, 3000)


class Declared(NamedTuple):
    """What schemas declare of elements of one name: types of attributes by name,
    and names of children.
    """

    attributes: dict[str, str]
    children: tuple[str, ...]


class Standard(NamedTuple):
    """Declarations of a standard's elements by name, and enumerated values by type."""

    elements: dict[str, Declared]
    words: dict[str, tuple[str, ...]]


@cache
def standard(root: str) -> Standard:
    """Declarations of the newest XSD at hand of documents with that root
    element; empty for another root.
    """
    schemas = [schema for schema in available_schemas() if schema.standard == root]
    if not schemas:
        return Standard({}, {})
    newest = schemas[-1]
    parts = {*newest.path.parent.glob("*.xsd")} - {newest.path} if root == "OpenDRIVE" else set()
    trees = [newest.tree(), *map(etree.parse, parts)]
    types, words = {}, {}
    for tree in sorted(trees, key=lambda tree: str(tree.docinfo.URL)):
        types |= {
            str(each.get("name")): each
            for tag in ("complexType", "group")
            for each in tree.iter(f"{XSD}{tag}")
        }
        for each in tree.iter(f"{XSD}simpleType"):
            words[str(each.get("name"))] = tuple(
                str(one.get("value")) for one in each.iter(f"{XSD}enumeration")
            )
    elements: dict[str, Declared] = {}
    for tree in trees:
        for each in tree.iter(f"{XSD}element"):
            if name := each.get("name"):
                known = elements.get(name, Declared({}, ()))
                attributes, children = _content(types, each.get("type"), each, 0)
                elements[name] = Declared(
                    known.attributes | attributes,
                    tuple(dict.fromkeys((*known.children, *children))),
                )
    return Standard(elements, {name: values for name, values in words.items() if values})


def _content(
    types: dict[str, etree._Element], name: str | None, own: etree._Element, depth: int
) -> tuple[dict[str, str], tuple[str, ...]]:
    """Attributes and children of a type by its name, or of an element that declares its own."""
    kind = types.get(name) if name else own
    if kind is None or depth > 5:
        return {}, ()
    attributes = {
        str(each.get("name")): str(each.get("type", ""))
        for each in kind.iter(f"{XSD}attribute")
        if each.get("name")
    }
    children = tuple(
        str(each.get("name"))
        for each in kind.iter(f"{XSD}element")
        if each.get("name") and each is not own
    )
    for reference in (*kind.iter(f"{XSD}extension"), *kind.iter(f"{XSD}group")):
        more, below = _content(types, reference.get("base") or reference.get("ref"), own, depth + 1)
        attributes, children = more | attributes, (*children, *below)
    return attributes, children


def _elements(root: etree._Element) -> list[etree._Element]:
    return list(root.iter(etree.Element))


def _name(element: etree._Element) -> str:
    return etree.QName(element).localname


def _declared(root: etree._Element, element: etree._Element) -> Declared:
    return standard(_name(root)).elements.get(_name(element), Declared({}, ()))


def value_of(root: etree._Element, kind: str, random: Random) -> str:
    """A value for an attribute of a type: mostly one of the type, at its limits or beyond them."""
    words = standard(_name(root)).words.get(kind)
    if words and random.random() < 0.7:
        word = random.choice(words)
        return random.choice((word, word, word.upper(), word[:-1], f" {word} "))
    if (
        kind.rpartition(":")[2]
        .lower()
        .startswith(("double", "int", "unsigned", "e_", "t_", "float", "decimal"))
    ):
        return (
            random.choice(NUMBERS)
            if random.random() < 0.5
            else repr(round(random.uniform(-1, 1) * 10 ** random.randint(-3, 6), 3))
        )
    return random.choice((*FORGED, "true", "1", "Ego", "$Ego", "2020-01-01T00:00:00", ""))


def _legal(text: str) -> str:
    return "".join(
        c
        for c in text
        if c in "\t\n\r" or (c >= " " and not "\ud800" <= c <= "\udfff" and c not in "\ufffe\uffff")
    )


# attributes -----------------------------------------------------------------------------------


def unknown_attributes(root: etree._Element, random: Random) -> str:
    """So many attributes that nothing declares."""
    element, count = random.choice(_elements(root)), random.choice(_COUNTS)
    for number in range(count):
        element.set(f"unknown{number}", "x")
    return f"{count} of {element.tag}"


def declared_attribute(root: etree._Element, random: Random) -> str:
    """An attribute that the XSD declares there, with a value of its type or nearly so."""
    element = random.choice(_elements(root))
    attributes = _declared(root, element).attributes
    if not attributes:
        return "nothing"
    name = random.choice(sorted(attributes))
    element.set(name, _legal(value_of(root, attributes[name], random)))
    return f"{element.tag}/@{name} = {element.get(name, '')[:40]!r}"


def extreme_number(root: etree._Element, random: Random) -> str:
    """A number that is none, or too great, in an attribute that has a number."""
    found = [
        (element, name)
        for element in _elements(root)
        for name, value in element.attrib.items()
        if _numeric(str(value))
    ]
    if not found:
        return "nothing"
    element, name = random.choice(found)
    element.set(name, random.choice(NUMBERS))
    return f"{element.tag}/@{name} = {element.get(name, '')[:30]}"


def _numeric(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def forged_name(root: etree._Element, random: Random) -> str:
    """A name, with all references to it, that means something to programs which get it."""
    named = [element for element in _elements(root) if element.get("name")]
    if not named:
        return "nothing"
    old, new = random.choice(named).get("name"), _legal(random.choice(FORGED))
    for element in _elements(root):
        for name, value in list(element.attrib.items()):
            if value == old:
                element.set(name, new)
    return f"{old!r} to {new[:40]!r}"


def doubled_name(root: etree._Element, random: Random) -> str:
    """Two things of one name, of any kinds; or an id twice."""
    key = random.choice(("name", "id", "name", "entityRef"))
    named = [element for element in _elements(root) if element.get(key)]
    if len(named) < 2:
        return "nothing"
    one, other = random.sample(named, 2)
    one.set(key, str(other.get(key)))
    return f"{one.tag} like {other.tag}: {one.get(key, '')[:40]!r}"


def crossed_reference(root: etree._Element, random: Random) -> str:
    """A reference to something there, of another kind or to its own element."""
    references = [
        (e, str(n))
        for e in _elements(root)
        for n in e.attrib
        if str(n).endswith(("Ref", "Id", "contactPoint", "Name"))
    ]
    names = [
        str(value) for e in _elements(root) for n, value in e.attrib.items() if n in ("name", "id")
    ]
    if not references or not names:
        return "nothing"
    element, name = random.choice(references)
    element.set(name, random.choice(names))
    return f"{element.tag}/@{name} = {element.get(name, '')[:40]!r}"


# elements -------------------------------------------------------------------------------------


def unknown_elements(root: etree._Element, random: Random) -> str:
    """So many elements that nothing declares."""
    element, count = random.choice(_elements(root)), random.choice(_COUNTS)
    for number in range(count):
        etree.SubElement(element, f"Unknown{number % 7}", a=str(number))
    return f"{count} in {element.tag}"


def declared_child(root: etree._Element, random: Random) -> str:
    """A child that the XSD declares there, with attributes and children of its
    own that it declares.
    """
    element = random.choice(_elements(root))
    children = _declared(root, element).children
    if not children:
        return "nothing"
    made = _made(root, random.choice(children), random, random.randint(0, 3))
    element.insert(random.randint(0, len(element)), made)
    return f"{made.tag} in {element.tag}"


def _made(root: etree._Element, name: str, random: Random, depth: int) -> etree._Element:
    element = etree.Element(name)
    declared = standard(_name(root)).elements.get(name, Declared({}, ()))
    for attribute, kind in declared.attributes.items():
        if random.random() < 0.9:
            element.set(attribute, _legal(value_of(root, kind, random)))
    if depth and declared.children:
        for child in random.sample(
            declared.children, min(len(declared.children), random.randint(0, 2))
        ):
            element.append(_made(root, child, random, depth - 1))
    return element


def wrong_parent(root: etree._Element, random: Random) -> str:
    """An element moved to where another one is declared."""
    element, place = random.choice(_elements(root)[1:] or [root]), random.choice(_elements(root))
    if element is root or element is place or element in place.iterancestors():
        return "nothing"
    place.insert(random.randint(0, len(place)), element)
    return f"{element.tag} into {place.tag}"


def nested(root: etree._Element, random: Random) -> str:
    """An element so many times inside itself."""
    element, depth = random.choice(_elements(root)), random.choice((2, 20, 120, 240, 400))
    inner = element
    for _ in range(depth):
        inner = etree.SubElement(inner, element.tag, dict(element.attrib))
    return f"{element.tag} {depth} times"


def enumeration(root: etree._Element, random: Random) -> str:
    """So many equal elements, or ones that differ in their numbers, names and ids."""
    leaves = [element for element in _elements(root)[1:] if len(element) < 4]
    if not leaves:
        return "nothing"
    element, count, same = random.choice(leaves), random.choice(_MANY), random.random() < 0.3
    parent, text = element.getparent(), etree.tostring(element, with_tail=False)
    assert parent is not None
    if len(text) * count > 2_000_000:
        count = 50
    for number in range(count):
        copy = deepcopy(element)
        copy.tail = None
        for name in () if same else ("id", "name", "value", "time", "s", "sOffset"):
            if name in copy.attrib:
                copy.set(name, str(number))
        parent.append(copy)
    return f"{count} {element.tag}"


def explosion(root: etree._Element, random: Random) -> str:
    """A range with as many values as there is no time for, where a distribution has one."""
    found = [
        element
        for element in _elements(root)
        if _name(element) in ("DistributionRange", "Range", "Bin")
    ]
    if not found:
        return extreme_number(root, random)
    element = random.choice(found)
    for name, value in (("stepWidth", "1e-9"), ("lowerLimit", "-1e9"), ("upperLimit", "1e9")):
        if name in element.attrib and random.random() < 0.8:
            element.set(name, value)
    return f"of {element.tag}"


def namespaces(root: etree._Element, random: Random) -> str:
    """An element, with all in it or alone, in another namespace; a foreign attribute."""
    element, uri = random.choice(_elements(root)), random.choice([uri for uri in _FOREIGN if uri])
    for each in _elements(element) if random.random() < 0.5 else [element]:
        each.tag = f"{{{uri}}}{_name(each)}"
    if random.random() < 0.4:
        element.set(f"{{{uri}}}{random.choice(('name', 'value', 'x'))}", "1")
    return f"{uri!r} of {element.tag}"


def long_value(root: etree._Element, random: Random) -> str:
    """A value as long as no one writes it."""
    element = random.choice([each for each in _elements(root) if each.attrib] or [root])
    name = str(random.choice(list(element.attrib) or ["x"]))
    size = random.choice((1000, 70_000, 400_000))
    element.set(name, random.choice(("x", "9", " ", "$a ", "${1+", "(", "1,")) * (size // 2))
    return f"{element.tag}/@{name}: {size}"


CHANGES: tuple[Callable[[etree._Element, Random], str], ...] = (
    *(
        unknown_attributes,
        declared_attribute,
        declared_attribute,
        declared_attribute,
        extreme_number,
        extreme_number,
    ),
    *(
        forged_name,
        doubled_name,
        crossed_reference,
        unknown_elements,
        declared_child,
        declared_child,
        declared_child,
    ),
    *(wrong_parent, nested, enumeration, explosion, namespaces, long_value),
)
"""Changes of a document's tree"""


# what no tree can hold ------------------------------------------------------------------------


def _inside_tags(data: bytes, random: Random, text: bytes) -> bytes:
    """Text put behind the name of one of the elements."""
    places = [
        at
        for at in range(len(data))
        if data[at : at + 1] == b"<" and data[at + 1 : at + 2].isalpha()
    ]
    if not places:
        return data
    at = random.choice(places) + 1
    while at < len(data) and (data[at : at + 1].isalnum() or data[at] in b"_:-."):
        at += 1
    return data[:at] + text + data[at:]


def doubled_attributes(data: bytes, random: Random) -> bytes:
    """Attributes that are there twice, with one value or two."""
    count = random.choice((1, 1, 50, 2000))
    return _inside_tags(data, random, b' name="a" name="%s"' % random.choice((b"a", b"b")) * count)


def declared_namespaces(data: bytes, random: Random) -> bytes:
    """Namespaces declared: relative, empty, doubled, by the prefix of XML itself."""
    uri = random.choice(_FOREIGN).encode()
    declared = random.choice(
        (
            b' xmlns="%s"',
            b' xmlns:x="%s"',
            b' xmlns:xml="%s"',
            b' xmlns:x="%s" x:name="a" y:name="b"',
        )
    )
    return _inside_tags(data, random, declared % uri)


def forbidden_characters(data: bytes, random: Random) -> bytes:
    """Characters that XML does not have, as themselves or by number."""
    what = random.choice(
        (
            b"\x00",
            b"\x1b[31m",
            b"\x08",
            b"&#0;",
            b"&#x1b;",
            b"&#xD800;",
            b"&#x110000;",
            b"\xff\xfe",
            b"\xed\xa0\x80",
        )
    )
    at = data.find(b'="', random.randrange(len(data) + 1))
    return data[: at + 2] + what + data[at + 2 :] if at >= 0 else what + data


TEXT_CHANGES: tuple[Callable[[bytes, Random], bytes], ...] = (
    doubled_attributes,
    declared_namespaces,
    forbidden_characters,
)
"""Changes of a document's bytes"""
