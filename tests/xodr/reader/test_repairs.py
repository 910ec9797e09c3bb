"""Every repair: what it assumes, its remark, its refusal where reading is
strict, and the rule that a check names.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest
from lxml import etree

import schemas
import xodr
from schemas.common.errors import InvalidFile
from schemas.common.remarks import Remark
from xodr.model.road import Road
from xodr.reader.elements import LARGEST
from xodr.reader.repairs import repair
from xodr.rules import roads

FOLDER = Path(__file__).parent / "repairs"
LIBRARY = Path(xodr.__file__).parent / "library"

SCHEMA = "asam.net:xodr:1.0.0:xml.valid_schema"
RECORDS = "xosc.toolchain:xodr:1.4.0:road.records_ascend"
NUMBERS = "xosc.toolchain:xodr:1.4.0:numbers_are_plausible"
LINE = "xosc.toolchain:xodr:1.4.0:road.geometry.reference_line_is_complete"
SECTIONS = "xosc.toolchain:xodr:1.4.0:road.lane.lane_sections_are_whole"
LINKS = "xosc.toolchain:xodr:1.4.0:road.linkage.linked_elements_exist"


class Case(NamedTuple):
    """A file with one fault: the rule, line and text of its remark."""

    file: str
    rule: str
    line: int
    text: str


CASES = [
    Case(
        "connection_of_no_road",
        LINKS,
        18,
        "connection: connectingRoad='9' does not exist; the connection is left out",
    ),
    Case(
        "connection_without_incoming_road",
        SCHEMA,
        31,
        "connection: incomingRoad is missing; the connection is left out",
    ),
    Case(
        "elevation_doubled",
        RECORDS,
        10,
        "elevation: two records begin at s=0; the last of them is read",
    ),
    Case(
        "elevation_out_of_order",
        RECORDS,
        10,
        "elevation: s=0 follows s=50; the records are read in ascending order",
    ),
    Case(
        "geometry_out_of_order",
        RECORDS,
        7,
        "geometry: s=0 follows s=60; the records are read in ascending order",
    ),
    Case(
        "geometry_without_length",
        LINE,
        6,
        "geometry: the only geometry of the road has no length; the length of the road is read",
    ),
    Case(
        "elevation_not_a_number",
        NUMBERS,
        10,
        "elevation: a=nan for 1e-06 m; the record is left out",
    ),
    Case(
        "header_missing",
        "asam.net:xodr:1.0.0:xml.fileheader_is_present",
        2,
        "OpenDRIVE: the element header is missing; read as OpenDRIVE 1.4",
    ),
    Case(
        "header_without_version",
        "asam.net:xodr:1.0.0:xml.version_is_defined",
        3,
        "header: revMinor='six' is no version; read as OpenDRIVE 1.4",
    ),
    Case("lane_link_empty", SCHEMA, 12, "successor: id is missing; the link is left out"),
    Case(
        "lane_offset_doubled",
        RECORDS,
        10,
        "laneOffset: two records begin at s=0; the last of them is read",
    ),
    Case(
        "lane_offset_out_of_order",
        RECORDS,
        10,
        "laneOffset: s=0 follows s=60; the records are read in ascending order",
    ),
    Case(
        "lanes_doubled",
        "asam.net:xodr:1.9.0:road.lane.layer.layer_limits",
        16,
        "lanes: the road '1' has another permanent layer of lanes; the first is read",
    ),
    Case(
        "lanes_on_the_wrong_side",
        SECTIONS,
        12,
        "lane: the lane ids on the right side have the sign of the other side; read with the sign "
        "of their side",
    ),
    Case(
        "link_to_an_unknown_end",
        SCHEMA,
        5,
        "successor: contactPoint='front' is neither start nor end; the nearer end is linked",
    ),
    Case(
        "link_to_no_junction",
        LINKS,
        5,
        "successor: the junction '9' does not exist; the link is left out",
    ),
    Case(
        "link_to_no_road", LINKS, 5, "successor: the road '9' does not exist; the link is left out"
    ),
    Case(
        "link_without_type",
        SCHEMA,
        5,
        "successor: elementType is missing; the only element of that id is linked",
    ),
    Case(
        "object_unreadable", SCHEMA, 16, "object: s='fifty' is not a number; the object is left out"
    ),
    Case(
        "parametric_curve_empty",
        SCHEMA,
        6,
        "paramPoly3: the curve has no coefficients; read as a line",
    ),
    Case(
        "road_of_no_length",
        LINE,
        17,
        "road: the road '2' has no geometry with a length; the road is left out",
    ),
    Case(
        "road_without_geometry",
        LINE,
        17,
        "road: the road '2' has no geometry with a length; the road is left out",
    ),
    Case(
        "road_without_lanes",
        SECTIONS,
        17,
        "road: the road '2' has no lane section; it is read as a road without lanes",
    ),
    Case(
        "road_without_length",
        LINE,
        4,
        "road: length='0' is no length; the length of its geometries is read",
    ),
    Case(
        "section_beyond_the_road",
        SECTIONS,
        15,
        "laneSection: s=120 is not on the road, which is 100 m long; the section is left out",
    ),
    Case(
        "shape_out_of_order",
        RECORDS,
        10,
        "shape: s=0 t=-3.5 follows s=0 t=0; the records are read in ascending order",
    ),
    Case(
        "shape_without_s", SCHEMA, 9, "shape: the attribute 's' is missing (and 1 more); read as 0"
    ),
    Case(
        "signal_unreadable",
        SCHEMA,
        16,
        "signal: t='-3.66+1.8e-07i' is not a number; the signal is left out",
    ),
    Case("speed_negative", SCHEMA, 12, "speed: max='-1' is negative; read as 'undefined'"),
    Case(
        "spiral_empty",
        SCHEMA,
        6,
        "spiral: the attribute 'curvStart' is missing (and 1 more); read as 0",
    ),
    Case(
        "width_absurd",
        NUMBERS,
        18,
        "width: c=-6e12 for 1e-06 m; the record is read as constant",
    ),
    Case(
        "width_out_of_order",
        RECORDS,
        13,
        "width: sOffset=0 follows sOffset=40; the records are read in ascending order",
    ),
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.file)
def test_a_fault_is_repaired_with_a_remark_named_by_a_check_and_refused_where_strict(
    case: Case,
) -> None:
    path = FOLDER / f"{case.file}.xodr"
    assert xodr.load(path).remarks == (Remark(case.rule, case.text, str(path), case.line),)
    assert case.rule in {problem.rule for problem in schemas.check(path)}
    with pytest.raises(InvalidFile) as refused:
        xodr.load(path, strict=True)
    assert refused.value.path == str(path)
    assert refused.value.line is not None


def test_every_file_here_is_a_case() -> None:
    assert {path.stem for path in FOLDER.glob("*.xodr")} == {case.file for case in CASES} | {
        "virtual_junction"
    }


def road(name: str) -> Road:
    """The first road of a repaired file."""
    return xodr.load(FOLDER / f"{name}.xodr").road("1")


def test_records_hold_where_they_begin() -> None:
    assert [road("elevation_out_of_order").pose(s).z for s in (10.0, 60.0)] == [1.0, 2.0]
    assert road("elevation_doubled").pose(10.0).z == 2.0
    assert [road("lane_offset_out_of_order").lane_t(s, 0) for s in (10.0, 70.0)] == [0.5, 1.0]
    assert road("lane_offset_doubled").lane_t(10.0, 0) == 0.5
    assert road("elevation_not_a_number").pose(100.0).z == 1.0
    assert [road("width_out_of_order").lane_width(s, -1) for s in (10.0, 50.0)] == [3.5, 3.0]
    assert [road("shape_out_of_order").pose(0.0, t).z for t in (-3.5, 0.0)] == [0.2, 0.1]


def test_lengths_and_curves_are_completed() -> None:
    for name in (
        "geometry_out_of_order",
        "geometry_without_length",
        "road_without_length",
        "spiral_empty",
        "parametric_curve_empty",
    ):
        assert road(name).length == 100.0
        assert road(name).pose(90.0)[:4] == (90.0, 0.0, 0.0, 0.0)


def test_lanes_are_completed() -> None:
    assert road("lanes_on_the_wrong_side").lane_ids(0.0) == (-1,)
    assert road("width_absurd").lane_width(100.0, -1) == 3.5
    assert len(road("section_beyond_the_road").sections) == 1
    assert xodr.load(FOLDER / "road_without_lanes.xodr").road("2").lane_ids(0.0) == ()
    assert road("speed_negative").speed_limit(0.0, -1) is None


def test_what_cannot_be_read_is_left_out() -> None:
    assert not road("signal_unreadable").signals
    assert not road("object_unreadable").objects
    assert list(xodr.load(FOLDER / "road_without_geometry.xodr").roads) == ["1"]
    for name in (
        "link_to_no_road",
        "link_to_no_junction",
        "lane_link_empty",
        "connection_of_no_road",
    ):
        assert xodr.load(FOLDER / f"{name}.xodr").links("1", -1, True) == []


def test_links_are_completed() -> None:
    for name in ("link_without_type", "link_to_an_unknown_end"):
        assert [
            link.road_id for link in xodr.load(FOLDER / f"{name}.xodr").links("1", -1, True)
        ] == ["2"]


def test_faults_of_one_kind_are_one_remark() -> None:
    (remark,) = xodr.load(FOLDER / "shape_without_s.xodr").remarks
    assert "(and 1 more)" in remark.message


def test_a_virtual_junction_is_no_fault_but_a_remark() -> None:
    path = FOLDER / "virtual_junction.xodr"
    for strict in (False, True):
        (remark,) = xodr.load(path, strict=strict).remarks
        assert remark.message.endswith("ways off that road are not followed")


def test_sound_files_have_no_remarks() -> None:
    for path in (Path(xodr.__file__).parent / "library").glob("*.xodr"):
        assert xodr.load(path).remarks == ()


def test_what_has_no_meaning_is_refused_although_repairs_are_allowed(tmp_path: Path) -> None:
    text = (FOLDER / "header_missing.xodr").read_text()
    path = tmp_path / "empty.xodr"
    path.write_text(text.replace('x="0" y="0"', 'x="east" y="0"'))
    with pytest.raises(InvalidFile, match="x='east' is not a number"):
        xodr.load(path)


def test_checks_and_the_reader_refuse_the_same_numbers() -> None:
    assert roads.LARGEST == LARGEST


@pytest.mark.parametrize(
    ("before", "line", "text"),
    [
        (
            "\ufeff\ufeff{declaration}\n",
            1,
            "a byte-order mark is not at the beginning; it is left out",
        ),
        (
            "\n\n{declaration}\n",
            3,
            "the XML declaration is not at the beginning; it is read as if it was",
        ),
        (
            "{declaration}\n<!DOCTYPE OpenDRIVE>\n",
            2,
            "a document type (DOCTYPE) is not allowed; it declares nothing, and is left out",
        ),
        (
            "{declaration}\n<!-- a -- b -->\n",
            2,
            "there is '--' in a comment; it does not end the comment",
        ),
    ],
)
def test_faults_outside_of_the_elements_are_repaired(
    tmp_path: Path, before: str, line: int, text: str
) -> None:
    declaration, _, elements = (
        (FOLDER / "virtual_junction.xodr").read_text(encoding="utf-8").partition("\n")
    )
    sound, broken = tmp_path / "sound.xodr", tmp_path / "broken.xodr"
    sound.write_text(f"{declaration}\n{elements}", encoding="utf-8")
    broken.write_text(before.format(declaration=declaration) + elements, encoding="utf-8")
    network, rule = xodr.load(broken), "asam.net:xodr:1.0.0:xml.valid_xml_document"
    assert network.remarks[0] == Remark(rule, text, str(broken), line)
    assert network.roads.keys() == xodr.load(sound).roads.keys()
    assert rule in {problem.rule for problem in schemas.check(broken)}
    with pytest.raises(InvalidFile):
        xodr.load(broken, strict=True)


def test_heights_of_other_names_are_read_as_none(tmp_path: Path) -> None:
    text = (LIBRARY / "narrow_road.xodr").read_text()
    path = tmp_path / "heights.xodr"
    root = etree.fromstring(text.encode())
    lane = root.find(".//lane[@id='-1']")
    assert lane is not None
    lane.append(etree.Element("height", {"sOffset": "0", "heightInner": "0.12"}))
    etree.ElementTree(root).write(path)
    network = xodr.load(path)
    said = [str(remark) for remark in network.remarks]
    assert any(
        "height: the attribute 'inner' is missing (and 1 more); read as 0" in line for line in said
    )


def test_other_elements_of_the_same_names_are_left_alone(tmp_path: Path) -> None:
    """Types of road marks, borders of objects and speeds of signs have no start
    and no coefficients.
    """
    text = (LIBRARY / "narrow_road.xodr").read_text()
    mark = (
        '<roadMark sOffset="0" type="solid" color="white"><type name="solid" '
        'width="0.1"/></roadMark>'
    )
    of_objects = (
        '<objects><object id="1" s="1" t="1" zOffset="0"><borders><border outlineId="0" '
        'type="curb" width="1"/></borders>'
    )
    signs = (
        '<signals><signal id="1" s="1" t="1" zOffset="0"><semantics><speed type="zone" '
        'unit="km/h" value="30"/></semantics>'
    )
    text = text.replace("</width>", "").replace(
        "</road>", f"{of_objects}</object></objects>{signs}</signal></signals></road>"
    )
    path = tmp_path / "names.xodr"
    path.write_text(
        text.replace(
            '<center>\n          <lane id="0" type="none" level="false">',
            f'<center><lane id="0" type="none">{mark}',
        )
    )
    root = etree.parse(path).getroot()
    before = etree.tostring(root)
    assert mark.encode() in before
    assert not repair(root, path)
    assert etree.tostring(root) == before
