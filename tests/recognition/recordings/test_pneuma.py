"""pNEUMA recordings: lines of unlike length, latitude and longitude, and malformed lines."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pyproj
import pytest

from recognition import recordings as datasets
from schemas.common.errors import InvalidFile
from tests.recognition.traffic import read

HEADER = "track_id; type; traveled_d; avg_speed; lat; lon; speed; lon_acc; lat_acc; time"
UTM = pyproj.Proj(proj="utm", zone=34, ellps="WGS84")
PLACE = UTM(23.7377, 37.9774)
"""A place in Athens, m of UTM"""


def line(name: str, kind: str, speed: float, frames: int, start: float = 0.0) -> str:
    """A vehicle that drives north at a speed (m/s) from a place of its own."""
    values = [name, kind, "0.0", "0.0"]
    for k in range(frames):
        time = start + 0.04 * k
        longitude, latitude = UTM(PLACE[0] + 10.0 * int(name), PLACE[1] + speed * time, True)
        frame = (f"{latitude:.8f}", f"{longitude:.8f}", f"{3.6 * speed:.4f}", "0.0", "0.0")
        values += [*frame, f"{time:.6f}"]
    return "; ".join(values) + "; "


def file(folder: Path, *lines: str) -> Path:
    path = folder / "athens" / "d1.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join((HEADER, *lines)) + "\n")
    return path


def test_vehicles_are_lines_of_unlike_length(tmp_path: Path) -> None:
    path = file(
        tmp_path, line("1", "Car", 10.0, 100), line("2", "Heavy Vehicle", 5.0, 60, start=1.0)
    )
    (source,) = datasets.open(tmp_path).sources
    assert (source.name, source.site, source.format) == ("d1", "athens", "pNEUMA")
    recording, report = read(path)
    assert recording.timestep == 0.04
    first, second = recording.tracks.values()
    assert (first.category, second.category) == ("car", "truck")
    assert (len(first.columns["time"]), len(second.columns["time"])) == (100, 60)
    assert second.columns["time"][0] == pytest.approx(1.0)
    assert first.columns["speed"] == pytest.approx(10.0, abs=0.05)
    assert first.columns["h"] == pytest.approx(np.pi / 2, abs=0.01)
    # The place is that of UTM, less the origin at 38.0° north and 23.7° east.
    east, north = UTM(23.7, 38.0)
    columns = first.columns
    assert columns["x"][0] == pytest.approx(PLACE[0] + 10.0 - east, abs=0.05)
    assert columns["y"][0] == pytest.approx(PLACE[1] - north - 0.3 * 4.5, abs=0.05)
    assert report.verdict == "fit"
    assert any("sizes are not recorded" in remark for remark in report.remarks)


def test_a_wrong_unit_of_the_speed_is_refused_by_the_intake(tmp_path: Path) -> None:
    metres = line("1", "Car", 10.0, 100).replace("; 36.0000; ", "; 10.0000; ")
    _, report = read(file(tmp_path, metres))
    assert report.verdict == "refused"
    assert "the places move at 3.60 times the stated speeds" in report.checks[0].reason


GOOD = line("1", "Car", 10.0, 5)


@pytest.mark.parametrize(
    ("bad", "told"),
    [
        (GOOD.rstrip("; ") + "; 37.9; 23.7; ", r"csv:2: 36 values in this line: 4 about the"),
        (GOOD.replace("Car", "Tank"), r"csv:2: column type: 'Tank' is none of car, taxi"),
        (GOOD.replace("; 36.0000", "; fast", 1), r"column speed of frame 1.*'fast' is no measured"),
        (GOOD.replace("; 36.0000", "; nan", 1), r"column speed of frame 1.*'nan' is no measured"),
        (GOOD.replace("37.97", "137.97", 1), r"column lat of frame 1.*no latitude and longitude"),
        (GOOD.replace("0.080000", "0.030000"), r"time 0.03 of track 1 follows 0.04"),
        (GOOD + "\n" + GOOD, r"csv:3: column track_id: track 1 is in line 2 already"),
        ("", "there is no vehicle below the header"),
    ],
)
def test_a_malformed_line_is_named(bad: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidFile) as raised:
        read(file(tmp_path, bad))
    assert re.search(told, str(raised.value))


def test_a_map_beside_it_has_the_same_origin(tmp_path: Path) -> None:
    path = file(tmp_path, line("1", "Car", 10.0, 5))
    (path.parent / "map.osm").write_text("<osm/>")
    (source,) = datasets.open(tmp_path).sources
    assert source.origin == (38.0, 23.7)
    assert source.map is not None and source.map.name == "map.osm"
