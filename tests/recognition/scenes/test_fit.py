"""Whether maps that were found for recordings are those of their places."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

import recognition.recordings as datasets
from recognition.scenes import share_astray, share_on_road, site_of
from runner.recording import Recording
from schemas.common.errors import InvalidFile
from tests.recognition.driving import STEP, ahead, site, track
from tests.recognition.traffic import interaction_rows, write_csv
from xodr import builders
from xodr.graph.network import RoadNetwork


@pytest.fixture(scope="module")
def road(tmp_path_factory: pytest.TempPathFactory) -> RoadNetwork:
    """One lane in the direction of x, 3.75 m wide."""
    return site(
        builders.straight_highway(lanes=1, length=300.0), tmp_path_factory.mktemp("road")
    ).network


def moving(*headings: float, speed: float = 5.0, category: str = "car") -> Recording:
    """Vehicles along the lane that head so, and go forwards or (speed < 0) backwards."""
    tracks = [
        track(str(n), ahead(150.0, math.cos(h) * speed, 20.0), -1.9, heading=h, category=category)
        for n, h in enumerate(headings)
    ]
    for one in tracks:
        one.columns["speed"][:] = speed
    return Recording(tracks, STEP, None)


@pytest.mark.parametrize(
    ("headings", "share"),
    [
        ((0.0, 0.0, 0.0), 0.0),
        ((math.pi, math.pi, math.pi), 1.0),
        ((0.0, 0.7, -0.7), 0.0),
        ((0.9, 0.9, -0.9, 0.0, 0.0), 0.5),
        ((0.0, 0.0, math.pi), 0.0),
        ((math.pi,), 0.0),
        ((), 0.0),
    ],
    ids=["along", "against", "within 45°", "across", "one of three", "one alone", "nobody"],
)
def test_who_goes_across_or_against_is_astray_except_the_worst(
    road: RoadNetwork, headings: tuple[float, ...], share: float
) -> None:
    assert share_astray(moving(*headings), road) == pytest.approx(share, abs=0.01)


def test_motion_counts_not_the_front(road: RoadNetwork) -> None:
    assert share_astray(moving(math.pi, math.pi, speed=-5.0), road) == 0.0
    assert share_astray(moving(0.0, 0.0, speed=-5.0), road) == 1.0


def test_who_hardly_moves_shows_nothing_nor_do_cyclists(road: RoadNetwork) -> None:
    assert share_astray(moving(math.pi, math.pi, speed=1.9), road) == 0.0
    assert share_astray(moving(math.pi, math.pi, category="bicycle"), road) == 0.0


def test_parked_vehicles_beside_the_road_show_nothing_where_others_move(road: RoadNetwork) -> None:
    parked = [track(f"parked {n}", np.full(50, 10.0 * n), 20.0, heading=0.0) for n in range(5)]
    along, beside = (
        track("along", ahead(150.0, 5.0, 5.0), -1.9),
        track("beside", ahead(150.0, 5.0, 5.0), 20.0),
    )
    assert share_on_road(Recording([*parked, along], STEP, None), road) == 1.0
    assert share_on_road(Recording([*parked, along, beside], STEP, None), road) == pytest.approx(
        0.5, abs=0.01
    )
    assert share_on_road(Recording(parked, STEP, None), road) == 0.0


def test_a_map_whose_lanes_lead_elsewhere_is_refused(tmp_path: Path) -> None:
    rows = [
        row
        for n in range(4)
        for row in interaction_rows(n, 50.0 + 20.0 * n, -1.9, -5.0, 0.0, math.pi)
    ]
    write_csv(tmp_path / "road" / "vehicle_tracks_000.csv", rows)
    builders.straight_highway(lanes=1, length=300.0).write(tmp_path / "road" / "road.xodr")
    (source,) = datasets.open(tmp_path / "road", tmp_path).sources
    message = (
        r"000\.csv: at 100% of their places vehicles go across the lanes of road\.xodr or against "
        r"the traffic there: a map"
    )
    with pytest.raises(InvalidFile, match=message):
        site_of(source, source.load(), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tracks", "map"),
    [("k733_2018-05-02", "k729_2022-03-16"), ("k729_2022-03-16", "k733_2018-05-02")],
)
def test_the_map_of_another_junction_is_refused(
    recordings: Path, tmp_path: Path, tracks: str, map: str
) -> None:
    """Each with its own origin, which is the middle of the junction, so that one
    lies upon the other.
    """
    folder, data = tmp_path / tracks, recordings / "taf_bw"
    folder.mkdir()
    shutil.copy(data / "recorded_trackfiles" / tracks / "vehicle_tracks_000.csv", folder)
    shutil.copy(data / "recorded_trackfiles" / map / "meta_data.csv", folder)
    shutil.copy(data / "maps" / f"{map}.osm", folder / f"{tracks}.osm")
    (source,) = datasets.open(folder, tmp_path).sources
    across, beside = (
        r"at \d\d% of their places vehicles go across the lanes",
        r"only \d\d% of the vehicles' places are on a road",
    )
    with pytest.raises(InvalidFile, match=rf"({across}|{beside}) of {tracks}\.osm"):
        site_of(source, source.load(), tmp_path)
