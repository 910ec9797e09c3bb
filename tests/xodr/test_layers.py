"""Lane layers (OpenDRIVE 1.9): which lanes are in force where, and what follows them."""

from __future__ import annotations

import pytest
from lxml import etree

import xodr
from xodr.builders.elements import LaneDesign, PlanPose, RoadDesign, RoadMap, SectionDesign, arc
from xodr.builders.roads_and_ramps import constant, for_traffic
from xodr.formats.sumo_net.plain import plain_network
from xodr.graph.network import RoadNetwork
from xodr.lookup.placing import place
from xodr.model import PERMANENT, TEMPORARY, RoadPoint
from xodr.model.geometry import Cubic


def _lane(
    lane_id: int,
    width: str,
    before: str = "",
    after: str = "",
    kind: str = "driving",
    more: str = "",
) -> str:
    links = "".join(
        f'<{tag} id="{name}" layer="{layer}"/>'
        for tag, text in (("predecessor", before), ("successor", after))
        for layer, name in (part.split() for part in text.split(",") if part)
    )
    return f'<lane id="{lane_id}" type="{kind}"><link>{links}</link>{width}{more}</lane>'


def _section(
    s: float, right: str = "", left: str = "", length: float | None = None, single: bool = False
) -> str:
    groups = (("left", left), ("center", '<lane id="0"/>'), ("right", right))
    sides = "".join(f"<{side}>{lanes}</{side}>" for side, lanes in groups if lanes)
    more = (f' length="{length}"' if length else "") + (' singleSide="true"' if single else "")
    return f'<laneSection s="{s}"{more}>{sides}</laneSection>'


WIDE = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
NARROW = '<width sOffset="0" a="2.5" b="0" c="0" d="0"/>'
P, T = PERMANENT, TEMPORARY


@pytest.fixture(scope="module")
def works(files) -> RoadNetwork:
    """One road of 300 m, 2 + 2 permanent lanes; from 100 m to 180 m two narrow
    temporary lanes on the right, moved 0.6 m.
    """
    usual = "".join(_lane(n, WIDE, f"{P} {n}", f"{P} {n}") for n in (2, 1))
    right = [
        "".join(_lane(n, WIDE, "", f"{P} {n},{T} {n}") for n in (-1, -2)),
        "".join(_lane(n, WIDE, f"{P} {n}", f"{P} {n}") for n in (-1, -2)),
        "".join(_lane(n, WIDE, f"{P} {n},{T} {n}", "") for n in (-1, -2)),
    ]
    temporary = "".join(_lane(n, NARROW, f"{P} {n}", f"{P} {n}") for n in (-1, -2))
    permanent = "".join(
        _section(s, side, usual) for s, side in zip((0, 100, 180), right, strict=True)
    )
    moved = f'<laneOffset s="0" a="-0.6" b="0" c="0" d="0"/>{_section(100, temporary, length=80.0)}'
    return files.load(
        files.road(length=300.0, lanes=f'{permanent}</lanes><lanes layer="temporary">{moved}')
    )


@pytest.mark.parametrize(
    ("s", "lane", "layer", "t"),
    [
        (50.0, -1, T, -1.75),
        (99.999, -2, T, -5.25),
        (100.0, -1, T, -1.85),
        (140.0, -2, T, -4.35),
        (179.999, -2, T, -4.35),
        (180.0, -2, T, -5.25),
        (140.0, -1, P, -1.75),
        (140.0, -2, P, -5.25),
        (140.0, 1, T, 1.75),
        (140.0, 2, P, 5.25),
    ],
)
def test_each_layer_has_its_lanes_at_their_places(
    works, s: float, lane: int, layer: str, t: float
) -> None:
    point = works.lane_point("1", lane, s, layer=layer)
    pose = works.pose(point)
    assert (pose.x, pose.y) == pytest.approx((s, t), abs=1e-9)
    found = works.locate(pose.x, pose.y, layer=layer)
    assert (found.lane_id, found.offset, found.layer) == (lane, pytest.approx(0.0, abs=1e-9), layer)


def test_temporary_lanes_are_in_force_where_there_are_some(works) -> None:
    road = works.road("1")
    assert [road.lane(s, -1).layer for s in (99.0, 101.0, 179.0, 181.0)] == [P, T, T, P]
    assert {road.lane(140.0, 1).layer, *(road.on(P).lane(140.0, n).layer for n in (-1, -2))} == {P}


def test_many_places_are_found_as_single_ones(works) -> None:
    x, y = [50.0, 140.0, 140.0, 140.0], [-3.0, -3.0, -6.8, 3.0]
    rows = place(works, x, y)
    single = [works.locate(*xy) for xy in zip(x, y, strict=True)]
    assert rows.lane_id.tolist() == [point.lane_id for point in single] == [-1, -1, -2, 1]
    assert rows.t.tolist() == pytest.approx([point.t for point in single])


def test_the_surface_is_that_of_the_permanent_layer(works) -> None:
    beside = works.locate(140.0, -6.5)
    assert beside.road_id == "1"
    assert beside.offset == pytest.approx(-6.5 + 4.35)
    assert works.on_road(beside)
    assert works.road("1").edges(140.0) == (-7.0, 7.0)


@pytest.mark.parametrize(("layer", "inside"), [(T, -4.35), (P, -5.25)])
def test_travel_follows_the_layer_that_a_point_keeps_to(works, layer: str, inside: float) -> None:
    start = works.lane_point("1", -2, 50.0, layer=layer)
    there, _, _ = works.travel(start, 90.0, True)
    after, _, _ = works.travel(start, 200.0, True)
    assert (there.s, there.t, there.layer) == (pytest.approx(140.0), pytest.approx(inside), layer)
    assert (after.s, after.t, after.lane_id, after.layer) == (
        pytest.approx(250.0),
        pytest.approx(-5.25),
        -2,
        layer,
    )
    back, forward, _ = works.travel(after, -200.0, True)
    assert (back.s, back.t, forward) == (pytest.approx(50.0), pytest.approx(-5.25), True)


def test_a_point_can_change_its_layer(works) -> None:
    point = works.moved(works.lane_point("1", -2, 140.0), PERMANENT)
    assert (point.t, point.lane_id, point.offset) == (pytest.approx(-4.35), -2, pytest.approx(0.9))
    assert works.moved(point, TEMPORARY) == works.lane_point("1", -2, 140.0)


def test_sumo_has_the_temporary_lanes_where_there_are_some(works) -> None:
    edges = plain_network(works).edges
    centres = {lane.get("shape") for lane in edges.iter("lane")}
    assert "100.0000,-4.3500 180.0000,-4.3500" in centres
    assert "100.0000,-5.2500 180.0000,-5.2500" not in centres
    assert "0.0000,-5.2500 100.0000,-5.2500" in centres


def test_relative_places_count_in_the_layer_of_the_origin(works) -> None:
    inner = works.lane_point("1", -1, 50.0)
    assert works.relative(inner, works.lane_point("1", -2, 140.0)).lanes == -1
    kept = works.lane_point("1", -2, 140.0, layer=PERMANENT)
    assert works.relative(inner, kept).lanes == -1


def _one_way(before: str, after: str, width: str) -> str:
    return _section(
        0.0, "".join(_lane(n, width, before.format(n), after.format(n)) for n in (-1, -2))
    )


@pytest.mark.parametrize("declared", ["both", "permanent only"])
def test_a_temporary_layer_goes_on_over_the_border_of_roads(files, declared: str) -> None:
    both = f"{P} {{0}},{T} {{0}}" if declared == "both" else f"{P} {{0}}"
    first = _one_way("", both, WIDE)
    second = _one_way(f"{P} {{0}}", "", WIDE)
    works = _one_way(f"{P} {{0}}", "", NARROW)
    network = files.load(
        files.road("1", lanes=first, link=files.to_road("successor", "2", "start")),
        files.road(
            "2",
            lanes=f'{second}</lanes><lanes layer="temporary">{works}',
            start=(100.0, 0.0, 0.0),
            link=files.to_road("predecessor", "1", "end"),
        ),
    )
    for layer, t in ((T, -3.75), (P, -5.25)):
        reached, _, left = network.travel(
            network.lane_point("1", -2, 90.0, layer=layer), 30.0, True
        )
        assert (reached.road_id, reached.lane_id, left) == ("2", -2, 0.0)
        assert network.road_of(reached).lane_t(reached.s, reached.lane_id) == pytest.approx(t)


def test_a_temporary_lane_against_the_usual_direction_hides_what_it_covers(files) -> None:
    """Contraflow: the right side gets a lane on the left carriageway."""
    usual = _section(0.0, _lane(-1, WIDE), _lane(2, WIDE) + _lane(1, WIDE))
    moved = (
        '<laneOffset s="0" a="3.5" b="0" c="0" '
        f'd="0"/>{_section(40, _lane(-1, WIDE) + _lane(-2, WIDE), length=30.0)}'
    )
    network = files.load(files.road(lanes=f'{usual}</lanes><lanes layer="temporary">{moved}'))
    road = network.road("1")
    assert road.lane_ids(50.0) == (-2, -1, 2)
    assert [road.lane_at(50.0, t) for t in (-1.0, 1.0, 6.0)] == [-2, -1, 2]
    assert [road.lane_ids(s) for s in (39.0, 71.0)] == [(-1, 1, 2)] * 2


def test_sections_of_one_side_hold_for_their_own_length(files) -> None:
    usual = _section(0.0, _lane(-1, WIDE), _lane(1, WIDE))
    right = _section(20, _lane(-1, NARROW), single=True, length=60.0)
    left = _section(50, "", _lane(1, NARROW), single=True, length=10.0)
    network = files.load(files.road(lanes=f'{usual}</lanes><lanes layer="temporary">{right}{left}'))
    road = network.road("1")
    found = {
        s: (road.lane(s, -1).layer[0], road.lane(s, 1).layer[0])
        for s in (10.0, 30.0, 55.0, 70.0, 90.0)
    }
    assert found == {
        10.0: ("p", "p"),
        30.0: ("t", "p"),
        55.0: ("t", "t"),
        70.0: ("t", "p"),
        90.0: ("p", "p"),
    }
    assert road.sections[-1].end == 100.0


@pytest.mark.parametrize(
    ("lanes", "message"),
    [
        ('<lanes layer="temporary">', "the element lanes is missing"),
        ('<lanes layer="provisional">', "neither permanent nor temporary"),
    ],
)
def test_layers_that_make_no_sense_are_refused(files, lanes: str, message: str) -> None:
    path = files.write(files.road())
    path.write_text(path.read_text().replace("<lanes>", lanes))
    with pytest.raises(xodr.RoadError.__bases__[0], match=message):
        xodr.load(path, strict=True)


def test_roads_without_temporary_lanes_are_the_same_on_every_layer(files) -> None:
    network = files.load(files.road())
    assert network.on(PERMANENT) is network
    assert network.road("1").on(PERMANENT) is network.road("1")
    kept = network.lane_point("1", -1, 10.0, layer=PERMANENT)
    assert network.travel(kept, 5.0, True).point == RoadPoint("1", 15.0, -1.75, -1, 0.0, PERMANENT)
    assert etree.tostring(plain_network(network).edges)


@pytest.mark.parametrize("rule", ["RHT", "LHT"])
def test_written_layers_are_read_again(tmp_path, rule: str) -> None:
    """Road works on a curve: built, mirrored for left-hand traffic, written, read."""
    wide, narrow = constant(3.5), constant(2.75)
    usual = [
        SectionDesign(
            s,
            {
                -1: LaneDesign(
                    "driving",
                    wide,
                    "broken",
                    before,
                    after,
                    other_predecessor=since,
                    other_successor=until,
                )
            },
        )
        for s, before, after, since, until in (
            (0.0, None, -1, None, -1),
            (60.0, -1, -1, None, None),
            (120.0, -1, None, -1, None),
        )
    ]
    works = SectionDesign(
        60.0,
        {-1: LaneDesign("driving", narrow, "solid", other_predecessor=-1, other_successor=-1)},
        length=60.0,
    )
    road = RoadDesign(
        "1", "works", PlanPose(3.0, 4.0, 0.5), (arc(200.0, 0.01),), tuple(usual), "rural", 20.0,
        temporary=(works,), temporary_offset=(Cubic(0.0, -0.5),),
    )  # fmt: skip
    network = xodr.load(for_traffic(RoadMap("works", (road,)), rule).write(tmp_path / "works.xodr"))
    assert network.header.version == (1, 9)
    side = -1 if rule == "RHT" else 1
    for s, layer, t in ((30.0, T, 1.75), (90.0, T, 0.5 + 1.375), (90.0, P, 1.75), (150.0, T, 1.75)):
        assert network.lane_point("1", side, s, layer=layer).t == pytest.approx(side * t)
    assert [section.lanes[side].successor for section in network.road("1").sections] == [
        side,
        side,
        None,
    ]


def test_nobody_drives_on_lanes_with_road_works(files) -> None:
    lanes = _section(
        0.0, _lane(-1, WIDE) + _lane(-2, WIDE).replace("<lane ", '<lane roadWorks="true" ')
    )
    onward = files.to_road("successor", "2", "start")
    network = files.load(
        files.road("1", lanes=lanes, link=onward),
        files.road("2", lanes=lanes, start=(100.0, 0.0, 0.0)),
    )
    closed = {
        lane.get("index"): lane.get("disallow")
        for lane in plain_network(network).edges.iter("lane")
        if lane.get("width") == "3.5000"
    }
    assert closed["0"] == "all"
    assert closed["1"] != "all"
    (leg, _) = network.route(
        [network.lane_point("1", -1, 10.0), network.lane_point("2", -1, 10.0)]
    ).legs
    assert leg.exit_lanes == (-1,)


def test_links_of_the_other_layer_lead_to_the_lane_at_their_place(files) -> None:
    """A direct junction that links temporary lanes only: road users on the
    permanent layer find the way, too.
    """
    ahead, works = _one_way("", f"{P} {{0}}", WIDE), _one_way("", "", NARROW)
    link = '<laneLink from="-2" to="-1" fromLayer="temporary" toLayer="permanent"/>'
    network = files.load(
        files.road(
            "1",
            lanes=f'{ahead}</lanes><lanes layer="temporary">{works}',
            link=files.to_junction("successor", "9"),
        ),
        files.road(
            "2",
            lanes=_section(0.0, _lane(-1, WIDE)),
            start=(100.0, -3.0, 0.0),
            link=files.to_junction("predecessor", "9"),
        ),
        '<junction id="9" type="direct"><connection id="0" incomingRoad="1" linkedRoad="2" '
        f'contactPoint="start">{link}'
        "</connection></junction>",
    )
    for layer in (T, P):
        reached = network.travel(network.lane_point("1", -2, 90.0, layer=layer), 30.0, True).point
        assert (reached.road_id, reached.lane_id, reached.layer) == ("2", -1, layer)
