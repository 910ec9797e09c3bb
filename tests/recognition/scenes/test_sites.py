"""Where the roads of a recording come from."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import recognition.recordings as datasets
from recognition.recordings.road_sources import straight_road
from recognition.scenes import LIT, LaneRole, site_of
from runner.recording import Recording
from schemas.common.errors import InvalidFile, UsageError
from tests.commands import Command
from tests.recognition.driving import STEP, ahead, sideways, track
from tests.recognition.traffic import (
    Car,
    commonroad,
    interaction_rows,
    obstacle,
    write_csv,
    write_highd,
)
from tests.xodr.formats.lanelet2.lanelet_maps import two_lanes
from xodr import builders
from xodr.reader import load


def opened(path: Path, roads: Path) -> tuple:
    source = datasets.open(path, roads).sources[0]
    return source, source.load(), roads


def test_highd_brings_its_road_along(tmp_path: Path) -> None:
    write_highd(tmp_path / "data", [Car(1, 50.0, 21.0, 30.0)])
    source, recording, roads = opened(tmp_path / "data", tmp_path / "roads")
    place = site_of(source, recording, roads)
    assert place.network is recording.network
    assert {entry.role for entry in place.roles.entries} == {LaneRole.MAIN}


def test_a_road_beside_the_tracks_is_the_sites(tmp_path: Path) -> None:
    write_csv(
        tmp_path / "ring" / "vehicle_tracks_000.csv",
        interaction_rows(1, 50.0, 2.0, -5.0, 0.0, math.pi),
    )
    path = builders.roundabout().write(tmp_path / "ring" / "ring.xodr")
    place = site_of(*opened(tmp_path / "ring", tmp_path / "roads"))
    assert place.path == path
    assert (tmp_path / "roads" / "ring.roles.json").is_file()
    assert not path.with_suffix(".roles.json").exists()


@pytest.mark.parametrize("lights", [True, False])
def test_junctions_with_lights_are_named_where_their_passages_do_not_count(
    lights: bool, tmp_path: Path, command: Command
) -> None:
    folder = tmp_path / "crossing"
    road = builders.four_way_intersection(signals=lights).write(folder / "crossing.xodr")
    x, y, h = load(road).roads["1"].pose(10.0, -1.75)[:3]
    rows = interaction_rows(1, x, y, 8.0 * math.cos(h), 8.0 * math.sin(h), h)
    write_csv(folder / "vehicle_tracks_000.csv", rows)
    call = ("xosc-recognize", folder, "--labels", "rules", "--out", tmp_path / "out")
    assert (f"{LIT} (1 recording)" in command(*call).out) == lights
    assert LIT not in command(*call, "--signalised").out


def test_what_was_done_to_make_the_road_joins_the_report(tmp_path: Path) -> None:
    write_csv(
        tmp_path / "ring" / "vehicle_tracks_000.csv", interaction_rows(1, 10.0, 1.75, 5.0, 0.0, 0.0)
    )
    two_lanes().write(tmp_path / "ring", "ring")
    source, recording, roads = opened(tmp_path / "ring", tmp_path / "roads")
    site_of(source, recording, roads)
    site_of(source, recording, roads)
    assert (
        source.report.remarks.count(
            "ring.osm: speed limits are the usual ones, since the map gives none: lanelets 1 2"
        )
        == 1
    )


def test_a_recording_without_roads_is_refused(tmp_path: Path) -> None:
    write_csv(
        tmp_path / "ring" / "vehicle_tracks_000.csv", interaction_rows(1, 0.0, 0.0, 5.0, 0.0, 0.0)
    )
    with pytest.raises(
        UsageError,
        match=r"ring/000 has no map: neither ring\.xodr beside it nor a Lanelet2 map ring\.osm",
    ):
        site_of(*opened(tmp_path / "ring", tmp_path / "roads"))


@pytest.mark.parametrize(("x", "share"), [(5000.0, "0%"), (42.5, "20%")])
def test_a_map_of_another_place_is_refused(tmp_path: Path, x: float, share: str) -> None:
    """Vehicles stand on the map's road up to x = 50 m, and beyond, every 10 m."""
    places = [(number, x + 10.0 * number) for number in range(5)]
    rows = [
        row for number, at in places for row in interaction_rows(number, at, -1.75, 0.0, 0.0, 0.0)
    ]
    write_csv(tmp_path / "road" / "vehicle_tracks_000.csv", rows)
    builders.straight_highway(length=50.0).write(tmp_path / "road" / "road.xodr")
    message = (
        rf"vehicle_tracks_000\.csv: only {share} of the vehicles' places are on a road of "
        r"road\.xodr: a map of this place"
    )
    with pytest.raises(InvalidFile, match=message):
        site_of(*opened(tmp_path / "road", tmp_path / "roads"))


def test_scenarios_without_lanelets_are_refused_by_their_own_file(tmp_path: Path) -> None:
    (tmp_path / "A_B-1_1_T-1.xml").write_text(commonroad(obstacle(1, 0.0, 0.0, 0.0, 5.0)))
    with pytest.raises(InvalidFile, match=r"A_B-1_1_T-1\.xml:2: commonRoad: there is no lanelet"):
        site_of(*opened(tmp_path, tmp_path / "roads"))


@pytest.mark.slow
def test_lanelet2_maps_become_roads_once(recordings: Path, tmp_path: Path) -> None:
    sources = [
        one
        for one in datasets.open(recordings / "taf_bw", tmp_path).sources
        if one.site == "k733_2018-05-02"
    ]
    places = [site_of(source, source.load(), tmp_path) for source in (sources[0], sources[0])]
    assert places[0].network is places[1].network
    assert places[0].path.parent == tmp_path
    assert sum(entry.role is LaneRole.SIGNALISED for entry in places[0].roles.entries) > 8


@pytest.mark.slow
def test_lanelets_of_commonroad_become_roads(recordings: Path, tmp_path: Path) -> None:
    archive = recordings / "ngsim" / "USA_ngsim_commonroad_xml.tar.xz"
    sources = {
        source.name.split("/")[-1]: source for source in datasets.open(archive, tmp_path).sources
    }
    motorway = sources["USA_US101-9_1_T-1"]
    place = site_of(motorway, motorway.load(), tmp_path)
    assert {entry.role for entry in place.roles.entries} <= {
        LaneRole.MAIN,
        LaneRole.ON_RAMP,
        LaneRole.OFF_RAMP,
    }
    street = sources["USA_Lanker-1_6_T-1"]
    place = site_of(street, street.load(), tmp_path)
    assert sum(entry.role is LaneRole.SIGNALISED for entry in place.roles.entries) > 4


# the straight road of NGSIM tables ------------------------------------------------------------


def traffic(*lanes: float) -> Recording:
    """Vehicles on lanes at these y, two each."""
    noise = np.random.default_rng(1)
    names = [(f"{index}.{number}", y) for index, y in enumerate(lanes) for number in (1, 2)]
    return Recording(
        [
            track(name, ahead(0, 20, 20), y + noise.normal(0, 0.2, 201), heading=0.0)
            for name, y in names
        ],
        STEP,
        None,
    )


def borders(recording: Recording) -> list[float]:
    road = straight_road(recording, "site").roads[0]
    widths = [lane.width[0].a for _, lane in sorted(road.sections[0].lanes.items(), reverse=True)]
    return (road.start.y - np.cumsum([0.0, *widths])).tolist()


def test_lanes_lie_where_most_vehicles_drive() -> None:
    recording = traffic(-2.0, -5.5, -9.0)
    changing = track("x", ahead(0, 20, 20), sideways(-2.0, -5.5, 10.0, 20.0))
    recording.tracks["x"] = changing
    assert borders(recording) == pytest.approx([-0.25, -3.75, -7.25, -10.75], abs=0.15)


def test_the_data_sets_own_lanes_count_where_it_has_them() -> None:
    recording = traffic(-2.0, -5.5, -9.0)
    for name, one in recording.tracks.items():
        one.columns["source_lane"] = np.full(201, {"0": 1, "1": 2, "2": 7}[name[0]])
    assert borders(recording) == pytest.approx([-0.25, -3.75, -7.25, -10.75], abs=0.1)
    kinds = [
        lane.type
        for _, lane in sorted(
            straight_road(recording, "site").roads[0].sections[0].lanes.items(), reverse=True
        )
    ]
    assert kinds == ["driving", "driving", "onRamp"]


def test_traffic_in_other_directions_shows_no_straight_road() -> None:
    recording = traffic(-2.0)
    for number in range(3):
        recording.tracks[f"across {number}"] = track(f"across {number}", 0.0, ahead(0, 20, 20))
    with pytest.raises(UsageError, match="does not go straight along x"):
        straight_road(recording, "site")
    with pytest.raises(UsageError, match="does not go straight"):
        straight_road(Recording([], STEP, None), "site")


@pytest.mark.slow
def test_phases_of_lights_beside_the_tracks_make_junctions_signalised(
    recordings: Path, tmp_path: Path
) -> None:
    found = {}
    for site in ("k729_2022-03-16", "k733_2018-05-02", "k733_2020-09-15"):
        place = site_of(*opened(recordings / "taf_bw" / "recorded_trackfiles" / site, tmp_path))
        found[site] = {entry.role for entry in place.roles.entries} & {
            LaneRole.INSIDE,
            LaneRole.SIGNALISED,
        }
    assert found["k729_2022-03-16"] == {LaneRole.INSIDE}
    assert found["k733_2018-05-02"] == found["k733_2020-09-15"] == {LaneRole.SIGNALISED}
