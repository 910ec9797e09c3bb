"""Catalogues that are not where a scenario says: found in the folders that are asked for, by runs,
checks, exports, searches.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import runner
import schemas
import xosc
from generation.search.variations import Writer
from generation.space.space import Space
from runner.judging.settings import RunSettings
from schemas.common.errors import InvalidFile
from tests.commands import Command
from xosc.exports import standard
from xosc.exports.draft import Folder

CUT_IN = Path(xosc.__file__).parent / "library" / "simple_cut_in.xosc"
FAST = RunSettings(sut="none", world="kinematic", max_time=0.2)
FOLDERS = ["all", "all/vehicles"]
"""The folder that has the directories of a library, and the directory itself."""


@pytest.fixture(autouse=True)
def nothing_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("XOSC_CATALOG_PATH", raising=False)


@pytest.fixture
def lost(tmp_path: Path) -> Path:
    """A scenario whose catalogues are in another folder, all."""
    path = tmp_path / "source" / CUT_IN.name
    standard.export(CUT_IN, "1.3", Folder(path.parent))
    shutil.move(path.parent / "catalogs", tmp_path / "all")
    return path


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_catalogue_path_is_looked_in_without_a_remark(
    folder: str, lost: Path, tmp_path: Path
) -> None:
    with pytest.raises(
        InvalidFile, match=r"CatalogReference: .*--catalog-path \(or in XOSC_CATALOG_PATH\)"
    ):
        runner.run(lost, FAST)
    result = runner.run(
        lost, FAST, catalog_path=(str(tmp_path / "none"), str(tmp_path / folder)), strict=True
    )
    assert result.remarks == runner.run(CUT_IN, FAST).remarks


def test_what_is_where_the_scenario_says_comes_first(tmp_path: Path) -> None:
    other = tmp_path / "vehicles" / "other.xosc"
    other.parent.mkdir()
    (catalogue,) = (CUT_IN.parent / "catalogs" / "vehicles").glob("*.xosc")
    other.write_text(
        catalogue.read_text(encoding="utf-8").replace('length="', 'length="1'), encoding="utf-8"
    )
    boxes = [
        xosc.resolve(xosc.load(CUT_IN), catalog_path=folders)
        .node.need("Entities")
        .element.find(".//Dimensions")
        .attrib
        for folders in ((), (tmp_path,))
    ]
    assert boxes[0] == boxes[1]


@pytest.mark.parametrize("asked", ["option", "variable"])
def test_commands_look_in_their_catalogue_paths(
    asked: str, lost: Path, tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = ("--sut", "none", "--world", "kinematic", "--max-time", "0.2", "--allow-inconclusive")
    assert command("xosc-run", lost, *options).code == 3
    assert "--catalog-path" in command("xosc-check", lost).out
    where: tuple[str, ...] = ()
    if asked == "option":
        where = ("--catalog-path", str(tmp_path / "all"))
    else:
        monkeypatch.setenv("XOSC_CATALOG_PATH", str(tmp_path / "all"))
    assert command("xosc-run", lost, *options, *where).code == 0
    assert command("xosc-check", lost, "--strict", *where).code == 0


@pytest.mark.parametrize("target", ["1.1", "1.2", "esmini", "carla"])
def test_exports_take_catalogues_along_from_where_they_are_found(
    target: str, lost: Path, tmp_path: Path, command: Command
) -> None:
    options = ("--to", target, "--out", tmp_path / "out")
    refused = command("xosc-export", lost, *options)
    assert (refused.code, "--catalog-path" in refused.err) == (3, True)
    assert command("xosc-export", lost, *options, "--catalog-path", tmp_path / "all").code == 0
    (copy,) = (tmp_path / "out").glob("*.xosc")
    assert not [problem for problem in schemas.check(copy) if problem.level == "error"]
    assert runner.run(copy, FAST).end_time == FAST.max_time


def test_searches_write_the_catalogues_along(lost: Path, tmp_path: Path) -> None:
    space = Space.of(lost)
    with pytest.raises(InvalidFile, match="--catalog-path"):
        Writer(lost, space, tmp_path / "refused")
    Writer(lost, space, tmp_path / "out", RunSettings(catalog_path=(str(tmp_path / "all"),)))
    assert runner.run(tmp_path / "out" / lost.name, FAST).end_time == FAST.max_time


def test_all_folders_are_searched_and_the_first_that_has_the_name_counts(
    lost: Path, tmp_path: Path
) -> None:
    (vehicles,) = (tmp_path / "all" / "vehicles").glob("*.xosc")
    text = vehicles.read_text(encoding="utf-8")
    name = text.partition('Catalog name="')[2].partition('"')[0]
    for folder, content in (
        ("other", text.replace(f'Catalog name="{name}"', 'Catalog name="Other"')),
        ("copy", text),
    ):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "catalog.xosc").write_text(content, encoding="utf-8")
    (tmp_path / "copy" / "catalog.xosc").write_text(
        text.replace('length="', 'length="1'), encoding="utf-8"
    )

    def lengths(*folders: str) -> list[str]:
        asked = tuple(str(tmp_path / folder) for folder in folders)
        root = xosc.resolve(xosc.load(lost), catalog_path=asked).node.element
        return [
            str(each.get("length")) for each in root.iterfind(".//Vehicle/BoundingBox/Dimensions")
        ]

    assert (
        lengths("other", "all/vehicles")
        == lengths("all/vehicles")
        == lengths("other", "all/vehicles", "copy")
    )
    assert lengths("copy", "all/vehicles") == [f"1{length}" for length in lengths("all/vehicles")]
