"""Windows: made from events, kept in files."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from recognition.trfe.inputs.grids import Grid
from recognition.trfe.training.windows import Windows, store, windows_of
from schemas.common.errors import InvalidFile, UsageError
from tests.recognition.built_scenes import Driver, recording

GRID = Grid(40.0, 20.0, 1.0, 1.0, channels=("others", "ego"))


@pytest.fixture
def windows():
    events = [SimpleNamespace(recording="r", ego=ego, time=time, label=label) for ego, time,
        label in
              (("a", 1.5, 3), ("b", 2.0, 0), ("a", 0.1, 5), ("b", 2.5, 17))]  # fmt: skip
    return windows_of(recording([Driver("a", speed=9.0), Driver("b", 9.0, 3.0)]), events, GRID)


def test_events_become_windows_but_for_those_at_the_ends_of_the_egos_track(windows):
    assert windows.labels.tolist() == [3, 0, 17]
    assert windows.egos.tolist() == ["a", "b", "b"]
    assert windows.times.tolist() == [1.5, 2.0, 2.5]
    assert set(windows.recordings) == {"r"}
    assert windows.inputs.shape == (3, *GRID.shape)


def test_no_events_make_no_windows():
    empty = windows_of(recording([Driver("a")]), [], GRID)
    assert len(empty) == 0
    assert empty.inputs.shape == (0, *GRID.shape)


def test_windows_are_read_as_they_were_saved_and_their_inputs_only_when_asked_for(
    windows, tmp_path
):
    windows.save(tmp_path / "set")
    read = Windows.load(tmp_path / "set")
    assert isinstance(read.inputs, np.memmap)
    for name in ("inputs", "labels", "recordings", "egos", "times"):
        assert (getattr(read, name) == getattr(windows, name)).all()
        assert getattr(read, name).dtype.kind == getattr(windows, name).dtype.kind


def test_an_archive_in_the_place_of_the_inputs_is_refused(windows, tmp_path):
    windows.save(tmp_path / "set")
    with (tmp_path / "set" / "inputs.npy").open("wb") as file:
        np.savez(file, windows.inputs)
    with pytest.raises(InvalidFile, match=r"inputs\.npy is an archive, an array is expected"):
        Windows.load(tmp_path / "set")


def test_selection_keeps_all_columns_together(windows):
    for chosen in (windows.labels == 17, [2], slice(2, 3), np.array([2])):
        one = windows.select(chosen)
        assert (one.labels.tolist(), one.times.tolist()) == ([17], [2.5])
        assert (one.inputs[0] == windows.inputs[2]).all()


def test_windows_of_several_recordings_follow_each_other_in_a_folder(windows, tmp_path):
    assert store(iter([windows.select([2]), windows]), tmp_path) == 4
    both = Windows.load(tmp_path)
    assert both.labels.tolist() == [17, 3, 0, 17]
    assert (both.inputs[0] == windows.inputs[2]).all() and (both.inputs[1:] == windows.inputs).all()


def test_windows_of_different_grids_are_not_stored(windows, tmp_path):
    other = Windows(windows.inputs[:, :, :1], *windows.columns[1:])
    with pytest.raises(UsageError, match="do not fit after"):
        store([windows, other], tmp_path)
    with pytest.raises(InvalidFile):
        Windows.load(tmp_path)


@pytest.mark.parametrize(
    "damage", ["no folder", "truncated grids", "no table", "other table", "other grids"]
)
def test_damaged_files_give_one_clear_error(windows, tmp_path, damage):
    if damage != "no folder":
        windows.save(tmp_path)
    grids, table = tmp_path / "inputs.npy", tmp_path / "windows.parquet"
    if damage == "truncated grids":
        grids.write_bytes(grids.read_bytes()[:1000])
    elif damage == "no table":
        table.write_bytes(b"")
    elif damage == "other table":
        windows.select([0]).save(tmp_path / "other")
        table.write_bytes((tmp_path / "other" / "windows.parquet").read_bytes())
    elif damage == "other grids":
        np.save(grids, np.zeros(3))
    with pytest.raises(InvalidFile) as error:
        Windows.load(tmp_path)
    assert "\n" not in str(error.value)
