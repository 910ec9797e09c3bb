"""Results of runs read back from their folders."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import runner
from runner.batch.batch import execute
from runner.batch.jobs import Job
from runner.batch.outputs.folder import EVENTS, RESULT, TRAJECTORIES, load_run
from runner.batch.outputs.report import summary
from runner.judging.settings import RunSettings
from schemas.common.errors import InvalidFile
from tests.runner.files import place, scenario, speed_action, story


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a finished run."""
    out = tmp_path_factory.mktemp("done")
    path = scenario(
        out / "files",
        init=place("Ego", 100, 20) + place("Lead", 110, 5),
        stories=story("Ego", [(0.5, speed_action(5))]),
    )
    assert (
        execute(Job("run", path, path), RunSettings(sut=None, world="kinematic"), out).state
        == "failed"
    )
    return out / "run"


@pytest.fixture
def copy(done: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(done, tmp_path / "copy"))


def test_a_run_comes_back_as_it_was(done: Path) -> None:
    path = done.parent / "files" / "scenario.xosc"
    original, back = runner.run(path, sut=None, world="kinematic"), load_run(done)
    assert back.trajectories.equals(original.trajectories)
    assert back.events == original.events
    assert (back.verdict, back.ego, back.sut, back.status) == (
        original.verdict,
        original.ego,
        original.sut,
        original.status,
    )
    assert summary(back) == summary(original)
    assert [
        (track.kind, track.category, track.box) for track in back.recording.tracks.values()
    ] == [(track.kind, track.category, track.box) for track in original.recording.tracks.values()]


def test_the_road_may_have_moved(copy: Path) -> None:
    values = json.loads((copy / RESULT).read_text())
    road, values["files"]["road"] = Path(values["files"]["road"]), "/absent/road.xodr"
    (copy / RESULT).write_text(json.dumps(values))
    with pytest.raises(InvalidFile, match="no longer exists; give it by --road"):
        load_run(copy)
    network = load_run(copy, road).recording.network
    assert network is not None and network.path == road


def without(name: str) -> Callable[[str], str]:
    return lambda text: json.dumps(
        {key: value for key, value in json.loads(text).items() if key != name}
    )


@pytest.mark.parametrize(
    ("file", "change", "complaint"),
    [
        (RESULT, lambda _: "{", "not readable as JSON"),
        (RESULT, lambda _: "[]", "a JSON object is expected"),
        (RESULT, without("verdict"), "not the result of a run: KeyError: 'verdict'"),
        (RESULT, without("settings"), "'settings'"),
        (
            RESULT,
            lambda text: text.replace('"Lead": {', '"Leader": {'),
            "'Lead' is not among the entities",
        ),
        (EVENTS, lambda text: text + '{"time": 1}\n', "not of an event log"),
        (EVENTS, lambda text: text + "end\n", "not readable as JSON"),
        (
            RESULT,
            lambda text: text.replace('"end_time": ', '"end_time": NaN, "was": '),
            "end_time is nan",
        ),
        (RESULT, lambda text: text.replace('"timestep": 0.05', '"timestep": 0'), "timestep is 0"),
        (RESULT, lambda text: text.replace('"length": 5.0', '"length": Infinity'), "length is inf"),
        (
            EVENTS,
            lambda text: text + '{"time": NaN, "kind": "note", "subject": "a", "text": "b"}\n',
            "not of an event log",
        ),
        (TRAJECTORIES, lambda _: "PAR1", "the results of a run can't be read"),
    ],
)
def test_damaged_results_are_refused(
    copy: Path, file: str, change: Callable[[str], str], complaint: str
) -> None:
    text = "" if file == TRAJECTORIES else (copy / file).read_text()
    (copy / file).write_text(change(text))
    with pytest.raises(InvalidFile, match=complaint):
        load_run(copy).trajectories


@pytest.mark.parametrize(
    ("column", "values", "complaint"),
    [
        ("x", lambda old: [math.nan] * len(old), "column x has values"),
        ("y", lambda old: [1e300] * len(old), "column y has values"),
        ("h", lambda old: [None] * len(old), "column h has values"),
        ("speed", lambda old: ["fast"] * len(old), "'fast'"),
        ("time", lambda old: old[::-1], "times of Ego do not ascend"),
    ],
)
def test_values_that_no_run_has_are_refused(
    copy: Path, column: str, values: Callable[[list], list], complaint: str
) -> None:
    table = pq.read_table(copy / TRAJECTORIES)
    index = table.column_names.index(column)
    changed = table.set_column(index, column, pa.array(values(table[column].to_pylist())))
    pq.write_table(changed, copy / TRAJECTORIES)
    with pytest.raises(InvalidFile, match=complaint):
        load_run(copy).trajectories


@pytest.mark.parametrize("file", [RESULT, EVENTS, TRAJECTORIES])
def test_missing_files_are_named(copy: Path, file: str) -> None:
    (copy / file).unlink()
    with pytest.raises(InvalidFile, match=f"{file}: .*[Nn]o such file"):
        load_run(copy)
