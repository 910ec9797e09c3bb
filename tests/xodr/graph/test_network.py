"""World to road and back: exact on every kind of road, on either side of every curve."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from xodr.graph.locate import Locator
from xodr.model import RoadError
from xodr.model.geometry import (
    ZERO,
    Arc,
    Cubic,
    Line,
    ParamPoly3,
    PlanElement,
    Profile,
    ReferenceLine,
    Spiral,
    Start,
)
from xodr.model.road import Road, Surface, lane_in
from xodr.reader.roads import read_sections

LANES = (
    '<lanes><laneOffset s="0" a="0.5" b="0.01"/><laneSection s="0"><left>'
    '<lane id="1" type="driving"><width sOffset="0" a="3" b="0.02"/></lane>'
    '<lane id="2" type="sidewalk"><width sOffset="0" a="2"/></lane></left><center><lane id="0" '
    'type="none"/></center><right>'
    '<lane id="-1" type="driving"><width sOffset="0" a="3.5"/></lane></right></laneSection></lanes>'
)

curvature = st.floats(-0.06, 0.06)
length = st.floats(5.0, 40.0)
pieces = st.one_of(
    st.tuples(st.just("line"), length, curvature, curvature),
    st.tuples(st.just("arc"), length, curvature, curvature),
    st.tuples(st.just("spiral"), length, curvature, curvature),
    st.tuples(st.just("cubic"), length, curvature, curvature),
)


def segment(kind: str, start: Start, one: float, other: float) -> PlanElement:
    """An element of that kind."""
    if kind == "line":
        return Line(start)
    if kind == "arc":
        return Arc(start, one)
    if kind == "spiral":
        return Spiral(start, one, other)
    bend = 0.5 * one * start.length**2
    return ParamPoly3(start, (0.0, start.length, 0.0, 0.0), (0.0, 0.0, bend, -0.3 * bend), 1.0)


@st.composite
def roads(draw: st.DrawFn) -> Road:
    """Smooth random roads, banked, hilly and with moving lanes."""
    from lxml import etree

    x, y, h = draw(st.floats(-1e4, 1e4)), draw(st.floats(-1e4, 1e4)), draw(st.floats(-7.0, 7.0))
    starts, segments, s = [], [], 0.0
    for kind, size, one, other in draw(st.lists(pieces, min_size=1, max_size=4)):
        segments.append(segment(kind, Start(x, y, h, size), one, other))
        starts.append(s)
        x, y, h = segments[-1].at(size)
        s += size
    banked = (
        Profile([Cubic(0.0, draw(st.floats(-0.1, 0.1)), 0.001)]) if draw(st.booleans()) else ZERO
    )
    return Road(
        path="road.xodr",
        id="1",
        name="",
        length=s,
        junction_id=None,
        rule=draw(st.sampled_from(["RHT", "LHT"])),
        line=ReferenceLine(starts, segments),
        sections=read_sections(etree.fromstring(LANES), s),
        elevation=Profile([Cubic(0.0, 3.0, 0.05)]),
        superelevation=banked,
        surface=Surface([(0.0, Profile([Cubic(-20.0, 0.2, 0.01)]))])
        if draw(st.booleans())
        else None,
    )


@settings(max_examples=150, deadline=None)
@given(roads(), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_a_road_point_is_found_again_from_the_world(
    road: Road, along: float, across: float
) -> None:
    s = along * road.length
    right, left = road.edges(s)
    t = right + across * (left - right)
    pose = road.pose(s, t)
    found = Locator([road]).locate(pose.x, pose.y, pose.z, None)
    assert math.dist(road.pose(found.s, found.t)[:2], pose[:2]) < 1e-6
    again = road.point(found.s, found.t)
    assert again.t == pytest.approx(road.lane_t(again.s, again.lane_id) + again.offset, abs=1e-9)


@settings(max_examples=100, deadline=None)
@given(st.floats(0.02, 0.2), st.booleans(), st.floats(0.0, 300.0), st.floats(0.05, 0.95))
def test_far_outside_a_tight_curve_the_way_back_is_exact(
    curvature: float, left: bool, far: float, along: float
) -> None:
    from lxml import etree

    size = min(60.0, 2.0 / curvature)
    line = ReferenceLine(
        [0.0], [Arc(Start(0.0, 0.0, 1.0, size), curvature if left else -curvature)]
    )
    road = Road(
        "r.xodr", "1", "", size, None, "RHT", line, read_sections(etree.fromstring(LANES), size)
    )
    t = -far if left else far
    pose = road.pose(along * size, t)
    found = Locator([road]).locate(pose.x, pose.y, None, None)
    assert (found.s, found.t) == pytest.approx((along * size, t), abs=1e-6)


def test_a_hint_gives_the_same_answer(files) -> None:
    geometry = files.geometry('<spiral curvStart="0" curvEnd="0.02"/>', 100.0)
    network = files.load(files.road(geometry=geometry))
    before = network.point("1", 40.0, -2.0)
    pose = network.road("1").pose(40.5, -1.9)
    slow, fast = network.locate(pose.x, pose.y), network.locate(pose.x, pose.y, hint=before)
    assert (slow.road_id, slow.lane_id) == (fast.road_id, fast.lane_id)
    assert (slow.s, slow.t, fast.s, fast.t) == pytest.approx((40.5, -1.9, 40.5, -1.9), abs=1e-7)


def test_off_the_road_the_nearest_road_answers_and_says_so(files) -> None:
    network = files.load(files.road("1"), files.road("2", start=(0.0, 50.0, 0.0)))
    point = network.locate(20.0, 15.0)
    assert (point.road_id, point.s, point.t, point.lane_id) == (
        "1",
        pytest.approx(20.0),
        pytest.approx(15.0),
        2,
    )
    assert not network.on_road(point)
    assert network.on_road(network.locate(20.0, 5.0))
    assert network.locate(20.0, 30.0).road_id == "2"
    beyond = network.locate(-5.0, 1.0)
    assert (beyond.s, beyond.t) == pytest.approx((-5.0, 1.0))
    assert not network.on_road(beyond)


def test_far_away_points_and_hints_are_no_problem(files) -> None:
    network = files.load(files.road("1"))
    point = network.locate(1e9, -1e9, hint=network.point("1", 3.0, 0.0))
    assert (point.s, point.t) == pytest.approx((1e9, -1e9))


@pytest.mark.parametrize("x", [math.nan, math.inf, -math.inf])
def test_places_that_are_no_places_are_refused(files, x: float) -> None:
    network = files.load(files.road("1"))
    with pytest.raises(RoadError, match="no place"):
        network.locate(x, 0.0)
    with pytest.raises(RoadError, match="no place"):
        network.locate(x, 0.0, hint=network.point("1", 3.0, 0.0))


def test_lanes_of_type_none_are_off_the_road(files) -> None:
    lanes = files.section(left=1, right=2).replace(
        '<lane id="-2" type="driving">', '<lane id="-2" type="none">'
    )
    network = files.load(files.road(lanes=lanes))
    assert network.on_road(network.point("1", 10.0, -1.0))
    assert not network.on_road(network.point("1", 10.0, -5.0))


def test_height_tells_a_bridge_from_the_road_below(files) -> None:
    bridge = files.road(
        "2",
        start=(50.0, -50.0, math.pi / 2),
        more='<elevationProfile><elevation s="0" a="6"/></elevationProfile>',
    )
    network = files.load(files.road("1"), bridge)
    assert network.locate(50.0, 1.0, 0.1).road_id == "1"
    assert network.locate(50.0, 1.0, 6.1).road_id == "2"


def test_heading_tells_crossing_roads_apart(files) -> None:
    network = files.load(files.road("1"), files.road("2", start=(50.0, -50.0, math.pi / 2)))
    assert network.locate(50.5, -1.0, None, 0.1).road_id == "1"
    assert network.locate(50.5, -1.0, None, 1.5).road_id == "2"


def test_superelevation_tilts_the_surface(files) -> None:
    profile = '<lateralProfile><superelevation s="0" a="0.1"/></lateralProfile>'
    road = files.load(files.road(more=profile)).road("1")
    pose = road.pose(10.0, 5.0)
    assert (pose.y, pose.z, pose.roll) == pytest.approx(
        (5.0 * math.cos(0.1), 5.0 * math.sin(0.1), 0.1)
    )


def test_level_lanes_stay_level(files) -> None:
    profile = '<lateralProfile><superelevation s="0" a="0.1"/></lateralProfile>'
    lanes = files.section(left=2).replace('<lane id="2"', '<lane level="true" id="2"')
    network = files.load(files.road(more=profile, lanes=lanes))
    pose = network.road("1").pose(10.0, 5.0)
    assert (pose.y, pose.z) == pytest.approx((3.5 * math.cos(0.1) + 1.5, 3.5 * math.sin(0.1)))
    assert network.locate(pose.x, pose.y).t == pytest.approx(5.0)


def test_slopes_have_the_sign_of_the_standard(files) -> None:
    road = files.load(
        files.road(more='<elevationProfile><elevation s="0" a="1" b="0.1"/></elevationProfile>')
    ).road("1")
    pose = road.pose(10.0)
    assert (pose.z, pose.pitch) == pytest.approx((2.0, -math.atan(0.1)))


def test_shape_and_crossfall_raise_the_surface(files) -> None:
    shape = '<shape s="0" t="-10" a="0" b="0.02"/><shape s="100" t="-10" a="1" b="0.02"/>'
    road = files.load(files.road(more=f"<lateralProfile>{shape}</lateralProfile>")).road("1")
    assert road.pose(50.0, 0.0).z == pytest.approx(0.7)
    crossfall = '<crossfall side="right" s="0" a="0.05"/>'
    road = files.load(files.road(more=f"<lateralProfile>{crossfall}</lateralProfile>")).road("1")
    assert [road.pose(50.0, t).z for t in (-4.0, 4.0)] == pytest.approx(
        [-4.0 * math.tan(0.05), 0.0]
    )


def test_a_lane_without_width_is_never_meant(files) -> None:
    lanes = files.section(right=3).replace(
        '<lane id="-2" type="driving">', '<lane id="-2" type="none">'
    )
    text = lanes.split('<lane id="-2"')
    lanes = text[0] + '<lane id="-2"' + text[1].replace('a="3.5"', 'a="0"', 1)
    road = files.load(files.road(lanes=lanes)).road("1")
    assert [road.lane_at(0.0, t) for t in (1.0, -1.0, -3.5, -3.6, -99.0)] == [-1, -1, -1, -3, -3]


def test_lanes_of_constant_width_are_found_by_their_borders(files) -> None:
    """Where all lanes keep their t, the bisection gives the lane that walking outwards gives."""
    narrow = files.section(right=4, left=2).replace('a="3.5"', 'a="0"', 2)
    for lanes in (files.section(right=3, left=2), files.section(right=3), narrow):
        section = files.load(files.road(lanes=lanes)).road("1").sections[0]
        assert section.borders is not None
        walked = replace(section)
        walked.borders = None
        borders = [lane.outer(0.0) for lane in section.lanes.values()]
        for t in (*borders, *(t + 1e-9 for t in borders), *(t - 1e-9 for t in borders), 99, -99):
            assert lane_in(section, 5.0, t) == lane_in(walked, 5.0, t)
