"""Recordings of inD and what follows its layout as this project reads them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from recognition import recordings as datasets
from recognition.recordings.motion import motion_models
from recognition.scenes import site_of
from schemas.common.errors import InvalidFile, UsageError
from tests.recognition.traffic import ind_rows, interaction_rows, read, write_csv, write_ind

CAR = ind_rows(1, 0.0, 0.0, 5.0, 0.0)
ORIGIN = (50.78, 6.13)


def test_the_same_traffic_in_the_layout_of_interaction_gives_the_same_recording(
    tmp_path: Path,
) -> None:
    places = {1: (0.0, 0.0, 5.0, 0.0), 2: (30.0, 9.0, -3.0, 4.0)}
    ours, _ = read(
        write_ind(
            tmp_path / "ind",
            [row for track, place in places.items() for row in ind_rows(track, *place)],
        )
    )
    rows = [
        row
        for track, (x, y, vx, vy) in places.items()
        for row in interaction_rows(track, x, y, vx, vy, math.atan2(vy, vx))
    ]
    other, _ = read(write_csv(tmp_path / "site" / "vehicle_tracks_000.csv", rows))
    assert list(ours.tracks) == list(other.tracks)
    for name, track in ours.tracks.items():
        assert (track.box, track.category) == (other.tracks[name].box, other.tracks[name].category)
        for column in ("x", "y", "h", "speed"):
            assert track.columns[column] == pytest.approx(
                other.tracks[name].columns[column], abs=1e-9
            ), column


def test_time_counts_from_frame_0(tmp_path: Path) -> None:
    recording, _ = read(
        write_ind(tmp_path, CAR + ind_rows(2, 0.0, 9.0, 5.0, 0.0, first=3), frameRate=25)
    )
    assert recording.timestep == 0.04
    assert [recording.tracks[name].columns["time"][0] for name in "12"] == [0.0, 0.12]


@pytest.mark.parametrize(
    ("kind", "category", "length"),
    [
        ("truck_bus", "truck", 4.0),
        ("Van", "van", 4.0),
        ("motorcycle", "motorbike", 4.0),
        ("trailer", "trailer", 4.0),
    ],
)
def test_classes_of_all_the_data_sets_are_known(
    tmp_path: Path, kind: str, category: str, length: float
) -> None:
    track = read(write_ind(tmp_path, CAR, {1: kind}))[0].tracks["1"]
    assert (track.category, track.box.length) == (category, length)


def test_tracks_without_a_smooth_motion_are_named_with_their_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def solve(*_: object, **__: object) -> None:
        raise np.linalg.LinAlgError("27th leading minor not positive definite")

    monkeypatch.setattr(motion_models, "solveh_banded", solve)
    with pytest.raises(
        InvalidFile,
        match=r"00_tracks\.csv: the tracks 1 to 1 have no smooth motion: a step is 0\.1 s",
    ):
        read(write_ind(tmp_path, CAR))


@pytest.mark.parametrize("size", [0.0, None])
@pytest.mark.parametrize(("kind", "length"), [("pedestrian", 0.5), ("bicycle", 1.8)])
def test_who_has_no_size_has_the_usual_one(
    tmp_path: Path, kind: str, length: float, size: float | None
) -> None:
    track = read(
        write_ind(tmp_path, ind_rows(1, 0.0, 0.0, 1.5, 0.0, width=size, length=size), {1: kind})
    )[0].tracks["1"]
    assert (track.category, track.box.length) == (kind, length)


def test_a_vehicle_without_a_size_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        InvalidFile, match=r"00_tracksMeta\.csv:2: column length: a value is missing"
    ):
        read(write_ind(tmp_path, ind_rows(1, 0.0, 0.0, 5.0, 0.0, length=0.0)))


def test_an_unknown_class_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        InvalidFile, match=r"00_tracksMeta\.csv:2: column class: 'horse' is none of car, "
    ):
        read(write_ind(tmp_path, CAR, {1: "horse"}))


@pytest.mark.parametrize("kind", ["tracksMeta", "recordingMeta"])
def test_a_recording_that_lacks_a_file_is_refused(tmp_path: Path, kind: str) -> None:
    path = write_ind(tmp_path, CAR)
    (tmp_path / f"00_{kind}.csv").unlink()
    with pytest.raises(InvalidFile, match=rf"00_tracks\.csv: there is no 00_{kind}\.csv beside it"):
        read(path)


@pytest.mark.parametrize(
    "name", ["maps/lanelet2/1_bendplatz.osm", "lanelets/location1.osm", "lanelets/inD_1.osm"]
)
def test_the_map_of_the_location_is_found(tmp_path: Path, name: str) -> None:
    for file in (name, name.replace("1", "11"), name.replace("1", "2")):
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text("<osm/>")
    (source,) = datasets.open(write_ind(tmp_path / "data", CAR)).sources
    assert (source.map, source.site) == (tmp_path / name, "location1")


def test_two_maps_of_one_location_are_refused(tmp_path: Path) -> None:
    for name in ("1_old.osm", "1_new.osm"):
        (tmp_path / "maps").mkdir(exist_ok=True)
        (tmp_path / "maps" / name).write_text("<osm/>")
    with pytest.raises(
        InvalidFile,
        match=r"1_new\.osm and .*1_old\.osm are both maps of location 1, one is expected",
    ):
        read(write_ind(tmp_path / "data", CAR))


def test_without_a_map_there_is_a_line_that_says_what_is_missing(tmp_path: Path) -> None:
    (source,) = datasets.open(write_ind(tmp_path, CAR)).sources
    with pytest.raises(
        UsageError, match=r"neither location1\.xodr beside it nor a Lanelet2 map location1\.osm"
    ):
        site_of(source, source.load(), tmp_path)


def test_the_map_lies_below_the_tracks_that_its_origin_says(tmp_path: Path) -> None:
    import pyproj

    (source,) = datasets.open(write_ind(tmp_path, CAR)).sources
    assert source.origin is not None
    east, north = pyproj.Proj(proj="utm", zone=32, ellps="WGS84")(
        source.origin[1], source.origin[0]
    )
    assert np.allclose((east, north), (297631.3187, 5629917.3465), atol=1e-3)
    assert np.allclose(source.origin, ORIGIN, atol=0.05)


@pytest.mark.parametrize(
    "wrong", [{"yUtmOrigin": 5e8}, {"xUtmOrigin": 0.0, "yUtmOrigin": 0.0}, {"lonLocation": 4e3}]
)
def test_an_origin_far_from_the_place_is_refused(tmp_path: Path, wrong: dict[str, float]) -> None:
    with pytest.raises(
        InvalidFile, match=r"00_recordingMeta\.csv:2: column xUtmOrigin: .* is not near .*° east"
    ):
        read(write_ind(tmp_path, CAR, **wrong))
