"""How the shipped library is laid out, named and tagged. That its files are
valid and run: `tests/test_library.py`.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import xodr
import xosc
from xosc.listing import LIBRARY, Listed, listing
from xosc.writing import tags
from xosc.writing.tags import ASAM

FOUND = listing([str(LIBRARY)])
ROADS = sorted((Path(xodr.__file__).parent / "library").glob("*.xodr"))
FILES = sorted(LIBRARY.rglob("*.xosc"))
NUMBER = re.compile(r"[A-Z][A-Za-z0-9]*_[A-Z][A-Za-z]*_(m|mps|mps2|mps3|kmh|s|steps)")
CHOICE = re.compile(r"[A-Z][A-Za-z0-9]*_(Model|Entry)")


def name(each: Listed) -> str:
    return each.name


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_file_is_tagged_with_what_made_it(path: Path) -> None:
    found = {tag.type for tag in tags.tags_of(path)}
    assert {"MadeBy", "Entries", "Catalogue"} <= found or {
        "MadeBy",
        "Situation",
        "RoadGeometry",
        "scenarioName",
    } <= found


@pytest.mark.parametrize("road", ROADS, ids=lambda path: path.stem)
def test_every_road_has_tags_beside_it(road: Path) -> None:
    found = tags.read(road.with_suffix(".openlabel.json"))
    assert any(tag.ontology == ASAM and tag.type.startswith("RoadType") for tag in found)
    assert "RoadGeometry" in {tag.type for tag in found}


@pytest.mark.parametrize("scenario", FOUND.scenarios, ids=name)
def test_every_scenario_has_variations_beside_it_and_is_tagged_like_its_road(
    scenario: Listed,
) -> None:
    assert scenario.path.with_name(f"{scenario.name}_variation.xosc") in [
        each.path for each in scenario.variations
    ]
    assert scenario.tags["scenarioName"] == scenario.name
    road = {
        tag.type: tag.value or True
        for tag in tags.read(ROADS[0].with_name(f"{scenario.road}.openlabel.json"))
    }
    assert road.items() <= dict(scenario.tags).items()


@pytest.mark.parametrize("scenario", FOUND.scenarios, ids=name)
def test_parameters_say_whose_they_are_and_in_which_unit_and_have_limits(scenario: Listed) -> None:
    entities = {
        each.get("name") for each in xosc.load(scenario.path).root.iter("ScenarioObject")
    } | {"Environment"}
    assert scenario.parameters
    for each in scenario.parameters:
        assert (NUMBER if each.type == "double" else CHOICE).fullmatch(each.name), each.name
        assert each.name.partition("_")[0] in entities
        assert each.allowed or "$" in each.value, each.name


def test_every_catalogue_is_referred_to() -> None:
    references = {
        each.get("catalogName")
        for path in FILES
        for each in xosc.load(path).root.iter("CatalogReference")
    }
    assert references == {each.name for each in FOUND.catalogues}
    assert {each.kind for each in FOUND.catalogues} == {
        "Controller",
        "Environment",
        "Maneuver",
        "Pedestrian",
        "Route",
        "Vehicle",
    }


def test_every_road_is_used() -> None:
    assert {each.road for each in FOUND.scenarios} == {road.stem for road in ROADS}
