"""NGSIM tables: public and metric layout, CSV and Parquet."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recognition import recordings as datasets
from schemas.common.errors import InvalidFile
from tests.recognition.traffic import (
    metric_rows,
    ngsim_rows,
    read,
    total_rows,
    write_csv,
    write_parquet,
)

FOOT = 0.3048
WRITERS = pytest.mark.parametrize(
    ("write", "name"), [(write_csv, "t.csv"), (write_parquet, "t.parquet")]
)
Writer = Callable[[Path, list], Path]


@WRITERS
def test_front_bumper_in_feet_becomes_rear_axle_in_metres(
    tmp_path: Path, write: Writer, name: str
) -> None:
    recording, report = read(write(tmp_path / name, ngsim_rows(7, 100.0, 20.0, 50.0)))
    track = recording.tracks["7"]
    length = 15.0 * FOOT
    assert (track.category, track.box.length, track.box.width) == (
        "car",
        pytest.approx(length),
        pytest.approx(6.0 * FOOT),
    )
    columns = track.columns
    assert columns["x"][0] == pytest.approx(100.0 * FOOT - 0.5 * length - 0.3 * length)
    assert columns["y"] == pytest.approx(-20.0 * FOOT)
    assert columns["speed"] == pytest.approx(50.0 * FOOT)
    assert columns["h"] == pytest.approx(0.0)
    assert columns["time"] == pytest.approx(np.arange(20) * 0.1)
    assert columns["source_lane"].tolist() == [3] * 20
    assert report.remarks == ["headings are the directions of motion"]


def test_moving_to_the_right_of_the_road_turns_the_heading_right(tmp_path: Path) -> None:
    rows = [
        row | {"Local_X": 20.0 + 0.1 * k * 5.0}
        for k, row in enumerate(ngsim_rows(1, 0.0, 0.0, 50.0))
    ]
    assert read(write_csv(tmp_path / "t.csv", rows))[0].tracks["1"].columns["h"] == pytest.approx(
        -math.atan2(5.0, 50.0)
    )


def test_spelling_of_columns_does_not_matter(tmp_path: Path) -> None:
    rows = [
        {key.lower(): value for key, value in row.items()} for row in ngsim_rows(1, 0.0, 0.0, 50.0)
    ]
    assert read(write_csv(tmp_path / "t.csv", rows))[1].rows == 20


@pytest.mark.parametrize("foot", [FOOT, 0.3084])
def test_metres_are_taken_as_they_are_or_corrected_where_the_foot_was_mistaken(
    tmp_path: Path, foot: float
) -> None:
    lengths = {"Local_X", "Local_Y", "v_Vel", "v_Acc"}
    rows = [
        {
            f"{key}(m)" if key in lengths else key: foot * value if key in lengths else value
            for key, value in row.items()
        }
        for row in ngsim_rows(1, 100.0, 20.0, 43.21)
    ]
    for row in rows:
        del row["v_Length"], row["v_Width"]
    recording, report = read(write_parquet(tmp_path / "t.parquet", rows))
    assert recording.tracks["1"].columns["speed"] == pytest.approx(43.21 * FOOT)
    assert any("0.3084 m a foot: they are corrected" in remark for remark in report.remarks) == (
        foot != FOOT
    )
    assert "sizes are the usual ones of the category" in report.remarks


def test_accelerations_that_are_not_given_are_derived(tmp_path: Path) -> None:
    rows = [row | {"v_Vel": 50.0 + k} for k, row in enumerate(ngsim_rows(1, 0.0, 0.0, 50.0))]
    for row in rows:
        del row["v_Acc"]
    recording, report = read(write_csv(tmp_path / "t.csv", rows))
    assert recording.tracks["1"].columns["raw_acceleration"] == pytest.approx(10.0 * FOOT)
    assert "accelerations are derived from the speeds" in report.remarks


def test_id_used_again_in_another_period_is_another_vehicle(tmp_path: Path) -> None:
    later = [
        row | {"Global_Time": row["Global_Time"] + 900_000} for row in ngsim_rows(1, 0.0, 0.0, 50.0)
    ]  # type: ignore[operator]
    recording, report = read(
        write_csv(
            tmp_path / "t.csv",
            ngsim_rows(1, 0.0, 0.0, 50.0) + later + ngsim_rows(2, 0.0, 9.0, 50.0),
        )
    )
    assert list(recording.tracks) == ["1.1", "1.2", "2"]
    assert recording.tracks["1.2"].columns["time"][0] == pytest.approx(900.0)
    assert report.missing == 0


def test_each_location_is_a_source(tmp_path: Path) -> None:
    rows = [
        row
        for k, place in enumerate(("us-101", "i-80"))
        for row in ngsim_rows(k, 0.0, 0.0, 50.0, n=5, Location=place)
    ]
    sources = datasets.open(write_csv(tmp_path / "all.csv", rows)).sources
    assert [(source.name, source.site) for source in sources] == [
        ("all/us-101", "us-101"),
        ("all/i-80", "i-80"),
    ]
    assert [list(source.load().tracks) for source in sources] == [["0"], ["1"]]


@WRITERS
def test_rows_may_be_in_any_order_and_repeated_ones_are_counted(
    tmp_path: Path, write: Writer, name: str
) -> None:
    rows = ngsim_rows(1, 0.0, 0.0, 50.0) + ngsim_rows(2, 0.0, 9.0, 40.0)
    mixed = [rows[k] for k in np.random.default_rng(5).permutation(len(rows))] + [rows[3]]
    recording, report = read(write(tmp_path / name, mixed))
    assert (np.diff(recording.tracks["1"].columns["x"]) > 0.0).all()
    assert [(one.what, one.rows) for one in report.exclusions] == [("1", 1)]
    assert report.rows + report.excluded == len(mixed)


# metric layout ------------------------------------------------------------------------------


@WRITERS
@pytest.mark.parametrize("heading", [0.0, 2.0, -3.0])
@pytest.mark.parametrize("turn", [0, 1, 2, -1])
def test_metric_layout_gives_centres_and_headings(
    tmp_path: Path, write: Writer, name: str, heading: float, turn: int
) -> None:
    rows = [
        row | {"heading_rad": heading + turn * math.pi / 2}
        for row in metric_rows(4, 10.0, 20.0, heading, 8.0)
    ]
    recording, report = read(write(tmp_path / name, rows))
    columns = recording.tracks["4"].columns
    assert np.cos(columns["h"] - heading) == pytest.approx(1.0)
    assert (columns["x"][0], columns["y"][0]) == pytest.approx(
        (10.0 - 1.2 * math.cos(heading), 20.0 - 1.2 * math.sin(heading))
    )
    assert columns["time"][:2].tolist() == [7.9, 8.0]
    assert any("headings are turned" in remark for remark in report.remarks) == (turn != 0)
    assert report.rows == total_rows(recording) == 20


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    vehicles=st.lists(
        st.tuples(
            st.integers(0, 10**9),
            st.floats(-500, 500),
            st.floats(-50, 50),
            st.floats(-3, 3),
            st.floats(2, 40),
            st.integers(2, 30),
        ),
        min_size=1,
        max_size=5,
        unique_by=lambda vehicle: vehicle[0],
    )
)
def test_what_is_written_is_read_back(tmp_path: Path, vehicles: list) -> None:
    written = {str(vehicle[0]): metric_rows(*vehicle) for vehicle in vehicles}
    recording, _ = read(
        write_parquet(tmp_path / "t.parquet", [row for rows in written.values() for row in rows])
    )
    for name, rows in written.items():
        columns, ahead = recording.tracks[name].columns, recording.tracks[name].box.x
        assert columns["x"] + ahead * np.cos(columns["h"]) == pytest.approx(
            [row["position_x"] for row in rows], abs=1e-6
        )
        assert columns["y"] + ahead * np.sin(columns["h"]) == pytest.approx(
            [row["position_y"] for row in rows], abs=1e-6
        )


# bad files ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("column", "value", "complaint"),
    [
        ("Local_Y", "", "a value is missing"),
        ("Local_Y", "nan", "'nan' is no value"),
        ("v_Vel", "inf", "inf is no measured value"),
        ("Vehicle_ID", "car", "'car' is not a whole number"),
        ("Frame_ID", "1.5", "'1.5' is not a whole number"),
        ("Global_Time", "9" * 20, "9{20} is too large"),
    ],
)
def test_bad_value_of_a_csv_is_refused_with_line_and_column(
    tmp_path: Path, column: str, value: str, complaint: str
) -> None:
    rows = ngsim_rows(1, 0.0, 0.0, 50.0)
    rows[5][column] = value
    with pytest.raises(InvalidFile, match=rf"t\.csv:7: column {column}: {complaint}"):
        read(write_csv(tmp_path / "t.csv", rows))


@pytest.mark.parametrize(
    ("column", "value", "complaint"),
    [
        ("position_x", None, "a value is missing"),
        ("position_x", math.nan, "'nan' is no value"),
        ("speed", -math.inf, "-inf is no measured value"),
        ("vehicle_id", 1.5, "'1.5' is not a whole number from 0"),
        ("vehicle_id", -4, "'-4' is not a whole number from 0"),
        ("lane_id", None, "a value is missing"),
    ],
)
def test_bad_value_of_a_parquet_table_is_refused_with_row_and_column(
    tmp_path: Path, column: str, value: object, complaint: str
) -> None:
    rows = metric_rows(1, 0.0, 0.0, 0.0, 8.0)
    for row in rows:
        row[column] = type(value)(row[column]) if value is not None else row[column]
    rows[5][column] = value
    with pytest.raises(InvalidFile, match=rf"t\.parquet: column {column}: row 6: {complaint}"):
        read(write_parquet(tmp_path / "t.parquet", rows))


@pytest.mark.parametrize(
    ("column", "value", "complaint"),
    [
        ("type", 7, "7 is none of 1 .motorcycle., 2 .car. and 3"),
        ("length", 0.0, "0 is no size"),
        ("width", -1.0, "-1 is no size"),
    ],
)
def test_impossible_vehicle_is_refused(
    tmp_path: Path, column: str, value: object, complaint: str
) -> None:
    with pytest.raises(InvalidFile, match=rf"t\.csv:2: column {column}: {complaint}"):
        read(write_csv(tmp_path / "t.csv", metric_rows(1, 0.0, 0.0, 0.0, 8.0, **{column: value})))


@WRITERS
@pytest.mark.parametrize(
    ("rows", "column"),
    [(ngsim_rows(1, 0.0, 0.0, 50.0), "v_Vel"), (metric_rows(1, 0.0, 0.0, 0.0, 8.0), "heading_rad")],
)
def test_missing_column_is_named(
    tmp_path: Path, write: Writer, name: str, rows: list, column: str
) -> None:
    less = [{key: value for key, value in row.items() if key != column} for row in rows]
    with pytest.raises(InvalidFile, match=f"no column {column.lower()}; columns: "):
        read(write(tmp_path / name, less))


@WRITERS
def test_columns_that_differ_in_spelling_only_are_refused(
    tmp_path: Path, write: Writer, name: str
) -> None:
    rows = [row | {"vehicle_id": 5} for row in ngsim_rows(1, 0.0, 0.0, 50.0)]
    with pytest.raises(
        InvalidFile, match="column vehicle_id: this column is there as 'Vehicle_ID' too"
    ):
        read(write(tmp_path / name, rows))


@pytest.mark.parametrize(
    "content", [b"", b"PAR1", b"PAR1" + b"\0" * 100 + b"PAR1", b"Vehicle_ID,Frame_ID\n"]
)
def test_file_that_is_no_parquet_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "t.parquet").write_bytes(content)
    with pytest.raises(InvalidFile, match=r"t\.parquet: the file can't be read: "):
        read(tmp_path)


def test_parquet_table_without_rows_is_refused(tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    path = write_parquet(tmp_path / "t.parquet", metric_rows(1, 0.0, 0.0, 0.0, 8.0))
    pq.write_table(pq.read_table(path).slice(0, 0), path)
    with pytest.raises(InvalidFile, match=r"t\.parquet: the table has no rows"):
        read(path)


def headless(rows: list[dict[str, object]]) -> str:
    """Rows as the FHWA's text has them: 18 columns between blanks, without a header."""
    before = ("Vehicle_ID", "Frame_ID", "Total_Frames", "Global_Time", "Local_X", "Local_Y")
    after = ("v_Length", "v_Width", "v_Class", "v_Vel", "v_Acc", "Lane_ID")
    words = [
        [
            *(row[name] for name in before),
            6451137.641,
            1873344.962,
            *(row[name] for name in after),
            0,
            0,
            0.0,
            0.0,
        ]
        for row in rows
    ]
    return "".join("".join(f"{word:>14} " for word in line) + "\n" for line in words)


def test_text_without_a_header_is_the_same_recording(tmp_path: Path) -> None:
    rows = ngsim_rows(7, 100.0, 20.0, 50.0) + ngsim_rows(8, 0.0, 32.0, 40.0, v_Class=3)
    (tmp_path / "trajectories.txt").write_text(headless(rows))
    found, report = read(tmp_path / "trajectories.txt")
    named, named_report = read(write_csv(tmp_path / "named.csv", rows))
    assert (list(found.tracks), report) == (list(named.tracks), named_report)
    for track in found.tracks.values():
        assert track.category == named.tracks[track.name].category
        for name, values in named.tracks[track.name].columns.items():
            assert track.columns[name].tolist() == values.tolist()


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("50.0 ", "fast ", "column v_vel: 'fast' is not a number"),
        ("50.0 ", "nan ", "column v_vel: 'nan' is no value"),
        (" 103 ", " 103.5 ", "column frame_id: '103.5' is not a whole number from 0"),
        (" 103 ", " ", "17 values in a table of 18 columns"),
        (" 103 ", " 103 1 ", "19 values in a table of 18 columns"),
        (" 15.0 ", " -15.0 ", "column v_length: -15 is no size"),
    ],
)
def test_damaged_text_without_a_header_is_refused_by_line(
    tmp_path: Path, old: str, new: str, complaint: str
) -> None:
    lines = headless(ngsim_rows(7, 100.0, 20.0, 50.0)).splitlines(keepends=True)
    assert old in lines[3]
    lines[3] = lines[3].replace(old, new)
    (tmp_path / "t.txt").write_text("".join(lines))
    with pytest.raises(InvalidFile, match=rf"t\.txt:4: {complaint}"):
        read(tmp_path / "t.txt")


def test_other_text_beside_recordings_is_none(tmp_path: Path) -> None:
    write_csv(tmp_path / "t.csv", ngsim_rows(7, 100.0, 20.0, 50.0))
    for name, content in {
        "readme.txt": b"Vehicle_ID: who",
        "empty.txt": b"",
        "matrix.txt": b"1 0 0\n0 1 0\n",
        "b.txt": b"\xff\0",
    }.items():
        (tmp_path / name).write_bytes(content)
    assert list(read(tmp_path)[0].tracks) == ["7"]


# real recordings ----------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "tracks", "remark"),
    [
        ("us101_370_vehicles.parquet", 370, "converted at 0.3084 m a foot"),
        ("i80_0400-0415_first200veh_10s.parquet", 200, "headings are turned by"),
    ],
)
def test_ngsim_tables_read_whole(recordings: Path, name: str, tracks: int, remark: str) -> None:
    import pyarrow.parquet as pq

    path = recordings / "ngsim" / name
    recording, report = read(path)
    assert report.rows + report.excluded == pq.read_metadata(path).num_rows
    assert report.rows == total_rows(recording)
    assert len(recording.tracks) == report.tracks == tracks + len(report.cuts)
    assert any(remark in one for one in report.remarks)
