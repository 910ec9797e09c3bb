"""A seeded mutator of scenario files: what a careless or hostile author might write, in the
scenario or in what it refers to.

The same source, seed and number give the same mutant. A mutant is written with everything that its
scenario refers to, in the same arrangement, so that its references lead where they led.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from random import Random
from typing import NamedTuple

from lxml import etree

from tests.fuzz import standard

REPOSITORY = Path(__file__).parents[1]
OWN_SCENARIOS = (
    REPOSITORY / "xosc" / "library",
    REPOSITORY / "tests" / "conformance" / "scenarios",
)

NUMBERS = (
    "-1",
    "0",
    "1",
    "1e308",
    "-1e308",
    "1e-320",
    "1e9",
    "-1e18",
    "0.5",
    "3.14159",
    "2147483648",
    "255",
)
VALUES = (
    *NUMBERS,
    *("NaN", "INF", "-INF", "9" * 400, "0x10", "1,5", "٣"),
    *(
        "",
        " ",
        "x" * 20000,
        "noSuchWord",
        "true",
        "$Nothing",
        "$",
        "${",
        "${1/0}",
        "${10**10**10}",
        "${$Nothing + 1}",
    ),
    *(
        "../../../../../../etc/passwd",
        "/dev/zero",
        "file:///etc/passwd",
        ".",
        "a\n\tb",
        "\x7f\u202e\ufffd",
        "%s%n{0}",
    ),
)
BOMB = (
    '<!DOCTYPE a [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c '
    '"&b;&b;&b;&b;&b;&b;&b;&b;">]>'
)
EXTERNAL = '<!DOCTYPE a [<!ENTITY c SYSTEM "file:///etc/passwd">]>'


class Source(NamedTuple):
    """A scenario file or parameter value distribution, and the files that it
    refers to, directly or not (itself first).
    """

    path: Path
    files: tuple[Path, ...]


class Mutant(NamedTuple):
    """Where a mutant was written, and what was changed in words."""

    path: Path
    changes: tuple[str, ...]


# sources --------------------------------------------------------------------------------------


def sources(folders: Iterable[Path]) -> list[Source]:
    """All scenarios and distributions below folders; catalogues are mutated with
    the scenarios that use them.
    """
    paths = [path for folder in folders for path in sorted(folder.rglob("*.xosc"))]
    return [
        Source(path, tuple(_closure(path)))
        for path in paths
        if etree.parse(path).find("Catalog") is None
    ]


def _closure(path: Path) -> Iterator[Path]:
    waiting, seen = [path.resolve()], {path.resolve()}
    while waiting:
        yield (current := waiting.pop(0))
        if current.suffix == ".xosc":
            found = set(_references(current)) - seen
            waiting += sorted(found)
            seen |= found


def _references(path: Path) -> Iterator[Path]:
    """Files that any attribute names, and the catalogues in directories that one names."""
    for value in {
        str(value)
        for element in etree.parse(path).iter(etree.Element)
        for value in element.attrib.values()
    }:
        if "/" in value or "." in value:
            target = (path.parent / value).resolve()
            if target.suffix in (".xosc", ".xodr") and target.is_file():
                yield target
            elif "/" in value and target.is_dir():
                yield from target.glob("*.xosc")


# mutants --------------------------------------------------------------------------------------


def write_mutant(source: Source, folder: Path, random: Random) -> Mutant:
    """Write a mutant into a new folder: up to three changes to one of the
    source's files, mostly the scenario itself.
    """
    base = Path(os.path.commonpath([path.parent for path in source.files]))
    for path in source.files:
        target = folder / path.relative_to(base)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, target)
    victim = source.files[0] if random.random() < 0.65 else random.choice(source.files)
    target = folder / victim.relative_to(base)
    changes = tuple(f"{victim.name}: {change}" for change in mutate(target, random))
    return Mutant(folder / source.files[0].relative_to(base), changes)


def mutate(path: Path, random: Random) -> Iterator[str]:
    """Change an XML file, up to three times; in words, how."""
    families = (_NUMBER_CHANGES, _TREE_CHANGES, _STANDARD_CHANGES, _TEXT_CHANGES, _FILE_CHANGES)
    family = random.choices(families, (20, 25, 35, 15, 5))[0]
    for _ in range(
        random.choice((1, 1, 2, 3)) if family not in (_TEXT_CHANGES, _FILE_CHANGES) else 1
    ):
        change = random.choice(family)
        yield f"{change.__name__.strip('_')} {change(path, random)}"


def _elements(root: etree._Element) -> list[etree._Element]:
    return list(root.iter(etree.Element))


def _on_text(change: Callable[[bytes, Random], bytes]) -> Callable[[Path, Random], str]:
    """A change of a document's bytes as a change of its file."""

    def changed(path: Path, random: Random) -> str:
        path.write_bytes(change(path.read_bytes(), random))
        return "in the text"

    changed.__name__ = change.__name__
    return changed


def _on_tree(change: Callable[[etree._Element, Random], str]) -> Callable[[Path, Random], str]:
    """A change of a document's tree as a change of its file."""

    def changed(path: Path, random: Random) -> str:
        tree = etree.parse(path, etree.XMLParser(huge_tree=True))
        words = change(tree.getroot(), random)
        tree.write(path, encoding="UTF-8", xml_declaration=True)
        return words

    changed.__name__ = change.__name__
    return changed


# changes of the tree --------------------------------------------------------------------------


def _delete(root: etree._Element, random: Random) -> str:
    element = random.choice(_elements(root)[1:] or [root])
    parent = element.getparent()
    if parent is not None:
        parent.remove(element)
    return element.tag


def _duplicate(root: etree._Element, random: Random) -> str:
    element = random.choice(_elements(root)[1:] or [root])
    element.addnext(_copy(element))
    return element.tag


def _graft(root: etree._Element, random: Random) -> str:
    """Put a copy of an element where it may not belong."""
    element, place = random.choice(_elements(root)), random.choice(_elements(root))
    place.insert(random.randint(0, len(place)), _copy(element))
    return f"{element.tag} into {place.tag}"


def _swap(root: etree._Element, random: Random) -> str:
    first, others = random.choice(_elements(root)), _elements(root)
    second = random.choice(
        [other for other in others if other.tag == first.tag] if random.random() < 0.7 else others
    )
    if (
        first in list(second.iterancestors())
        or second in list(first.iterancestors())
        or first is second
    ):
        return "nothing"
    holder = etree.Element("holder")
    for old, new in ((first, holder), (second, first), (holder, second)):
        parent = old.getparent()
        assert parent is not None
        parent.replace(old, new)
    return f"{first.tag} and {second.tag}"


def _empty(root: etree._Element, random: Random) -> str:
    element = random.choice(_elements(root)[1:] or [root])
    for child in list(element):
        element.remove(child)
    return element.tag


def _rename(root: etree._Element, random: Random) -> str:
    element, old = random.choice(_elements(root)), random.choice(_elements(root)).tag
    words = f"{element.tag} to {old}"
    element.tag = random.choice((old, "noSuchElement"))
    return words


def _drop_attribute(root: etree._Element, random: Random) -> str:
    element, name = _attribute(root, random)
    element.attrib.pop(name, "")
    return f"{element.tag}/@{name}"


def _set_attribute(root: etree._Element, random: Random) -> str:
    element, name = _attribute(root, random)
    value = random.choice(VALUES)
    element.set(name, "".join(c for c in value if c.isprintable() or c in "\n\t\u202e"))
    return f"{element.tag}/@{name} = {value[:40]!r}"


def _set_number(root: etree._Element, random: Random) -> str:
    element, name = _attribute(root, random, numeric=True)
    element.set(name, random.choice(NUMBERS))
    return f"{element.tag}/@{name} = {element.get(name)}"


def _exchange_values(root: etree._Element, random: Random) -> str:
    """Give an attribute the value of another one: references to the wrong kind
    of thing, words for numbers.
    """
    (element, name), (other, source) = _attribute(root, random), _attribute(root, random)
    element.set(name, other.get(source, ""))
    return f"{element.tag}/@{name} = {other.get(source, '')[:40]!r}"


def _scale(root: etree._Element, random: Random) -> str:
    """Make a number a large, small, negative or cyclic one of its kind."""
    element, name = _attribute(root, random, numeric=True)
    value = random.choice(("-", "1e3*", "1e-6*", "1e12*", "0*"))
    old = element.get(name, "")
    element.set(name, f"-{old}" if value == "-" else _times(value[:-1], old))
    return f"{element.tag}/@{name} {old[:20]} to {element.get(name)}"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _times(factor: str, value: str) -> str:
    try:
        return repr(float(factor) * float(value))
    except ValueError:
        return factor


def _refer_to_nothing(root: etree._Element, random: Random) -> str:
    element, name = _attribute(root, random, ending=("Ref", "Name", "Id", "path", "id"))
    element.set(name, "nobody")
    return f"{element.tag}/@{name}"


def _parameter_cycle(root: etree._Element, random: Random) -> str:
    """Declare parameters by each other."""
    first, second = (f"cycle{random.randint(0, 9)}" for _ in range(2))
    place = root.find("ParameterDeclarations")
    if place is None:
        place = etree.SubElement(root, "ParameterDeclarations")
    for name, other in ((first, second), (second, first)):
        etree.SubElement(
            place,
            "ParameterDeclaration",
            name=name,
            parameterType="double",
            value=f"${{2 * ${other}}}",
        )
    element, name = _attribute(root, random)
    element.set(name, f"${first}")
    return f"in {element.tag}/@{name}"


def _catalogue_cycle(root: etree._Element, random: Random) -> str:
    """Let a catalogue's entry hold a reference to itself; in a scenario, let one
    element refer to a wrong entry.
    """
    references = [e for e in _elements(root) if e.tag == "CatalogReference"]
    catalogue = root.find("Catalog")
    if catalogue is not None and len(catalogue):
        entry = random.choice(list(catalogue.iterchildren(etree.Element)))
        place = random.choice(_elements(entry))
        names = {"catalogName": catalogue.get("name", ""), "entryName": entry.get("name", "")}
        etree.SubElement(place, "CatalogReference", names)
        return f"{entry.get('name')} in its own {place.tag}"
    if references:
        random.choice(references).set("entryName", random.choice(references).get("entryName", ""))
    return "among references"


def _copy(element: etree._Element) -> etree._Element:
    copied = etree.fromstring(etree.tostring(element, with_tail=False))
    copied.tail = element.tail
    return copied


def _attribute(
    root: etree._Element, random: Random, numeric: bool = False, ending: tuple[str, ...] = ("",)
) -> tuple[etree._Element, str]:
    found = [
        (element, name)
        for element in _elements(root)
        for name, value in ((str(name), str(value)) for name, value in element.attrib.items())
        if name.endswith(ending) and (not numeric or _is_number(value))
    ]
    return random.choice(found) if found else (root, "noSuchAttribute")


# changes of the text --------------------------------------------------------------------------


def _truncate(path: Path, random: Random) -> str:
    data = path.read_bytes()
    path.write_bytes(data[: random.randrange(len(data) + 1)])
    return f"at {path.stat().st_size} of {len(data)}"


def _flip_bytes(path: Path, random: Random) -> str:
    data = bytearray(path.read_bytes())
    for _ in range(random.choice((1, 3, 30)) if data else 0):
        data[random.randrange(len(data))] ^= 1 << random.randrange(8)
    path.write_bytes(data)
    return "here and there"


def _repeat_text(path: Path, random: Random) -> str:
    data = path.read_bytes()
    start, end = sorted(random.randrange(len(data) + 1) for _ in range(2))
    path.write_bytes(data[:end] + data[start:])
    return f"{start} to {end}"


def _lie_about_encoding(path: Path, random: Random) -> str:
    name = random.choice(("UTF-16", "UTF-32", "EBCDIC-CP-US", "no-such-code", "ascii", "UTF-7"))
    body = path.read_bytes().partition(b"?>")[2].replace(b"a", "ä".encode(), 3)
    path.write_bytes(f'<?xml version="1.0" encoding="{name}"?>'.encode() + body)
    return name


def _attack_with_entities(path: Path, random: Random) -> str:
    body = path.read_bytes().partition(b"?>")[2].replace(b'="', b'="&c;', 1)
    path.write_bytes(random.choice((BOMB, EXTERNAL)).encode() + body)
    return "in the first attribute"


def _nest_deeply(path: Path, random: Random) -> str:
    depth = random.choice((200, 300, 5000))
    root = etree.parse(path).getroot()
    inner = b"".join(etree.tostring(child) for child in root)
    tag = random.choice(_elements(root)).tag.encode()
    open_tag = etree.tostring(root).partition(b">")[0] + b">"
    path.write_bytes(
        open_tag
        + b"<%s>" % tag * depth
        + inner
        + b"</%s>" % tag * depth
        + f"</{root.tag}>".encode()
    )
    return f"{depth} times"


# changes of files -----------------------------------------------------------------------------


def _remove(path: Path, random: Random) -> str:
    path.unlink()
    return "the file"


def _make_folder(path: Path, random: Random) -> str:
    path.unlink()
    path.mkdir()
    return "of it"


def _clear(path: Path, random: Random) -> str:
    path.write_bytes(random.choice((b"", b"\n\n", b"\0" * 1000, random.randbytes(2000))))
    return "the file"


def _exchange_file(path: Path, random: Random) -> str:
    """Put a file of another kind in the place of one."""
    other = random.choice(
        sorted(p for p in path.parent.parent.rglob("*.xo*") if p.is_file()) or [path]
    )
    if other != path:
        shutil.copyfile(other, path)
    return f"for {other.name}"


_Changes = tuple[Callable[[Path, Random], str], ...]

_VALUE_CHANGES = (
    _drop_attribute,
    _set_attribute,
    _set_attribute,
    _exchange_values,
    _refer_to_nothing,
)
_STRUCTURE_CHANGES = (
    _delete,
    _duplicate,
    _graft,
    _swap,
    _empty,
    _rename,
    _parameter_cycle,
    _catalogue_cycle,
)
_NUMBER_CHANGES: _Changes = tuple(_on_tree(change) for change in (_set_number, _set_number, _scale))
_TREE_CHANGES: _Changes = tuple(
    _on_tree(change) for change in (*_VALUE_CHANGES, *_STRUCTURE_CHANGES)
)
_STANDARD_CHANGES: _Changes = tuple(_on_tree(change) for change in standard.CHANGES)
_TEXT_CHANGES: _Changes = (
    *(
        _truncate,
        _flip_bytes,
        _repeat_text,
        _lie_about_encoding,
        _attack_with_entities,
        _nest_deeply,
    ),
    *(_on_text(change) for change in standard.TEXT_CHANGES),
)
_FILE_CHANGES: _Changes = (_remove, _make_folder, _clear, _exchange_file)
