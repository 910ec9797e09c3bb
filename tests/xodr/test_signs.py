"""The sign matrix: {right-, left-hand traffic} × {with, against s} × {relative lane ±1}.

A driver's left is +t when driving towards +s and −t when driving towards −s, whatever side the
traffic keeps to. Every expectation is checked in the world: the lane that is one to the driver's
left lies to the left of the driver's heading.
"""

from __future__ import annotations

import math

import pytest

RULES = ("RHT", "LHT")


@pytest.fixture(scope="module", params=RULES)
def rule(request: pytest.FixtureRequest) -> str:
    """Side of the road that traffic keeps to."""
    return request.param


@pytest.fixture(scope="module")
def network(files, rule: str):
    """A road in an arbitrary direction, three lanes on each side."""
    return files.load(
        files.road(rule=rule, start=(7.0, -3.0, 2.5), lanes=files.section(left=3, right=3))
    )


@pytest.mark.parametrize("with_s", [True, False])
def test_traffic_keeps_to_its_side(network, rule: str, with_s: bool) -> None:
    side = -1 if (rule == "RHT") == with_s else 1
    road = network.road("1")
    assert [road.direction(side * lane) for lane in (1, 2, 3)] == [1 if with_s else -1] * 3


@pytest.mark.parametrize("step", [1, -1])
@pytest.mark.parametrize("with_s", [True, False])
@pytest.mark.parametrize("lane", [-2, -1, 1, 2])
def test_one_lane_to_the_left_lies_to_the_left(network, with_s: bool, step: int, lane: int) -> None:
    road = network.road("1")
    beside = road.lane_beside(50.0, lane, step if with_s else -step)
    here, there = (
        road.pose(50.0, road.lane_t(50.0, lane)),
        road.pose(50.0, road.lane_t(50.0, beside)),
    )
    heading = here.h if with_s else here.h + math.pi
    left = (there.y - here.y) * math.cos(heading) - (there.x - here.x) * math.sin(heading)
    assert left == pytest.approx(3.5 * step)


@pytest.mark.parametrize("step", [1, -1])
@pytest.mark.parametrize("with_s", [True, False])
def test_a_positive_offset_lies_towards_positive_t_for_both_directions(
    network, rule: str, with_s: bool, step: int
) -> None:
    lane = -2 if (rule == "RHT") == with_s else 2
    point = network.lane_point("1", lane, 50.0, 0.5 * step)
    assert point.t == pytest.approx((3.5 * 1.5) * (1 if lane > 0 else -1) + 0.5 * step)
    moved = network.travel(point, 10.0, with_s).point
    assert (moved.s, moved.offset) == (pytest.approx(60.0 if with_s else 40.0), 0.5 * step)


@pytest.mark.parametrize("with_s", [True, False])
def test_traffic_moves_in_its_lanes_direction(network, rule: str, with_s: bool) -> None:
    lane = -2 if (rule == "RHT") == with_s else 2
    forward = network.road("1").direction(lane) > 0
    before = network.lane_point("1", lane, 50.0)
    after = network.travel(before, 10.0, forward).point
    heading = network.pose(before).h + (0.0 if with_s else math.pi)
    a, b = network.pose(before), network.pose(after)
    assert (b.x - a.x, b.y - a.y) == pytest.approx(
        (10.0 * math.cos(heading), 10.0 * math.sin(heading))
    )


def test_heading_finds_the_lane_of_its_direction_where_two_roads_lie_upon_each_other(
    files, rule: str
) -> None:
    lane = files.section(right=1)
    there = files.road("there", rule=rule, lanes=lane, start=(0.0, 0.0, 0.0))
    back = files.road("back", rule=rule, lanes=lane, start=(100.0, -3.5, math.pi))
    network = files.load(there, back)
    towards = 0.0 if rule == "RHT" else math.pi
    assert network.locate(50.0, -1.75, None, towards).road_id == "there"
    assert network.locate(50.0, -1.75, None, towards + math.pi).road_id == "back"


@pytest.mark.parametrize(
    ("lane", "steps", "expected"),
    [(-1, 1, 1), (1, -1, -1), (-1, 3, 3), (3, 1, None), (-3, -1, None), (0, 2, 2), (0, -1, -1)],
)
def test_the_centre_lane_is_not_counted(
    network, lane: int, steps: int, expected: int | None
) -> None:
    assert network.road("1").lane_beside(50.0, lane, steps) == expected


def test_reversed_lanes_turn_their_traffic_only(files, rule: str) -> None:
    lanes = files.section(right=2).replace('<lane id="-1"', '<lane direction="reversed" id="-1"')
    road = files.load(files.road(rule=rule, lanes=lanes)).road("1")
    assert road.direction(-1) == -road.direction(-2)
