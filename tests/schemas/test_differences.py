"""XSDs made of an earlier version and a difference give the verdicts of the official ones.

The number of mutants is that of the environment variable XOSC_MUTANTS; 2,000 take about a minute.
"""

from __future__ import annotations

import copy
import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import pytest
import xmlschema
from lxml import etree

import xodr
from schemas import check
from schemas.registry import OPENDRIVE, OPENSCENARIO, SCHEMA_DIR, schema_for
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
    assert schema.difference is not None
    return etree.XMLSchema(schema.tree()), etree.XMLSchema(etree.parse(OFFICIAL))


@cache
def own() -> tuple[etree._ElementTree, ...]:
    """The documents of 1.4 among the tests."""
    paths = sorted(SCENARIOS.rglob("*.xosc"))
    return tuple(etree.parse(path) for path in paths if b'revMinor="4"' in path.read_bytes())


def stamped(paths: list[Path]) -> Iterator[etree._ElementTree]:
    """Documents with 1.4 in their headers."""
    for path in paths:
        try:
            tree = etree.parse(path)
        except etree.XMLSyntaxError:
            continue
        for header in tree.iter("FileHeader"):
            header.set("revMinor", "4")
        yield tree


def mutant(tree: etree._ElementTree, random: Random) -> etree._ElementTree:
    """A copy with up to three changes: elements grafted, doubled, removed or renamed, attributes set, dropped or added."""
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
                element.insert(random.randint(0, len(element)), etree.Element(child) if found is None else copy.deepcopy(found))
            case 4 if element.attrib:
                del element.attrib[random.choice(list(element.attrib))]
            case _ if declared and declared.attributes:
                name, kind = random.choice(list(declared.attributes.items()))
                element.set(name, standard.value_of(root, kind, random).replace("\x00", ""))
    return changed


def test_documents_of_1_4_are_valid_by_both(verdicts: tuple[etree.XMLSchema, etree.XMLSchema]) -> None:
    assert own()
    for tree in own():
        assert [schema.validate(tree) for schema in verdicts] == [True, True], tree.docinfo.URL


def test_public_files_stamped_1_4_have_the_same_verdict(verdicts: tuple[etree.XMLSchema, etree.XMLSchema], corpora: Path) -> None:
    paths = sorted([*corpora.rglob("*.xosc"), *(SHARED / "wild").rglob("*.xosc")])
    found = [
        [schema.validate(tree) for schema in verdicts] for tree in stamped(Random(14).sample(paths, min(PUBLIC, len(paths))))
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


def test_1_4_is_checked_without_any_official_file_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(SCHEMA_DIR, raising=False)
    text = (SCENARIOS / "LanePosition.xosc").read_text(encoding="utf-8").replace('revMinor="3"', 'revMinor="4"')
    path = tmp_path / "a.xosc"
    for layer, wrong in (("temporary", False), ("painted", True)):
        path.write_text(text.replace("<LanePosition ", f'<LanePosition layer="{layer}" ').replace('revMinor="2"', 'revMinor="4"'))
        messages = [each.message for each in check(path) if each.rule.endswith("valid_schema")]
        assert bool(messages) == wrong
        assert all("layer" in message for message in messages)


ROADS = SHARED / "standards"
ROAD_MUTANTS = MUTANTS // 10


@pytest.fixture(scope="module")
def road_schemas() -> Iterator[tuple[Any, Any]]:
    """Schemas of OpenDRIVE 1.9, XSD 1.1: the one made of 1.8, and the official one."""
    if not ROADS.is_dir():
        pytest.skip("the development folder shared/standards is not beside this checkout")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(SCHEMA_DIR, str(ROADS / "opendrive-schemas"))
        schema = schema_for(OPENDRIVE, (1, 9))
        assert schema is not None
        assert schema.difference is not None
        made = xmlschema.XMLSchema11(etree.tostring(schema.tree(), encoding="unicode"))
        yield made, xmlschema.XMLSchema11(str(ROADS / "opendrive-1.9.0" / "schema" / "OpenDRIVE_Core.xsd"))


@cache
def roads() -> tuple[etree._ElementTree, ...]:
    """Road networks as OpenDRIVE 1.9: with layers, objects of every kind that has an assertion, signals with semantics."""
    library = [etree.parse(path) for path in sorted((Path(xodr.__file__).parent / "library").glob("highway*.xodr"))]
    for tree in library:
        tree.getroot()[0].set("revMinor", "9")
    kinds = ("barrier", "building", "crosswalk", "gantry", "obstacle", "pole", "roadMark", "roadSurface", "tree", "vegetation")
    objects = "".join(
        f'<object id="{number}" type="{kind}" s="1" t="2" zOffset="0" radius="1"><repeat s="0" length="5" distance="1" tStart="0"'
        ' tEnd="0" heightStart="1" heightEnd="1" zOffsetStart="0" zOffsetEnd="0"/><outlines><outline id="0">'
        '<curveLocal hdg="0" height="1" length="2" u="0" v="0" z="0"><line/></curveLocal></outline></outlines></object>'
        for number, kind in enumerate(kinds)
    )
    layered = SOUND.replace("</lanes>\n</road>", f"</lanes>\n<objects>{objects}</objects></road>", 1)
    return (*library, etree.ElementTree(etree.fromstring(SOUND.encode())), etree.ElementTree(etree.fromstring(layered.encode())))


def test_road_networks_of_1_9_have_the_same_verdict(road_schemas: tuple[Any, Any]) -> None:
    made, official = road_schemas
    assert [made.is_valid(tree) for tree in roads()] == [official.is_valid(tree) for tree in roads()]
    assert made.is_valid(roads()[-2])


def test_mutants_of_road_networks_have_the_same_verdict(road_schemas: tuple[Any, Any]) -> None:
    made, official = road_schemas
    random = Random(1)
    verdicts = []
    for _ in range(ROAD_MUTANTS):
        tree = copy.deepcopy(random.choice(roads()[-2:]))
        elements = [each for each in tree.getroot().iter(etree.Element) if each.getparent() is not None]
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
