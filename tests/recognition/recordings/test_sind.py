"""SinD recordings: vehicles and pedestrians of one folder, times with decimals,
headings in yaw_rad.
"""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from recognition import recordings as datasets
from schemas.common.errors import InvalidFile
from tests.recognition.traffic import read, write_csv

STEP = 1000.0 / 9.99
"""Milliseconds between frames"""


def rows(track: object, x: float, speed: float, kind: str = "car", n: int = 40) -> list[dict]:
    """Rows of a vehicle that drives along y."""
    return [
        {
            "track_id": track, "frame_id": k, "timestamp_ms": round(k * STEP, 4),
            "agent_type": kind, "x": x,
            "y": speed * k * STEP / 1000.0, "vx": 0.0, "vy": speed, "yaw_rad": math.pi / 2,
            "heading_rad": 1.5,
            "length": 4.5, "width": 1.8,
        }
        for k in range(n)
    ]  # fmt: skip


def walker(track: str, n: int = 40) -> list[dict]:
    boxless = ("yaw_rad", "heading_rad", "length", "width")
    return [
        {name: value for name, value in row.items() if name not in boxless}
        for row in rows(track, 8.0, 1.2, "pedestrian", n)
    ]


def folder(tmp_path: Path) -> Path:
    """A recording in the data set's layout."""
    place = tmp_path / "Tianjin" / "8_2_1"
    write_csv(place / "Veh_smoothed_tracks.csv", rows(1, 0.0, 10.0) + rows(2, 4.0, 5.0, "tricycle"))
    write_csv(place / "Ped_smoothed_tracks.csv", walker("P1"))
    write_csv(
        place / "TrafficLight_8_2_1.csv",
        [{"RawFrameID": 0, "timestamp(ms)": 0.0, "Traffic light 1": 1}],
    )
    write_csv(place / "Veh_tracks_meta.csv", [{"trackId": 1, "initialFrame": 0}])
    return tmp_path


def test_vehicles_and_pedestrians_of_a_folder_are_one_recording(tmp_path: Path) -> None:
    found = datasets.open(folder(tmp_path))
    (source,) = found.sources
    assert (source.name, source.site, source.format) == ("8_2_1", "Tianjin", "SinD")
    assert found.skipped == []
    recording, report = read(folder(tmp_path))
    assert recording.timestep == pytest.approx(1.0 / 9.99, rel=1e-6)
    kinds = {name: track.category for name, track in recording.tracks.items()}
    assert kinds == {"1": "car", "2": "motorbike", "P1": "pedestrian"}
    columns = recording.tracks["1"].columns
    assert columns["h"] == pytest.approx(math.pi / 2)
    assert columns["speed"] == pytest.approx(10.0)
    assert len(columns["time"]) == 40 and report.gaps == []
    assert any("TrafficLight_8_2_1.csv" in remark for remark in report.remarks)
    assert report.verdict == "fit"


def test_a_map_above_the_recording_is_its_own_and_two_are_none(tmp_path: Path) -> None:
    place = folder(tmp_path) / "Tianjin"
    (place / "map_relink_law_save.osm").write_text("<osm/>")
    assert datasets.open(place).sources[0].map == place / "map_relink_law_save.osm"
    (place / "other.osm").write_text("<osm/>")
    assert datasets.open(place).sources[0].map is None


@pytest.mark.parametrize(
    ("column", "value", "reason"),
    [
        ("yaw_rad", "", "yaw_rad: a value is missing"),
        ("agent_type", "tank", "is none of"),
        ("timestamp_ms", "x", "is not a number"),
        ("length", "-1", "length"),
    ],
)
def test_wrong_values_are_named_with_their_column(
    tmp_path: Path, column: str, value: str, reason: str
) -> None:
    path = folder(tmp_path) / "Tianjin" / "8_2_1" / "Veh_smoothed_tracks.csv"
    write_csv(path, [row | {column: value} for row in rows(1, 0.0, 10.0)])
    with pytest.raises(InvalidFile, match=reason):
        read(tmp_path)
