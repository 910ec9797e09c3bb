"""Road networks are found by their names where they are not where the scenario says."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from lxml import etree

import schemas
from schemas.common.errors import InvalidFile
from schemas.common.terminal.files import LIBRARY
from xosc.document.node import Node
from xosc.document.road_files import VARIABLE, find_roads


@pytest.fixture(autouse=True)
def no_folders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)


def logic(folder: Path, name: str) -> Node:
    """The LogicFile of a scenario in that folder."""
    folder.mkdir(parents=True, exist_ok=True)
    return Node(etree.fromstring(f'<LogicFile filepath="{name}"/>'), folder / "scenario.xosc")


def road(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("<OpenDRIVE/>")
    return path


def test_a_file_that_is_where_the_scenario_says_needs_no_remark(tmp_path: Path) -> None:
    there = road(tmp_path / "maps" / "Town01.xodr")
    road(tmp_path / "Town01.xodr")
    assert find_roads(logic(tmp_path, "maps/Town01.xodr")) == (there, None)


@pytest.mark.parametrize(
    "named", ["Town01", "maps/Town01.xodr", "/Game/Maps/Town01", r"..\maps\Town01.xodr"]
)
@pytest.mark.parametrize("place", ["a/b", "a", "."])
def test_it_is_found_by_its_name_beside_the_scenario_and_above(
    named: str, place: str, tmp_path: Path
) -> None:
    there = road(tmp_path / place / "Town01.xodr")
    found = find_roads(logic(tmp_path / "a" / "b", named))
    assert found.path.samefile(there)
    assert found.remark is not None
    assert str(found.path) in found.remark.message


@pytest.mark.parametrize("named", ["../maps/Town01.xodr", "maps/Town01"])
def test_it_is_found_by_its_path_from_the_folders_above(named: str, tmp_path: Path) -> None:
    there = road(tmp_path / "maps" / "Town01.xodr")
    road(tmp_path / "elsewhere" / "Town01.xodr")
    found = find_roads(logic(tmp_path / "scenarios" / "test_track", named))
    assert found.path == there
    assert found.remark is not None and str(there) in found.remark.message
    with pytest.raises(InvalidFile):
        find_roads(
            logic(
                tmp_path / "scenarios" / "test_track",
                str(tmp_path / "absent" / "maps" / "Town01.xodr"),
            )
        )


def test_a_file_without_an_ending_is_found_too(tmp_path: Path) -> None:
    there = road(tmp_path / "Town01")
    assert find_roads(logic(tmp_path / "a", "Town01.xodr")).path == there


def test_folders_that_are_asked_for_come_first_and_need_no_remark(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder in ("first", "second", "third"):
        road(tmp_path / folder / "Town01.xodr")
    road(tmp_path / "Town01.xodr")
    node = logic(tmp_path, "maps/Town01")
    folders = [tmp_path / "absent", tmp_path / "first", tmp_path / "second"]
    assert find_roads(node, folders) == (tmp_path / "first" / "Town01.xodr", None)
    monkeypatch.setenv(VARIABLE, os.pathsep.join(["", str(tmp_path / "third")]))
    assert find_roads(node) == (tmp_path / "third" / "Town01.xodr", None)
    assert find_roads(node, folders).path.parent.name == "first"


@pytest.mark.parametrize("name", ["Town01", ".", "x" * 5000])
def test_a_road_network_that_is_nowhere_is_refused_with_three_ways_out(
    name: str, tmp_path: Path
) -> None:
    with pytest.raises(
        InvalidFile,
        match=r"put it there, name its folder with --road-path .*XOSC_ROAD_PATH.*--road auto",
    ):
        find_roads(logic(tmp_path, name))


def test_a_misspelt_road_network_is_guessed(tmp_path: Path) -> None:
    (tmp_path / "X-Intersection_NCAP.xodr").write_text("")
    (tmp_path / "notes.txt").write_text("")
    meant = r"did you mean 'X-Intersection_NCAP\.xodr'\? put it there"
    with pytest.raises(InvalidFile, match=meant):
        find_roads(logic(tmp_path, "X-Intersectoin_NCAP.xodr"))
    with pytest.raises(InvalidFile, match="does not exist: put it there"):
        find_roads(logic(tmp_path, "Elsewhere.xodr"))
    checked = tmp_path / "checked.xosc"
    text = (LIBRARY / "simple_cut_in.xosc").read_text("utf-8")
    checked.write_text(re.sub('LogicFile filepath="[^"]*"', WRONG, text), "utf-8")
    told = [str(problem) for problem in schemas.check(checked)]
    assert any("'X-Intersectoin_NCAP.xodr' in " in text and MEANT in text for text in told)


WRONG = 'LogicFile filepath="X-Intersectoin_NCAP.xodr"'
MEANT = "; did you mean 'X-Intersection_NCAP.xodr'?"
