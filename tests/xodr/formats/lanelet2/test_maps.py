"""What the elements and tags of a Lanelet2 file become, and files that are refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pyproj
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

import schemas
import xodr
from schemas.common.errors import InvalidFile, ToolchainError, UsageError
from tests.xodr.formats.lanelet2.lanelet_maps import (
    WIDTH,
    LaneletMap,
    four_way,
    straight,
    turn,
    two_lanes,
)
from xodr.formats.lanelet2 import Conversion, convert, lanes
from xodr.lookup.geo import Geodetic, GeoReference

REGULATED = '<member type="relation" role="regulatory_element" ref="{}"/>'
EAST = ((0.0, 0.0), (100.0, 0.0))


def lane(made: LaneletMap, name: int, t: float = 0.0, **tags: str) -> None:
    """Add a straight lanelet to the east, its middle at t."""
    made.lanelet(name, straight(*EAST, t + WIDTH / 2), straight(*EAST, t - WIDTH / 2), **tags)


def converted(made: LaneletMap, folder: Path) -> tuple[Conversion, xodr.RoadNetwork]:
    conversion = convert(made.write(folder), None, folder / "map.xodr")
    assert {problem.rule.rpartition(".")[2] for problem in schemas.check(conversion.path)} <= {
        "avoid_redundant_info"
    }
    return conversion, xodr.load(conversion.path)


def beside_two(
    order: tuple[int, int] = (1, 0), turned: bool = False, apart: float = 0.0
) -> LaneletMap:
    """Lanelet 1, 100 m to the east, on its right 2 and then 3, with whose left
    bounds it shares its right one.
    """
    made = LaneletMap()
    halves = [straight((0.0, 0.0), (60.0, 0.0)), straight((60.0 + apart, 0.0), (100.0, 0.0))]
    ways = [made.way(halves[index][::-1] if turned and index else halves[index]) for index in order]
    made.lanelet(
        1,
        straight(*EAST, WIDTH),
        (),
        "".join(f'<member type="way" role="right" ref="{way}"/>' for way in ways),
    )
    for name, half in zip((2, 3), halves, strict=True):
        made.lanelet(name, half, [(x, -WIDTH) for x, _ in half])
    return made


# bounds of several ways ---------------------------------------------------------------------------


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
@pytest.mark.parametrize("turned", [False, True])
def test_ways_in_any_order_and_direction_make_one_bound(
    order: tuple[int, int], turned: bool, tmp_path: Path
) -> None:
    made = LaneletMap()
    ways = [
        made.way(line)
        for line in (
            straight((0.0, 0.0), (60.0, 0.0)),
            straight((60.0, 0.0), (100.0, 0.0))[:: -1 if turned else 1],
        )
    ]
    made.lanelet(
        1,
        straight(*EAST, WIDTH),
        (),
        "".join(f'<member type="way" role="right" ref="{ways[index]}"/>' for index in order),
    )
    conversion, network = converted(made, tmp_path)
    assert conversion.deviation < 1e-6
    assert network.road("1").length == pytest.approx(100.0)
    assert any(
        "bounds of several ways are joined" in note and note.endswith("lanelets 1")
        for note in conversion.notes
    )


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_lanelet_is_split_where_the_one_beside_it_ends(
    order: tuple[int, int], tmp_path: Path
) -> None:
    conversion, network = converted(beside_two(order), tmp_path)
    assert [conversion.lanelets[name] for name in ("1", "1/2", "2", "3")] == [
        ("1", -1),
        ("1", -1),
        ("1", -2),
        ("1", -2),
    ]
    assert network.road("1").length == pytest.approx(100.0)
    assert conversion.deviation < 0.2
    assert any(note == "lanelet 1 is split where 2 beside it ends" for note in conversion.notes)


def test_ways_that_make_no_line_are_refused(tmp_path: Path) -> None:
    with pytest.raises(
        InvalidFile, match=r"its right bound, ways \d+ \d+, is not one line"
    ) as caught:
        converted(beside_two(apart=1.0), tmp_path)
    assert (caught.value.element, bool(caught.value.line)) == ("relation 1", True)


def test_members_that_a_map_has_lost_are_left_out_with_a_note(tmp_path: Path) -> None:
    made = two_lanes()
    made.relation(7, '<member type="way" role="outer" ref="77"/>', type="multipolygon")
    conversion, _ = converted(made, tmp_path)
    assert "left out, since the map does not have them: way 77 (of 7)" in conversion.notes


# kinds of lanelets --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("subtype", "lane_type", "road_type"),
    [
        ("road", "driving", "town"),
        ("", "driving", "town"),
        ("highway", "driving", "motorway"),
        ("play_street", "driving", "lowSpeed"),
        ("bus_lane", "bus", "town"),
        ("emergency_lane", "stop", "town"),
        ("bicycle_lane", "biking", "town"),
        ("walkway", "sidewalk", "town"),
        ("rail", "rail", "town"),
    ],
)
def test_subtypes_are_lane_types(
    subtype: str, lane_type: str, road_type: str, tmp_path: Path
) -> None:
    made = LaneletMap()
    lane(made, 1, **({"subtype": subtype} if subtype else {}))
    road = converted(made, tmp_path)[1].road("1")
    assert (road.lane_type(50.0, -1), road.road_type(50.0)) == (lane_type, road_type)


def test_a_bicycle_lane_beside_a_lane_is_on_the_same_road(tmp_path: Path) -> None:
    made = two_lanes()
    made.lanelet(3, straight(*EAST, -WIDTH), straight(*EAST, -WIDTH - 1.5), subtype="bicycle_lane")
    _, network = converted(made, tmp_path)
    assert [network.road("1").lane_type(50.0, number) for number in (-1, -2, -3)] == [
        "driving",
        "driving",
        "biking",
    ]


def test_a_crosswalk_is_an_object_where_it_was(tmp_path: Path) -> None:
    made = two_lanes()
    corners = [(40.0, 5.0), (40.0, -5.0), (43.0, -5.0), (43.0, 5.0)]
    made.lanelet(9, corners[:2], corners[:1:-1], subtype="crosswalk")
    _, network = converted(made, tmp_path)
    (item,) = network.road("1").objects
    assert (item.type, item.name) == ("crosswalk", "9")
    place = network.pose(network.point("1", item.s, item.t))
    cos, sin = math.cos(place.h), math.sin(place.h)
    found = {
        (
            round(place.x + cos * corner.u - sin * corner.v, 6),
            round(place.y + sin * corner.u + cos * corner.v, 6),
        )
        for corner in item.outlines[0]
    }
    assert found == set(corners)


def test_what_is_no_lane_is_named(tmp_path: Path) -> None:
    made = two_lanes()
    lane(made, 7, 30.0, subtype="runway")
    made.relation(8, type="multipolygon", subtype="parking")
    lane(made, 9, -30.0, one_way="no", speed_limit="30")
    conversion, _ = converted(made, tmp_path)
    assert "7" not in conversion.lanelets
    for text in (
        "lanelet 7 is left out: its subtype 'runway'",
        "multipolygon parking: 8",
        "lanelet 9 may be driven both ways",
    ):
        assert any(text in note for note in conversion.notes), text


def test_marks_of_bounds_are_road_marks(tmp_path: Path) -> None:
    converted(two_lanes(), tmp_path)
    text = (tmp_path / "map.xodr").read_text()
    assert [line.split('"')[3] for line in text.splitlines() if "<roadMark" in line] == [
        "curb",
        "broken",
        "solid",
    ]


# speed limits -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("tags", "limit"),
    [
        ({"speed_limit": "30"}, 30 / 3.6),
        ({"speed_limit": "50 km/h"}, 50 / 3.6),
        ({"speed_limit": "30mph"}, 30 * 0.44704),
        ({"speed_limit": "12.5 m/s"}, 12.5),
        ({"maxspeed": "60"}, 60 / 3.6),
        ({"location": "urban"}, 50 / 3.6),
        ({"location": "nonurban"}, 100 / 3.6),
        ({"subtype": "highway"}, None),
        ({"subtype": "play_street"}, 7 / 3.6),
    ],
)
def test_speed_limits(tags: dict[str, str], limit: float | None, tmp_path: Path) -> None:
    made = LaneletMap()
    lane(made, 1, **tags)
    conversion, network = converted(made, tmp_path)
    assert network.road("1").speed_limit(50.0, -1) == (
        None if limit is None else pytest.approx(limit)
    )
    assert any("usual ones" in note for note in conversion.notes) == (
        not {"speed_limit", "maxspeed"} & set(tags)
    )


@pytest.mark.parametrize(
    "tags", [{"sign_type": "de274-60"}, {"sign_type": "60 km/h"}, {"speed_limit": "60"}]
)
def test_regulatory_elements_limit_the_speed(tags: dict[str, str], tmp_path: Path) -> None:
    made = LaneletMap()
    made.relation(5, type="regulatory_element", subtype="speed_limit", **tags)
    made.lanelet(1, straight(*EAST, 2.0), straight(*EAST, -2.0), REGULATED.format(5))
    assert converted(made, tmp_path)[1].road("1").speed_limit(50.0, -1) == pytest.approx(60 / 3.6)


def test_lanes_of_one_road_keep_their_own_limits(tmp_path: Path) -> None:
    made = LaneletMap()
    lane(made, 1, 0.0, speed_limit="100")
    lane(made, 2, -WIDTH, speed_limit="60")
    _, network = converted(made, tmp_path)
    assert [network.road("1").speed_limit(50.0, number) for number in (-1, -2)] == pytest.approx(
        [100 / 3.6, 60 / 3.6]
    )


# other regulatory elements ------------------------------------------------------------------------


def test_traffic_lights_hold_the_lanes_that_refer_to_them(tmp_path: Path) -> None:
    made = four_way({1: REGULATED.format(70), 2: REGULATED.format(71), 3: REGULATED.format(70)})
    for name in (70, 71, 72):
        made.relation(name, type="regulatory_element", subtype="traffic_light")
    conversion, network = converted(made, tmp_path)
    held = {(signal.name, signal.road_id): signal for signal in network.signals.values()}
    assert set(held) == {
        (light, conversion.lanelets[name][0])
        for light, name in (("70", "1"), ("71", "2"), ("70", "3"))
    }
    assert all(signal.dynamic and signal.validity == ((-1, -1),) for signal in held.values())
    assert {
        controller.name: len(controller.signals) for controller in network.controllers.values()
    } == {"70": 2, "71": 1}
    assert any("traffic_light: 72" in note for note in conversion.notes)


@pytest.mark.parametrize(
    ("code", "meaning"),
    [
        ("de205", ("205", "-1", "DE")),
        ("de274-60", ("274", "60", "DE")),
        ("usR1-1", ("R1", "1", "US")),
        ("stop", ("stop", "-1", "")),
    ],
)
def test_a_sign_has_the_place_and_meaning_of_its_way(
    code: str, meaning: tuple[str, str, str], tmp_path: Path
) -> None:
    made = LaneletMap()
    lane(made, 1, members=REGULATED.format(70))
    face = made.way([(50.0, -3.0), (50.0, -3.6)], f"traffic_sign {code}")
    made.relation(
        70,
        f'<member type="way" role="refers" ref="{face}"/>',
        type="regulatory_element",
        subtype="traffic_sign",
    )
    (sign,) = lanes.read(made.write(tmp_path)).signals
    assert (sign.type, sign.subtype, sign.country) == meaning
    assert sign.place == pytest.approx((50.0, -3.3, 0.0)) and sign.lanes == ("1",)
    assert math.cos(sign.heading - math.pi) > 0.999, "it looks at those who drive east"


def test_the_right_of_way_is_a_priority_of_the_junction(tmp_path: Path) -> None:
    made = four_way()
    first = "".join(
        f'<member type="relation" role="right_of_way" ref="{name}"/>' for name in (1, 3)
    )
    made.relation(
        70,
        first + '<member type="relation" role="yield" ref="124"/>',
        type="regulatory_element",
        subtype="right_of_way",
    )
    conversion, _ = converted(made, tmp_path)
    (junction,) = etree.parse(str(conversion.path)).iterfind("junction")
    found = {(item.get("high"), item.get("low")) for item in junction.iterfind("priority")}
    going = {
        conversion.lanelets[f"{100 + 10 * arm + to}"][0]
        for arm in (1, 3)
        for to in range(1, 5)
        if to != arm
    }
    assert found == {(road, conversion.lanelets["124"][0]) for road in going}


# what is not said in so many words ----------------------------------------------------------------


def test_bounds_may_run_either_way(tmp_path: Path) -> None:
    """Left and right decide the direction, as in Lanelet2."""
    made = LaneletMap()
    made.lanelet(1, straight(*EAST, 2.0)[::-1], straight(*EAST, -2.0))
    made.lanelet(2, straight(*EAST, 8.0), straight(*EAST, 12.0))
    conversion, network = converted(made, tmp_path)
    headings = [
        math.cos(network.roads[conversion.lanelets[name][0]].heading(0.0)) for name in ("1", "2")
    ]
    assert headings == pytest.approx([1.0, -1.0])


def test_a_lane_of_which_only_the_borders_are_there_is_added(tmp_path: Path) -> None:
    made = LaneletMap()
    for name, t in ((1, WIDTH), (3, -WIDTH)):
        lane(made, name, t)
    lines = [[straight(*EAST, t)[1], (150.0, t)] for t in (WIDTH / 2, -WIDTH / 2)]
    made.lanelet(12, *lines)
    conversion, network = converted(made, tmp_path)
    assert [conversion.lanelets[name] for name in ("1", "1|3", "3")] == [
        ("1", -1),
        ("1", -2),
        ("1", -3),
    ]
    assert any("1|3" in note for note in conversion.notes)
    assert [(link.road_id, link.lane_id) for link in network.links("1", -2, True)] == [
        conversion.lanelets["12"]
    ]


def test_a_lanelet_that_ends_upon_another_one_leads_into_it(tmp_path: Path) -> None:
    made = LaneletMap()
    lane(made, 1)
    ends = (10.0, -25.0, 0.7), (60.0, 0.0, 0.0)
    made.lanelet(2, turn(*ends, WIDTH / 2), turn(*ends, -WIDTH / 2))
    conversion, network = converted(made, tmp_path)
    assert conversion.deviation < 0.2
    for name in ("1", "2"):
        assert [
            (link.road_id, link.lane_id) for link in network.links(*conversion.lanelets[name], True)
        ] == [conversion.lanelets["1/2"]]


def test_a_lanelet_that_ends_along_another_one_tapers_off(tmp_path: Path) -> None:
    made = two_lanes()
    made.lanelet(
        3,
        straight((0.0, -WIDTH), (60.0, -WIDTH)),
        [(0.0, -2 * WIDTH), (60.0, -2 * WIDTH), (90.0, -WIDTH)],
    )
    conversion, network = converted(made, tmp_path)
    road = network.road(conversion.lanelets["3"][0])
    assert road.lane_width(road.length - 0.5, -1) < 0.5
    assert any("tapers off" in note for note in conversion.notes)
    assert conversion.deviation < 0.2


# coordinates --------------------------------------------------------------------------------------


def geographic(made: LaneletMap, origin: tuple[float, float]) -> str:
    """The map with latitudes and longitudes instead of local coordinates."""
    zone = pyproj.Proj(proj="utm", zone=int((origin[1] + 180) // 6) + 1, ellps="WGS84")
    x0, y0 = zone(origin[1], origin[0])
    text = made.text()
    for (x, y), number in made.nodes.items():
        longitude, latitude = zone(x0 + x, y0 + y, inverse=True)
        old = next(line for line in text.splitlines() if line.startswith(f'<node id="{number}"'))
        text = text.replace(old, f'<node id="{number}" lat="{latitude!r}" lon="{longitude!r}"/>')
    return text


@pytest.mark.parametrize("origin", [(49.0116, 8.4386), (0.0, 0.0)])
def test_coordinates_are_those_relative_to_the_origin(
    origin: tuple[float, float], tmp_path: Path
) -> None:
    path = tmp_path / "map.osm"
    path.write_text(geographic(two_lanes(), origin))
    given_origin = None if origin == (0.0, 0.0) else origin
    network = xodr.load(convert(path, given_origin, tmp_path / "map.xodr").path)
    pose = network.pose(network.lane_point("1", -1, 30.0))
    assert (pose.x, pose.y) == pytest.approx((30.0, WIDTH / 2), abs=1e-3)
    assert GeoReference(network).to_world(Geodetic(*origin, 0.0))[:2] == pytest.approx(
        (0.0, 0.0), abs=1e-3
    )


def test_an_origin_beyond_the_earth_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no UTM zone"):
        convert(two_lanes().write(tmp_path), (91.0, 0.0), tmp_path / "map.xodr")


# bad maps -----------------------------------------------------------------------------------------

BAD = {
    "empty": ("", "is empty"),
    "no xml": ("lanelets", "not well-formed"),
    "another format": ("<OpenDRIVE/>", "root element"),
    "entity bomb": ('<!DOCTYPE osm [<!ENTITY a "aaaa">]>\n<osm>&a;</osm>', "document type"),
    "no lanelets": ("<osm/>", "no lanelet"),
    "only crosswalks": ("subtype=crosswalk", "is a lane"),
}


@pytest.mark.parametrize("name", BAD)
def test_files_that_are_no_maps_are_refused(name: str, tmp_path: Path) -> None:
    text, complaint = BAD[name]
    if text.startswith("subtype"):
        text = two_lanes(subtype="crosswalk").text()
    path = tmp_path / "map.osm"
    path.write_text(text)
    with pytest.raises(InvalidFile, match=complaint) as caught:
        convert(path, None, tmp_path / "map.xodr")
    assert caught.value.path == str(path)
    assert not (tmp_path / "map.xodr").exists()


WRONG = {
    "bound missing": (
        'role="right"',
        'role="rihgt"',
        "relation 1",
        "one way as its right bound, this one has none",
    ),
    "way twice": (
        '<member type="way" role="left" ref="1000"/>',
        '<member type="way" role="left" ref="1000"/>' * 2,
        "member",
        "left bound twice",
    ),
    "way missing": ('role="left" ref="1000"', 'role="left" ref="77"', "member", "no way '77'"),
    "node missing": ('<nd ref="1"/>', '<nd ref="77"/>', "nd", "no node '77'"),
    "coordinate not finite": (
        'k="local_x" v="0.0"',
        'k="local_x" v="nan"',
        "node 1",
        "local_x='nan'",
    ),
    "coordinate no number": (
        'k="local_y" v="3.5"',
        'k="local_y" v="three"',
        "node 1",
        "local_y='three'",
    ),
    "coordinate missing": ('<tag k="local_x" v="0.0"/>', "", "node 1", "local_x=''"),
    "place not on Earth": (
        '<node id="1" lat="" lon="">',
        '<node id="1" lat="95" lon="8">',
        "node 1",
        "no place on Earth",
    ),
    "too far": ('k="local_x" v="0.0"', 'k="local_x" v="1e300"', "node 1", "too far"),
    "id twice": ('<relation id="2"', '<relation id="1"', "relation 1", "used twice"),
    "id missing": ('<node id="1"', "<node", "node", "attribute id"),
    "speed": ('v="50"', 'v="fast"', "relation 1", "no speed limit"),
    "speed zero": ('v="50"', 'v="0"', "relation 1", "no speed limit"),
    "member of no kind": ('<member type="way"', '<member type="area"', "member", "type='area'"),
    "bound of one node": ('<nd ref="2"/>', "", "relation 1", "1 nodes"),
    "bound without length": (
        'k="local_x" v="100.0"',
        'k="local_x" v="0.0"',
        "relation 1",
        "no length",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_elements_are_refused_with_line_and_name(name: str, tmp_path: Path) -> None:
    old, new, element, complaint = WRONG[name]
    text = two_lanes(speed_limit="50").text()
    assert old in text
    path = tmp_path / "map.osm"
    path.write_text(text.replace(old, new))
    with pytest.raises(InvalidFile, match=complaint) as caught:
        convert(path, None, tmp_path / "map.xodr")
    assert caught.value.element == element
    assert caught.value.line


@settings(max_examples=30)
@given(data=st.data())
def test_torn_files_are_refused_or_converted(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """No other error than ours, whatever line is lost, doubled or cut."""
    lines = four_way().text().splitlines()
    number = data.draw(st.integers(0, len(lines) - 1))
    lines[number : number + 1] = data.draw(
        st.sampled_from(([], [lines[number]] * 2, [lines[number][: len(lines[number]) // 2]]))
    )
    path = tmp_path_factory.getbasetemp() / "torn.osm"
    path.write_text("\n".join(lines))
    try:
        conversion = convert(path, None, path.with_suffix(".xodr"))
    except ToolchainError:
        return
    assert np.isfinite(conversion.deviation)
