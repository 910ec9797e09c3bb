"""Edge cases on every geometry: their files alone, wherever they are moved to,
lead to the verdicts that they tell.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import runner
import schemas
import xosc
from generation.search.outcomes import COLLISION
from generation.space.logical.library import SCENARIOS
from tests.generation.test_xosc_generate import call
from xosc.writing.tags import read

QUICK = (
    "--method",
    "draws",
    "--violations",
    "--budget",
    "8",
    "--most",
    "2",
    "--density",
    "gaussian",
    "--jobs",
    "1",
    "--concrete",
    "--quiet",
)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "diverging_highway",
        "cut_out_sharp_curve",
        "lane_change_left_narrow_road",
        "congestion_four_way_intersection",
        "turn_off_t_junction",
    ],
)
def test_generated_files_are_valid_and_lead_to_the_same_verdict_by_themselves(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert call(monkeypatch, SCENARIOS / f"{name}.xosc", "--out", tmp_path / "made", *QUICK) == 0
    folder = tmp_path / "elsewhere" / "moved"
    shutil.move(tmp_path / "made", folder)
    files = [*folder.rglob("*.xosc"), *folder.rglob("*.xodr")]
    assert {path.name: schemas.check(path) for path in files} == {path.name: [] for path in files}
    told = next(
        tag.value
        for tag in read(folder / f"{name}_edge_cases.openlabel.json")
        if tag.type == "Verdict"
    )
    sets = list(xosc.variations(folder / f"{name}_edge_cases.xosc"))
    concrete = sorted(folder.glob(f"{name}_edge_case_0*.xosc"))
    assert len(sets) == len(concrete) == len(told) >= 1
    for verdict, (scenario, parameters), alone in zip(told, sets, concrete, strict=True):
        assert scenario.parent == folder
        found = runner.run(scenario, parameters=parameters), runner.run(alone)
        assert [not run.verdict.passed for run in found] == [verdict == COLLISION] * 2
        assert found[0].end_time == found[1].end_time
