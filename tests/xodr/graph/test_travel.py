"""Moving along lanes: distances, offsets, borders, junctions, ends."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from xodr.model import LaneLink, RoadError


@pytest.fixture(scope="module")
def curve(files):
    """A curve to the left of radius 50 m with two lanes on each side."""
    return files.load(files.road(geometry=files.geometry('<arc curvature="0.02"/>', 100.0)))


@pytest.fixture(scope="module")
def fork(files):
    """A road into a junction with a way straight on and one to the left, which road 3 continues."""
    junction = (
        f'<junction id="j">{files.connection("1", "10")}{files.connection("1", "20")}</junction>'
    )
    to_junction = '<successor elementType="junction" elementId="j"/>'
    from_junction = '<predecessor elementType="junction" elementId="j"/>'
    bend = files.geometry('<arc curvature="0.1"/>', 5.0 * math.pi, start=(100.0, 0.0, 0.0))
    one_lane = files.section(right=1)
    return files.load(
        files.road("1", link=to_junction, lanes=one_lane),
        files.road(
            "10",
            length=5.0 * math.pi,
            geometry=bend,
            junction="j",
            lanes=one_lane,
            link=files.to_road("predecessor", "1", "end")
            + files.to_road("successor", "3", "start"),
        ),
        files.road(
            "20",
            length=20.0,
            start=(100.0, 0.0, 0.0),
            junction="j",
            lanes=one_lane,
            link=files.to_road("predecessor", "1", "end")
            + files.to_road("successor", "2", "start"),
        ),
        files.road("2", start=(120.0, 0.0, 0.0), link=from_junction, lanes=one_lane),
        files.road("3", start=(110.0, 10.0, math.pi / 2), link=from_junction, lanes=one_lane),
        junction,
    )


@pytest.mark.parametrize(("lane", "radius"), [(-1, 51.75), (-2, 55.25), (1, 48.25)])
def test_on_a_curve_the_distance_is_that_of_the_lane(curve, lane: int, radius: float) -> None:
    reached = curve.travel(curve.lane_point("1", lane, 10.0), 20.0, True).point
    assert reached.s == pytest.approx(10.0 + 20.0 * 50.0 / radius, abs=1e-9)
    assert (reached.lane_id, reached.offset) == (lane, 0.0)


def test_on_a_drifting_lane_the_distance_is_that_of_the_way(files) -> None:
    lanes = '<laneOffset s="0" a="0" b="0.75"/>' + files.section(right=1)
    network = files.load(files.road(lanes=lanes))
    reached = network.travel(network.lane_point("1", -1, 0.0), 50.0, True).point
    assert reached.s == pytest.approx(40.0)
    assert reached.t == pytest.approx(30.0 - 1.75)


@settings(max_examples=50, deadline=None)
@given(
    st.floats(-0.05, 0.05),
    st.floats(-0.05, 0.05),
    st.sampled_from([-2, -1, 1, 2]),
    st.floats(-1.0, 1.0),
    st.floats(0.1, 60.0),
)
def test_there_and_back_again(
    files, start: float, end: float, lane: int, offset: float, distance: float
) -> None:
    network = files.load(
        files.road(geometry=files.geometry(f'<spiral curvStart="{start}" curvEnd="{end}"/>', 100.0))
    )
    origin = network.lane_point("1", lane, 20.0, offset)
    there = network.travel(origin, distance, True)
    back = network.travel(there.point, -distance, True)
    assert there.left == 0.0
    assert back.forward
    assert (back.point.s, back.point.t) == pytest.approx((origin.s, origin.t), abs=1e-3)


def test_small_steps_add_up_to_one_large_step(curve) -> None:
    point = origin = curve.lane_point("1", -2, 0.0, 0.3)
    for _ in range(500):
        point = curve.travel(point, 0.1, True).point
    assert point.s == pytest.approx(curve.travel(origin, 50.0, True).point.s, abs=1e-6)


def test_lane_sections_are_crossed_by_lane_links(files) -> None:
    lanes = files.section(right=1).replace(
        'successor id="-1"', 'successor id="-2"'
    ) + files.section(right=2, s=50.0).replace(
        '<lane id="-2" type="driving"><link><predecessor id="-2"/>',
        '<lane id="-2" type="driving"><link><predecessor id="-1"/>',
    )
    network = files.load(files.road(lanes=lanes))
    reached = network.travel(network.lane_point("1", -1, 40.0, 0.2), 20.0, True)
    assert (reached.point.s, reached.point.lane_id, reached.point.offset) == (60.0, -2, 0.2)
    back = network.travel(reached.point, 20.0, False)
    assert (back.point.s, back.point.lane_id, back.point.offset) == (40.0, -1, 0.2)


@pytest.mark.parametrize("order", [("left", "right"), ("right", "left")])
def test_of_ways_that_turn_equally_the_left_one_is_the_straightest(
    files, order: tuple[str, str]
) -> None:
    """Whatever their order in the file, and however their angles are rounded."""
    sides = {
        "left": ("2", "0.05", files.connection("1", "2")),
        "right": ("3", "-0.05000000000000001", files.connection("1", "3")),
    }
    link = files.to_road("predecessor", "1", "end")
    ways = [
        files.road(
            name,
            length=20.0,
            junction="j",
            lanes=files.section(right=1),
            link=link,
            geometry=files.geometry(f'<arc curvature="{bend}"/>', 20.0, start=(100.0, 0.0, 0.0)),
        )
        for name, bend, _ in (sides[side] for side in order)
    ]
    first = files.road(
        "1", link='<successor elementType="junction" elementId="j"/>', lanes=files.section(right=1)
    )
    network = files.load(
        first, *ways, f'<junction id="j">{"".join(sides[side][2] for side in order)}</junction>'
    )
    assert network.travel(network.lane_point("1", -1, 90.0), 15.0, True).point.road_id == "2"


def test_a_lane_that_ends_within_a_road_is_left_without_a_jump(files) -> None:
    lanes = files.section(right=2, linked=False) + files.section(right=1, s=50.0, linked=False)
    network = files.load(files.road(lanes=lanes))
    reached = network.travel(network.lane_point("1", -2, 40.0), 20.0, True).point
    assert (reached.s, reached.t, reached.lane_id) == (60.0, -5.25, -1)


def test_a_lane_that_narrows_to_nothing_is_left_without_a_jump(files) -> None:
    before = files.section(right=1, width='<width sOffset="0" a="3" b="-0.06"/>').replace(
        'successor id="-1"', 'successor id="-2"'
    )
    network = files.load(files.road(lanes=before + files.section(right=2, s=50.0)))
    reached = network.travel(network.lane_point("1", -1, 49.0), 2.0, True).point
    assert (reached.lane_id, reached.t) == (-2, pytest.approx(0.0, abs=1e-9))


def test_a_lane_that_narrows_to_nothing_at_the_roads_end_goes_on_beside(files) -> None:
    narrow = files.road(
        "1", lanes=files.section(right=2), link=files.to_road("successor", "2", "start")
    )
    head, tail = narrow.split('<lane id="-2"')
    tail = tail.replace(
        '<width sOffset="0" a="3.5"/>', '<width sOffset="0" a="3.5" b="-0.035"/>'
    ).replace('<successor id="-2"/>', "")
    network = files.load(
        head + '<lane id="-2"' + tail,
        files.road("2", lanes=files.section(right=1), start=(100.0, 0.0, 0.0)),
    )
    reached = network.travel(network.lane_point("1", -2, 90.0), 20.0, True)
    assert reached.left == 0.0
    assert (reached.point.road_id, reached.point.lane_id) == ("2", -1)
    assert reached.point.t == pytest.approx(-3.5, abs=1e-6)


CLOSING = '<width sOffset="0" a="3.5" b="-0.07"/><width sOffset="50" a="0"/>'
FULL = '<width sOffset="0" a="3.5"/>'
OPENING = '<width sOffset="0" a="0"/><width sOffset="50" a="0" b="0.07"/>'


def tapering(files, width: str, lane: int):
    """A road with two lanes on the right, one of them of changing width."""
    head, tail = files.section(right=2).split(f'<lane id="{lane}"')
    return files.load(files.road(lanes=f'{head}<lane id="{lane}"' + tail.replace(FULL, width, 1)))


@pytest.mark.parametrize(("lane", "beside", "t"), [(-2, -1, -3.5), (-1, -2, 0.0)])
@pytest.mark.parametrize(
    ("width", "start", "forward"), [(CLOSING, 10.0, True), (OPENING, 90.0, False)]
)
def test_a_lane_that_closes_within_a_section_is_left_there_without_a_jump(
    files, lane: int, beside: int, t: float, width: str, start: float, forward: bool
) -> None:
    network = tapering(files, width, lane)
    there = network.travel(network.lane_point("1", lane, start), 60.0, forward)
    assert (there.point.lane_id, there.left) == (beside, 0.0)
    assert there.point.t == pytest.approx(t, abs=1e-5)
    assert network.travel(network.lane_point("1", lane, start), 30.0, forward).point.lane_id == lane


@pytest.mark.parametrize(
    ("width", "start", "forward"), [(OPENING, 0.0, True), (CLOSING, 100.0, False)]
)
def test_a_lane_that_opens_is_followed_from_no_width_on(
    files, width: str, start: float, forward: bool
) -> None:
    network = tapering(files, width, -2)
    there = network.travel(network.lane_point("1", -2, start), 80.0, forward).point
    assert (there.lane_id, there.offset) == (-2, 0.0)
    assert there.t < -4.5


def test_nobody_is_led_onto_the_lanes_of_the_other_direction(files) -> None:
    both = files.section(left=2, right=1)
    head, tail = both.split('<lane id="1"')
    narrow = tail.replace(FULL, OPENING, 1).replace('<predecessor id="1"/>', "", 1)
    before = files.road(
        "1",
        lanes=files.section(left=1, right=1).replace('successor id="1"', 'successor id="2"'),
        link=files.to_road("successor", "2", "start"),
    )
    network = files.load(
        before,
        files.road(
            "2",
            lanes=f'{head}<lane id="1"{narrow}'.replace('predecessor id="2"', 'predecessor id="1"'),
            start=(100.0, 0.0, 0.0),
            link=files.to_road("predecessor", "1", "end"),
        ),
    )
    there = network.travel(network.lane_point("2", 1, 90.0), 120.0, False).point
    assert (there.road_id, there.lane_id) == ("1", 1)


@pytest.mark.parametrize("border", [50.0, 100.0])
def test_a_step_that_ends_on_a_border_can_go_on(files, border: float) -> None:
    lanes = files.section(right=1) + files.section(right=1, s=50.0)
    network = files.load(
        files.road("1", lanes=lanes, link=files.to_road("successor", "2", "start")),
        files.road("2", start=(100.0, 0.0, 0.0)),
    )
    on_border = network.travel(network.lane_point("1", -1, 10.0), border - 10.0, True)
    assert (on_border.point.s, on_border.left) == (border, 0.0)
    beyond = network.travel(on_border.point, 5.0, True)
    assert network.pose(beyond.point).x == pytest.approx(border + 5.0)
    back = network.travel(beyond.point, 10.0, False)
    assert network.pose(back.point).x == pytest.approx(border - 5.0)


@pytest.mark.parametrize(("contact", "lane", "forward"), [("start", -1, True), ("end", 1, False)])
def test_road_borders_keep_the_side_of_the_driver(
    files, contact: str, lane: int, forward: bool
) -> None:
    start = (100.0, 0.0, 0.0) if contact == "start" else (200.0, 0.0, math.pi)
    first = files.road("1", link=files.to_road("successor", "2", contact))
    if contact == "end":
        first = first.replace('successor id="-1"', 'successor id="1"')
    network = files.load(first, files.road("2", start=start))
    reached = network.travel(network.lane_point("1", -1, 90.0, 0.4), 30.0, True)
    assert (reached.point.road_id, reached.point.lane_id, reached.forward) == ("2", lane, forward)
    pose = network.pose(reached.point)
    assert (pose.x, pose.y) == pytest.approx((120.0, -1.35))


def test_a_link_that_one_road_declares_is_enough(files) -> None:
    network = files.load(
        files.road("1", link=files.to_road("successor", "2", "start")),
        files.road("2", start=(100.0, 0.0, 0.0)),
    )
    assert network.links("2", -1, False) == [LaneLink("1", -1, False)]


@pytest.mark.parametrize(("contact", "lane"), [("start", -1), ("end", 1)])
def test_roads_that_link_no_lanes_at_all_go_on_in_the_lanes_at_the_same_place(
    files, contact: str, lane: int
) -> None:
    bare = files.section(left=1, right=1, linked=False)
    network = files.load(
        files.road("1", lanes=bare, link=files.to_road("successor", "2", contact)),
        files.road("2", lanes=bare),
    )
    assert network.links("1", -1, True) == [LaneLink("2", lane, contact == "start")]


def test_the_end_of_the_road_is_reported(files) -> None:
    network = files.load(files.road())
    reached = network.travel(network.lane_point("1", -1, 90.0), 25.0, True)
    assert (reached.point.s, reached.left) == (100.0, 15.0)
    assert network.travel(reached.point, 1.0, True) == reached._replace(left=1.0)


def test_a_point_that_left_the_road_stays_or_returns(files) -> None:
    network = files.load(files.road())
    beyond = network.locate(105.0, -1.0)
    assert network.travel(beyond, 3.0, True) == (beyond, True, 3.0)
    assert network.travel(beyond, 10.0, False).point.s == pytest.approx(95.0)


def test_junctions_are_crossed_straight_on_by_default(fork) -> None:
    reached = fork.travel(fork.lane_point("1", -1, 90.0), 40.0, True)
    assert (reached.point.road_id, reached.point.s) == ("2", pytest.approx(10.0))


def test_a_chooser_decides_at_junctions(fork) -> None:
    seen = []

    def left(point, forward, links):
        seen.append((point.road_id, forward, len(links)))
        return links[0]

    reached = fork.travel(fork.lane_point("1", -1, 90.0), 60.0, True, left)
    assert reached.point.road_id == "3"
    assert seen == [("1", True, 2), ("10", True, 1)]


def test_a_chooser_may_stay(fork) -> None:
    reached = fork.travel(fork.lane_point("1", -1, 90.0), 40.0, True, lambda *_: None)
    assert (reached.point.road_id, reached.point.s, reached.left) == ("1", 100.0, 30.0)


def test_direct_junctions_link_roads_without_connecting_roads(files) -> None:
    junction = (
        '<junction id="d" '
        f'type="direct">{files.connection("1", "2", -2, -1, direct=True)}</junction>'
    )
    network = files.load(
        files.road("1", link='<successor elementType="junction" elementId="d"/>'),
        files.road(
            "2",
            start=(100.0, -3.5, 0.0),
            link='<predecessor elementType="junction" elementId="d"/>',
        ),
        junction,
    )
    assert network.links("1", -2, True) == [LaneLink("2", -1, True)]
    assert network.links("1", -1, True) == []


def test_a_ring_of_roads_does_not_hold_a_step_forever(files) -> None:
    ring = files.geometry('<arc curvature="6.283185307179586"/>', 1.0)
    link = files.to_road("predecessor", "1", "end") + files.to_road("successor", "1", "start")
    network = files.load(
        files.road(
            length=1.0,
            geometry=ring,
            link=link,
            lanes=files.section(right=1, width='<width sOffset="0" a="0.1"/>'),
        )
    )
    assert network.travel(network.lane_point("1", -1, 0.0), 10.0, True).left == 0.0
    with pytest.raises(RoadError, match="crosses more than"):
        network.travel(network.lane_point("1", -1, 0.0), 1e9, True)


def test_lanes_that_are_not_there_are_named(curve) -> None:
    with pytest.raises(RoadError, match="no lane -7"):
        curve.travel(curve.lane_point("1", -2, 0.0)._replace(lane_id=-7), 1.0, True)
