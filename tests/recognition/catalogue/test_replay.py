"""Scenes of recordings as scenarios that replay them: who takes part, and that
runs repeat what was recorded.
"""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import xosc
from recognition import recordings as datasets
from recognition.catalogue.whole import write_replay
from recognition.catalogue.writing import replay
from recognition.catalogue.writing.replay import entry
from recognition.scenes.cut import Excerpt, SceneCutter, Scope, needed
from runner import run
from runner.recording import Recording
from schemas import check
from studies.recognition.fidelity import replayed
from tests.recognition import motorway
from xosc.writing import maneuvers
from xosc.writing.versions import Version

HEADER = maneuvers.FileHeader("a test", "a tester", datetime(2000, 1, 1))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    folder = tmp_path_factory.mktemp("motorway")
    (source,) = datasets.open(motorway.write_motorway(folder), roads=folder).sources
    return source.load()


def write(folder: Path, recording: Recording, scene: Excerpt, version: Version = (1, 3)) -> Path:
    """A scenario with its catalogues."""
    entries = {part.name: entry(part.track) for part in scene.parts}
    built = {
        kind: {e.name: e.built for e in entries.values() if e.kind == kind}
        for kind in {e.kind for e in entries.values()}
    }
    built["Trajectory"] = {path.name: path for path in replay.trajectories(scene)}
    for kind, content in built.items():
        path = folder / kind / "catalog.xosc"
        path.parent.mkdir(exist_ok=True)
        xosc.write(
            maneuvers.catalog(path, HEADER, f"{kind}Catalog", list(content.values()), version), path
        )
    assert recording.network is not None
    (folder / "road.xodr").write_bytes(Path(recording.network.path).read_bytes())
    path = folder / "scenario.xosc"
    catalogs = {kind: kind for kind in built}
    content = replay.scenario(
        path, HEADER, scene, road="road.xodr", entries=entries, catalogs=catalogs, version=version
    )
    path.write_bytes(content)
    return path


def test_those_who_come_near_take_part(recording: Recording) -> None:
    scene = SceneCutter(recording, Scope()).cut(motorway.EGO, 1.0, 7.0)
    assert [part.name for part in scene.parts] == [
        "Ego",
        "car_2",
        "car_3",
        "car_4",
        "truck_5",
        "car_6",
    ]
    scene = SceneCutter(recording, Scope(reach=30.0)).cut(motorway.EGO, 5.0, 7.0)
    assert [part.name for part in scene.parts] == ["Ego", "car_3", "car_4", "car_6"], (
        "the one that cuts in is 40 m ahead"
    )


def test_scenes_end_with_the_ego(recording: Recording) -> None:
    scene = SceneCutter(recording, Scope()).cut(motorway.LATE, -5.0, 60.0)
    assert (scene.start, scene.end) == (4.0, 8.0)
    assert scene.ego.track.name == motorway.LATE


@pytest.mark.parametrize("version", [(1, 0), (1, 1), (1, 2), (1, 3)])
def test_replays_are_valid_and_sound_in_every_version(
    tmp_path: Path, recording: Recording, version: Version
) -> None:
    write(tmp_path, recording, SceneCutter(recording, Scope()).cut(motorway.EGO, 1.0, 9.0), version)
    files = sorted(tmp_path.rglob("*.xosc"))
    assert [problem for file in files for problem in check(file)] == []
    assert {xosc.load(file).version for file in files} == {version}


@pytest.mark.parametrize(
    ("ego", "world"),
    [(motorway.EGO, "sumo"), (motorway.OTHER_EGO, "kinematic"), (motorway.STOPPING, "kinematic")],
)
def test_runs_repeat_what_was_recorded(
    tmp_path: Path, recording: Recording, ego: str, world: str
) -> None:
    scene = SceneCutter(recording, Scope()).cut(ego, 0.5, 11.9)
    deviations = replayed(write(tmp_path, recording, scene), scene, world).deviations
    assert len(deviations) == len(scene.parts) >= 4
    assert max(each.greatest for each in deviations) < 0.03
    assert max(each.missing for each in deviations) <= 2, (
        "all are there but for the step in which they come"
    )
    assert max(each.speed for each in deviations) < 0.1
    assert max(each.acceleration for each in deviations) < 0.5
    assert max(each.hardest for each in deviations) < 6.0, (
        "those who come later have their speed at once"
    )


def test_who_enters_for_two_rows_has_both(recording: Recording) -> None:
    """A truck comes at 2.04 s, between two steps of usual runs."""
    start = float(recording.tracks["5"].columns["time"][0])
    scene = SceneCutter(recording, Scope()).cut(motorway.EGO, 0.5, start + 0.05)
    (part,) = (part for part in scene.parts if part.track.name == "5")
    assert len(part.rows) == 2


def test_who_stands_at_the_end_of_a_trajectory_stays_there(
    tmp_path: Path, recording: Recording
) -> None:
    scene = SceneCutter(recording, Scope()).cut(motorway.STOPPING, 0.0, 11.9)
    assert scene.ego.column("speed")[-1] == pytest.approx(0.0, abs=1e-6)
    (ego, *_) = replayed(write(tmp_path, recording, scene), scene, "kinematic").deviations
    assert ego.greatest < 0.03


def test_entries_of_one_name_have_one_content(recording: Recording) -> None:
    entries = {name: entry(track) for name, track in recording.tracks.items()}
    assert entries["1"].name == entries["2"].name == "car_4.00x2.00x1.50_x1.20"
    assert entries["5"].name == "truck_12.00x2.00x3.50_x3.60"
    box = entries["5"].built.boundingbox
    assert (box.boundingbox.length, box.boundingbox.width, box.center.x) == (12.0, 2.0, 3.6)


@pytest.mark.parametrize("raw", [False, True])
def test_whole_recordings_are_replayed_smoothed_unless_raw(raw: bool, tmp_path: Path) -> None:
    path = motorway.write_motorway(tmp_path)
    made = write_replay(path, tmp_path / "whole.xosc", ego=motorway.STOPPING, raw=raw)
    assert any("off the recorded places; --raw" in remark for remark in made.remarks) != raw
    content = made.files[0].read_text(encoding="utf-8")
    assert ('followingMode="position"' in content) == raw
    assert ('followingMode="follow"' in content) != raw
    (source,) = datasets.open(path).sources
    recorded = source.load().tracks[motorway.STOPPING].columns
    played = run(made.files[0], sut=None, world="kinematic", timestep=0.04).recording
    x = np.interp(recorded["time"], *(played.tracks["Ego"].columns[name] for name in ("time", "x")))
    assert x == pytest.approx(recorded["raw_x" if raw else "x"], abs=1.5e-3 if raw else 0.03)


@given(st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=60))
def test_left_out_rows_are_within_the_tolerance(steps: list[float]) -> None:
    values = np.cumsum(steps)[:, None]
    time = np.arange(len(steps), dtype=float)
    rows = needed(time, values)
    assert {0, len(steps) - 1} <= set(rows.tolist())
    assert np.abs(np.interp(time, time[rows], values[rows, 0]) - values[:, 0]).max() <= 1.0 + 1e-9
