"""What the reader understands, and what it refuses with file and line."""

from __future__ import annotations

from pathlib import Path

import pytest

import xodr
from schemas.common.errors import InvalidFile
from xodr.model import RoadMark
from xodr.reader import load


def test_the_header_gives_name_projection_and_offset(files) -> None:
    header = (
        '<geoReference><![CDATA[ +proj=utm +zone=32 ]]></geoReference><offset x="1" '
        'y="2" z="3" hdg="0.5"/>'
    )
    network = files.load(files.road(), header=header)
    assert network.name == "test"
    assert network.geo_reference == "+proj=utm +zone=32"
    assert network.header.offset == (1.0, 2.0, 3.0, 0.5)
    assert network.header.version == (1, 6)


def test_a_namespace_makes_no_difference(files) -> None:
    root = '<OpenDRIVE xmlns="http://code.asam.net/simulation/standard/opendrive_schema">'
    assert files.load(files.road(), root=root).road("1").lane_ids(0.0) == (-2, -1, 1, 2)


def test_an_unchanged_file_is_read_once(files) -> None:
    path = files.write(files.road())
    assert load(path) is load(str(path))
    path.write_text(path.read_text().replace('name="test"', 'name="changed"'))
    assert load(path).name == "changed"


def test_elements_of_no_length_are_left_out(files) -> None:
    geometry = (
        files.geometry("<line/>", 60.0)
        + files.geometry("<line/>", 0.0, 60.0)
        + files.geometry("<line/>", 40.0, 60.0, (60.0, 0.0, 0.0))
    )
    road = files.load(files.road(geometry=geometry)).road("1")
    assert len(road.line.segments) == 2
    assert road.pose(100.0).x == pytest.approx(100.0)


def test_marks_hold_from_their_place_on(files) -> None:
    center = '<roadMark sOffset="0" type="solid solid" color="yellow" width="0.12"/>'
    lane = (
        '<roadMark sOffset="50" type="solid"/><roadMark sOffset="0" type="broken" '
        'color="standard" width=""/>'
    )
    path = files.write(files.road())
    text = path.read_text()
    for lane_id, marks in (("0", center), ("-1", lane)):
        before, found, after = text.partition(f'<lane id="{lane_id}"')
        head, close, rest = after.partition(">")
        text = (
            before
            + found
            + (
                head[:-1] + f">{marks}</lane>" + rest
                if head.endswith("/")
                else head + close + marks + rest
            )
        )
    path.write_text(text)
    lanes = load(path).road("1").section(0.0).lanes
    assert lanes[0].marks == (RoadMark(0.0, "solid solid", "yellow", 0.12),)
    assert lanes[-1].marks == (
        RoadMark(0.0, "broken", "standard", None),
        RoadMark(50.0, "solid", "standard", None),
    )
    assert lanes[1].marks == ()


def test_signals_keep_what_a_traffic_light_needs(files) -> None:
    signals = (
        '<signals><signal s="80" t="-5" id="7" name="light" dynamic="yes" orientation="+" '
        'zOffset="4" country="OpenDRIVE"'
        ' type="1000001" subtype="-1" value="-1"><validity fromLane="-2" toLane="-1"/></signal>'
        '<signal s="10" t="3" id="8" dynamic="no" orientation="-"/>'
        '<signalReference id="7" s="20" t="1" orientation="none"/></signals>'
    )
    network = files.load(
        files.road(more=signals),
        '<controller id="c" name="phase" sequence="2"><control signalId="7" '
        'type="0"/></controller>',
    )
    light, plain = network.signals["7"], network.signals["8"]
    assert (light.road_id, light.s, light.t, light.dynamic, light.type, light.orientation) == (
        "1",
        80.0,
        -5.0,
        True,
        "1000001",
        "+",
    )
    assert light.validity == ((-2, -1),)
    assert (plain.type, plain.dynamic, plain.value) == ("", False, None)
    assert network.road("1").signal_references[0].signal_id == "7"
    assert network.controllers["c"].signals == ("7",)


def test_objects_keep_dimensions_and_outlines(files) -> None:
    objects = (
        '<objects><object id="o" type="building" s="30" t="12" zOffset="0" hdg="0.1" length="8" '
        'width="4" height="3">'
        '<outlines><outline><cornerLocal u="1" v="2" z="0" height="3"/><cornerRoad s="31" t="12" '
        'dz="0" height="3"/></outline>'
        "</outlines></object></objects>"
    )
    (item,) = files.load(files.road(more=objects)).road("1").objects
    assert (item.length, item.width, item.height, item.radius) == (8.0, 4.0, 3.0, None)
    assert [(corner.u, corner.v, corner.on_road) for corner in item.outlines[0]] == [
        (1.0, 2.0, False),
        (31.0, 12.0, True),
    ]


@pytest.mark.parametrize(
    ("limit", "expected"),
    [
        ('max="100" unit="km/h"', 100 / 3.6),
        ('max="60" unit="mph"', 26.8224),
        ('max="20"', 20.0),
        ('max="no limit"', None),
    ],
)
def test_speed_limits_are_read_in_their_units(files, limit: str, expected: float | None) -> None:
    road = files.load(files.road(more=f'<type s="0" type="motorway"><speed {limit}/></type>')).road(
        "1"
    )
    assert road.speed_limit(50.0) == (pytest.approx(expected) if expected else None)
    assert road.road_type(50.0) == "motorway"


def test_a_lanes_own_speed_limit_comes_first(files) -> None:
    width = '<width sOffset="0" a="3.5"/><speed sOffset="20" max="10"/>'
    road = files.load(
        files.road(
            lanes=files.section(right=1, width=width),
            more='<type s="0" type="town"><speed max="15"/></type>',
        )
    ).road("1")
    assert [road.speed_limit(s, -1) for s in (10.0, 30.0)] == [15.0, 10.0]


def test_borders_describe_lanes_as_widths_do(files) -> None:
    lanes = (
        '<laneSection s="0"><left><lane id="1" type="driving"><border sOffset="0" a="3" '
        'b="0.01"/></lane></left>'
        '<center><lane id="0" type="none"/></center><right><lane id="-1" type="driving"><border '
        'sOffset="0" a="-3"/></lane>'
        '<lane id="-2" type="shoulder"><border sOffset="0" a="-4"/></lane></right></laneSection>'
    )
    road = files.load(files.road(lanes=lanes)).road("1")
    assert [road.lane_width(100.0, lane) for lane in (1, -1, -2)] == pytest.approx([4.0, 3.0, 1.0])
    assert [road.lane_t(100.0, lane) for lane in (1, -1, -2)] == pytest.approx([2.0, -1.5, -3.5])


def test_a_single_sided_section_keeps_the_other_sides_lanes(files) -> None:
    second = files.section(right=3, s=40.0).replace(
        "<laneSection", '<laneSection singleSide="true"'
    )
    lanes = (
        '<laneOffset s="0" a="0"/><laneOffset s="60" a="0" b="0.1"/>'
        + files.section(left=2, right=2)
        + second
    )
    road = files.load(files.road(lanes=lanes)).road("1")
    assert road.lane_ids(50.0) == (-3, -2, -1, 1, 2)
    assert road.lane_t(50.0, 2) == pytest.approx(5.25)
    assert road.lane_t(90.0, 2) == pytest.approx(5.25 + 3.0)


FAULTS = {
    "a missing attribute": ('hdg="0.0"', "", "'hdg' is missing"),
    "NaN": ('x="0.0"', 'x="NaN"', "x='NaN'"),
    "infinity": ('length="100.0" junction', 'length="INF" junction', "length='INF'"),
    "a word for a number": ('y="0.0"', 'y="north"', "is not a number"),
    "a length of zero": ('length="100.0" junction', 'length="0" junction', "must be positive"),
    "a negative length": ('length="100.0"><line', 'length="-1"><line', "must not be negative"),
    "an unknown geometry": ("<line/>", "<hyperbola/>", "hyperbola"),
    "a curve without length": (
        "<line/>",
        '<paramPoly3 aU="0" bU="0" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0"/>',
        "without length",
    ),
    "an absurd curvature": ("<line/>", '<arc curvature="1e11"/>', "winds"),
    "a lane on the wrong side": (
        '<lane id="-1"',
        '<lane id="5"',
        "does not belong on the right side",
    ),
    "a lane id that is no integer": ('<lane id="-1"', '<lane id="-1.5"', "not an integer"),
    "an unknown rule": ('rule="RHT"', 'rule="left"', "neither RHT nor LHT"),
    "no lanes": ("<lanes>", "<lanez>", "lanes is missing"),
    "no lane section": ("laneSection", "laneSektion", "at least one laneSection"),
    "a link to nowhere": (
        "<link></link>",
        '<link><successor elementType="road" elementId="9"/></link>',
        "'9'",
    ),
    "a link to a junction that is not there": (
        "<link></link>",
        '<link><successor elementType="junction" elementId="9"/></link>',
        "'9'",
    ),
    "an unknown contact point": (
        "<link></link>",
        '<link><successor elementType="road" elementId="1" contactPoint="middle"/></link>',
        "middle",
    ),
    "another root": ("OpenDRIVE", "OpenSCENARIO", "root element"),
    "a road used twice": ("</OpenDRIVE>", '<road id="1"/></OpenDRIVE>', "used twice"),
    "no road": ('<road id="1"', '<rood id="1"', "has no road"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_what_has_no_meaning_is_refused_with_file_and_line(files, fault: str) -> None:
    before, after, message = FAULTS[fault]
    path = files.write(files.road())
    text = path.read_text()
    assert before in text
    end = {"<lanez>": ("</lanes>", "</lanez>"), '<rood id="1"': ("</road>", "</rood>")}.get(
        after, ("", "")
    )
    path.write_text(text.replace(before, after).replace(*end))
    with pytest.raises(InvalidFile, match=message) as caught:
        load(path, strict=True)
    assert caught.value.path == str(path)
    assert caught.value.line is not None


def test_records_must_not_go_back(files) -> None:
    path = files.write(
        files.road(
            lanes=files.section(right=1)
            + files.section(right=1, s=50.0)
            + files.section(right=1, s=20.0)
        )
    )
    with pytest.raises(InvalidFile, match="must not decrease"):
        load(path, strict=True)
    assert [section.s for section in load(path).road("1").sections] == [0.0, 20.0, 50.0]


def test_a_road_of_absurd_length_is_refused(files) -> None:
    with pytest.raises(InvalidFile, match="too long"):
        files.load(files.road(length=1e11))


def test_missing_roads_and_lanes_are_named(files) -> None:
    network = files.load(files.road())
    with pytest.raises(xodr.RoadError, match="no road '9'; roads: 1"):
        network.road("9")
    with pytest.raises(xodr.RoadError, match=r"no lane -3 at s = 10\.00 m"):
        network.lane_point("1", -3, 10.0)


def test_a_missing_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(InvalidFile, match="no such file"):
        load(tmp_path / "none.xodr")


GAPPED = """<OpenDRIVE><header revMajor="1" revMinor="6"/>{}</OpenDRIVE>"""
ROAD = """<road id="{id}" length="100" junction="-1"><link>{link}</link>
<planView><geometry s="0" x="{x}" y="0" hdg="0" length="100"><line/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right><lane id="-1" type="driving"><link>{lane}</link>
<width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection></lanes></road>"""


@pytest.mark.parametrize(("x", "told"), [(100.5, False), (150.0, True)])
def test_linked_lanes_whose_ends_are_apart_are_remarked_and_refused_where_strict(
    x: float, told: bool, tmp_path: Path
) -> None:
    onward = '<successor elementType="road" elementId="2" contactPoint="start"/>'
    back = '<predecessor elementType="road" elementId="1" contactPoint="end"/>'
    roads = ROAD.format(id=1, link=onward, x=0, lane='<successor id="-1"/>')
    roads += ROAD.format(id=2, link=back, x=x, lane='<predecessor id="-1"/>')
    path = tmp_path / "gap.xodr"
    path.write_text(GAPPED.format(roads))
    remarks = [str(remark) for remark in load(path).remarks]
    text = (
        "gap.xodr:1: a link joins the end of the road '1' and the start of the road '2', 50 m apart"
    )
    assert [text in remark for remark in remarks] == ([True] if told else [])
    if told:
        with pytest.raises(InvalidFile, match="50 m apart"):
            load(path, strict=True)
