"""The recorder from end to end: what it writes is read, is the same each time,
and moves as vehicles do.
"""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import typer
from shapely import Polygon
from typer.testing import CliRunner

from recognition import xosc_recognize
from recognition.recorder import SITES, record
from recognition.recordings import Source
from recognition.recordings import open as open_data_set
from recognition.recordings.table import read_table
from recognition.scenes import site_of
from runner.recording import Recording, Track
from schemas import check
from schemas.common.errors import UsageError

NAMES = ["motorway_sparse", "kerbside", "crossing"]
LEAST = 1e-6


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recorded")
    record(folder, scale=LEAST, sites=NAMES, jobs=2)
    return folder


@pytest.fixture(scope="module")
def sources(
    recorded: Path, tmp_path_factory: pytest.TempPathFactory
) -> list[tuple[Source, Recording]]:
    found = open_data_set(recorded, roads=tmp_path_factory.mktemp("roads")).sources
    return [(source, source.load()) for source in found]


def centres(track: Track) -> tuple[np.ndarray, np.ndarray]:
    columns = track.columns
    return columns["x"] + track.box.x * np.cos(columns["h"]), columns["y"] + track.box.x * np.sin(
        columns["h"]
    )


def outline(track: Track, row: int) -> Polygon:
    x, y = (values[row] for values in centres(track))
    h, half_length, half_width = (
        track.columns["h"][row],
        0.5 * track.box.length,
        0.5 * track.box.width,
    )
    ahead, left = (
        np.array([np.cos(h), np.sin(h)]) * half_length,
        np.array([-np.sin(h), np.cos(h)]) * half_width,
    )
    return Polygon(
        [np.array([x, y]) + a * ahead + b * left for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
    )


def test_one_job_and_two_write_the_same_bytes(recorded: Path, tmp_path: Path) -> None:
    names = [
        path.relative_to(tmp_path)
        for path in record(tmp_path, scale=LEAST, sites=["crossing", "motorway_sparse"])
    ]
    assert names
    for name in names:
        assert (tmp_path / name).read_bytes() == (recorded / name).read_bytes()


def test_another_seed_gives_other_traffic(recorded: Path, tmp_path: Path) -> None:
    [first, *_] = record(tmp_path, scale=LEAST, seed=1, sites=["crossing"])
    assert first.read_bytes() != (recorded / "crossing" / first.name).read_bytes()


def test_readers_find_three_recordings_of_each_site_without_complaint(
    sources: list[tuple[Source, Recording]],
) -> None:
    assert [
        source.site if source.format == "INTERACTION" else source.path.parent.name
        for source, _ in sources
    ] == [name for name in sorted(NAMES) for _ in range(3)]
    for source, recording in sources:
        report = source.report
        assert report is not None and recording.tracks
        assert not report.gaps and not report.exclusions
        assert not any("contradict" in remark for remark in report.remarks)


def test_maps_lie_beside_interaction_recordings_and_are_valid(
    recorded: Path, sources: list[tuple[Source, Recording]]
) -> None:
    for name in ("kerbside", "crossing"):
        assert not [
            problem
            for problem in check(recorded / name / f"{name}.xodr")
            if problem.severity == "error"
        ]
    for source, recording in sources:
        network = site_of(source, recording, recorded).network
        for track in recording.tracks.values():
            for x, y in np.stack(centres(track), axis=1)[::50].tolist():
                point = network.locate(x, y)
                assert network.on_road(point)
                assert network.road(point.road_id).lane_type(point.s, point.lane_id) == "driving"


@pytest.mark.parametrize(
    ("file", "names", "rate", "rounding"),
    [
        ("motorway_sparse/01_tracks.csv", ("id", "x", "y", "xVelocity", "yVelocity"), 25, 0.011),
        ("crossing/vehicle_tracks_000.csv", ("track_id", "x", "y", "vx", "vy"), 10, 0.0011),
        ("kerbside/vehicle_tracks_002.csv", ("track_id", "x", "y", "vx", "vy"), 10, 0.0011),
    ],
)
def test_nobody_jumps(
    recorded: Path, file: str, names: tuple[str, ...], rate: int, rounding: float
) -> None:
    table = read_table(recorded / file, dict.fromkeys(names, "number"))
    who, x, y, vx, vy = (table[name] for name in names)
    same = who[1:] == who[:-1]
    for place, velocity in ((x, vx), (y, vy)):
        way = 0.5 * (velocity[1:] + velocity[:-1]) / rate
        assert np.abs(np.diff(place) - way)[same].max() < rounding + 9.0 / (4 * rate**2)


def test_headings_turn_smoothly_and_accelerations_are_those_of_cars(
    sources: list[tuple[Source, Recording]],
) -> None:
    for _, recording in sources:
        for track in recording.tracks.values():
            turn = np.diff(np.unwrap(track.columns["h"])) / recording.timestep
            assert np.abs(turn).max(initial=0.0) < 1.5
            assert np.abs(track.columns["acceleration"]).max() < 9.0


def test_boxes_do_not_overlap(sources: list[tuple[Source, Recording]]) -> None:
    for _, recording in sources:
        frames: dict[int, list[tuple[Track, int]]] = {}
        for track in recording.tracks.values():
            for row, time in enumerate(track.columns["time"]):
                frames.setdefault(round(time / recording.timestep), []).append((track, row))
        for frame in sorted(frames)[::25]:
            boxes = [outline(track, row) for track, row in frames[frame]]
            assert not any(a.intersects(b) for a, b in combinations(boxes, 2))


def test_parked_cars_stand_and_pull_out_to_the_left(
    sources: list[tuple[Source, Recording]],
) -> None:
    tracks = [
        track
        for source, recording in sources
        if source.site == "kerbside"
        for track in recording.tracks.values()
    ]
    standing = [
        track
        for track in tracks
        if abs(track.columns["speed"][0]) < 0.01 and len(track.columns["x"]) > 50
    ]
    leaving = [track for track in standing if track.columns["speed"].max() > 3.0]
    assert len(leaving) >= 10
    forwards = np.array([np.cos(track.columns["h"][0]) for track in leaving])
    (along, aside) = (
        np.array([[values[-1] - values[0] for values in centres(track)] for track in leaving]).T
        * forwards
    )
    assert (along > 0.0).all()
    assert (aside > 1.5).sum() >= 5


def test_highd_neighbours_are_those_around_each_vehicle(recorded: Path) -> None:
    names = (
        "frame",
        "id",
        "laneId",
        "precedingId",
        "followingId",
        "leftPrecedingId",
        "leftAlongsideId",
        "leftFollowingId",
    )
    wholes = (*names, "rightPrecedingId", "rightAlongsideId", "rightFollowingId")
    numbers = ("x", "width", "xVelocity", "dhw", "thw", "ttc", "precedingXVelocity")
    path = recorded / "motorway_sparse" / "01_tracks.csv"
    table = read_table(path, dict.fromkeys(wholes, "whole") | dict.fromkeys(numbers, "number"))
    rows = [
        dict(zip(table.columns, values, strict=True))
        for values in zip(*table.columns.values(), strict=True)
    ]
    for frame in range(1, 500, 50):
        there = [row for row in rows if row["frame"] == frame]
        for ego in there:
            expected = around(ego, [row for row in there if row is not ego])
            assert {name: ego[name] for name in expected} == expected
            lead = next((row for row in there if row["id"] == ego["precedingId"]), None)
            if lead is None:
                assert ego["dhw"] == ego["thw"] == ego["ttc"] == ego["precedingXVelocity"] == 0.0
            else:
                gap = (
                    abs(lead["x"] + lead["width"] / 2 - ego["x"] - ego["width"] / 2)
                    - (lead["width"] + ego["width"]) / 2
                )
                assert ego["dhw"] == pytest.approx(gap, abs=0.03)
                assert ego["thw"] == pytest.approx(gap / abs(ego["xVelocity"]), abs=0.02)
                assert ego["precedingXVelocity"] == pytest.approx(lead["xVelocity"], abs=0.011)


def around(ego: dict[str, float], others: list[dict[str, float]]) -> dict[str, float]:
    """highD's neighbours of a vehicle, found by looking at everybody."""
    direction = np.sign(ego["xVelocity"])
    right = 1 if direction > 0 else -1

    def ahead(row: dict[str, float]) -> float:
        return float(direction * (row["x"] + row["width"] / 2 - ego["x"] - ego["width"] / 2))

    def beside(row: dict[str, float]) -> bool:
        return abs(ahead(row)) < (row["width"] + ego["width"]) / 2

    def nearest(rows: list[dict[str, float]]) -> float:
        return min(rows, key=lambda row: abs(ahead(row)))["id"] if rows else 0

    found = {}
    for prefix, lane in (("", 0), ("left", -right), ("right", right)):
        rows = [
            row
            for row in others
            if row["laneId"] == ego["laneId"] + lane and np.sign(row["xVelocity"]) == direction
        ]
        free = [row for row in rows if not (prefix and beside(row))]
        names = (
            [f"{prefix}Preceding", f"{prefix}Following"] if prefix else ["preceding", "following"]
        )
        found[f"{names[0]}Id"] = nearest([row for row in free if ahead(row) > 0])
        found[f"{names[1]}Id"] = nearest([row for row in free if ahead(row) < 0])
        if prefix:
            found[f"{prefix}AlongsideId"] = nearest([row for row in rows if beside(row)])
    return found


def test_highd_lanes_lie_between_the_markings(recorded: Path) -> None:
    folder = recorded / "motorway_sparse"
    meta = read_table(
        folder / "01_recordingMeta.csv", {"upperLaneMarkings": "text", "lowerLaneMarkings": "text"}
    )
    upper, lower = (
        [float(y) for y in meta[f"{side}LaneMarkings"][0].split(";")] for side in ("upper", "lower")
    )
    table = read_table(
        folder / "01_tracks.csv",
        {"y": "number", "height": "number", "laneId": "whole", "xVelocity": "number"},
    )
    assert len(upper) == len(lower) == 4
    assert set(table["laneId"][table["xVelocity"] < 0]) <= {2, 3, 4}
    assert set(table["laneId"][table["xVelocity"] > 0]) <= {6, 7, 8}
    middle = table["y"] + table["height"] / 2
    borders = np.array([-np.inf, *upper, *lower, np.inf])
    assert (borders[table["laneId"] - 1] <= middle + 0.01).all()
    assert (middle - 0.01 <= borders[table["laneId"]]).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scale": 0.0}, "scale=0.0 must be above 0"),
        ({"scale": float("nan")}, "scale=nan"),
        ({"seed": -1}, "seed=-1 must be at least 0"),
        ({"jobs": 0}, "jobs=0 must be at least 1"),
        ({"sites": ["nowhere"]}, "no site 'nowhere'; sites: motorway_sparse"),
    ],
)
def test_arguments_that_make_no_sense_are_refused(
    tmp_path: Path, arguments: dict[str, object], message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        record(tmp_path, **arguments)  # type: ignore[arg-type]


def test_folders_with_recordings_are_left_alone(recorded: Path) -> None:
    with pytest.raises(UsageError, match="has something in it already"):
        record(recorded, scale=LEAST, sites=["crossing"])


def test_the_command_records_and_says_what(tmp_path: Path) -> None:
    app = typer.Typer()
    app.command()(xosc_recognize.record)
    result = CliRunner().invoke(
        app, [str(tmp_path), "--scale", str(LEAST), "--site", "roundabout", "--jobs", "2"]
    )
    assert result.exit_code == 0
    assert result.stdout == f"3 recordings in {tmp_path}\n"
    assert len(list(tmp_path.glob("roundabout/vehicle_tracks_*.csv"))) == 3


def test_paper_scale_has_twenty_recordings_of_each_kind_of_site() -> None:
    kinds = [
        ("motorway",),
        ("on_ramp",),
        ("off_ramp",),
        ("arterial", "kerbside"),
        ("roundabout",),
        ("crossing",),
        ("t_junction",),
    ]
    for names in kinds:
        assert sum(site.recordings for name, site in SITES.items() if name.startswith(names)) >= 20
