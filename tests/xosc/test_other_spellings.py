"""Files that say one thing in other words: prefixes, arithmetic, values of
roads, catalogues of one name.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from lxml import etree

import runner
from schemas.common.errors import InvalidFile
from schemas.expressions.values import number
from tests.runner.files import car, scenario
from xodr.reader.repairs import repair
from xosc.document import load


@pytest.mark.parametrize(
    ("text", "hint"),
    [("10/3.6", "${10/3.6}"), ("$v/3.6", "${$v/3.6}"), ("(1+2)*3", "${(1+2)*3}"), ("50km/h", "")],
)
def test_arithmetic_outside_an_expression_is_refused_with_the_spelling_that_works(
    text: str, hint: str
) -> None:
    with pytest.raises(ValueError, match="is not a number") as refused:
        number(text)
    assert hint in str(refused.value) and ("${" in str(refused.value)) == bool(hint)


def test_an_undeclared_prefix_is_declared_with_a_remark(tmp_path: Path) -> None:
    path = scenario(tmp_path)
    text = path.read_text(encoding="utf-8")
    path.write_text(
        text.replace("<OpenSCENARIO>", '<OpenSCENARIO xsi:noNamespaceSchemaLocation="a.xsd">')
    )
    (remark,) = [each for each in load(path).remarks if "prefix" in each.message]
    assert remark.line == 2 and "'xsi' is not declared" in remark.message
    with pytest.raises(InvalidFile, match="prefix"):
        load(path, strict=True)


def test_a_file_of_openscenario_dsl_is_called_so(tmp_path: Path) -> None:
    path = tmp_path / "a.osc"
    path.write_text(
        "import osc.standard\nscenario top:\n    do serial:\n        wait elapsed(3s)\n"
    )
    with pytest.raises(InvalidFile, match="this is OpenSCENARIO DSL"):
        load(path)


def test_a_rule_and_a_direction_in_other_words_are_read() -> None:
    road = etree.fromstring(
        '<OpenDRIVE><header revMajor="1" revMinor="8"/><road id="1" length="10" junction="-1" '
        'rule="left">'
        '<planView><geometry s="0" x="0" y="0" hdg="0" length="10"><line/></geometry></planView>'
        '<lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>'
        '<lane id="-1" type="driving" direction="backward"><width sOffset="0" a="3" b="0" c="0" '
        'd="0"/></lane>'
        "</right></laneSection></lanes></road></OpenDRIVE>"
    )
    messages = [remark.message for remark in repair(road, "a.xodr")]
    assert road.find("road").get("rule") == "LHT"
    assert (
        next(lane for lane in road.iter("lane") if lane.get("id") == "-1").get("direction")
        == "reversed"
    )
    assert len([message for message in messages if "is meant" in message]) == 2


CATALOG = (
    '<OpenSCENARIO><FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" author="" '
    'description=""/><Catalog name="VehicleCatalog">{}</Catalog></OpenSCENARIO>'
)
ENVIRONMENT = '<Environment name="sunny"/>'


def test_an_entry_is_looked_for_in_every_catalogue_of_that_name(tmp_path: Path) -> None:
    """A folder of environments whose catalogue has that name, too, hid all vehicles."""
    vehicle = (
        car("Ego").split('<ScenarioObject name="Ego">')[1].split("</ScenarioObject>")[0].strip()
    )
    folders = [tmp_path / name for name in ("environments", "vehicles", "again")]
    for folder, entry in zip(folders, (ENVIRONMENT, vehicle, vehicle), strict=True):
        folder.mkdir()
        (folder / "catalog.xosc").write_text(CATALOG.format(entry))
    reference = '<CatalogReference catalogName="VehicleCatalog" entryName="car"/>'
    entities = [
        f'<ScenarioObject name="{name}">{reference}</ScenarioObject>' for name in ("Ego", "Lead")
    ]
    path = scenario(tmp_path, entities=entities, stop=0.1)
    located = (
        "<CatalogLocations><VehicleCatalog><Directory "
        'path="nowhere"/></VehicleCatalog></CatalogLocations>'
    )
    path.write_text(path.read_text().replace("<CatalogLocations/>", located))
    options = {"sut": None, "world": "kinematic"}
    result = runner.run(path, catalog_path=tuple(map(str, folders[:2])), **options)
    assert not any("has the name, too" in remark for remark in result.remarks)
    both = runner.run(path, catalog_path=tuple(map(str, folders)), **options)
    assert any("has the name, too" in remark for remark in both.remarks)
