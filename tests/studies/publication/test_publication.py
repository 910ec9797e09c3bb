"""The publication's tables: commands that exist, runs that go on, and a page that says what the result files say."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, cast

import pytest
import typer

from schemas.common.errors import InvalidFile
from studies.publication import __main__ as command
from studies.publication import page, results
from studies.publication.stages import SCALES, FailedStage, Stage, run, stages

SCALE = "smallest"
RESULTS = results.RESULTS


@pytest.fixture
def call(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., int]:
    def calling(*arguments: str) -> int:
        paths = ("--out", tmp_path / "work", "--results", tmp_path / "results")
        monkeypatch.setattr(sys, "argv", ["publication", *map(str, (*arguments, *paths))])
        with pytest.raises(SystemExit) as ended:
            command.main()
        return int(ended.value.code or 0)

    return calling


@pytest.mark.parametrize("scale", SCALES)
def test_each_stage_is_a_command_with_options_that_exist(scale: str, tmp_path: Path) -> None:
    for stage in stages(SCALES[scale], tmp_path):
        module, name, *arguments = stage.command
        app = import_module(module if "xosc" in module else f"{module}.__main__").app
        found = cast(Any, typer.main.get_command(app)).commands[name]
        if "recognition" in module and name == "protocol":
            arguments[0] = str(tmp_path)  # which the stage before it makes
        context = found.make_context(name, arguments)
        assert context.params["out"] is not None


def test_recordings_of_ones_own_take_the_place_of_sumos(tmp_path: Path) -> None:
    own = stages(SCALES[SCALE], tmp_path, tmp_path / "highd")
    assert "recordings" not in [stage.name for stage in own]
    assert str(tmp_path / "highd") in own[0].command


def test_a_stage_is_run_again_only_where_its_command_is_another(
    call: Callable[..., int],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    stage, out = Stage("recordings", ("platform",)), str(tmp_path / "page.md")
    monkeypatch.setattr(command, "stages", lambda *_: [stage])
    assert call("--smallest", "--page", out) == 0
    assert "recordings: " in capfd.readouterr().out
    assert call("--smallest", "--page", out) == 0
    assert "recordings: " not in capfd.readouterr().out
    stage = Stage("recordings", ("platform", "--terse"))
    assert call("--smallest", "--page", out) == 0
    assert "recordings: " in capfd.readouterr().out
    assert "`python -m platform --terse`" in (tmp_path / "page.md").read_text(encoding="utf-8")


def test_a_stage_that_fails_ends_the_command_and_is_named(tmp_path: Path) -> None:
    with pytest.raises(FailedStage, match="the stage shipped ended with exit code 1"):
        list(run([Stage("shipped", ("no_such_module_anywhere",))]))


def test_an_unknown_stage_is_named(
    call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("--smallest", "--only", "shiped") == 2
    assert "there is no stage 'shiped'; stages: recordings, published" in capsys.readouterr().err


def table(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def test_rows_of_ours_stand_beside_the_published_ones(tmp_path: Path) -> None:
    for stage, f1 in (("published", "0.500 ± 0.010"), ("shipped", "0.800")):
        table(
            tmp_path / SCALE / stage / "open-set.csv",
            f",macro-F1,(K+1) accuracy,AUROC,OSCR,p\n**TRFE**,{f1},0,0.9,0.7,–\nCAC,0.4,0,0.8,0.6,0.03\n",
        )
    text = page.text(tmp_path)
    assert "| TRFE | 0.906 | 0.500 ± 0.010 | 0.9 | 0.7 | 0.800 | 0.9 | 0.7 |" in text
    assert "| CEVT (reading B) | 0.875 | – | – | – | – | – | – |" in text
    assert "| CAC | – | 0.4 |" in text
    assert "### Table 4: clustering of new classes\n\nNot made with these settings." in text


def test_full_rows_are_shown_before_the_smallest_and_say_their_seeds(tmp_path: Path) -> None:
    for scale, seeds in (("smallest", 1), ("full", 2)):
        for name in ("open-set", "chain") if scale == "smallest" else ("open-set",):
            table(
                tmp_path / scale / "shipped" / f"{name}.csv",
                f",macro-F1,AUROC,OSCR,ACC_cluster,macro-F1 after,seeds,p\n**TRFE**,{seeds},,,,,{seeds},\n",
            )
    text = page.text(tmp_path)
    assert "### Table 3: recognition of known and unknown classes\n" in text
    assert "| TRFE | 0.906 | – | – | – | – | 2 |  |  | 2 |" in text
    assert "### five rounds on the model's own discoveries, smallest settings\n" in text


def test_a_damaged_journal_is_named(tmp_path: Path) -> None:
    table(tmp_path / SCALE / results.JOURNAL, "stage,command\na,b\n")
    with pytest.raises(InvalidFile, match="no journal of stages"):
        page.text(tmp_path)


def test_the_page_says_what_the_result_files_say() -> None:
    assert page.PAGE.read_text(encoding="utf-8") == page.text(RESULTS), (
        "python -m studies.publication --page-only"
    )


@pytest.mark.parametrize("scale", SCALES)
def test_each_row_of_results_comes_from_a_command_that_is_still_there(scale: str) -> None:
    work = Path("WORK")
    now = {one.name: results.written(one, work) for one in stages(SCALES[scale], work)}
    journal = results.read_journal(RESULTS / scale)
    made = {path.parent.name for path in (RESULTS / scale).glob("*/*.csv")}
    assert made <= journal.keys() <= now.keys()
    assert {name: entry.command for name, entry in journal.items()} == {
        name: now[name] for name in journal
    }
