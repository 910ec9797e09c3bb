"""A loop goes on in its folder with inputs that were mended, and not with
another version of the system.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from functools import partial
from importlib import invalidate_caches
from pathlib import Path

import pytest

from generation.loop import runs as loop_runs
from generation.loop.findings import (
    Checked,
    LoopResult,
    LoopStage,
    Ran,
    Recognised,
    RecognisedRun,
    Round,
    StageFinding,
)
from generation.loop.inputs import Inputs
from generation.loop.loop import _Loop, run_loop
from generation.loop.runs import FinishedStages
from generation.search.settings import Ask, LoopSettings
from generation.space.logical.library import SCENARIOS
from runner.judging.settings import RunSettings
from schemas.common.errors import UsageError
from schemas.common.terminal.command_line import progress_bar
from tests.runner.batch.test_inputs import SYSTEM
from xosc.exports import standard
from xosc.exports.draft import Folder

QUIET = partial(progress_bar, quiet=True)
SETTINGS = LoopSettings(
    model=None, rounds=1, budget=6, most=1, method="draws", processes=1, ask=Ask(density="uniform")
)


def go(folder: Path, out: Path, settings: LoopSettings = SETTINGS) -> list[str]:
    """Run the loop; the stages that were done now."""
    done = []

    def report(stage: LoopStage, found: StageFinding, seconds: float | None) -> None:
        if seconds is not None:
            done.append(stage.name)

    run_loop(folder, out, settings, partial(progress_bar, quiet=True), report)
    return done


def loop(folder: Path, out: Path) -> _Loop:
    stages = FinishedStages(out, SETTINGS.deciding(), lambda *_: None)
    return _Loop(Inputs.of(folder), out, SETTINGS, QUIET, stages)


def test_a_file_that_was_edited_since_is_checked_again(tmp_path: Path) -> None:
    folder, out = tmp_path / "mine", tmp_path / "out"
    standard.export(SCENARIOS / "cut_in_highway.xosc", "1.3", Folder(folder))
    standard.export(SCENARIOS / "cut_in_highway.xosc", "1.3", Folder(out / "catalogue"))
    shutil.rmtree(out / "stages", ignore_errors=True)
    (out / "loop.json").write_text(json.dumps(SETTINGS.deciding()))
    assert loop(folder, out).check([]).problems == []
    (edited,) = (out / "catalogue").rglob("cut_in_highway.xosc")
    text = edited.read_text(encoding="utf-8")
    edited.write_text(text.replace("<Storyboard>", "<Storyboards>"), encoding="utf-8")
    (problem,) = loop(folder, out).check([]).problems
    assert "cut_in_highway.xosc" in problem
    edited.write_text(text, encoding="utf-8")
    assert loop(folder, out).check([]).problems == []


def test_runs_that_can_not_be_labelled_are_named_and_no_sound_loop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, out = tmp_path / "mine", tmp_path / "out"
    standard.export(SCENARIOS / "cut_in_highway.xosc", "1.3", Folder(folder))
    failures = {"cut_in_highway_0": "no road"}
    monkeypatch.setattr(loop_runs, "catalogue", lambda *_, **__: Recognised(failures=failures))
    monkeypatch.setattr("generation.loop.loop.rows_of", lambda _: [])
    labelled = loop(folder, out)._label(out / "round_1")
    assert labelled.failures == failures
    ran, checked = Ran(), Checked(files=1, problems=[])
    result = LoopResult({}, 0, Recognised(), [], [Round(1, [], ran, labelled)], ran, ran, checked)
    assert result.unsound
    calm = replace(result, rounds=[Round(1, [], ran, RecognisedRun())])
    assert not calm.unsound


@pytest.mark.slow
def test_only_what_a_mended_scenario_decides_is_done_again(tmp_path: Path) -> None:
    folder, out = tmp_path / "mine", tmp_path / "out"
    for name in ("cut_in_highway", "congestion_highway"):
        standard.export(SCENARIOS / f"{name}.xosc", "1.3", Folder(folder / name))
    first = go(folder, out)
    assert {"round_1_search_cut_in_highway", "round_1_search_congestion_highway"} <= set(first)
    assert go(folder, out) == []
    (file,) = (folder / "cut_in_highway").rglob("cut_in_highway.xosc")
    file.write_text(file.read_text(encoding="utf-8") + "<!-- mended -->", encoding="utf-8")
    assert go(folder, out) == [
        name for name in first if name != "round_1_search_congestion_highway"
    ]


@pytest.mark.slow
def test_a_scenario_without_its_road_is_named_and_searched_once_it_is_there(tmp_path: Path) -> None:
    folder, out = tmp_path / "mine", tmp_path / "out"
    standard.export(SCENARIOS / "cut_in_highway.xosc", "1.3", Folder(folder))
    (road,) = folder.rglob("*.xodr")
    away = road.rename(tmp_path / "away")
    run = partial(
        run_loop, folder, out, SETTINGS, partial(progress_bar, quiet=True), lambda *_: None
    )
    found = run()
    assert "LogicFile: the road network" in found.rounds[0].searches[0].error
    assert any("there is no file" in problem for problem in found.checked.problems)
    away.rename(road)
    again = run()
    assert again.rounds[0].searches[0].error == ""
    assert again.checked.problems == []


@pytest.mark.slow
def test_another_version_of_the_system_needs_another_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, out, module = tmp_path / "mine", tmp_path / "out", tmp_path / "plugged_in.py"
    standard.export(SCENARIOS / "cut_in_highway.xosc", "1.3", Folder(folder))
    monkeypatch.syspath_prepend(str(tmp_path))
    module.write_text(SYSTEM.format(brake=6.0, comment="first"), encoding="utf-8")
    invalidate_caches()
    settings = replace(SETTINGS, run=RunSettings(sut="plugged_in:Mine"))
    go(folder, out, settings)
    module.write_text(SYSTEM.format(brake=6.0, comment="second"), encoding="utf-8")
    with pytest.raises(UsageError, match=r"other settings \(code of the system\)"):
        go(folder, out, settings)
