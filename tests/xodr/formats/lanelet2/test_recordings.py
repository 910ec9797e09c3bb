"""The Lanelet2 maps of real recordings, which are present in development and CI only."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import schemas
import xodr
from recognition import recordings as datasets
from xodr.formats import sumo_net
from xodr.formats.lanelet2 import Conversion, convert
from xodr.formats.lanelet2.borders import completed
from xodr.formats.lanelet2.reader import read_lanelets

ORIGINS = {
    "k729_2022-03-16": (49.01160993928274, 8.43856470258739),
    "k733_2018-05-02": (49.005306, 8.4374089),
    "k733_2020-09-15": (49.005306, 8.4374089),
}
SLOW = 2.0
"""Tracks of what hardly moves wander, m/s."""


@pytest.fixture(params=ORIGINS)
def site(request: pytest.FixtureRequest) -> str:
    """Name of a site."""
    return str(request.param)


@pytest.fixture
def conversion(site: str, recordings: Path, tmp_path: Path) -> Conversion:
    """Its map, converted."""
    return convert(
        recordings / "taf_bw" / "maps" / f"{site}.osm", ORIGINS[site], tmp_path / f"{site}.xodr"
    )


def test_real_maps_are_valid_roads_within_tolerance(conversion: Conversion) -> None:
    assert {problem.rule.rpartition(".")[2] for problem in schemas.check(conversion.path)} <= {
        "avoid_redundant_info"
    }
    assert conversion.deviation <= 0.2


def test_every_connection_of_real_lanelets_is_one_of_lanes(
    site: str, conversion: Conversion, recordings: Path
) -> None:
    network = xodr.load(conversion.path)
    lanes, _ = completed(
        read_lanelets(recordings / "taf_bw" / "maps" / f"{site}.osm", ORIGINS[site]).lanes
    )
    pairs = [
        (conversion.lanelets[one.id], conversion.lanelets[other])
        for one in lanes
        for other in one.successors
    ]
    assert len(pairs) >= 30
    for lane, target in pairs:
        following = {(link.road_id, link.lane_id) for link in network.links(*lane, True)}
        inside = [each for each in following if network.roads[each[0]].junction_id is not None]
        beyond = {
            (link.road_id, link.lane_id) for each in inside for link in network.links(*each, True)
        }
        assert lane == target or target in following | beyond, (
            "a part cut off for a junction may come between"
        )


@pytest.mark.slow
def test_recorded_cars_drive_on_the_lanes(
    site: str, conversion: Conversion, recordings: Path
) -> None:
    network = xodr.load(conversion.path)
    offsets = []
    for source in datasets.open(recordings / "taf_bw" / "recorded_trackfiles" / site).sources:
        for track in source.load().tracks.values():
            if track.kind == "vehicle" and track.category != "bicycle":
                offsets += [
                    _offset(network, *place) for place in _places(track.box.x, track.columns)
                ]
    found = np.array(offsets)[~np.isnan(offsets)]  # the rest is beyond the edge of the map
    assert len(found) > 150
    assert np.mean(np.isfinite(found)) > 0.96
    assert np.median(np.abs(found[np.isfinite(found)])) < 1.0


def _places(ahead: float, columns: dict[str, np.ndarray]) -> list[tuple[float, float, float]]:
    """x, y and heading of a car's centre, every second."""
    moving = np.flatnonzero(np.abs(columns["speed"]) > SLOW)[::10]
    h = columns["h"][moving]
    return list(
        zip(
            columns["x"][moving] + ahead * np.cos(h),
            columns["y"][moving] + ahead * np.sin(h),
            h,
            strict=True,
        )
    )


def _offset(network: xodr.RoadNetwork, x: float, y: float, h: float) -> float:
    """Distance from the middle of the lane; infinite where there is none, NaN
    beyond the ends of roads.
    """
    point = network.locate(x, y, h=h)
    road = network.roads[point.road_id]
    if not 0.0 <= point.s <= road.length:
        return float("nan")
    driving = network.on_road(point) and road.lane_type(point.s, point.lane_id) == "driving"
    return point.offset if driving else float("inf")


def test_sumo_has_all_ways_through_real_junctions(
    conversion: Conversion, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XOSC_CACHE_DIR", str(tmp_path))
    network = xodr.load(conversion.path)
    net = sumo_net.build(conversion.path)
    known = {track.road_id for lane in net.sumo_lanes if (track := net.track(lane))}
    assert known == set(network.roads)
