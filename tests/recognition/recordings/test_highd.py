"""highD recordings as this project reads them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import schemas
from recognition import recordings as datasets
from schemas.common.errors import InvalidFile, UsageError
from tests.recognition.traffic import Car, highd_rows, read, write_csv, write_highd

EAST = Car(1, 100.0, 21.0, 30.0, lane=6)
WEST = Car(2, 300.0, 13.0, -25.0, kind="Truck", length=12.0, width=2.5, first=3, lane=3)


def test_corner_in_the_image_becomes_rear_axle_in_the_world(tmp_path: Path) -> None:
    recording, _ = read(write_highd(tmp_path, [EAST, WEST]))
    east, west = (recording.tracks[name].columns for name in "12")
    assert (east["x"][0], east["y"][0], east["h"][0]) == pytest.approx(
        (102.0 - 0.3 * 4.0, -22.0, 0.0)
    )
    assert (west["x"][0], west["y"][0]) == pytest.approx((306.0 + 0.3 * 12.0, -14.25))
    assert abs(west["h"][0]) == pytest.approx(math.pi)
    assert (east["speed"][0], west["speed"][0]) == pytest.approx((30.0, 25.0))


def test_box_put_back_is_the_recorded_one(tmp_path: Path) -> None:
    track = read(write_highd(tmp_path, [WEST]))[0].tracks["2"]
    box, columns = track.box, track.columns
    centre = columns["x"] + box.x * np.cos(columns["h"])
    assert (box.length, box.width, track.category) == (12.0, 2.5, "truck")
    assert centre - 6.0 == pytest.approx([row["x"] for row in highd_rows([WEST])])


def test_time_counts_from_the_first_frame(tmp_path: Path) -> None:
    recording, _ = read(write_highd(tmp_path, [EAST, WEST], rate=25.0))
    assert recording.timestep == 0.04
    assert recording.tracks["1"].columns["time"][:3].tolist() == [0.0, 0.04, 0.08]
    assert recording.tracks["2"].columns["time"][0] == 0.08


@pytest.mark.parametrize(
    ("vx", "vy", "turned"),
    [(30.0, 1.0, "right"), (30.0, -1.0, "left"), (-30.0, 1.0, "left"), (-30.0, -1.0, "right")],
)
def test_drifting_down_the_image_is_to_the_right_eastwards_and_to_the_left_westwards(
    tmp_path: Path, vx: float, vy: float, turned: str
) -> None:
    columns = read(write_highd(tmp_path, [EAST._replace(vx=vx, vy=vy)]))[0].tracks["1"].columns
    relative = columns["h"][0] - (0.0 if vx > 0 else math.copysign(math.pi, columns["h"][0]))
    assert relative == pytest.approx(math.atan2(1.0, 30.0) * (1 if turned == "left" else -1))
    assert columns["speed"][0] == pytest.approx(math.hypot(30.0, 1.0))


def test_acceleration_is_along_the_driving_direction(tmp_path: Path) -> None:
    rows = [{**row, "xAcceleration": -1.5} for row in highd_rows([EAST, WEST])]
    recording, _ = read(write_highd(tmp_path, [EAST, WEST], rows=rows))
    assert recording.tracks["1"].columns["raw_acceleration"] == pytest.approx(-1.5)
    assert recording.tracks["2"].columns["raw_acceleration"] == pytest.approx(1.5)


def test_crawling_vehicle_keeps_its_heading_in_spite_of_lateral_noise(tmp_path: Path) -> None:
    columns = read(write_highd(tmp_path, [EAST._replace(vx=0.01, vy=0.3)]))[0].tracks["1"].columns
    assert abs(columns["h"][0]) < 0.07


def test_lanes_count_outwards_from_the_median_which_is_lane_one(tmp_path: Path) -> None:
    lanes = {3.0: 3, 9.0: 3, 13.0: 2, 17.5: -1, 21.0: -2, 25.0: -3, 35.0: -3}
    cars = [Car(k, 100.0, y, 30.0 if y > 16.0 else -30.0) for k, y in enumerate(lanes, 1)]
    recording, _ = read(write_highd(tmp_path, cars))
    assert [int(track.columns["lane_id"][0]) for track in recording.tracks.values()] == list(
        lanes.values()
    )


def test_own_lane_ids_of_the_data_set_are_kept(tmp_path: Path) -> None:
    recording, _ = read(write_highd(tmp_path, [EAST, WEST]))
    assert [track.columns["source_lane"][0] for track in recording.tracks.values()] == [6, 3]


@pytest.mark.parametrize(
    ("upper", "lower"),
    [("8;12;16", "20;24;28"), ("8.5;12.25;16", "16;19.5;23.5"), ("3;7", "9;12;16;20")],
)
def test_places_are_those_of_the_road_that_was_written(
    tmp_path: Path, upper: str, lower: str
) -> None:
    cars = [Car(k, 50.0 + 7.3 * k, 0.5 * k, 30.0 if k % 2 else -30.0, 0.4) for k in range(1, 60)]
    recording, _ = read(write_highd(tmp_path, cars, upper=upper, lower=lower))
    network = recording.network
    assert network is not None
    for track in recording.tracks.values():
        columns = track.columns
        for i in (0, -1):
            point = network.locate(columns["x"][i], columns["y"][i])
            found = [columns[name][i] for name in ("s", "t", "lane_offset")]
            assert found == pytest.approx([point.s, point.t, point.offset], abs=1e-9)
            assert (columns["road_id"][i], columns["lane_id"][i]) == (point.road_id, point.lane_id)


def test_traffic_drives_in_its_lanes_direction(tmp_path: Path) -> None:
    recording, _ = read(write_highd(tmp_path, [EAST, WEST]))
    road = recording.network.road("1")  # type: ignore[union-attr]
    assert [
        road.direction(int(track.columns["lane_id"][0])) for track in recording.tracks.values()
    ] == [1, -1]
    assert recording.tracks["1"].columns["s"][-1] > recording.tracks["1"].columns["s"][0]


@pytest.mark.parametrize("speed_limit", [-1.0, 33.33])
def test_road_is_valid_opendrive(tmp_path: Path, speed_limit: float) -> None:
    recording, _ = read(write_highd(tmp_path, [EAST, WEST], speed_limit=speed_limit))
    assert recording.network is not None
    assert not [
        problem for problem in schemas.check(recording.network.path) if problem.level == "error"
    ]
    assert recording.network.road("1").types[0].speed == (
        pytest.approx(33.33) if speed_limit > 0 else None
    )


def test_same_recording_gives_the_same_road_file(tmp_path: Path) -> None:
    path = write_highd(tmp_path, [EAST, WEST])
    first, second = read(path)[0].network, read(path)[0].network
    assert first is second
    assert len(list((tmp_path / "roads").iterdir())) == 1


def test_road_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    path = write_highd(tmp_path, [EAST])
    (tmp_path / "roads").write_text("")
    with pytest.raises(UsageError, match="road can't be written"):
        read(path)


def test_folder_is_opened_without_reading_tracks(tmp_path: Path) -> None:
    for k in range(1, 61):
        write_highd(tmp_path, [EAST], name=f"{k:02}")
    (tmp_path / "07_tracks.csv").write_text("nonsense")
    sources = datasets.open(tmp_path, roads=tmp_path / "roads").sources
    assert [source.site for source in sources] == [f"{k:02}" for k in range(1, 61)]
    sources[0].load()
    with pytest.raises(InvalidFile, match=r"07_tracks.csv:1: no column"):
        sources[6].load()


def test_missing_frames_are_reported_and_left_missing(tmp_path: Path) -> None:
    rows = [row for row in highd_rows([EAST]) if row["frame"] not in (4, 5)]
    recording, report = read(write_highd(tmp_path, [EAST], rows=rows))
    assert len(recording.tracks["1"].columns["time"]) == 8
    assert report.gaps == [datasets.Gap("1", pytest.approx(0.08), pytest.approx(0.2), 2)]
    assert (report.missing, report.rows, report.tracks) == (2, 8, 1)


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    cars=st.lists(
        st.builds(
            Car, id=st.integers(1, 10**12), x=st.floats(0, 400), y=st.floats(0, 40),
            vx=st.sampled_from([-35.0, -8.0, 8.0, 35.0]),
            vy=st.floats(-2, 2), length=st.floats(1, 25), width=st.floats(0.5, 3),
            kind=st.sampled_from(["Car", "Truck"]),
            first=st.integers(1, 20000), frames=st.integers(1, 30), lane=st.integers(0, 9),
        ),
        min_size=1, max_size=6, unique_by=lambda car: car.id,
    ),
    rate=st.sampled_from([10.0, 25.0]),
)  # fmt: skip
def test_what_is_written_is_read_back(tmp_path: Path, cars: list[Car], rate: float) -> None:
    recording, report = read(write_highd(tmp_path, cars, rate=rate))
    assert report.rows == sum(car.frames for car in cars)
    for car in cars:
        track, rows = recording.tracks[str(car.id)], highd_rows([car], rate)
        columns = track.columns
        h = columns["raw_h"]
        x, y = (
            columns["raw_x"] + track.box.x * np.cos(h),
            columns["raw_y"] + track.box.x * np.sin(h),
        )
        assert x - car.length / 2 == pytest.approx([row["x"] for row in rows], abs=1e-6)
        assert -y - car.width / 2 == pytest.approx([row["y"] for row in rows], abs=1e-6)
        assert np.round(columns["time"] * rate).astype(int).tolist() == [
            int(str(row["frame"])) - 1 for row in rows
        ]


# bad files ----------------------------------------------------------------------------------


def broken(tmp_path: Path, **changes: object) -> Path:
    """A recording whose sixth row has other values."""
    rows = highd_rows([EAST])
    rows[5] |= changes
    return write_highd(tmp_path, [EAST], rows=rows)


@pytest.mark.parametrize(
    ("column", "value", "complaint"),
    [
        ("x", "nan", "'nan' is no value"),
        ("x", "", "a value is missing"),
        ("x", "inf", "'inf' is no measured value|inf is no measured value"),
        ("x", "1e300", "1e300 is no measured value"),
        ("x", "-99999", r"the vehicle is 1001\d\d m away from the others"),
        ("xVelocity", "fast", "'fast' is not a number"),
        ("frame", "6.5", "'6.5' is not a whole number"),
        ("frame", "-6", "'-6' is not a whole number from 0"),
        ("frame", "3", "3 of track 1 comes after 5"),
        ("frame", "5", "5 of track 1 is there twice"),
        ("id", "9" * 30, "9{30} is too large"),
        ("id", str(2**62), f"{2**62} is too large"),
        ("id", "7", "track 7 is not in 01_tracksMeta.csv"),
    ],
)
def test_bad_value_is_refused_with_line_and_column(
    tmp_path: Path, column: str, value: str, complaint: str
) -> None:
    with pytest.raises(InvalidFile, match=rf"01_tracks\.csv:7: column {column}: ({complaint})"):
        read(broken(tmp_path, **{column: value}))


def test_file_cut_within_a_line_is_refused(tmp_path: Path) -> None:
    path = write_highd(tmp_path, [EAST])
    path.write_text(path.read_text()[:-45])
    with pytest.raises(InvalidFile, match=r"01_tracks.csv:11: \d+ values in a table of 25 columns"):
        read(path)


def test_file_cut_between_lines_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        InvalidFile,
        match=r"tracksMeta.csv:2: column finalFrame: 10 of track 1, but 01_tracks.csv has 7",
    ):
        read(write_highd(tmp_path, [EAST], rows=highd_rows([EAST])[:7]))


def test_vehicle_without_rows_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        InvalidFile, match=r"tracksMeta.csv:3: column id: track 2 is not in 01_tracks.csv"
    ):
        read(write_highd(tmp_path, [EAST, WEST], rows=highd_rows([EAST])))


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", ":1: the file is empty"),
        (b"\n", ":1: the first line names no columns"),
        (b"frame;id;x\n1;1;2\n", ":1: columns are separated by semicolons"),
        (b"frame\tid\tx\n", ":1: columns are separated by tabs"),
        (b"frame,id,x,x\n", ":1: column x: this column is there twice"),
        (b"frame,id,x\n1,1,2\n", ":1: no column y, width"),
        (b"\xff\xfef\0r\0", ":1: this is not UTF-8 text"),
        (b"frame,id\n\0\0\0\0", ":1: no column x"),
    ],
)
def test_file_that_is_no_such_table_is_refused(
    tmp_path: Path, content: bytes, complaint: str
) -> None:
    path = write_highd(tmp_path, [EAST])
    path.write_bytes(content)
    with pytest.raises(InvalidFile, match=rf"01_tracks\.csv{complaint}"):
        read(path)


def test_header_without_rows_is_refused(tmp_path: Path) -> None:
    path = write_highd(tmp_path, [EAST])
    path.write_text(path.read_text().splitlines()[0] + "\n")
    with pytest.raises(InvalidFile, match="there are no rows below the header"):
        read(path)


def test_byte_order_mark_windows_line_ends_and_blank_lines_do_no_harm(tmp_path: Path) -> None:
    path = write_highd(tmp_path, [EAST])
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n") + b"\r\n\r\n")
    assert read(path)[1].rows == 10


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    path = broken(tmp_path, x="\xe9")
    path.write_bytes(path.read_bytes().replace("\xe9".encode(), b"\xe9"))
    with pytest.raises(InvalidFile, match="not UTF-8"):
        read(path)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"upper": "8"}, "column upperLaneMarkings: '8' are not two or more rising numbers"),
        ({"upper": "8;7"}, "column upperLaneMarkings"),
        ({"upper": "8;nan"}, "column upperLaneMarkings"),
        ({"upper": "8;x"}, "column upperLaneMarkings"),
        ({"lower": "12;20"}, "column lowerLaneMarkings: the lower carriageway begins at 12"),
        ({"rate": 0.0}, "column frameRate: 0 frames a second are too few"),
    ],
)
def test_bad_recording_meta_is_refused(tmp_path: Path, change: dict, complaint: str) -> None:
    with pytest.raises(InvalidFile, match=f"01_recordingMeta.csv:2: {complaint}"):
        read(
            write_highd(tmp_path, [EAST], **{"rate": 25.0, **change})
            if change.get("rate") != 0.0
            else _at_no_rate(tmp_path)
        )


def _at_no_rate(folder: Path) -> Path:
    path = write_highd(folder, [EAST])
    meta = folder / "01_recordingMeta.csv"
    meta.write_text(meta.read_text().replace("25.0", "0"))
    return path


@pytest.mark.parametrize(
    ("column", "value", "complaint"),
    [
        ("class", "Boat", "'Boat' is none of Car and Truck"),
        ("drivingDirection", 3, "3 is neither 1 nor 2"),
        ("width", 0, "0 is no size"),
    ],
)
def test_bad_vehicle_meta_is_refused(
    tmp_path: Path, column: str, value: object, complaint: str
) -> None:
    path = write_highd(tmp_path, [EAST])
    good = {
        "id": 1,
        "width": 4,
        "height": 2,
        "initialFrame": 1,
        "finalFrame": 10,
        "class": "Car",
        "drivingDirection": 2,
    }
    write_csv(tmp_path / "01_tracksMeta.csv", [good | {column: value}])
    with pytest.raises(InvalidFile, match=f"tracksMeta.csv:2: column {column}: {complaint}"):
        read(path)


@pytest.mark.parametrize("kind", ["tracksMeta", "recordingMeta"])
def test_recording_that_lacks_a_file_is_refused(tmp_path: Path, kind: str) -> None:
    path = write_highd(tmp_path, [EAST])
    (tmp_path / f"01_{kind}.csv").unlink()
    with pytest.raises(InvalidFile, match=f"there is no 01_{kind}.csv beside it"):
        read(path)
