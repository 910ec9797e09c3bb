"""Labels for the output of runs: annotated copies and OpenLABEL tags beside the scenarios."""

from __future__ import annotations

import json
import re
from functools import partial
from pathlib import Path
from shutil import copytree
from typing import Literal

import pytest

import xosc
from recognition.catalogue.detect import ByRules
from recognition.catalogue.pipeline import LabelledRuns, label_runs
from recognition.catalogue.recordings import CatalogueSettings
from runner.batch.batch import execute
from runner.batch.jobs import Job
from runner.judging.settings import RunSettings
from schemas import check
from schemas.common.errors import InvalidFile
from schemas.common.terminal.command_line import progress_bar
from xosc.writing import tags

LIBRARY = Path(xosc.__file__).parent / "library"


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """A copy of the library's cut-in."""
    for name in ("xosc", "xodr"):
        copytree(LIBRARY.parents[1] / name / "library", tmp_path / name / "library")
    return tmp_path / "xosc" / "library" / "simple_cut_in.xosc"


def run(scenario: Path, out: Path, *names: str) -> Path:
    out.mkdir(exist_ok=True)
    for name in names or ("run",):
        job = Job(name, scenario, scenario)
        assert execute(job, RunSettings(sut="none", world="kinematic"), out).status == "completed"
    return out


def label(runs: Path, annotate: Literal["copies", "scenarios"] | None = "copies") -> LabelledRuns:
    bar = partial(progress_bar, quiet=True)
    return label_runs(runs, CatalogueSettings(), ByRules(), bar, annotate)


def held(path: Path) -> dict[str | None, str | None]:
    return {
        each.get("name"): each.get("value")
        for each in xosc.load(path).root.iterfind("FileHeader/Properties/Property")
    }


def test_a_copy_and_tags_come_beside_the_scenario(scenario: Path, tmp_path: Path) -> None:
    before = scenario.read_bytes()
    labelled = label(run(scenario, tmp_path / "runs"))
    copy, beside = (
        scenario.with_name("simple_cut_in_labelled.xosc"),
        scenario.with_name("simple_cut_in_labelled.openlabel.json"),
    )
    assert sorted(labelled.written) == sorted([copy, beside])
    assert scenario.read_bytes() == before
    assert check(copy) == []
    assert "highway cut in" in (held(copy)["openlabel.Classes"] or "")
    told = {tag.type: tag.value for tag in tags.read(beside)}
    assert "highway cut in" in told["Classes"] and told["Runs"] == 1
    assert any(
        "highway cut in of Ego at" in each and "with CutIn" in each for each in told["Findings"]
    )
    assert not any("of CutIn" in str(each) for each in told["Findings"]), "tags are about the ego"


def test_nothing_is_written_beside_a_scenario_unless_asked(scenario: Path, tmp_path: Path) -> None:
    runs, before = run(scenario, tmp_path / "runs"), sorted(scenario.parent.iterdir())
    labelled = label(runs, annotate=None)
    assert (labelled.written, sorted(scenario.parent.iterdir())) == ([], before)
    assert labelled.findings.keys() == json.loads((runs / "labels.json").read_text())["runs"].keys()


def test_all_that_was_found_is_told_beside_the_runs(scenario: Path, tmp_path: Path) -> None:
    runs = run(scenario, tmp_path / "runs", "one", "two")
    label(runs)
    told = json.loads((runs / "labels.json").read_text())
    assert told["runs"].keys() == {"one", "two"}
    assert told["runs"]["one"] == told["runs"]["two"]
    cut_in = next(each for each in told["runs"]["one"] if each["class"] == "highway cut in")
    assert (cut_in["ego"], cut_in["partner"], cut_in["state"]) == ("Ego", "CutIn", "known")
    beside = scenario.with_name("simple_cut_in_labelled.openlabel.json")
    findings = {tag.type: tag.value for tag in tags.read(beside)}["Findings"]
    assert any(str(each).endswith("in two") for each in findings)


def test_labelling_again_changes_nothing_and_leaves_edited_files(
    scenario: Path, tmp_path: Path
) -> None:
    runs = run(scenario, tmp_path / "runs")
    first = label(runs)
    before = {path: path.read_bytes() for path in first.written}
    assert label(runs).edited == []
    assert {path: path.read_bytes() for path in first.written} == before
    first.written[0].write_bytes(b"mine")
    for _ in range(2):
        assert label(runs).edited == [first.written[0]]
        assert label(runs, annotate=None).edited == []
    assert first.written[0].read_bytes() == b"mine"


def test_in_place_the_scenario_itself_is_annotated(scenario: Path, tmp_path: Path) -> None:
    labelled = label(run(scenario, tmp_path / "runs"), "scenarios")
    assert (
        scenario in labelled.written
        and not scenario.with_name("simple_cut_in_labelled.xosc").exists()
    )
    assert "highway cut in" in (held(scenario)["openlabel.Classes"] or "")
    assert check(scenario) == []


def test_before_1_2_only_openlabel_is_written(scenario: Path, tmp_path: Path) -> None:
    text = re.sub(
        r"<Properties>.*?</Properties>", "", scenario.read_text(), count=1, flags=re.DOTALL
    )
    scenario.write_text(text)
    xosc.write(xosc.convert(xosc.load(scenario), (1, 1)), scenario)
    labelled = label(run(scenario, tmp_path / "runs"))
    assert [path.name for path in labelled.written] == ["simple_cut_in_labelled.openlabel.json"]
    assert (
        json.loads(labelled.written[0].read_text())["openlabel"]["metadata"]["tagged_file"]
        == "simple_cut_in.xosc"
    )


def test_runs_whose_scenario_is_gone_are_refused(scenario: Path, tmp_path: Path) -> None:
    runs = run(scenario, tmp_path / "runs")
    scenario.unlink()
    with pytest.raises(
        InvalidFile, match=r"the scenario of this run, .*simple_cut_in.xosc, is not there"
    ):
        label(runs)


def test_folders_without_runs_and_broken_labels_are_refused(scenario: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(InvalidFile, match="no recording of a known format"):
        label(tmp_path / "empty")
    runs = run(scenario, tmp_path / "runs")
    (runs / "labels.json").write_text("mine")
    with pytest.raises(InvalidFile, match=r"labels.json:1: not readable as JSON"):
        label(runs)
