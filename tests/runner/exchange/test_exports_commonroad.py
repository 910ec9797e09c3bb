"""CommonRoad scenarios: read back by this project's own reader (by commonroad-io
in tests/readers).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import runner
import xodr
from recognition.recordings.formats import commonroad as reader
from runner.exchange.exports import commonroad
from runner.exchange.exports.moments import box_centre
from schemas.common.errors import Unsupported
from tests.runner.files import ROADS, car, place, scenario, story
from xodr.formats.commonroad import lanelets as read_lanelets
from xodr.lookup.lanelets import lanelets
from xosc.exports.draft import Folder

LIBRARY = Path(xodr.__file__).parent / "library"


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> runner.RunResult:
    path = scenario(
        tmp_path_factory.mktemp("commonroad"),
        road="curve",
        entities=[car("Ego"), car("Other")],
        init=place("Ego", 20, 10) + place("Other", 150, 12, lane=1),
    )
    return runner.run(path, world="kinematic", timestep=0.1, sut="none")


@pytest.fixture(scope="module")
def exported(result: runner.RunResult, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exported")
    assert commonroad.export(result, "curve", Folder(folder)) == []
    return folder / "curve.xml"


def states(result: runner.RunResult, name: str) -> np.ndarray:
    """Centre x, y, heading and speed of a participant."""
    track = result.recording.tracks[name]
    heading = np.arctan2(np.sin(track.columns["h"]), np.cos(track.columns["h"]))
    return np.column_stack([box_centre(track)[:, :2], heading, track.columns["speed"]])


def test_our_own_reader_finds_the_obstacles_where_they_were(
    result: runner.RunResult, exported: Path
) -> None:
    (source,) = reader.sources(exported, exported.parent)
    recording, report = source.read()
    assert not report.exclusions
    (track,) = recording.tracks.values()
    got = np.column_stack([box_centre(track)[:, :2], track.columns["h"], track.columns["speed"]])
    assert np.allclose(got, states(result, "Other"), atol=1e-5)
    assert (track.category, recording.timestep) == ("car", 0.1)


def test_our_own_reader_finds_the_lanelets(exported: Path) -> None:
    (source,) = reader.sources(exported, exported.parent)
    expected = list(lanelets(xodr.load(ROADS / "curve.xodr")).values())
    for read, lanelet in zip(read_lanelets(reader.document(source.path)), expected, strict=True):
        assert np.allclose(read.left, lanelet.left[:, :2], atol=1e-5)
        assert np.allclose(read.right, lanelet.right[:, :2], atol=1e-5)


@pytest.mark.parametrize(
    "name", ["highway_on_ramp", "intersection_four_way_two_lanes", "t_junction_two_lanes"]
)
def test_lanelets_lie_left_to_right_and_end_where_the_next_begin(name: str) -> None:
    found = lanelets(xodr.load(LIBRARY / f"{name}.xodr"))
    for lanelet in found.values():
        ahead = (lanelet.left + lanelet.right)[1:] - (lanelet.left + lanelet.right)[:-1]
        aside = (lanelet.left - lanelet.right)[:-1]
        assert (ahead[:, 0] * aside[:, 1] - ahead[:, 1] * aside[:, 0] >= -1e-9).all(), lanelet.key
        for key in lanelet.successors:
            assert np.linalg.norm(found[key].left[0] - lanelet.left[-1]) < 0.05, (lanelet.key, key)
            assert np.linalg.norm(found[key].right[0] - lanelet.right[-1]) < 0.05, (
                lanelet.key,
                key,
            )
            assert lanelet.key in found[key].predecessors
        left, _ = lanelet.beside
        if left is not None and left[1]:
            assert np.allclose(found[left[0]].right, lanelet.left)
        elif left is not None:
            assert np.allclose(found[left[0]].left[::-1], lanelet.left)
    assert any(lanelet.in_junction for lanelet in found.values())


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("cut_in", "ZAM_CutIn-1_1_T-1"),
        ("cut_in~000003", "ZAM_CutIn-1_4_T-1"),
        ("a~b", "ZAM_AB-1_1_T-1"),
        ("~", "ZAM_Run-1_1_T-1"),
    ],
)
def test_benchmark_ids_count_sets_of_parameters_as_configurations(name: str, expected: str) -> None:
    assert commonroad.benchmark_id(name) == expected


def test_the_goal_is_where_the_ego_was_before_it_hit_somebody(tmp_path: Path) -> None:
    crash = place("Ego", 20, 20) + place("Other", 40, 0)
    path = scenario(tmp_path, entities=[car("Ego"), car("Other")], init=crash, stop=3.0)
    crashed = runner.run(path, world="kinematic", timestep=0.1, sut="none")
    assert crashed.verdict.reasons
    (goal,) = commonroad.scenario(crashed, "crash", []).iter("goalState")
    centre = [float(goal.findtext(f"position/rectangle/center/{axis}", "")) for axis in "xy"]
    ego, other = (box_centre(crashed.recording.tracks[name]) for name in ("Ego", "Other"))
    gaps = other[:, 0] - ego[:, 0] - 5.0
    (row,) = np.flatnonzero(np.isclose(ego[:, 0], centre[0], atol=1e-5))
    assert gaps[row] > 0.0 >= gaps[row + 1]
    interval = [float(goal.findtext(f"orientation/interval{end}", "")) for end in ("Start", "End")]
    assert interval[0] < crashed.recording.tracks["Ego"].columns["h"][row] < interval[1]


def test_a_run_without_an_ego_is_refused(tmp_path: Path) -> None:
    path = scenario(
        tmp_path,
        entities=[car("A"), car("B")],
        init=place("A", 20, 10) + place("B", 60, 10),
        stories=story("A", []),
    )
    other = runner.run(path, world="kinematic", sut="none", timestep=0.1)
    with pytest.raises(Unsupported, match="no ego to plan for"):
        commonroad.export(other, "run", Folder(tmp_path / "out"))
    assert not (tmp_path / "out").exists()
