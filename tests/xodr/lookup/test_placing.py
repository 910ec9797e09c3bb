"""Placing many positions: as `RoadNetwork.locate` places each."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import xodr
from xodr import builders
from xodr.graph.network import RoadNetwork
from xodr.lookup import placing
from xodr.model import RoadError

MAPS: dict[str, Callable[[], builders.RoadMap]] = {
    "highway": lambda: builders.straight_highway(opposite_lanes=2),
    "on-ramp": builders.on_ramp,
    "off-ramp": lambda: builders.off_ramp(rule="LHT"),
    "curve": lambda: builders.sharp_curve(radius=40.0, angle=2.5),
    "roundabout": lambda: builders.roundabout(lanes=2),
    "crossing": lambda: builders.four_way_intersection(lanes=2),
}


@pytest.fixture(scope="module", params=MAPS)
def network(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> RoadNetwork:
    return xodr.load(MAPS[request.param]().write(tmp_path_factory.mktemp("maps") / "map.xodr"))


def users(network: RoadNetwork, count: int, beside: float, seed: int = 1) -> np.ndarray:
    """Random places on all roads and up to so many metres beside them: rows x, y, z, h."""
    rng = np.random.default_rng(seed)
    roads = list(network.roads.values())
    poses = []
    for _ in range(count):
        road = roads[rng.integers(len(roads))]
        s = rng.uniform(-beside, road.length + beside)
        right, left = road.edges(s)
        pose = road.pose(s, rng.uniform(right - beside, left + beside))
        poses.append(
            (pose.x, pose.y, pose.z, pose.h + rng.choice([0.0, math.pi]) + rng.normal(0.0, 0.1))
        )
    return np.array(poses).T


def differing(network: RoadNetwork, where: np.ndarray) -> list[str]:
    """Places that are not those of `locate`, to a tenth of a millimetre."""
    found = placing.place(network, *where)
    wrong = []
    for index, one in enumerate(where.T.tolist()):
        wanted = network.locate(*one)
        mine = (
            found.road_id[index],
            found.lane_id[index],
            found.s[index],
            found.t[index],
            found.offset[index],
        )
        same = mine[:2] == (wanted.road_id, wanted.lane_id)
        if not same or mine[2:] != pytest.approx((wanted.s, wanted.t, wanted.offset), abs=1e-4):
            wrong.append(f"{mine} is not {tuple(wanted)}")
    return wrong


def test_positions_on_roads_are_where_locate_has_them(network: RoadNetwork) -> None:
    assert differing(network, users(network, 300, 0.0)) == []


def test_positions_beside_roads_are_where_locate_has_them(network: RoadNetwork) -> None:
    assert (
        len(differing(network, users(network, 200, 40.0))) <= 2
    )  # positions equally far from two roads


def test_roads_of_real_maps_are_no_exception(corpora: Path) -> None:
    paths = sorted(corpora.rglob("*.xodr"))
    count = wrong = 0
    for path in paths:
        network = xodr.load(path)
        count, wrong = count + 40, wrong + len(differing(network, users(network, 40, 2.0)))
    assert len(paths) > 20
    assert wrong <= 0.002 * count


def test_without_heading_and_height_the_nearest_lane_centre_counts(network: RoadNetwork) -> None:
    x, y, _, _ = users(network, 100, 0.0)
    found = placing.place(network, x, y)
    for index in range(len(x)):
        wanted = network.locate(float(x[index]), float(y[index]))
        assert found.offset[index] == pytest.approx(wanted.offset, abs=1e-4)


def test_far_away_positions_have_the_road_that_is_nearest(network: RoadNetwork) -> None:
    assert differing(network, np.array([[5e4, -3e4, 0.0, 0.0], [-2e3, 7e3, 0.0, 1.0]]).T) == []


def test_bridges_are_told_apart_by_height(corpora: Path) -> None:
    for path in sorted(corpora.rglob("*.xodr")):
        network = xodr.load(path)
        if any(road.elevation.constant is None for road in network.roads.values()):
            assert len(differing(network, users(network, 60, 0.0, seed=3))) <= 1


def test_no_positions_have_no_places(network: RoadNetwork) -> None:
    assert len(placing.place(network, [], []).s) == 0


def test_positions_that_are_none_are_refused(network: RoadNetwork) -> None:
    with pytest.raises(RoadError, match="no place in the world"):
        placing.place(network, [0.0, math.nan], [0.0, 1.0])


def test_positions_on_geometries_that_overlap_have_a_place(files) -> None:
    geometry = "".join(
        f'<geometry s="{s}" x="{s}" y="0" hdg="0" length="{length}"><arc '
        'curvature="0.001"/></geometry>'
        for s, length in ((0, 60), (0, 60), (40, 60))
    )
    places = placing.place(files.load(files.road(geometry=geometry)), [20.0, 80.0], [-1.0, -1.0])
    assert list(places.road_id) == ["1", "1"]
