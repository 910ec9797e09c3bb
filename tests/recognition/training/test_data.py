"""Windows of recordings, kept for the next time, and features without an encoder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recognition.grids import Grid
from recognition.labels import Label
from recognition.training.windows import fingerprint, source_of, windows_at
from schemas.common.errors import InvalidFile, UsageError
from studies.recognition.protocol.pixels import pixel_features
from tests.recognition.traffic import Car, write_highd

GRID = Grid(length=20.0, width=8.0, channels=("others", "speed"))
CARS = [Car(1, 0.0, 21.0, 30.0, frames=500, lane=6), Car(2, 0.0, 25.0, 25.0, frames=500, lane=7)]


@pytest.fixture
def recordings(tmp_path: Path) -> Path:
    write_highd(tmp_path / "recordings", CARS)
    return tmp_path / "recordings"


def test_recordings_become_windows_of_the_events_that_rules_find(recordings: Path, tmp_path: Path) -> None:
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


def test_frequent_classes_are_thinned_before_they_are_drawn(recordings: Path, tmp_path: Path) -> None:
    everything = windows_at(recordings, tmp_path / "all", GRID, None)
    thinned = windows_at(recordings, tmp_path / "few", GRID, 2)
    assert len(thinned) == 2 < len(everything)


def test_saved_windows_are_taken_as_they_are_if_their_grid_is_right(recordings: Path, tmp_path: Path) -> None:
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
    assert found.shape == (60, 30)
    means = [found[labels == label].mean(axis=0) for label in (0, 1)]
    assert np.linalg.norm(means[0] - means[1]) > 5 * found[labels == 0, 1].std()
    assert np.array_equal(found, pixel_features(grids[:30], grids, seed=0))
