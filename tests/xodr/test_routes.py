"""Routes through junctions, positions on them, and where points lie relative to each other."""

from __future__ import annotations

from random import Random

import pytest

from xodr.routes import lanes_between


def road_link(kind: str, road_id: str, contact: str) -> str:
    """A link to a road."""
    return f'<{kind} elementType="road" elementId="{road_id}" contactPoint="{contact}"/>'


def junction_link(kind: str, junction_id: str) -> str:
    """A link to a junction."""
    return f'<{kind} elementType="junction" elementId="{junction_id}"/>'


@pytest.fixture(scope="module")
def network(files):
    """Two ways from road 1 to road 4: over the short slow road 2 with a junction, or the long fast road 3 without one.

    1 ──┬── 10 (in the junction, 10 m) ── 2 (90 m, 10 m/s) ──┬── 4
        └── 3 (300 m, 50 m/s, leaves the direct junction) ───┘
    """
    one = files.section(right=1, left=1)
    single = files.section(right=1)
    return files.load(
        files.road("1", lanes=one, link=junction_link("successor", "a")),
        files.road(
            "10",
            length=10.0,
            lanes=single,
            junction="a",
            link=road_link("predecessor", "1", "end") + road_link("successor", "2", "start"),
        ),
        files.road(
            "2",
            length=90.0,
            lanes=single,
            link=junction_link("predecessor", "a") + junction_link("successor", "b"),
            more=limit(10),
        ),
        files.road(
            "3",
            length=300.0,
            lanes=single,
            link=junction_link("predecessor", "a") + junction_link("successor", "b"),
            more=limit(50),
        ),
        files.road("4", lanes=one, link=junction_link("predecessor", "b")),
        files.road("5", lanes=one),
        f'<junction id="a">{files.connection("1", "10")}{files.connection("1", "3", direct=True)}</junction>',
        f'<junction id="b" type="direct">{files.connection("2", "4", direct=True)}'
        f"{files.connection('3', '4', direct=True)}</junction>",
    )


def limit(speed: float) -> str:
    """A road type with a speed limit."""
    return f'<type s="0" type="rural"><speed max="{speed}"/></type>'


def roads(path) -> list[str]:
    """Road ids along a route."""
    return [leg.road_id for leg in path.legs]


@pytest.mark.parametrize(
    ("strategy", "expected"),
    [("shortest", ["1", "10", "2", "4"]), ("fastest", ["1", "3", "4"]), ("leastIntersections", ["1", "3", "4"])],
)
def test_each_strategy_finds_its_route(network, strategy: str, expected: list[str]) -> None:
    path = network.route([network.lane_point("1", -1, 40.0), network.lane_point("4", -1, 30.0)], [strategy])
    assert roads(path) == expected


def test_a_random_route_is_some_route_and_the_same_for_the_same_seed(network) -> None:
    ends = [network.lane_point("1", -1, 40.0), network.lane_point("4", -1, 30.0)]
    found = [roads(network.route(ends, ["random"], Random(seed))) for seed in range(20)]
    assert {tuple(way) for way in found} == {("1", "10", "2", "4"), ("1", "3", "4")}
    assert found == [roads(network.route(ends, ["random"], Random(seed))) for seed in range(20)]


def test_waypoints_are_passed_in_order(network) -> None:
    points = [network.lane_point("1", -1, 40.0), network.lane_point("3", -1, 100.0), network.lane_point("4", -1, 30.0)]
    path = network.route(points)
    assert roads(path) == ["1", "3", "4"]
    assert path.length == pytest.approx(60.0 + 300.0 + 30.0)


def test_there_is_no_route_to_an_unconnected_road(network) -> None:
    assert network.route([network.lane_point("1", -1, 40.0), network.lane_point("5", -1, 30.0)]) is None


def test_against_the_traffic_a_route_is_found_where_there_is_no_other(network) -> None:
    path = network.route([network.lane_point("4", -1, 30.0), network.lane_point("1", -1, 40.0)])
    assert [(leg.road_id, leg.forward) for leg in path.legs] == [("4", False), ("2", False), ("10", False), ("1", False)]


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
        assert network.travel(start, path.length, True, path.choose).point == network.lane_point("4", -1, 30.0)


def test_a_route_may_stay_on_one_road(network) -> None:
    path = network.route([network.lane_point("1", 1, 70.0), network.lane_point("1", 1, 20.0)])
    assert [leg[:4] for leg in path.legs] == [("1", False, 70.0, 20.0)]


def test_relative_positions_count_along_the_road(network) -> None:
    origin = network.lane_point("1", -1, 90.0)
    ahead = network.relative(origin, network.lane_point("2", -1, 5.0, 0.5))
    assert (ahead.ds, ahead.dt, ahead.lanes, ahead.aligned) == (pytest.approx(25.0), pytest.approx(0.5), 0, True)
    behind = network.relative(network.lane_point("2", -1, 5.0), origin)
    assert behind.ds == pytest.approx(-25.0)
    same = network.relative(origin, network.lane_point("1", 1, 80.0))
    assert (same.ds, same.dt, same.lanes) == (-10.0, 3.5, 1)
    assert network.relative(origin, network.lane_point("5", 1, 80.0)) is None


def test_relative_positions_take_the_algorithm_that_is_asked_for(network) -> None:
    origin, target = network.lane_point("1", -1, 90.0), network.lane_point("4", -1, 10.0)
    assert network.relative(origin, target, "shortest").ds == pytest.approx(120.0)
    assert network.relative(origin, target, "fastest").ds == pytest.approx(320.0)


def test_relative_positions_are_mirrored_where_the_other_road_runs_the_other_way(files) -> None:
    network = files.load(
        files.road(
            "1",
            link=road_link("successor", "2", "end"),
            lanes=files.section(1, 1).replace('successor id="-1"', 'successor id="1"'),
        ),
        files.road("2", start=(200.0, 0.0, 3.141592653589793), lanes=files.section(1, 1, linked=False)),
    )
    seen = network.relative(network.lane_point("1", -1, 90.0), network.lane_point("2", 1, 80.0, 0.3))
    assert (seen.ds, seen.dt, seen.lanes, seen.aligned) == (pytest.approx(30.0), pytest.approx(-0.3), 0, False)


def test_in_lane_coordinates_distances_are_those_of_the_lane(files) -> None:
    network = files.load(files.road(geometry=files.geometry('<arc curvature="0.02"/>', 100.0)))
    seen = network.relative_in_lane(network.lane_point("1", -2, 80.0, 0.2), network.lane_point("1", -1, 30.0, 0.5))
    assert seen.ds == pytest.approx(-50.0 * (1.0 + 0.02 * 5.25))
    assert (seen.dt, seen.lanes) == (pytest.approx(3.5 + 0.3), 1)


def test_in_lane_coordinates_the_lane_goes_on_by_its_links(files) -> None:
    network = files.load(
        files.road("1", lanes=files.section(right=1, left=1), link=junction_link("successor", "a")),
        files.road("2", start=(100.0, 3.5, 0.0), lanes=files.section(right=2), link=junction_link("predecessor", "a")),
        f'<junction id="a" type="direct">{files.connection("1", "2", -1, -2, direct=True)}</junction>',
    )
    seen = network.relative_in_lane(network.lane_point("1", -1, 90.0), network.lane_point("2", -2, 20.0, 0.4))
    assert (seen.ds, seen.dt, seen.lanes) == (pytest.approx(30.0), pytest.approx(0.4), 0)
    back = network.relative_in_lane(network.lane_point("2", -1, 20.0), network.lane_point("1", 1, 90.0))
    assert (back.ds, back.dt, back.lanes) == (pytest.approx(-30.0), pytest.approx(3.5), 1)


def test_lane_coordinates_are_mirrored_too(files) -> None:
    network = files.load(
        files.road(
            "1",
            link=road_link("successor", "2", "end"),
            lanes=files.section(1, 1).replace('successor id="-1"', 'successor id="1"'),
        ),
        files.road("2", start=(200.0, 0.0, 3.141592653589793), lanes=files.section(2, 1, linked=False)),
    )
    seen = network.relative_in_lane(network.lane_point("1", -1, 90.0), network.lane_point("2", 2, 80.0, 0.3))
    assert (seen.ds, seen.dt, seen.lanes, seen.aligned) == (pytest.approx(30.0), pytest.approx(-3.8), -1, False)


@pytest.mark.parametrize(("one", "other", "lanes"), [(-1, -3, -2), (-1, 1, 1), (2, -2, -3), (1, 1, 0)])
def test_lanes_are_counted_without_the_centre(one: int, other: int, lanes: int) -> None:
    assert lanes_between(one, other) == lanes
