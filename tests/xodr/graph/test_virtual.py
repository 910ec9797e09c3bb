"""Ways off a main road between its ends, and onto it: virtual junctions."""

from __future__ import annotations

import math

import pytest

from xodr.graph.network import RoadNetwork


@pytest.fixture(scope="module")
def siding(files) -> RoadNetwork:
    """Road 2 leaves road 1 at s=40 to the right and comes back at s=160; traffic
    of road 1's left lane uses neither.

    1 ──────┬──────────────────┬────── 200 m, straight on
            └──── 2, 120 m ────┘
    """
    link = (
        '<predecessor elementType="road" elementId="1" elementS="40" elementDir="+"/>'
        '<successor elementType="road" elementId="1" elementS="160" elementDir="+"/>'
    )
    junction = (
        '<junction id="v" type="virtual" mainRoad="1" sStart="40" sEnd="160" orientation="+">'
        '<connection id="0" incomingRoad="1" connectingRoad="2" contactPoint="start"><laneLink '
        'from="-1" to="-1"/></connection>'
        "</junction>"
    )
    main = files.section(left=1, right=1, linked=False)
    return files.load(
        files.road("1", length=200.0, lanes=main),
        files.road(
            "2",
            length=120.0,
            start=(40.0, -0.5, 0.0),
            lanes=files.section(right=1),
            junction="v",
            link=link,
        ),
        junction,
    )


def test_the_main_road_goes_on_without_a_route(siding: RoadNetwork) -> None:
    reached = siding.travel(siding.lane_point("1", -1, 10.0, 0.5), 180.0, True)
    assert (reached.point.road_id, reached.point.s, reached.point.offset, reached.left) == (
        "1",
        190.0,
        0.5,
        0.0,
    )
    back = siding.travel(siding.lane_point("1", -1, 190.0), 180.0, False)
    assert (back.point.road_id, back.point.s, back.forward) == ("1", 10.0, False)


def test_a_place_on_the_main_road_keeps_its_s_and_lanes(siding: RoadNetwork) -> None:
    assert [section.s for section in siding.road("1").sections] == [0.0, 40.0, 160.0]
    assert all(siding.road("1").lane_ids(s) == (-1, 1) for s in (20.0, 40.0, 100.0, 160.0))
    assert siding.links("1", -1, True) == siding.links("2", -1, True) == []
    assert siding.remarks == ()


def test_a_route_leads_off_the_main_road_and_back(siding: RoadNetwork) -> None:
    waypoints = [
        siding.lane_point("1", -1, 10.0),
        siding.lane_point("2", -1, 60.0),
        siding.lane_point("1", -1, 190.0),
    ]
    path = siding.route(waypoints)
    assert path is not None
    assert [
        (leg.road_id, leg.enter, leg.leave, leg.before, leg.exit_lanes) for leg in path.legs
    ] == [
        ("1", 10.0, 40.0, 0.0, (-1,)),
        ("2", 0.0, 120.0, 30.0, (-1,)),
        ("1", 160.0, 190.0, 150.0, ()),
    ]
    roads = [
        siding.travel(waypoints[0], distance, True, path.choose).point[:2]
        for distance in (29.0, 31.0, 149.0, 151.0, 180.0)
    ]
    assert roads == [("1", 39.0), ("2", 1.0), ("2", 119.0), ("1", 161.0), ("1", 190.0)]


def test_a_route_along_the_main_road_stays_on_it(siding: RoadNetwork) -> None:
    path = siding.route([siding.lane_point("1", -1, 10.0), siding.lane_point("1", -1, 190.0)])
    assert path is not None and [leg.road_id for leg in path.legs] == ["1"]
    assert siding.travel(siding.lane_point("1", -1, 10.0), 100.0, True, path.choose).point[:2] == (
        "1",
        110.0,
    )


def test_a_way_off_can_be_followed_backwards(siding: RoadNetwork) -> None:
    reached = siding.travel(siding.lane_point("2", -1, 10.0), 20.0, False)
    assert (reached.point.road_id, reached.point.lane_id, reached.point.s, reached.forward) == (
        "1",
        -1,
        30.0,
        False,
    )


def test_the_other_lane_has_no_way_off(siding: RoadNetwork) -> None:
    path = siding.route([siding.lane_point("1", -1, 10.0), siding.lane_point("2", -1, 60.0)])
    assert path is not None
    assert siding.travel(siding.lane_point("1", 1, 10.0), 60.0, True, path.choose).point[:2] == (
        "1",
        70.0,
    )


def test_someone_who_stops_at_the_way_off_takes_it_later(siding: RoadNetwork) -> None:
    path = siding.route([siding.lane_point("1", -1, 10.0), siding.lane_point("2", -1, 60.0)])
    assert path is not None
    there = siding.travel(siding.lane_point("1", -1, 10.0), 30.0, True, path.choose).point
    assert there[:2] == ("2", 0.0)


def test_a_way_off_that_a_lane_link_of_the_junction_names(files) -> None:
    """The road's lanes link none of the main road's; the junction does. A lane
    narrows across the border.
    """
    link = '<predecessor elementType="road" elementId="1" elementS="50" elementDir="-"/>'
    connection = files.connection("1", "2", lane_from=1, lane_to=-1)
    junction = (
        '<junction id="v" type="virtual" mainRoad="1" sStart="45" '
        f'sEnd="55">{connection}</junction>'
    )
    lanes = files.section(
        left=1,
        right=1,
        linked=False,
        width='<width sOffset="0" a="3"/><width sOffset="60" a="3" b="-0.1"/>',
    )
    network = files.load(
        files.road("1", lanes=lanes),
        files.road(
            "2", lanes=files.section(right=1, linked=False), start=(50.0, 0.0, math.pi), link=link
        ),
        junction,
    )
    first, second = network.road("1").sections
    assert first.lanes[1].closes == second.lanes[1].opens * -1 == math.inf
    assert second.lanes[1].closes == pytest.approx(90.0, abs=1e-3)
    path = network.route([network.lane_point("1", 1, 80.0), network.lane_point("2", -1, 10.0)])
    assert path is not None and [leg[:4] for leg in path.legs] == [
        ("1", False, 80.0, 50.0),
        ("2", True, 0.0, 10.0),
    ]


def test_a_way_off_without_a_place_is_not_followed(files) -> None:
    connection = (
        files.connection("1", "2")
        + files.connection("1", "3")
        + '<connection id="2" type="virtual"/>'
    )
    junction = (
        '<junction id="v" type="virtual" mainRoad="1" sStart="10" '
        f'sEnd="20">{connection}</junction>'
    )
    link = '<predecessor elementType="road" elementId="1" elementS="10" elementDir="+"/>'
    roads = [
        files.road("1"),
        files.road("2", junction="v", link=link),
        files.road("3", junction="v"),
    ]
    network = files.load(*roads, junction)
    assert [remark.message for remark in network.remarks] == [
        (
            "junction: the virtual junction 'v' lies beside its main road; 2 of 3 ways off that "
            "road are not followed"
        )
    ]


@pytest.mark.parametrize("s", ["0", "100", "250", "-3"])
def test_a_road_that_begins_at_no_place_inside_the_other_leaves_it_whole(files, s: str) -> None:
    link = f'<predecessor elementType="road" elementId="1" elementS="{s}" elementDir="+"/>'
    junction = (
        '<junction id="v" type="virtual" mainRoad="1" sStart="10" '
        f'sEnd="20">{files.connection("1", "2")}</junction>'
    )
    network = files.load(files.road("1"), files.road("2", link=link), junction)
    assert len(network.road("1").sections) == 1
    assert "not followed" in network.remarks[0].message
    assert (
        network.route([network.lane_point("1", -1, 10.0), network.lane_point("2", -1, 60.0)])
        is None
    )
