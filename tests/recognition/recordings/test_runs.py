"""This project's own runs, read back."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import runner
from recognition import recordings as datasets
from recognition.recordings.formats import runs
from runner.batch.batch import run_batch
from runner.batch.jobs import jobs_of
from runner.batch.outputs.folder import write_run
from runner.judging.settings import RunSettings
from runner.recording import COLUMNS
from schemas.common.errors import InvalidFile
from tests.recognition.traffic import read, total_rows

SCENARIO = Path(runner.__file__).parents[1] / "xosc" / "library" / "simple_cut_in.xosc"


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of a shipped scenario, as `xosc-run --out` leaves them."""
    out = tmp_path_factory.mktemp("out")
    (outcome,) = run_batch(jobs_of([SCENARIO], {}, True), RunSettings(), out=out)
    assert outcome.state == "passed"
    return out


@pytest.fixture
def run(finished: Path, tmp_path: Path) -> Path:
    """A copy of the folder of its only run."""
    return Path(shutil.copytree(finished / "simple_cut_in", tmp_path / "simple_cut_in"))


def test_rows_are_those_that_the_run_wrote_down(finished: Path) -> None:
    recording, report = read(finished)
    original = runner.run(SCENARIO).recording
    assert list(recording.tracks) == list(original.tracks) == ["Ego", "CutIn"]
    for name, track in original.locate().tracks.items():
        again = recording.tracks[name]
        assert (again.kind, again.category, again.box) == (track.kind, track.category, track.box)
        for column in COLUMNS:
            assert again.columns[column].tolist() == track.columns[column].tolist()
    assert recording.timestep == original.timestep
    assert (report.rows, report.missing, report.excluded) == (total_rows(original), 0, 0)


def test_table_written_again_is_the_same(finished: Path) -> None:
    stored = pq.read_table(finished / "simple_cut_in" / "trajectories.parquet")
    assert read(finished)[0].table().equals(stored)


def test_recording_knows_its_road(finished: Path) -> None:
    network = read(finished)[0].network
    assert network is not None
    ego = read(finished)[0].tracks["Ego"].columns
    point = network.locate(float(ego["x"][0]), float(ego["y"][0]))
    assert (point.road_id, point.lane_id, point.s) == (
        ego["road_id"][0],
        ego["lane_id"][0],
        pytest.approx(ego["s"][0]),
    )


def test_run_whose_road_is_gone_is_read_without_and_says_so(run: Path) -> None:
    change(run, files={"scenario": "gone.xosc", "road": "/gone/road.xodr"})
    recording, report = read(run)
    assert recording.network is None
    assert report.remarks == ["the road network /gone/road.xodr is not there any more"]


def test_runs_of_one_scenario_have_one_site(run: Path) -> None:
    for k in range(3):
        shutil.copytree(run, run.parent / f"cut_in~{k:06d}")
    shutil.rmtree(run)
    assert {source.site for source in datasets.open(run.parent).sources} == {"cut_in"}


def change(run: Path, **values: object) -> None:
    """Change entries of a run's result.json."""
    path = run / "result.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | values))


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"settings": {}}, "KeyError: 'timestep'"),
        ({"settings": {"timestep": "fast"}}, "timestep is 'fast'"),
        ({"settings": {"timestep": 0}}, "timestep is 0"),
        ({"settings": []}, "TypeError"),
        ({"entities": []}, "AttributeError"),
        ({"entities": {"Ego": {"box": {}, "kind": "vehicle"}}}, "KeyError: 'category'"),
        ({"entities": {"Ego": {"box": {}, "kind": "vehicle", "category": "car"}}}, "KeyError: 'x'"),
        ({"files": {"scenario": "a.xosc", "road": 7}}, "TypeError"),
    ],
)
def test_bad_result_is_refused(run: Path, values: dict, complaint: str) -> None:
    change(run, **values)
    with pytest.raises(
        InvalidFile, match=rf"result\.json: this is not the result of a run: .*{complaint}"
    ):
        read(run)


def test_participant_that_the_result_does_not_know_is_refused(run: Path) -> None:
    change(run, entities={})
    with pytest.raises(
        InvalidFile,
        match=r"trajectories\.parquet: 'CutIn' is not among the entities of result\.json",
    ):
        read(run)


@pytest.mark.parametrize("content", [b"", b"{", b"\xff\xfe", b"[" * 100_000, b"nonsense"])
def test_result_that_is_no_json_is_refused(run: Path, content: bytes) -> None:
    (run / "result.json").write_bytes(content)
    with pytest.raises(InvalidFile, match=r"result\.json.*: not readable as JSON"):
        read(run)


@pytest.mark.parametrize("content", [b"[]", b"1", b"null"])
def test_result_that_is_no_object_is_refused(run: Path, content: bytes) -> None:
    (run / "result.json").write_bytes(content)
    with pytest.raises(InvalidFile, match=r"result\.json: a JSON object is expected"):
        read(run)


@pytest.mark.parametrize("what", [runs.road, runs.scenario])
def test_files_of_a_run_are_named_or_refused(run: Path, what: Callable[[Path], Path]) -> None:
    trajectories = run / "trajectories.parquet"
    assert what(trajectories).is_file()
    for name in ("/gone", "a" * 5000, "\0"):
        change(run, files={"scenario": name, "road": name})
        with pytest.raises(InvalidFile, match=f"the {what.__name__} of this run, .* is not there"):
            what(trajectories)


def test_run_on_no_road_names_none(run: Path) -> None:
    change(run, files={"scenario": "/gone.xosc", "road": None})
    with pytest.raises(InvalidFile, match=r"result\.json: the run has no road"):
        runs.road(run / "trajectories.parquet")


def test_damaged_trajectories_are_refused(run: Path) -> None:
    path = run / "trajectories.parquet"
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InvalidFile, match=r"trajectories\.parquet: the file can't be read"):
        read(run)


def test_time_that_goes_back_is_refused_with_its_row(run: Path) -> None:
    path = run / "trajectories.parquet"
    table = pq.read_table(path)
    time = table["time"].to_numpy().copy()
    time[8] = 0.0
    pq.write_table(table.set_column(0, "time", [np.asarray(time)]), path)
    with pytest.raises(
        InvalidFile, match=r"trajectories\.parquet: column time: row 9: 0 of track Ego comes after"
    ):
        read(run)


@pytest.mark.parametrize(
    ("weather", "road", "expected"),
    [
        (
            '<Precipitation precipitationType="rain" precipitationIntensity="5"/>',
            'frictionScaleFactor="0.7" wetness="wetWithPuddles"',
            ("rain", "unknown", "standing water"),
        ),
        (
            '<Sun azimuth="0" elevation="-0.3" illuminance="0"/><Fog visualRange="200"/>',
            'frictionScaleFactor="1"',
            ("fog", "night", "unknown"),
        ),
        ("", 'frictionScaleFactor="1" wetness="dry"', ("clear", "unknown", "dry")),
    ],
)
def test_conditions_are_those_that_the_scenario_sets(
    weather: str, road: str, expected: tuple[str, str, str], tmp_path: Path
) -> None:
    action = (
        f'<GlobalAction><EnvironmentAction><Environment name="e"><Weather '
        f'fractionalCloudCover="oneOktas">{weather}</Weather><RoadCondition {road}/>'
        "</Environment></EnvironmentAction></GlobalAction>"
    )
    text = SCENARIO.read_text().replace("<Actions>", f"<Actions>{action}", 1)
    text = text.replace("../../xodr", str(SCENARIO.parents[2] / "xodr"))
    text = text.replace('path="catalogs', f'path="{SCENARIO.parent / "catalogs"}')
    scenario = tmp_path / "wet.xosc"
    scenario.write_text(text)
    result = runner.run(scenario, world="kinematic", sut="none", max_time=1.0)
    write_run(result, tmp_path / "run")
    (source,) = datasets.open(tmp_path / "run").sources
    source.load()
    assert source.conditions()[:3] == expected
    scenario.unlink()
    assert source.conditions()[:3] == ("unknown",) * 3
