"""Windows of recordings, kept for the next time, and features without an encoder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recognition.labels import Label
from recognition.trfe.inputs.grids import Grid
from recognition.trfe.inputs.samples import BACKGROUND
from recognition.trfe.training.windows import fingerprint, judged, reviewed, source_of, windows_at
from schemas.common.errors import InvalidFile, UsageError
from studies.recognition.protocol.pixels import pixel_features
from tests.recognition.traffic import Car, write_highd

GRID = Grid(length=20.0, width=8.0, channels=("others", "speed"))
CARS = [Car(1, 0.0, 21.0, 30.0, frames=500, lane=6), Car(2, 0.0, 25.0, 25.0, frames=500, lane=7)]


@pytest.fixture
def recordings(tmp_path: Path) -> Path:
    write_highd(tmp_path / "recordings", CARS)
    return tmp_path / "recordings"


def test_recordings_become_windows_of_the_events_that_rules_find(
    recordings: Path, tmp_path: Path
) -> None:
    windows = windows_at(recordings, tmp_path / "cache", GRID, None)
    assert set(windows.labels.tolist()) == {Label.FREE_CRUISE}
    assert set(windows.egos.tolist()) == {"1", "2"}
    assert windows.inputs.shape[1:] == GRID.shape


def test_windows_are_made_once(recordings: Path, tmp_path: Path) -> None:
    first = windows_at(recordings, tmp_path / "cache", GRID, None)
    (recordings / "01_tracks.csv").unlink()
    again = windows_at(recordings, tmp_path / "cache", GRID, None)
    assert fingerprint(again) == fingerprint(first)
    assert fingerprint(again.select(slice(1, None))) != fingerprint(first)


def test_other_recordings_have_another_digest(recordings: Path) -> None:
    before = source_of(recordings)
    assert source_of(recordings) == before
    write_highd(recordings, CARS[:1], name="02")
    assert source_of(recordings) != before


def test_frequent_classes_are_thinned_before_they_are_drawn(
    recordings: Path, tmp_path: Path
) -> None:
    everything = windows_at(recordings, tmp_path / "all", GRID, None)
    thinned = windows_at(recordings, tmp_path / "few", GRID, 2)
    assert len(thinned) == 2 < len(everything)


def test_saved_windows_are_taken_as_they_are_if_their_grid_is_right(
    recordings: Path, tmp_path: Path
) -> None:
    windows_at(recordings, tmp_path / "windows", GRID, None)
    assert len(windows_at(tmp_path / "windows", tmp_path / "unused", GRID, None))
    assert not (tmp_path / "unused").exists()
    with pytest.raises(UsageError, match="not of the shape"):
        windows_at(tmp_path / "windows", tmp_path / "unused", Grid(), None)


def test_folder_without_recordings_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidFile, match="no recording of a known format"):
        windows_at(tmp_path, tmp_path / "cache", GRID, None)


def test_components_tell_windows_apart_that_look_different() -> None:
    labels = np.arange(60) % 2
    grids = np.random.default_rng(0).integers(0, 40, (60, 4, 2, 9, 21), dtype=np.uint8)
    grids[labels == 1, :, :, 2:6, 4:8] += 150
    found = pixel_features(grids[:30], grids, seed=0)
    assert found.shape == (60, 3)
    means = [found[labels == label].mean(axis=0) for label in (0, 1)]
    assert np.linalg.norm(means[0] - means[1]) > 5 * found[labels == 0, 1].std()
    assert np.array_equal(found, pixel_features(grids[:30], grids, seed=0))


FINDINGS = "number,recording,vehicle,time,class,verdict,reason\n"
LISTED = "recording,vehicle,start,end,class,time\n"


def table(path: Path, header: str, *rows: str) -> Path:
    path.write_text(header + "\n".join(rows) + "\n", encoding="utf-8")
    return path


def test_verdicts_of_reviewers_are_labels_unless_they_contradict_each_other(tmp_path: Path) -> None:
    first = table(
        tmp_path / "first.csv",
        FINDINGS,
        "0,01,1,8.0,left lane change,right,",
        "1,01,2,5.0,highway cut in,wrong,nobody is ahead",
        "2,01,1,14.0,highway cut out,right,",
        "3,01,2,9.0,highway cut out,unclear,",
    )
    second = table(
        tmp_path / "second.csv",
        FINDINGS,
        "0,01,1,8.0,left lane change,right,",
        "2,01,1,14.0,highway cut out,wrong,",
    )
    listed = table(
        tmp_path / "listed.csv", LISTED, "01,2,4.0,14.0,right lane change,12.0", "01,1,0.0,10.0,,"
    )
    found = [(one.ego, one.time, one.label) for one in judged([first, second, listed])]
    left, right = int(Label.LANE_CHANGE_LEFT), int(Label.LANE_CHANGE_RIGHT)
    assert found == [("1", 8.0, left), ("2", 5.0, BACKGROUND), ("1", 8.0, left), ("2", 12.0, right)]


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("0,01,1,8.0,overtaking,right,", "first.csv:2.*column class.*'overtaking' is none of"),
        (
            "0,01,1,8.0,left lane change,yes,",
            "first.csv:2.*column verdict.*'yes' is none of right, wrong, unclear",
        ),
        ("0,01,1,,left lane change,right,", "first.csv:2.*column time.*missing"),
    ],
)
def test_a_verdict_that_is_none_is_refused_with_its_line(
    tmp_path: Path, row: str, message: str
) -> None:
    with pytest.raises(InvalidFile, match=message):
        judged([table(tmp_path / "first.csv", FINDINGS, row)])


def test_judged_moments_become_windows_of_their_recordings(
    recordings: Path, tmp_path: Path
) -> None:
    event = windows_at(recordings, tmp_path / "cache", GRID, None).select([0])
    name, ego, time = event.recordings[0], event.egos[0], event.times[0]
    rows = f"0,{name},{ego},{time},left lane change,wrong,", f"1,{name},9,8.0,highway cut in,right,"
    windows = reviewed(
        [recordings],
        judged([table(tmp_path / "verdicts.csv", FINDINGS, *rows)]),
        tmp_path / "roads",
        GRID,
    )
    assert (windows.egos.tolist(), windows.times.tolist(), windows.labels.tolist()) == (
        [ego],
        [time],
        [BACKGROUND],
    )
    assert np.array_equal(windows.inputs, event.inputs)
    elsewhere = table(tmp_path / "elsewhere.csv", FINDINGS, "0,other,1,8.0,left lane change,right,")
    with pytest.raises(UsageError, match="no verdict is on a vehicle of these recordings"):
        reviewed([recordings], judged([elsewhere]), tmp_path / "roads", GRID)
