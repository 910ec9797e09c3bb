"""The shipped library in every export: exported or refused by name, and the
standard's versions with the same motion.
"""

from __future__ import annotations

import math
import shutil
import sys
from collections.abc import Callable
from copy import copy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree

import runner
import schemas
import xosc
from runner.batch.jobs import Job, jobs_of
from runner.exchange.exports import TARGETS, ExportTarget
from runner.exchange.exports.exporting import export_documents, export_runs
from runner.judging import execution
from runner.judging.result import RunResult
from runner.judging.settings import RunSettings
from schemas.common.errors import ExitCode, ToolchainError
from xosc.exports.draft import Folder

ROOT = Path(__file__).parents[1]
LIBRARY = sorted((ROOT / "xosc" / "library").rglob("*.xosc"))
KINDS = {path: xosc.load(path).kind for path in LIBRARY}
DISTRIBUTIONS = ("cut_in_highway_variation", "lane_closure_highway_variation")
"""One that draws values, and one that lists them"""
PLAYED = [path for path in LIBRARY if KINDS[path] == "scenario" or path.stem in DISTRIBUTIONS]
"""Each road and each motion; what other distributions lead to is one of these with other values"""
VERSIONS = ("1.0", "1.1", "1.2", "1.3", "1.4")
QUICK = RunSettings(timestep=0.2, sut="none", world="kinematic", max_time=8.0)


def motion(job: Job) -> dict[str, np.ndarray]:
    """Place, heading and speed of everyone at every step, without a simulator."""
    result = runner.run(
        job.scenario,
        parameters=job.parameters,
        world="kinematic",
        sut="none",
        timestep=0.2,
        max_time=30,
    )
    columns = ("time", "x", "y", "z", "h", "speed")
    return {
        name: np.column_stack([track.columns[c] for c in columns])
        for name, track in result.recording.tracks.items()
    }


@cache
def original_motion(path: Path, number: int) -> dict[str, np.ndarray]:
    """That of a job of a file of the library, which all versions are compared with."""
    return motion(jobs(path)[number])


@pytest.mark.parametrize("target", ["1.0", "carla"])
@pytest.mark.parametrize(
    "name", ["AcquirePositionAction", "LongitudinalDistanceAction", "TeleportAction"]
)
def test_an_action_among_conditions_is_left_out_by_name(
    name: str, target: str, tmp_path: Path
) -> None:
    scenarios = ROOT / "tests" / "conformance" / "scenarios"
    tree = etree.parse(scenarios / f"{name}.xosc")
    next(tree.iter("ConditionGroup")).append(next(tree.iter(name)))
    path = tmp_path / "scenarios" / f"{name}.xosc"
    path.parent.mkdir()
    tree.write(path)
    for folder in ("roads", "scenarios/catalogs"):
        if (scenarios.parent / folder).is_dir():
            shutil.copytree(scenarios.parent / folder, tmp_path / folder)
    (done,) = export_documents([path], TARGETS[target], Folder(tmp_path / "out"))
    assert done.exit_code == 0, done
    assert any(f"{name}: outside an action it does nothing" in remark for remark in done.remarks)
    (written,) = (tmp_path / "out").rglob(path.name)
    assert not [
        each for each in etree.parse(written).iter("ConditionGroup") if each.find(name) is not None
    ]


def jobs(path: Path) -> list[Job]:
    found = list(jobs_of([path], {}, True))
    assert all(isinstance(job, Job) for job in found), found
    return [job for job in found if isinstance(job, Job)]


Exported = Callable[[str], tuple[Path, dict[Path, Any]]]
"""The library in an export by its name: the folder, and what became of each file"""


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    @cache
    def export(target: str) -> tuple[Path, dict[Path, Any]]:
        folder = tmp_path_factory.mktemp(target)
        return folder, dict(
            zip(LIBRARY, export_documents(LIBRARY, TARGETS[target], Folder(folder)), strict=True)
        )

    return export


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
def test_the_library_moves_as_before_in_every_version_that_can_say_it(
    version: str, exported: Exported
) -> None:
    folder, done = exported(version)
    assert [problem for file in folder.rglob("*.xosc") for problem in schemas.check(file)] == []
    refused = {path for path, each in done.items() if each.exit_code}
    assert not refused or version not in ("1.3", "1.4"), refused
    moved = [path for path in PLAYED if path not in refused]
    for path in moved:
        whole = folder / path.name
        files = [whole] if whole.exists() else sorted(folder.glob(f"{path.stem}~*.xosc"))
        assert all(
            f"{xosc.load(file).version}" == f"({version.replace('.', ', ')})" for file in files
        )
        originals, copies = jobs(path), [job for file in files for job in jobs(file)]
        assert len(originals) == len(copies)
        for number, job in enumerate(copies):
            expected, got = original_motion(path, number), motion(job)
            assert expected.keys() == got.keys()
            for name, rows in expected.items():
                assert np.allclose(rows, got[name], rtol=0.0, atol=1e-6), (path, version, name)
    assert moved


@pytest.mark.parametrize("target", ["1.3", "esmini", "carla"])
def test_lane_layers_are_lost_with_a_word_on_the_action_and_on_the_road(
    target: str, tmp_path: Path
) -> None:
    closure = ROOT / "xosc" / "library" / "lane_closure_highway.xosc"
    (done,) = export_documents([closure], TARGETS[target], Folder(tmp_path))
    assert done.exit_code == 0
    for element, reason in (
        ("highway_works.xodr:", "temporary lanes"),
        ("PreferredLaneLayerAction", "lane layers"),
    ):
        assert any(element in each and reason in each for each in done.remarks), (
            element,
            done.remarks,
        )


OTHERWISE = ("Performance asks for that", "where the steady state or the tolerance begins")
"""Of remarks on what an older version plays otherwise"""


def _moves_as(before: np.ndarray, after: np.ndarray) -> bool:
    """Whether rows of `motion` are the same within 1 mm, 1 mrad and 1 mm/s: curves that a version
    lacks are polylines. Headings that differ by a turn are one heading."""
    if before.shape != after.shape:
        return False
    apart = np.abs(before - after)
    apart[:, 4] = np.abs(np.mod(apart[:, 4] + math.pi, 2.0 * math.pi) - math.pi)
    return bool((apart <= 1e-3).all())


@pytest.mark.study
@pytest.mark.parametrize("target", [*VERSIONS, "esmini"])
def test_public_scenarios_move_as_before_or_are_said_not_to(
    target: str, corpora: Path, tmp_path: Path
) -> None:
    same = 0
    for path in sorted(corpora.rglob("*.xosc")):
        try:
            if xosc.load(path).kind != "scenario":
                continue
            expected = motion(Job(path.stem, path, path))
        except ToolchainError:
            continue
        folder = Folder(tmp_path / f"{same}")
        (done,) = export_documents([path], TARGETS[target], folder)
        if done.exit_code == 0:
            got = motion(Job(path.stem, path, folder.path / path.name))
            if all(_moves_as(rows, got[name]) for name, rows in expected.items()):
                same += 1
            else:
                assert any(words in remark for words in OTHERWISE for remark in done.remarks), path
    assert same >= 10


@pytest.mark.slow
@pytest.mark.parametrize(
    "target",
    [target for target in TARGETS.values() if not target.of_run],
    ids=lambda target: target.name,
)
def test_a_document_is_exported_or_refused_with_file_line_and_reason(
    target: ExportTarget, exported: Exported
) -> None:
    _, done = exported(target.name)
    check(list(done.values()))
    assert list(done) == LIBRARY


@cache
def played(scenario: Path, parameters: tuple[tuple[str, str], ...]) -> RunResult:
    """Run of a job, which all targets export."""
    return execution.run(scenario, QUICK, parameters=dict(parameters))


class Executed:
    """`runner.judging.execution` as exports use it: each job is run once."""

    @staticmethod
    def run(scenario: Path, settings: RunSettings, parameters: dict[str, str]) -> RunResult:
        assert settings == QUICK
        return copy(played(scenario, tuple(parameters.items())))  # exports add what was assumed


@pytest.mark.slow
@pytest.mark.parametrize(
    "target",
    [target for target in TARGETS.values() if target.of_run],
    ids=lambda target: target.name,
)
def test_a_run_is_exported_or_refused_with_file_and_reason(
    target: ExportTarget, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "runner.judging.execution", Executed)
    done = list(export_runs(PLAYED, target, Folder(tmp_path), QUICK, {}))
    check(
        [each for each in done if each.exit_code != ExitCode.INCONCLUSIVE]
    )  # the short time limit comes before the first event
    assert len(done) == sum(len(jobs(path)) for path in PLAYED)


def check(done: list) -> None:
    assert {each.exit_code for each in done} <= {0, 4}, [
        each for each in done if each.exit_code not in (0, 4)
    ]
    assert all(
        ".xosc:" in each.remarks[0] or ".xodr:" in each.remarks[0]
        for each in done
        if each.exit_code
    )
    assert any(each.exit_code == 0 for each in done)
