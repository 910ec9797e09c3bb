"""Triage of a folder: one row a file, in its group and under its cause, as text, JSON and HTML."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from runner.view.rehearsal import FINE, NOTHING, REFUSED, REPAIRED, causes, triage
from tests.commands import Command
from tests.runner.chromium import Browser
from tests.runner.files import ROADS, car, distribution, place, scenario


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a file of each group; a variation file of 100 sets, and a
    scenario, lack their road.
    """
    found = tmp_path / "found"
    scenario(found, "good")
    text = scenario(found, "repaired").read_text()
    (found / "repaired.xosc").write_text(
        text.replace('revMajor="1" revMinor="3"', 'revMajor="0" revMinor="9"')
    )
    scenario(found, "empty", init=place("Ego", 100, 10), entities=[car("Ego")], stop=0.0)
    for name, road in (("lost", "gone"), ("logical", "away")):
        scenario(found, name, road="straight")
        (found / f"{name}.xosc").write_text(
            (found / f"{name}.xosc").read_text().replace("straight.xodr", f"{road}.xodr")
        )
    distribution(found, "hundred", {"Gap": (1, 100, 1)}, "logical")
    (found / "broken.xosc").write_text("<OpenSCENARIO>")
    (found / "straight.xodr").write_bytes((ROADS / "straight.xodr").read_bytes())
    return found


def test_each_file_is_one_row_under_its_cause(folder: Path) -> None:
    rows = {row.path: row for row in triage(sorted(folder.iterdir()))}
    assert {name: row.group for name, row in rows.items()} == {
        "good.xosc": FINE,
        "straight.xodr": FINE,
        "repaired.xosc": REPAIRED,
        "empty.xosc": NOTHING,
        "broken.xosc": REFUSED,
        "lost.xosc": REFUSED,
        "logical.xosc": REFUSED,
        "hundred.xosc": REFUSED,
    }
    assert (rows["hundred.xosc"].kind, rows["straight.xodr"].kind) == ("distribution", "road")
    (cause, those), _ = causes([row for row in rows.values() if row.group == REFUSED])
    assert cause.endswith("the road network … does not exist")
    assert sorted(row.path for row in those) == ["hundred.xosc", "logical.xosc", "lost.xosc"]
    assert rows["lost.xosc"].line == next(
        number
        for number, line in enumerate((folder / "lost.xosc").read_text().splitlines(), 1)
        if "LogicFile" in line
    )
    assert "1.0" in rows["repaired.xosc"].message and rows["repaired.xosc"].repairs >= 1


def test_a_fault_of_another_file_names_that_file_and_no_line_of_the_own(folder: Path) -> None:
    catalogs = (
        "<CatalogLocations><VehicleCatalog><Directory "
        'path="catalogs"/></VehicleCatalog></CatalogLocations>'
    )
    text = (folder / "good.xosc").read_text().replace("<CatalogLocations/>", catalogs)
    start, end = text.index('<ScenarioObject name="Lead">') + 28, text.rindex("</ScenarioObject>")
    vehicle = text[start:end].strip()
    (folder / "catalogs").mkdir()
    twice = vehicle.replace("<BoundingBox>",
        '<ParameterDeclarations><ParameterDeclaration name="$a" parameterType="double" '
                            'value="1"/></ParameterDeclarations><BoundingBox>')  # fmt: skip
    header = (
        '<FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" author="t" '
        'description="t"/>'
    )
    (folder / "catalogs" / "cars.xosc").write_text(
        f'<OpenSCENARIO>{header}<Catalog name="cars">{twice}</Catalog></OpenSCENARIO>'
    )
    reference = '<CatalogReference catalogName="cars" entryName="car"/>'
    (folder / "user.xosc").write_text(text[:start] + reference + text[end:])
    (row,) = [row for row in triage([folder / "user.xosc"]) if row.path == "user.xosc"]
    assert (row.group, row.line) == (REPAIRED, None)
    assert row.message.startswith("in catalogs/cars.xosc:2: ") and row.cause.startswith(
        "in cars.xosc: "
    )


def test_the_report_names_groups_causes_and_files(command: Command, folder: Path) -> None:
    answer = command("xosc-check", "--triage", folder)
    lines = answer.out.splitlines()
    assert answer.code == 1
    assert lines[-1] == "8 files, fine: 2, plays with repairs: 1, tests nothing: 1, refused: 4"
    remedy = next(line for line in lines if "does not exist: " in line and "files" in line)
    assert "3 files (put it there" in remedy
    assert sum("hundred.xosc" in line for line in lines) == 1


@pytest.mark.slow
def test_json_and_page_have_the_same_rows(command: Command, folder: Path, tmp_path: Path) -> None:
    values = json.loads(command("xosc-check", "--triage", "--format", "json", folder).out)
    assert [file["path"] for file in values["files"]] == sorted(
        path.name for path in folder.iterdir()
    )
    page = tmp_path / "triage.html"
    answer = command("xosc-check", "--triage", "--format", "html", "--output", page, folder)
    assert answer.out.splitlines()[-1] == f"triage: {page}"
    with Browser(tmp_path / "profile") as browser:
        browser.open(page)
        assert browser.errors == [] and browser.unnamed() == []
        assert browser.run("document.querySelectorAll('tbody tr').length") == len(values["files"])
        assert browser.run("document.querySelector('h2').textContent").startswith("refused")


@pytest.mark.parametrize("call", [["--format", "html"], ["--triage", "--format", "sarif"]])
def test_a_format_that_does_not_fit_is_refused(
    command: Command, folder: Path, call: list[str]
) -> None:
    answer = command("xosc-check", *call, folder)
    assert (answer.code, answer.out) == (
        2,
        "",
    ) and "--triage, --format is one of text, json, " in answer.err
