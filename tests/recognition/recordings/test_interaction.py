"""INTERACTION recordings, both layouts, and TAF-BW's, which follow the first."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recognition import recordings as datasets
from schemas.common.errors import InvalidFile
from tests.recognition.traffic import interaction_rows, read, total_rows, write_csv

CAR = (1, 10.0, 20.0, 6.0, 8.0, math.atan2(8.0, 6.0))
PEDESTRIAN = {"agent_type": "pedestrian/bicycle", "psi_rad": None, "length": None, "width": None}


def write(tmp_path: Path, rows: list, name: str = "site/vehicle_tracks_000.csv") -> Path:
    return write_csv(tmp_path / name, rows)


def test_centre_becomes_rear_axle(tmp_path: Path) -> None:
    recording, report = read(write(tmp_path, interaction_rows(*CAR)))
    columns = recording.tracks["1"].columns
    assert (columns["x"][0], columns["y"][0]) == pytest.approx((10.0 - 1.2 * 0.6, 20.0 - 1.2 * 0.8))
    assert columns["speed"] == pytest.approx(10.0)
    assert columns["time"][:2].tolist() == [0.1, 0.2]
    assert report.remarks == ["accelerations are derived from the speeds"]


def test_acceleration_is_the_rate_of_the_speed(tmp_path: Path) -> None:
    rows = [
        row
        | {
            "x": 5.0 * (k / 10) + (k / 10) ** 2,
            "y": 0.0,
            "vx": 5.0 + 2.0 * k / 10,
            "vy": 0.0,
            "psi_rad": 0.0,
        }
        for k, row in enumerate(interaction_rows(*CAR))
    ]
    assert read(write(tmp_path, rows))[0].tracks["1"].columns["acceleration"] == pytest.approx(
        2.0, abs=0.02
    )


def test_rates_do_not_reach_across_missing_frames(tmp_path: Path) -> None:
    rows = interaction_rows(*CAR, n=30)
    jump = [
        row | {"vx": 12.0, "vy": 16.0, "x": 12.0 * k / 10, "y": 16.0 * k / 10}
        for k, row in enumerate(rows)
        if k > 17
    ]
    recording, report = read(write(tmp_path, rows[:10] + jump))
    assert recording.tracks["1"].columns["raw_acceleration"] == pytest.approx(0.0)
    assert report.gaps == [datasets.Gap("1", 1.0, pytest.approx(1.9), 8)]


def test_reversing_vehicle_has_a_negative_speed(tmp_path: Path) -> None:
    recording, _ = read(write(tmp_path, interaction_rows(1, 0.0, 0.0, -2.0, 0.0, 0.0)))
    assert recording.tracks["1"].columns["speed"] == pytest.approx(-2.0)
    assert recording.tracks["1"].columns["h"] == pytest.approx(0.0)


def test_pedestrians_of_their_own_file_join_in(tmp_path: Path) -> None:
    walk = [
        {key: value for key, value in row.items() if key not in ("psi_rad", "length", "width")}
        for row in interaction_rows("P1", 0.0, 0.0, 0.0, 1.5, 0.0, agent_type="pedestrian/bicycle")
    ]
    write(tmp_path, walk, "site/pedestrian_tracks_000.csv")
    recording, report = read(write(tmp_path, interaction_rows(*CAR)).parent)
    pedestrian = recording.tracks["P1"]
    assert (pedestrian.kind, pedestrian.box.x, report.tracks) == ("pedestrian", 0.0, 2)
    assert pedestrian.columns["h"] == pytest.approx(math.pi / 2)
    assert pedestrian.columns["raw_y"][0] == 0.0


def test_pedestrian_with_a_vehicles_number_gets_a_name_of_its_own(tmp_path: Path) -> None:
    write(
        tmp_path,
        interaction_rows(1, 0.0, 0.0, 0.0, 1.5, 0.0, **PEDESTRIAN),
        "site/pedestrian_tracks_000.csv",
    )
    assert list(read(write(tmp_path, interaction_rows(*CAR)).parent)[0].tracks) == ["1", "P1"]


def test_no_name_is_given_twice(tmp_path: Path) -> None:
    walks = [
        row
        for name in ("1", "P1")
        for row in interaction_rows(name, 0.0, 0.0, 0.0, 1.5, 0.0, **PEDESTRIAN)
    ]
    write(tmp_path, walks, "site/pedestrian_tracks_000.csv")
    recording, report = read(write(tmp_path, interaction_rows(*CAR)))
    assert list(recording.tracks) == ["1", "PP1", "P1"]
    assert report.rows == total_rows(recording) == 60


def test_numbers_written_as_floats_are_the_same_numbers(tmp_path: Path) -> None:
    rows = interaction_rows(*CAR)
    recording, _ = read(
        write(tmp_path, [row | {"track_id": "1.0" if k % 2 else "1"} for k, row in enumerate(rows)])
    )
    assert [len(track.columns["time"]) for track in recording.tracks.values()] == [20]


def test_standing_pedestrian_faces_where_it_went(tmp_path: Path) -> None:
    walk = interaction_rows("P1", 0.0, 0.0, 0.0, -1.5, 0.0, n=20, **PEDESTRIAN)
    stand = [
        row | {"timestamp_ms": 2000 + 100 * k, "x": 0.0, "y": -2.85, "vx": 0.01, "vy": 0.0}
        for k, row in enumerate(walk, 1)
    ]
    columns = read(write(tmp_path, walk + stand))[0].tracks["P1"].columns
    assert columns["h"] == pytest.approx(-math.pi / 2)


def test_each_case_is_a_scene_of_its_own(tmp_path: Path) -> None:
    rows = [
        {"case_id": f"{case}.0", **row}
        for case in (1, 2)
        for row in interaction_rows("1.0", 10.0 * case, 0.0, 5.0, 0.0, 0.0)
        + interaction_rows(2 + case, 0.0, 9.0, 0.0, 5.0, 1.57)
    ]
    path = write(tmp_path, rows, "train/DR_USA_Intersection_EP0_train.csv")
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "DR_USA_Intersection_EP0.osm").write_text("<osm/>")
    sources = datasets.open(tmp_path).sources
    assert [source.name for source in sources] == [f"{path.stem}/1", f"{path.stem}/2"]
    assert {source.site for source in sources} == {"DR_USA_Intersection_EP0"}
    assert sources[0].map == tmp_path / "maps" / "DR_USA_Intersection_EP0.osm"
    assert [list(source.load().tracks) for source in sources] == [["1", "3"], ["1", "4"]]
    assert sources[1].load().tracks["1"].columns["x"][0] == pytest.approx(20.0 - 1.2)


def test_bad_value_in_a_case_is_found_in_the_whole_file(tmp_path: Path) -> None:
    rows = [{"case_id": case, **row} for case in (1, 2) for row in interaction_rows(*CAR, n=3)]
    rows[4]["agent_type"] = rows[3]["agent_type"] = "ufo"
    sources = datasets.open(write(tmp_path, rows, "a_val.csv")).sources
    sources[0].load()
    with pytest.raises(InvalidFile, match=r"a_val.csv:5: column agent_type: 'ufo' is none of car"):
        sources[1].load()


def test_rows_of_the_same_time_are_excluded_and_counted(tmp_path: Path) -> None:
    rows = interaction_rows(*CAR)
    twice = [*rows[:6], rows[5] | {"x": 99.0}, *rows[6:]]
    recording, report = read(write(tmp_path, twice))
    assert recording.tracks["1"].columns["x"].max() < 50.0
    assert [(one.what, one.rows) for one in report.exclusions] == [("1", 1)]
    assert (report.excluded, report.rows) == (1, 20)


@pytest.mark.parametrize("factors", [(-1.0, -1.0), (0.3, 0.9)], ids=["backwards", "at random"])
def test_velocities_that_contradict_the_positions_are_replaced(
    tmp_path: Path, factors: tuple[float, float]
) -> None:
    scale = np.random.default_rng(1).uniform(*factors, 20)
    rows = [
        row | {"vx": 6.0 * s, "vy": 8.0 * s}
        for s, row in zip(scale, interaction_rows(*CAR), strict=True)
    ]
    recording, report = read(write(tmp_path, rows))
    assert recording.tracks["1"].columns["speed"] == pytest.approx(10.0)
    assert (
        "the velocities contradict the positions: speeds are derived from the positions"
        in report.remarks
    )


def test_headings_folded_into_half_a_circle_are_taken_from_the_motion(tmp_path: Path) -> None:
    """As in one recording of TAF-BW: velocities backwards, headings arctan(vy /
    vx), which a left turn shows.
    """
    angles = np.linspace(0.0, math.pi, 60)
    rows = [
        row
        | {
            "x": 20.0 * math.sin(a),
            "y": -20.0 * math.cos(a),
            "vx": -6.0 * math.cos(a),
            "vy": -6.0 * math.sin(a),
        }
        for a, row in zip(angles, interaction_rows(*CAR, n=60), strict=True)
    ]
    folded = [
        row | {"psi_rad": math.atan(math.tan(a))} for a, row in zip(angles, rows, strict=True)
    ]
    recording, report = read(write(tmp_path, folded))
    turned = recording.tracks["1"].columns["h"]
    assert np.cos(turned - angles) == pytest.approx(1.0, abs=0.05)
    assert (
        "the headings contradict the positions too: they are taken from the motion"
        in report.remarks
    )


def test_good_headings_are_kept_where_velocities_are_wrong(tmp_path: Path) -> None:
    askew = math.atan2(8.0, 6.0) + 0.1
    rows = [row | {"vx": -6.0, "vy": -8.0, "psi_rad": askew} for row in interaction_rows(*CAR)]
    assert read(write(tmp_path, rows))[0].tracks["1"].columns["raw_h"] == pytest.approx(askew)


@settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    agents=st.lists(
        st.tuples(
            st.integers(0, 10**9), st.floats(-2000, 2000), st.floats(-2000, 2000),
            st.floats(-20, 20), st.floats(-20, 20),
            st.floats(-7, 7), st.integers(2, 30),
        ),
        min_size=1, max_size=5, unique_by=lambda agent: agent[0],
    ),
)  # fmt: skip
def test_what_is_written_is_read_back(tmp_path: Path, agents: list) -> None:
    written = {str(agent[0]): interaction_rows(*agent) for agent in agents}
    recording, _ = read(write(tmp_path, [row for rows in written.values() for row in rows]))
    assert list(recording.tracks) == list(written)
    for name, rows in written.items():
        track = recording.tracks[name]
        columns, ahead = track.columns, track.box.x
        h = columns["raw_h"]
        assert columns["raw_x"] + ahead * np.cos(h) == pytest.approx(
            [row["x"] for row in rows], abs=1e-6
        )
        assert columns["raw_y"] + ahead * np.sin(h) == pytest.approx(
            [row["y"] for row in rows], abs=1e-6
        )
        assert np.cos(h - rows[0]["psi_rad"]) == pytest.approx(1.0)
        assert columns["raw_speed"] == pytest.approx(
            rows[0]["vx"] * np.cos(h) + rows[0]["vy"] * np.sin(h)
        )


@pytest.mark.parametrize(
    ("column", "value", "complaint"),
    [
        ("psi_rad", None, "a value is missing"),
        ("psi_rad", "north", "'north' is not a number"),
        ("timestamp_ms", 300, "300 of track 1 is there twice|300 of track 1 comes after 500"),
        ("timestamp_ms", 10**18, f"{10**18} is too large"),
        ("x", "nan", "'nan' is no value"),
        ("track_id", None, "a value is missing"),
        ("agent_type", None, "a value is missing"),
        ("track_id", "\x1b[31m1", r"'\\x1b\[31m1' has characters that can't be printed"),
    ],
)
def test_bad_value_is_refused_with_line_and_column(
    tmp_path: Path, column: str, value: object, complaint: str
) -> None:
    rows = interaction_rows(*CAR)
    rows[5][column] = value
    with pytest.raises(
        InvalidFile, match=rf"vehicle_tracks_000\.csv:7: column {column}: ({complaint})"
    ):
        read(write(tmp_path, rows))


@pytest.mark.parametrize(
    ("column", "value", "complaint"),
    [("length", None, "a value is missing"), ("width", -1, "-1 is no size")],
)
def test_vehicle_without_a_size_is_refused(
    tmp_path: Path, column: str, value: object, complaint: str
) -> None:
    with pytest.raises(InvalidFile, match=f"csv:2: column {column}: {complaint}"):
        read(write(tmp_path, interaction_rows(*CAR, **{column: value})))


def test_vehicle_file_without_boxes_is_refused(tmp_path: Path) -> None:
    rows = [
        {key: value for key, value in row.items() if key != "length"}
        for row in interaction_rows(*CAR)
    ]
    with pytest.raises(InvalidFile, match="csv:1: no column length; columns: track_id, frame_id"):
        read(write(tmp_path, rows))


# real recordings ----------------------------------------------------------------------------


@pytest.mark.slow
def test_taf_bw_reads_whole(recordings: Path) -> None:
    sources = datasets.open(recordings / "taf_bw").sources
    assert len(sources) == 27
    rows = 0
    for source in sources:
        recording = source.load()
        assert source.report is not None
        assert source.map is not None
        assert source.map.stem == source.site
        assert source.origin is not None
        assert recording.timestep == 0.1
        assert source.report.missing == 0
        rows += source.report.rows + source.report.excluded
    assert rows == 45_776


@pytest.mark.slow
@pytest.mark.parametrize(
    ("site", "folded"), [("k733_2018-05-02", True), ("k733_2020-09-15", False)]
)
def test_vehicles_of_taf_bw_go_where_they_face(recordings: Path, site: str, folded: bool) -> None:
    (source,) = datasets.open(recordings / "taf_bw" / "recorded_trackfiles" / site).sources
    recording = source.load()
    assert source.report is not None
    assert any("velocities contradict" in remark for remark in source.report.remarks)
    assert any("headings contradict" in remark for remark in source.report.remarks) == folded
    agreeing = total = 0.0
    for track in recording.tracks.values():
        columns = track.columns
        dx, dy = np.diff(columns["x"]), np.diff(columns["y"])
        agreeing += float((dx * np.cos(columns["h"][1:]) + dy * np.sin(columns["h"][1:])).sum())
        total += float(np.hypot(dx, dy).sum())
    assert agreeing > 0.9 * total


def test_headings_in_degrees_are_taken_as_such_and_told(tmp_path: Path) -> None:
    rows = [
        row | {"psi_rad": 357.0 + 6.0 * (k % 2)}
        for k, row in enumerate(interaction_rows(1, 0.0, 0.0, 9.0, 0.0, 0.0))
    ]
    recording, report = read(write(tmp_path, rows))
    assert recording.tracks["1"].columns["raw_h"] == pytest.approx(0.0, abs=math.radians(3.1))
    assert any("taken as degrees" in remark for remark in report.remarks)


def test_recording_of_which_nothing_is_left_is_refused(tmp_path: Path) -> None:
    rows = [row | {"timestamp_ms": 10_000 * k} for k, row in enumerate(interaction_rows(*CAR))]
    path = write(tmp_path, rows)
    with pytest.raises(InvalidFile, match="no track is left") as raised:
        read(path)
    assert raised.value.path == str(path)


def test_phases_of_lights_beside_tracks_belong_to_them_and_are_told(tmp_path: Path) -> None:
    folder = tmp_path / "k733_2020-09-15"
    write_csv(folder / "vehicle_tracks_000.csv", interaction_rows(*CAR))
    write_csv(folder / "signal_phases_000.csv", [{"signal_group_id": 1, "timestamp_ms": 0}])
    found = datasets.open(folder)
    assert found.skipped == []
    _, report = read(folder)
    (told,) = [remark for remark in report.remarks if remark.startswith("signal_phases_000.csv: ")]
    assert "not read" in told
