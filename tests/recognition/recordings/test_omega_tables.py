"""Tables of omega-prime: OSI's numbers of types, epochs, maps in metadata, and bad rows."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import xodr
from recognition import recordings as datasets
from recognition.scenes import site_of
from schemas.common.errors import InvalidFile
from tests.recognition.traffic import read, write_csv

EPOCH = 1_700_000_000_000_000_000
"""Start of recordings on a clock with nanoseconds since 1970"""


def rows(idx: int, y: float, speed: float, kind: int, subtype: int, n: int = 40) -> list[dict]:
    """Rows of an object that drives along x, its box's centre 0.75 m above the ground."""
    return [
        {
            "total_nanos": EPOCH + k * 100_000_000, "idx": idx, "x": speed * 0.1 * k, "y": y,
            "z": 0.75, "vel_x": speed, "vel_y": 0.0, "vel_z": 0.0, "acc_x": 0.5, "acc_y": 0.0,
            "acc_z": 0.0, "length": 4.0, "width": 2.0, "height": 1.5, "roll": 0.0, "pitch": 0.0,
            "yaw": 0.0, "type": kind, "role": 0, "subtype": subtype,
        }
        for k in range(n)
    ]  # fmt: skip


ALL = rows(1, 0.0, 10.0, 2, 4) + rows(2, 4.0, 8.0, 2, 7) + rows(3, 9.0, 1.0, 3, -1)


def test_a_table_is_a_recording(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "table.csv", [*ALL, *rows(4, 20.0, 0.0, 1, -1)])
    recording, report = read(path)
    assert (report.verdict, recording.timestep) == ("fit", 0.1)
    kinds = {name: track.category for name, track in recording.tracks.items()}
    assert kinds == {"1": "car", "2": "truck", "3": "pedestrian", "4": "obstacle"}
    columns = recording.tracks["1"].columns
    assert columns["time"][[0, -1]] == pytest.approx([0.0, 3.9])
    assert columns["speed"] == pytest.approx(10.0)
    assert columns["acceleration"] == pytest.approx(0.5)
    assert columns["z"] == pytest.approx(0.0)
    assert columns["x"][0] == pytest.approx(-0.3 * 4.0)
    assert "moving objects of type 1 are taken as obstacles" in report.remarks


def test_parquet_files_bring_their_map_and_ego(tmp_path: Path) -> None:
    table = pa.Table.from_pylist(ALL)
    road = (Path(xodr.__file__).parent / "library" / "highway_straight.xodr").read_bytes()
    metadata = {b"xodr": road, b"xodr_name": b"road", b"host_vehicle_idx": b"2"}
    pq.write_table(table.replace_schema_metadata(metadata), tmp_path / "table.parquet")
    (source,) = datasets.open(tmp_path).sources
    recording = source.load()
    assert source.ego() == "2"
    site = site_of(source, recording, tmp_path / "roads")
    assert site.path.read_bytes() == road
    assert source.report is not None
    assert any("in the table's metadata" in remark for remark in source.report.remarks)


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"length": 0.0}, "csv:3: column length: 0 is no size"),
        ({"total_nanos": EPOCH}, f"csv:3: column total_nanos: {EPOCH} of track 1 is there twice"),
        ({"yaw": None}, "csv:3: column yaw: a value is missing"),
        ({"idx": "x"}, "csv:3: column idx: 'x' is not a whole number from 0"),
    ],
)
def test_a_bad_row_is_named(changed: dict[str, object], told: str, tmp_path: Path) -> None:
    table = [*ALL]
    table[1] = table[1] | changed
    with pytest.raises(InvalidFile) as raised:
        read(write_csv(tmp_path / "table.csv", table))
    assert told in str(raised.value)


def test_a_table_of_one_instant_has_no_step(tmp_path: Path) -> None:
    with pytest.raises(InvalidFile, match="all rows are of one time"):
        read(write_csv(tmp_path / "table.csv", rows(1, 0.0, 1.0, 2, 4, n=1)))
