"""Answers to people who begin: what a message says to do, done as it says."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pyarrow.parquet as pq
import pytest

import xosc_toolchain as xt
from tests.commands import Command

NAME = "highway_lead_brake"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_batch_is_repeated_by_the_command_that_it_names(folder: Path, command: Command) -> None:
    first = ("-p", "Ego_Speed_mps=20", "--sut", "none", "--seed", "3", "--out", "before")
    before = command("xosc-run", NAME, *first)
    refused = command("xosc-run", "before")
    assert refused.code == 2 and "repeat them by: xosc-run" in refused.err
    words = shlex.split(refused.err.split("repeat them by: xosc-run", 1)[1])
    again = command("xosc-run", *words, "--out", "after", "--against", "before")
    assert again.code == before.code and "0 new" in again.out
    for name in ("trajectories.csv", "result.json"):
        old, new = (folder / out / NAME / name for out in ("before", "after"))
        assert old.read_bytes() == new.read_bytes()


def test_a_run_of_a_variation_is_repeated_alone(folder: Path, command: Command) -> None:
    command(
        "xosc-run", "simple_cut_in_variation", "--only", "1,3", "--sut", "none", "--out", "before"
    )
    run = "before/simple_cut_in_variation~000003"
    told = command("xosc-run", run).err
    assert told.rstrip().endswith("--sut none --only 3")
    told = command("xosc-export", run, "--to", "esmini", "--out", "esmini").err
    assert "xosc new scenario NAME --like FILE -p NAME=VALUE" in told


def test_a_scenario_begins_with_the_values_of_a_failure(folder: Path, command: Command) -> None:
    new = ("xosc", "new", "scenario")
    assert command(*new, "mine", "--like", NAME, "-p", "Ego_Speed_mps=21.5").code == 0
    assert (
        'name="Ego_Speed_mps" parameterType="double" value="21.5"' in Path("mine.xosc").read_text()
    )
    assert "did you mean 'Ego_Speed_mps'?" in command(*new, "b", "-p", "Ego_Sped_mps=1").err
    assert f"--like {NAME} begins as that" in command("xosc", "new", "variation", NAME).err


def test_a_range_is_for_a_variation_file(folder: Path, command: Command) -> None:
    answer = command("xosc-run", NAME, "-p", "Ego_Speed_mps=20..40")
    assert answer.code == 2 and "a variation file: xosc new variation" in answer.err


def test_a_question_without_an_answer_names_what_is_there(folder: Path, command: Command) -> None:
    command("xosc-run", NAME, "--sut", "none", "--out", "results")
    answer = command("xosc-list", "results", "--where", "state = 'fail'")
    assert answer.code == 0 and "no row has state 'fail'; did you mean 'failed'?" in answer.err
    assert not command("xosc-list", "results", "--where", "state = 'failed'").err
    answer = command("xosc-list", "--class", "cut in")
    assert "did you mean 'highway cut in' or 'urban cut in'?" in answer.err


def test_a_table_of_other_columns_says_how_it_is_read(folder: Path, command: Command) -> None:
    Path("mine.csv").write_text("t,veh,px,py\n0.0,a,1,2\n")
    answer = command("xosc-recognize", "mine.csv", "--labels", "rules", "--out", "catalogue")
    assert "its first line is 't,veh,px,py': a columns.toml beside it" in answer.err


def test_a_scenario_of_ones_own_is_varied_where_it_is(folder: Path, command: Command) -> None:
    new = ("xosc", "new", "variation")
    command("xosc", "new", "scenario", "mine", "--out", "here")
    before = sorted(folder.rglob("*"))
    assert command(*new, "sets", "--like", "here/mine.xosc").out.splitlines() == ["sets.xosc"]
    assert sorted({*folder.rglob("*")} - {*before}) == [folder / "sets.xosc"]
    sets = [values for _, values in xt.variations("sets.xosc")]
    assert len(sets) == 9 and {values["Ego_Speed_mps"] for values in sets} == {
        "15",
        "22",
        "31.33",
    }
    assert command("xosc-check", "sets.xosc").code == 0
    assert "sets.xosc: this file is there already" in command(*new, "sets", "--like", NAME).err
    made = command(*new, "shipped", "--like", NAME, "--out", "there").out.splitlines()
    assert made[:2] == ["there/shipped.xosc", f"there/{NAME}.xosc"]
    assert command("xosc-run", "there/shipped.xosc", "--dry-run").code == 0
    text = Path("here/mine.xosc").read_text()
    Path("here/free.xosc").write_text(
        re.sub(r"(?s)<ConstraintGroup>.*?</ConstraintGroup>", "", text)
    )
    assert (
        "no parameter has limits on both sides"
        in command(*new, "v", "--like", "here/free.xosc").err
    )
    assert "'a/b' is no name" in command(*new, "a/b", "--like", "here/mine.xosc").err


def test_results_of_runs_are_exported_by_their_folder(folder: Path, command: Command) -> None:
    run = ("--sut", "cas:sensor_range=60", "-p", "CutIn_Gap_m=12", "--timestep", "0.1")
    assert command("xosc-run", "simple_cut_in", *run, "--out", "before").code == 0
    answer = command("xosc-export", "before/simple_cut_in", "--to", "parquet", "--out", "tables")
    assert answer.code == 0
    before, exported = (
        pq.read_table(folder / path).to_pandas().set_index(["entity", "time"])["x"]
        for path in ("before/simple_cut_in/trajectories.parquet", "tables/simple_cut_in.parquet")
    )
    assert before.sort_index().tolist() == exported.sort_index().tolist()


def test_several_shipped_scenarios_have_one_pattern(folder: Path, command: Command) -> None:
    answer = command("xosc-run", "--dry-run", "cut_in_*way")
    assert answer.code == 0 and "cut_in_highway " in answer.out
    (folder / "cut_in_my_way.xosc").write_text("<no/>")
    assert "cut_in_highway " not in command("xosc-run", "--dry-run", "cut_in_*way*").out
    assert command("xosc-run", "--dry-run", "nothing_*").code == 2


def test_rows_of_batches_have_the_system_and_labels_of_runs(folder: Path, command: Command) -> None:
    for system in ("adas", "none"):
        command("xosc-run", "simple_cut_in", "--sut", system, "--out", system)
    assert command("xosc-recognize", "label", "adas", "--labels", "rules").code == 0
    answer = command("xosc-list", "adas", "none", "--columns", "sut,class", "--format", "csv")
    _, labelled, bare = answer.out.splitlines()
    assert labelled.startswith("adas,") and "highway cut in" in labelled and bare == "none,"
    whole = command("xosc-list", "adas", "--format", "csv").out.splitlines()[0]
    assert "min_ttc" in whole and "end_time" in whole
    assert command("xosc-list", "adas", "--format", "parquet", "--output", "rows.parquet").code == 0
    (classes,) = pq.read_table(folder / "rows.parquet")["class"].to_pylist()
    assert "highway cut in" in classes


def test_formats_of_recordings_are_listed(command: Command) -> None:
    told = command("xosc-recognize", "--formats").out
    assert all(name in told for name in ("columns.toml", "highD", "NGSIM", "CommonRoad"))


def test_a_file_of_systems_is_asked_for_its_class(folder: Path, command: Command) -> None:
    told = command("xosc-run", "simple_cut_in", "--sut", "mine.py").err
    assert "mine.py:Mine" in told


def test_a_verdict_is_readable_and_errors_have_public_names() -> None:
    assert repr(xt.Verdict(("collision with Lead at 1.00 s",))) == (
        "<Verdict failed: collision with Lead at 1.00 s>"
    )
    with pytest.raises(xt.UsageError):
        xt.run("simple_cut_in", parametres={})  # type: ignore[call-overload, unused-ignore]
