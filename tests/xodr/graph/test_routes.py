"""Routes through junctions, and positions on them."""

from __future__ import annotations

from random import Random

import pytest


@pytest.fixture
def network(two_ways):
    """Two ways from road 1 to road 4."""
    return two_ways


def roads(path) -> list[str]:
    """Road ids along a route."""
    return [leg.road_id for leg in path.legs]


@pytest.mark.parametrize(
    ("strategy", "expected"),
    [
        ("shortest", ["1", "10", "2", "4"]),
        ("fastest", ["1", "3", "4"]),
        ("leastIntersections", ["1", "3", "4"]),
    ],
)
def test_each_strategy_finds_its_route(network, strategy: str, expected: list[str]) -> None:
    path = network.route(
        [network.lane_point("1", -1, 40.0), network.lane_point("4", -1, 30.0)], [strategy]
    )
    assert roads(path) == expected


def test_a_random_route_is_some_route_and_the_same_for_the_same_seed(network) -> None:
    ends = [network.lane_point("1", -1, 40.0), network.lane_point("4", -1, 30.0)]
    found = [roads(network.route(ends, ["random"], Random(seed))) for seed in range(20)]
    assert {tuple(way) for way in found} == {("1", "10", "2", "4"), ("1", "3", "4")}
    assert found == [roads(network.route(ends, ["random"], Random(seed))) for seed in range(20)]


def test_waypoints_are_passed_in_order(network) -> None:
    points = [
        network.lane_point("1", -1, 40.0),
        network.lane_point("3", -1, 100.0),
        network.lane_point("4", -1, 30.0),
    ]
    path = network.route(points)
    assert roads(path) == ["1", "3", "4"]
    assert path.length == pytest.approx(60.0 + 300.0 + 30.0)


def test_there_is_no_route_to_an_unconnected_road(network) -> None:
    assert (
        network.route([network.lane_point("1", -1, 40.0), network.lane_point("5", -1, 30.0)])
        is None
    )


def test_against_the_traffic_a_route_is_found_where_there_is_no_other(network) -> None:
    path = network.route([network.lane_point("4", -1, 30.0), network.lane_point("1", -1, 40.0)])
    assert [(leg.road_id, leg.forward) for leg in path.legs] == [
        ("4", False),
        ("2", False),
        ("10", False),
        ("1", False),
    ]


def test_positions_on_a_route_are_distances_along_it(network) -> None:
    path = network.route([network.lane_point("1", -1, 40.0), network.lane_point("4", -1, 30.0)])
    assert path.length == pytest.approx(60.0 + 10.0 + 90.0 + 30.0)
    assert path.at(75.0) == ("2", pytest.approx(5.0), True)
    assert path.position(network.point("2", 5.0, -1.0)) == pytest.approx(75.0)
    assert path.position(network.point("1", 10.0, -1.0)) == pytest.approx(-30.0)
    assert path.position(network.point("3", 10.0, -1.0)) is None
    assert (path.at(-5.0)[1], path.at(1e6)[1]) == (40.0, 30.0)
    assert [leg.exit_lanes for leg in path.legs] == [(-1,), (-1,), (-1,), ()]


def test_travelling_follows_the_route(network) -> None:
    start = network.lane_point("1", -1, 40.0)
    for strategy, road_id in (("shortest", "2"), ("fastest", "3")):
        path = network.route([start, network.lane_point("4", -1, 30.0)], [strategy])
        assert network.travel(start, 80.0, True, path.choose).point.road_id == road_id
        assert network.travel(start, path.length, True, path.choose).point == network.lane_point(
            "4", -1, 30.0
        )


def test_a_route_may_stay_on_one_road(network) -> None:
    path = network.route([network.lane_point("1", 1, 70.0), network.lane_point("1", 1, 20.0)])
    assert [leg[:4] for leg in path.legs] == [("1", False, 70.0, 20.0)]
