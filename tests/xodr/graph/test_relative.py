"""Where points lie relative to each other: along the road, across it, in lanes."""

from __future__ import annotations

import pytest

from xodr.graph.routes import lanes_between


def test_relative_positions_count_along_the_road(two_ways) -> None:
    origin = two_ways.lane_point("1", -1, 90.0)
    ahead = two_ways.relative(origin, two_ways.lane_point("2", -1, 5.0, 0.5))
    assert (ahead.ds, ahead.dt, ahead.lanes, ahead.aligned) == (
        pytest.approx(25.0),
        pytest.approx(0.5),
        0,
        True,
    )
    behind = two_ways.relative(two_ways.lane_point("2", -1, 5.0), origin)
    assert behind.ds == pytest.approx(-25.0)
    same = two_ways.relative(origin, two_ways.lane_point("1", 1, 80.0))
    assert (same.ds, same.dt, same.lanes) == (-10.0, 3.5, 1)
    assert two_ways.relative(origin, two_ways.lane_point("5", 1, 80.0)) is None


def test_relative_positions_take_the_algorithm_that_is_asked_for(two_ways) -> None:
    origin, target = two_ways.lane_point("1", -1, 90.0), two_ways.lane_point("4", -1, 10.0)
    assert two_ways.relative(origin, target, "shortest").ds == pytest.approx(120.0)
    assert two_ways.relative(origin, target, "fastest").ds == pytest.approx(320.0)


def test_relative_positions_are_mirrored_where_the_other_road_runs_the_other_way(files) -> None:
    network = files.load(
        files.road(
            "1",
            link=files.to_road("successor", "2", "end"),
            lanes=files.section(1, 1).replace('successor id="-1"', 'successor id="1"'),
        ),
        files.road(
            "2", start=(200.0, 0.0, 3.141592653589793), lanes=files.section(1, 1, linked=False)
        ),
    )
    seen = network.relative(
        network.lane_point("1", -1, 90.0), network.lane_point("2", 1, 80.0, 0.3)
    )
    assert (seen.ds, seen.dt, seen.lanes, seen.aligned) == (
        pytest.approx(30.0),
        pytest.approx(-0.3),
        0,
        False,
    )


def test_in_lane_coordinates_distances_are_those_of_the_lane(files) -> None:
    network = files.load(files.road(geometry=files.geometry('<arc curvature="0.02"/>', 100.0)))
    seen = network.relative_in_lane(
        network.lane_point("1", -2, 80.0, 0.2), network.lane_point("1", -1, 30.0, 0.5)
    )
    assert seen.ds == pytest.approx(-50.0 * (1.0 + 0.02 * 5.25))
    assert (seen.dt, seen.lanes) == (pytest.approx(3.5 + 0.3), 1)


def test_in_lane_coordinates_the_lane_goes_on_by_its_links(files) -> None:
    network = files.load(
        files.road(
            "1", lanes=files.section(right=1, left=1), link=files.to_junction("successor", "a")
        ),
        files.road(
            "2",
            start=(100.0, 3.5, 0.0),
            lanes=files.section(right=2),
            link=files.to_junction("predecessor", "a"),
        ),
        '<junction id="a" '
        f'type="direct">{files.connection("1", "2", -1, -2, direct=True)}</junction>',
    )
    seen = network.relative_in_lane(
        network.lane_point("1", -1, 90.0), network.lane_point("2", -2, 20.0, 0.4)
    )
    assert (seen.ds, seen.dt, seen.lanes) == (pytest.approx(30.0), pytest.approx(0.4), 0)
    back = network.relative_in_lane(
        network.lane_point("2", -1, 20.0), network.lane_point("1", 1, 90.0)
    )
    assert (back.ds, back.dt, back.lanes) == (pytest.approx(-30.0), pytest.approx(3.5), 1)


def test_lane_coordinates_are_mirrored_too(files) -> None:
    network = files.load(
        files.road(
            "1",
            link=files.to_road("successor", "2", "end"),
            lanes=files.section(1, 1).replace('successor id="-1"', 'successor id="1"'),
        ),
        files.road(
            "2", start=(200.0, 0.0, 3.141592653589793), lanes=files.section(2, 1, linked=False)
        ),
    )
    seen = network.relative_in_lane(
        network.lane_point("1", -1, 90.0), network.lane_point("2", 2, 80.0, 0.3)
    )
    assert (seen.ds, seen.dt, seen.lanes, seen.aligned) == (
        pytest.approx(30.0),
        pytest.approx(-3.8),
        -1,
        False,
    )


@pytest.mark.parametrize(
    ("one", "other", "lanes"), [(-1, -3, -2), (-1, 1, 1), (2, -2, -3), (1, 1, 0)]
)
def test_lanes_are_counted_without_the_centre(one: int, other: int, lanes: int) -> None:
    assert lanes_between(one, other) == lanes
