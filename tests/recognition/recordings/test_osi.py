"""OSI traces as recordings of a data set, and catalogues of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import runner
import xosc
from recognition import recordings as datasets
from recognition import xosc_recognize
from recognition.catalogue.whole import write_replay
from recognition.scenes import site_of
from runner.exchange.exports import osi
from runner.exchange.traces.reading import read as read_trace
from schemas.common.errors import UsageError
from schemas.osi.traces import Trace
from tests.runner.exchange.test_traces import truths, write

pytest.importorskip("osi3", reason="the extra `osi` is not installed")

LIBRARY = Path(xosc.__file__).parent / "library"


@pytest.fixture(scope="module")
def trace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("osi") / "trace.mcap"
    osi.write_trace(
        runner.run(
            LIBRARY / "highway_lead_brake.xosc", world="kinematic", sut="none", max_time=8.0
        ),
        path,
    )
    return path


def test_a_trace_is_a_recording_with_a_road(trace: Path, tmp_path: Path) -> None:
    (source,) = datasets.open(trace.parent).sources
    assert (source.name, source.format) == ("trace", "OSI")
    recording = source.load()
    site = site_of(source, recording, tmp_path)
    assert source.report is not None and source.report.rows == sum(
        len(each.columns["time"]) for each in recording.tracks.values()
    )
    assert any("the roads are drawn from the lanes" in each for each in source.report.remarks)
    assert site.network.roads


def test_gaps_in_tracks_are_reported(trace: Path, tmp_path: Path) -> None:
    messages = [frame.truth for frame in Trace(trace).frames()][:40]
    del messages[10].moving_object[0], messages[11].moving_object[0]
    write(tmp_path / "gap.osi", [each.SerializeToString() for each in messages])
    (source,) = datasets.open(tmp_path).sources
    source.load()
    assert source.report is not None
    assert [(gap.missing, round(gap.end - gap.start, 3)) for gap in source.report.gaps] == [
        (2, 0.15)
    ]


def test_a_trace_without_roads_says_how_to_give_one(tmp_path: Path) -> None:
    write(tmp_path / "bare.osi", [each.SerializeToString() for each in truths()])
    (source,) = datasets.open(tmp_path).sources
    with pytest.raises(
        UsageError,
        match=r"bare has no road: no map, no lanes, and no bare\.xodr beside "
        r"it; give one by --road",
    ):
        site_of(source, source.load(), tmp_path)


def test_a_trace_becomes_one_scenario_that_replays_it(trace: Path, tmp_path: Path) -> None:
    made = write_replay(trace, tmp_path / "replay.xosc")
    assert made.files == [tmp_path / "replay.xosc", tmp_path / "replay.xodr"]
    result = runner.run(tmp_path / "replay.xosc", world="kinematic", sut="none")
    recorded = read_trace(trace).recording.tracks
    assert result.recording.tracks.keys() >= {"Ego"} and len(result.recording.tracks) == len(
        recorded
    )
    was, now = recorded["Ego"].columns, result.recording.tracks["Ego"].columns
    assert (
        np.hypot(
            *(np.interp(now["time"], was["time"], was[axis]) - now[axis] for axis in "xy")
        ).max()
        < 0.05
    )


def test_a_road_that_is_given_counts_before_the_trace_s_own(trace: Path, tmp_path: Path) -> None:
    road = LIBRARY.parents[1] / "xodr" / "library" / "highway_straight.xodr"
    made = write_replay(trace, tmp_path / "replay.xosc", road=road)
    assert (tmp_path / "replay.xodr").read_bytes() == road.read_bytes()
    assert "the road is highway_straight.xodr, as --road says" in made.remarks


def test_a_trace_without_roads_is_replayed_on_a_plane(tmp_path: Path) -> None:
    path = write(tmp_path / "bare.osi", [each.SerializeToString() for each in truths()])
    made = write_replay(path, tmp_path / "replay.xosc")
    assert made.files == [tmp_path / "replay.xosc"]
    assert (
        "the recording names no ego: 7 is it, which is there for longest; --ego chooses another one"
        in made.remarks
    )
    with pytest.raises(
        UsageError, match="no participant 'nobody' is there for two messages; there are 7"
    ):
        write_replay(path, tmp_path / "other.xosc", ego="nobody")


def test_a_catalogue_is_made_of_a_trace_on_a_given_road(trace: Path, tmp_path: Path) -> None:
    arguments = ["catalogue", str(trace), "--out", str(tmp_path / "catalogue"), "--labels", "rules"]
    road = LIBRARY.parents[1] / "xodr" / "library" / "highway_straight.xodr"
    answer = CliRunner().invoke(xosc_recognize.app, [*arguments, "--road", str(road)])
    assert answer.exit_code == 0, answer.output
    assert list((tmp_path / "catalogue").rglob("*.xosc"))
