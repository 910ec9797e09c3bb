"""XSDs made of an earlier version and differences give the verdicts of the official ones.

The number of mutants is that of the environment variable XOSC_MUTANTS; 2,000 take about a minute.
"""

from __future__ import annotations

import copy
import os
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import pytest
import xmlschema
from lxml import etree

import xodr
from schemas import check
from schemas.versions.registry import OPENDRIVE, OPENSCENARIO, SCHEMA_DIR, schema_for
from tests.conftest import SHARED
from tests.fuzz import standard
from tests.schemas.test_road_rules import SOUND

MUTANTS = int(os.environ.get("XOSC_MUTANTS", "200"))
PUBLIC = MUTANTS // 4
"""Number of public files that are stamped 1.4."""
OFFICIAL = SHARED / "standards" / "openscenario-xml-1.4.0" / "OpenSCENARIO.xsd"
SCENARIOS = Path(__file__).parents[1] / "conformance" / "scenarios"


@pytest.fixture
def verdicts(monkeypatch: pytest.MonkeyPatch) -> tuple[etree.XMLSchema, etree.XMLSchema]:
    """Schemas of 1.4: the one made here, and the official one."""
    if not OFFICIAL.is_file():
        pytest.skip("the development folder shared/standards is not beside this checkout")
    monkeypatch.delenv(SCHEMA_DIR, raising=False)
    schema = schema_for(OPENSCENARIO, (1, 4))
    assert schema is not None
    assert schema.differences
    return etree.XMLSchema(schema.tree()), etree.XMLSchema(etree.parse(OFFICIAL))


@cache
def own() -> tuple[etree._ElementTree, ...]:
    """The documents of 1.4 among the tests."""
    paths = sorted(SCENARIOS.rglob("*.xosc"))
    return tuple(etree.parse(path) for path in paths if b'revMinor="4"' in path.read_bytes())


def read(paths: list[Path]) -> Iterator[etree._ElementTree]:
    """Documents of those files that are well-formed."""
    for path in paths:
        with suppress(etree.XMLSyntaxError):
            yield etree.parse(path)


def stamped(trees: Iterable[etree._ElementTree], minor: int) -> Iterator[etree._ElementTree]:
    """Copies of documents with that minor version in their headers."""
    for tree in trees:
        changed = copy.deepcopy(tree)
        for header in changed.iter("FileHeader", "header"):
            header.set("revMinor", str(minor))
        yield changed


def without_layers(tree: etree._ElementTree) -> etree._ElementTree:
    """A road network without lanes and attributes of temporary layers, as 1.8 has none."""
    for lanes in list(tree.iter("lanes")):
        if lanes.get("layer") == "temporary":
            parent = lanes.getparent()
            assert parent is not None
            parent.remove(lanes)
    for element in tree.iter(etree.Element):
        for name in ("layer", "fromLayer", "toLayer"):
            element.attrib.pop(name, None)
    return tree


def mutant(tree: etree._ElementTree, random: Random) -> etree._ElementTree:
    """A copy with up to three changes: elements grafted, doubled, removed or
    renamed, attributes set, dropped or added.
    """
    changed = copy.deepcopy(tree)
    root = changed.getroot()
    known = standard.standard(OPENSCENARIO)
    for _ in range(random.choice((1, 1, 2, 3))):
        element = random.choice([each for each in root.iter(etree.Element) if each is not root])
        declared = known.elements.get(str(element.tag))
        parent = element.getparent()
        assert parent is not None
        match random.randrange(6):
            case 0:
                parent.remove(element)
            case 1:
                element.addnext(copy.deepcopy(element))
            case 2:
                element.tag = random.choice(list(known.elements))
            case 3 if declared and declared.children:
                child = random.choice(declared.children)
                found = next((each for other in own() for each in other.iter(child)), None)
                element.insert(
                    random.randint(0, len(element)),
                    etree.Element(child) if found is None else copy.deepcopy(found),
                )
            case 4 if element.attrib:
                del element.attrib[random.choice(list(element.attrib))]
            case _ if declared and declared.attributes:
                name, kind = random.choice(list(declared.attributes.items()))
                element.set(name, standard.value_of(root, kind, random).replace("\x00", ""))
    return changed


def test_documents_of_1_4_are_valid_by_both(
    verdicts: tuple[etree.XMLSchema, etree.XMLSchema],
) -> None:
    assert own()
    for tree in own():
        assert [schema.validate(tree) for schema in verdicts] == [True, True], tree.docinfo.URL


def test_public_files_stamped_1_4_have_the_same_verdict(
    verdicts: tuple[etree.XMLSchema, etree.XMLSchema], corpora: Path
) -> None:
    paths = sorted([*corpora.rglob("*.xosc"), *(SHARED / "wild").rglob("*.xosc")])
    found = [
        [schema.validate(tree) for schema in verdicts]
        for tree in stamped(read(Random(14).sample(paths, min(PUBLIC, len(paths)))), 4)
    ]
    assert [made for made, _ in found] == [official for _, official in found]
    assert {made for made, _ in found} == {True, False}


def test_mutants_have_the_same_verdict(verdicts: tuple[etree.XMLSchema, etree.XMLSchema]) -> None:
    random = Random(1400)
    valid = 0
    for number in range(MUTANTS):
        tree = mutant(random.choice(own()), random)
        made, official = (schema.validate(tree) for schema in verdicts)
        assert made == official, f"mutant {number}: {etree.tostring(tree).decode()}"
        valid += made
    assert 0.05 * MUTANTS < valid < 0.95 * MUTANTS


def test_1_4_is_checked_without_any_official_file_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(SCHEMA_DIR, raising=False)
    text = (
        (SCENARIOS / "LanePosition.xosc")
        .read_text(encoding="utf-8")
        .replace('revMinor="3"', 'revMinor="4"')
    )
    path = tmp_path / "a.xosc"
    for layer, wrong in (("temporary", False), ("painted", True)):
        path.write_text(
            text.replace("<LanePosition ", f'<LanePosition layer="{layer}" ').replace(
                'revMinor="2"', 'revMinor="4"'
            )
        )
        messages = [each.message for each in check(path) if each.rule.endswith("valid_schema")]
        assert bool(messages) == wrong
        assert all("layer" in message for message in messages)


STANDARDS = SHARED / "standards"
ROAD_MUTANTS = MUTANTS // 10
ROAD_XSDS = {
    8: STANDARDS / "opendrive-schemas" / "1.8.0",
    9: STANDARDS / "opendrive-1.9.0" / "schema",
}


@pytest.fixture(scope="module", params=[8, 9])
def road_schemas(request: pytest.FixtureRequest) -> Iterator[tuple[int, Any, Any]]:
    """Minor version and schemas of OpenDRIVE, XSD 1.1: the one made of the 1.7 that a dependency
    brings, and the official one.
    """
    if not STANDARDS.is_dir():
        pytest.skip("the development folder shared/standards is not beside this checkout")
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv(SCHEMA_DIR, raising=False)
        schema = schema_for(OPENDRIVE, (1, request.param))
        assert schema is not None
        assert schema.path.name == "opendrive_17_core.xsd"
        made = xmlschema.XMLSchema11(etree.tostring(schema.tree(), encoding="unicode"))
        yield (
            request.param,
            made,
            xmlschema.XMLSchema11(str(ROAD_XSDS[request.param] / "OpenDRIVE_Core.xsd")),
        )


@cache
def roads() -> tuple[etree._ElementTree, ...]:
    """Road networks as OpenDRIVE 1.9: with layers, objects of every kind that
    has an assertion, signals with semantics.
    """
    library = [
        etree.parse(path)
        for path in sorted((Path(xodr.__file__).parent / "library").glob("highway*.xodr"))
    ]
    for tree in library:
        tree.getroot()[0].set("revMinor", "9")
    kinds = (
        "barrier",
        "building",
        "crosswalk",
        "gantry",
        "obstacle",
        "pole",
        "roadMark",
        "roadSurface",
        "tree",
        "vegetation",
    )
    objects = "".join(
        f'<object id="{number}" type="{kind}" s="1" t="2" zOffset="0" radius="1"><repeat s="0" '
        'length="5" distance="1" tStart="0"'
        ' tEnd="0" heightStart="1" heightEnd="1" zOffsetStart="0" '
        'zOffsetEnd="0"/><outlines><outline id="0">'
        '<curveLocal hdg="0" height="1" length="2" u="0" v="0" '
        'z="0"><line/></curveLocal></outline></outlines></object>'
        for number, kind in enumerate(kinds)
    )
    layered = SOUND.replace(
        "</lanes>\n</road>", f"</lanes>\n<objects>{objects}</objects></road>", 1
    )
    return (
        *library,
        etree.ElementTree(etree.fromstring(SOUND.encode())),
        etree.ElementTree(etree.fromstring(layered.encode())),
    )


@pytest.mark.slow
def test_road_networks_have_the_same_verdict(road_schemas: tuple[int, Any, Any]) -> None:
    minor, made, official = road_schemas
    verdicts = [made.is_valid(tree) for tree in stamped(roads(), minor)]
    assert verdicts == [official.is_valid(tree) for tree in stamped(roads(), minor)]
    assert verdicts[-2] == (minor == 9)


@pytest.mark.slow
def test_mutants_of_road_networks_have_the_same_verdict(road_schemas: tuple[int, Any, Any]) -> None:
    minor, made, official = road_schemas
    random = Random(1)
    bases = list(stamped(roads()[-2:], minor))
    if minor == 8:
        bases = [without_layers(tree) for tree in bases]
    verdicts = []
    for _ in range(ROAD_MUTANTS):
        tree = copy.deepcopy(random.choice(bases))
        elements = [
            each for each in tree.getroot().iter(etree.Element) if each.getparent() is not None
        ]
        element, other = random.choice(elements), random.choice(elements)
        parent = element.getparent()
        assert parent is not None
        match random.randrange(4):
            case 0:
                parent.remove(element)
            case 1:
                element.addnext(copy.deepcopy(element))
            case 2:
                element.attrib.update(dict(other.attrib))
            case _:
                element.append(copy.deepcopy(other))
        verdicts.append((made.is_valid(tree), official.is_valid(tree)))
    assert [pair for pair in verdicts if pair[0] != pair[1]] == []
    assert {pair[0] for pair in verdicts} == {True, False}


XSD = "{http://www.w3.org/2001/XMLSchema}"
UNUSED = {"t_junction_grid_position_list"}
"""Types that 1.8 declares and uses nowhere."""


def test_1_8_declares_what_the_official_schema_declares(monkeypatch: pytest.MonkeyPatch) -> None:
    if not STANDARDS.is_dir():
        pytest.skip("the development folder shared/standards is not beside this checkout")
    monkeypatch.delenv(SCHEMA_DIR, raising=False)
    schema = schema_for(OPENDRIVE, (1, 8))
    assert schema is not None
    made = declared(schema.tree().getroot())
    official: dict[str, object] = {}
    for path in sorted(ROAD_XSDS[8].glob("*.xsd")):
        official |= declared(etree.parse(path).getroot())
    assert len(official) > 200
    assert {name: made.get(name) for name in official.keys() - UNUSED} == {
        name: official[name] for name in official.keys() - UNUSED
    }


def declared(root: etree._Element) -> dict[str, object]:
    """Content of the named types and of the root element, by name, the same in
    any order of attributes and values.
    """
    found: dict[str, object] = {}
    for element in root:
        name = str(element.get("name"))
        if element.tag == f"{XSD}complexType":
            found[name] = content(element)
        elif element.tag == f"{XSD}simpleType":
            values = sorted(str(each.get("value")) for each in element.iter(f"{XSD}enumeration"))
            found[name] = values, [each.get("memberTypes") for each in element.iter(f"{XSD}union")]
        elif name == OPENDRIVE:
            kind = element.find(f"{XSD}complexType")
            assert kind is not None
            found[name] = content(kind), keys(element)
    return found


def content(kind: etree._Element) -> object:
    """Base, children in order, attributes and assertions of a type."""
    extension = kind.find(f"{XSD}complexContent/{XSD}extension")
    holder = kind if extension is None else extension
    base = (
        None
        if extension is None or extension.get("base") == "_OpenDriveElement"
        else extension.get("base")
    )
    attributes = sorted(
        tuple(each.get(name) or "" for name in ("name", "type", "use", "fixed"))
        for each in holder.iter(f"{XSD}attribute")
    )
    required = [each for each in attributes if each[2] == "required"]
    tests = sorted(str(each.get("test")) for each in holder.iterchildren(f"{XSD}assert"))
    models = [model for each in holder.iterchildren(f"{XSD}sequence") if (model := particles(each))]
    return base, kind.get("abstract"), models, [each[:2] for each in attributes], required, tests


def particles(model: etree._Element) -> list[object]:
    """Children of a sequence or choice with their occurrences, types and conditional types."""
    found: list[object] = []
    for each in model.iterchildren(
        f"{XSD}element", f"{XSD}group", f"{XSD}choice", f"{XSD}sequence"
    ):
        conditions = [
            (other.get("test"), other.get("type"))
            for other in each.iterchildren(f"{XSD}alternative")
        ]
        times = each.get("minOccurs", "1"), each.get("maxOccurs", "1")
        found.append(
            (
                each.tag,
                each.get("name") or each.get("ref"),
                each.get("type"),
                times,
                conditions,
                keys(each),
                particles(each),
            )
        )
    return found


def keys(element: etree._Element) -> set[tuple[str | None, ...]]:
    """Keys and references to keys that an element declares, but those that can select nothing."""
    found = set()
    for each in element.iterchildren(f"{XSD}key", f"{XSD}keyref"):
        selector, field = each.find(f"{XSD}selector"), each.find(f"{XSD}field")
        assert selector is not None and field is not None
        if not (element.get("name") == OPENDRIVE and selector.get("xpath") == "connection"):
            found.add((selector.get("xpath"), field.get("xpath"), each.get("refer")))
    return found
