"""Answers to people who begin: what a message says to do, done as it says."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

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
