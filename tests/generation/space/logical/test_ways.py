"""Where ways through junctions meet."""

from __future__ import annotations

from math import hypot

import pytest

import xodr
from generation.space.logical.library import ROADS
from generation.space.logical.roads import Course, Crossing, LaneId, meeting
from schemas.common.errors import UsageError

CROSSING = xodr.load(ROADS / "intersection_four_way_two_lanes.xodr")
EASTWARDS = Course(LaneId("3", 1), LaneId("1", -1))
NORTHWARDS = Course(LaneId("4", 1), LaneId("2", -1))
REACH = 15.0
"""From the middle of the junction to where its arms end, m."""


def test_ways_that_cross_meet_where_they_do() -> None:
    found = meeting(CROSSING, NORTHWARDS, EASTWARDS)
    assert (found.x, found.y) == pytest.approx((1.75, -1.75), abs=0.3)
    assert found.ego == pytest.approx(REACH - 1.75, abs=0.3)
    assert found.other == pytest.approx(REACH + 1.75, abs=0.3)


def test_ways_that_join_meet_where_they_come_together() -> None:
    turn = Course(LaneId("4", 2), LaneId("1", -2))
    found = meeting(CROSSING, turn, Course(LaneId("3", 2), LaneId("1", -2)))
    assert found.y == pytest.approx(-5.25, abs=1.1)
    assert 0.0 < found.x < REACH


def test_a_pedestrian_is_met_in_the_lane_that_it_crosses() -> None:
    found = meeting(CROSSING, NORTHWARDS, Crossing(LaneId("2", -1), 6.0))
    assert hypot(found.x - 1.75, found.y - (REACH + 6.0)) < 1.0
    assert (found.ego, found.other) == (pytest.approx(2 * REACH + 6.0, abs=1.0), 0.0)


def test_ways_that_do_not_meet_are_refused() -> None:
    with pytest.raises(UsageError, match="do not meet"):
        meeting(CROSSING, NORTHWARDS, Course(LaneId("2", 1), LaneId("4", -1)))
