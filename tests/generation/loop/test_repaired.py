"""A loop goes on in its folder with inputs that were mended, and not with
another version of the system.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from importlib import invalidate_caches
from pathlib import Path

import pytest

from generation.loop.findings import LoopStage, StageFinding
from generation.loop.loop import run_loop
from generation.search.settings import Ask, LoopSettings
from generation.space.logical.library import SCENARIOS
from runner.judging.settings import RunSettings
from schemas.common.errors import UsageError
from schemas.common.terminal.command_line import progress_bar
from tests.runner.batch.test_inputs import SYSTEM
from xosc.exports import standard
from xosc.exports.draft import Folder

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
