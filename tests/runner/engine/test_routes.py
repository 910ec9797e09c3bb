"""The choice at junctions that follows from a route."""

from __future__ import annotations

import random
from types import SimpleNamespace

import pytest

from runner.engine.motion.on_roads import LaneMotion
from runner.engine.motion.routes import AssignedRoute, RandomRoute, Route, Waypoint
from xodr.graph.lane_plan import Leg
from xodr.graph.routes import RoadPath
from xodr.model import LaneLink, RoadPoint

LINKS = [LaneLink("west", -1, True), LaneLink("east", -2, True), LaneLink("east", -1, True)]


def end_of(road_id: str) -> RoadPoint:
    """The end of a road, 100 m long."""
    return RoadPoint(road_id, 100.0, -1.75, -1, 0.0)


def path(*names: str) -> RoadPath:
    """A route along roads of 100 m, all towards +s, left on lane −1."""
    return RoadPath(
        [Leg(name, True, 0.0, 100.0, 100.0 * index, (-1,)) for index, name in enumerate(names)],
        lambda *_: LINKS[0],
    )


def test_a_route_that_uses_a_road_twice_goes_its_own_way_each_time() -> None:
    route = AssignedRoute(path("main", "west", "main", "east"))
    assert route.choose(end_of("main"), True, LINKS) == LINKS[0]
    route.enter("west", True)
    assert route.choose(end_of("main"), True, LINKS) == LINKS[2]
    route.enter("main", True)
    assert route.distance(
        RoadPoint("main", 40.0, 0.0, -1, 0.0), RoadPoint("east", 10.0, 0.0, -1, 0.0)
    ) == pytest.approx(70.0)


def test_of_several_lanes_that_lead_on_the_one_is_taken_that_leads_to_the_leg_after() -> None:
    assert AssignedRoute(path("main", "east")).choose(end_of("main"), True, LINKS) == LINKS[2]


def test_off_the_route_the_straightest_way_is_taken() -> None:
    route = AssignedRoute(path("main", "east"))
    assert route.choose(end_of("elsewhere"), True, LINKS) == LINKS[0]
    assert route.choose(end_of("main"), True, LINKS[:1]) == LINKS[0]
    assert route.distance(end_of("elsewhere"), end_of("main")) is None


def test_the_strategy_of_a_waypoint_is_that_of_the_way_to_it() -> None:
    asked: list[list[str]] = []
    network = SimpleNamespace(
        route=lambda points, strategies, rng: asked.append(strategies) or path("main")
    )
    position = SimpleNamespace(
        fixed=None, resolve=lambda run, actor: SimpleNamespace(point=end_of("main"))
    )
    waypoints = [
        Waypoint(position, strategy, None)
        for strategy in ("fastest", "shortest", "leastIntersections")
    ]
    Route({}, network, waypoints, closed=False).path(None)
    Route({}, network, waypoints, closed=True).path(None)
    assert asked == [
        ["shortest", "leastIntersections"],
        ["shortest", "leastIntersections", "fastest"],
    ]


def test_a_closed_route_begins_anew_at_its_end() -> None:
    route = AssignedRoute(path("main", "east", "main"), closed=True)
    route.enter("east", True)
    route.enter("main", True)
    assert route.choose(end_of("main"), True, LINKS) == LINKS[2]
    assert route.distance(
        RoadPoint("east", 90.0, 0.0, -1, 0.0), RoadPoint("east", 40.0, 0.0, -1, 0.0)
    ) == pytest.approx(250.0)


def test_random_choices_follow_from_the_seed() -> None:
    taken = [
        [RandomRoute(random.Random(seed)).choose(end_of("main"), True, LINKS) for seed in range(20)]
        for _ in range(2)
    ]
    assert taken[0] == taken[1]
    assert set(taken[0]) == set(LINKS)
    assert RandomRoute(random.Random(1)).choose(end_of("main"), True, []) is None


def test_who_changes_lanes_before_a_junction_goes_on_along_the_route_from_the_lane_under_it() -> (
    None
):
    """On its way to lane -2, which leads off the route, from lane -1, which leads on along it."""
    links = {-1: [LaneLink("east", -1, True)], -2: [LaneLink("west", -1, True)]}
    network = SimpleNamespace(
        links=lambda road, lane, forward: links[lane], on=lambda layer: network
    )
    section = SimpleNamespace()
    for t, lane in ((-2.0, -1), (-5.0, -2)):
        road = SimpleNamespace(
            id="main",
            sections=[section],
            section=lambda s: section,
            lane_at=lambda s, t: -1 if t > -3.5 else -2,
            lane_t=lambda s, lane: 1.75 + 3.5 * lane,
        )
        point = RoadPoint("main", 99.9, t, -2, t + 5.25)
        route = AssignedRoute(path("main", "east"))
        assert LaneMotion(network)._on_route(point, road, route, True) == RoadPoint(
            "main", 99.9, t, lane, t - 1.75 - 3.5 * lane
        )
