"""Maps converted between formats: the error that is told is the one that is
there, and kept fields are read back.
"""

from __future__ import annotations

import json
import math
import re
import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from lxml import etree

import xodr
from schemas.common import fates
from schemas.common.errors import InvalidFile, UsageError
from tests.commands import Command
from tests.runner.matrix_case import road
from xodr.builders.elements import (
    Clothoid,
    LaneDesign,
    PlanPose,
    RoadDesign,
    RoadMap,
    SectionDesign,
    arc,
    line,
)
from xodr.formats.lanelet2 import lanes as lanelet2_lanes
from xodr.formats.maps import files as maps
from xodr.formats.maps.comparing import compare
from xodr.formats.maps.converting import FATES, MAP_FIELDS
from xodr.formats.maps.lane_map import LaneMap, of_network
from xodr.formats.maps.projecting import Projector
from xodr.model import RoadLink
from xodr.model.geometry import Cubic

LIBRARY = Path(xodr.__file__).parent / "library"
ENDINGS = {
    "lanelet2": "map.osm", "sumo": "map.net.xml", "commonroad": "map.xml", "geojson": "map.geojson",
    "opendrive": "map.xodr",
}  # fmt: skip


CROSSWALKS = """<object id="10" type="crosswalk" s="80" t="0" zOffset="0" hdg="0.1" length="3" width="8"/>
<object id="11" type="crosswalk" s="40" t="0" zOffset="0"><outlines><outline id="0">
<cornerRoad s="40" t="-6" dz="0" height="0" id="0"/><cornerRoad s="43" t="-6" dz="0" height="0" id="1"/>
<cornerRoad s="43" t="0" dz="0" height="0" id="2"/><cornerRoad s="43.5" t="4" dz="0" height="0" id="3"/>
<cornerRoad s="40" t="4" dz="0" height="0" id="4"/></outline></outlines></object>"""
"""A rectangle, and an area with a corner in one of its long sides"""
STOP_LINE = (
    '<object id="12" type="roadMark" subtype="signalLines" name="halt" s="60" t="-1.75" zOffset="0"'
    ' hdg="0.1" length="0.3" width="3.2"/>'
)
TREE = '<object id="13" type="tree" name="oak" s="60" t="-12" zOffset="0" hdg="0"/>'


def straight() -> str:
    """A road of the library, of 200 m of its 2,000: borders are compared all along."""
    text = (LIBRARY / "highway_straight.xodr").read_text(encoding="utf-8")
    return text.replace('length="2000"', 'length="200"')


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two linked roads on a projection, with heights, kerbs, limits, a sign, a
    light, two crosswalks, a stop line, a pole and a tree.
    """
    path = tmp_path_factory.mktemp("map") / "source.xodr"
    more = CROSSWALKS + STOP_LINE + TREE
    path.write_text(road().replace("</objects>", f"{more}</objects>"), encoding="utf-8")
    return path


@pytest.mark.parametrize("target", ["lanelet2", "commonroad", "geojson", "sumo"])
@pytest.mark.parametrize("name", ["intersection_four_way", "roundabout", "sharp_curve"])
def test_borders_and_connections_are_those_of_the_source(
    name: str, target: str, tmp_path: Path
) -> None:
    made = maps.convert(LIBRARY / f"{name}.xodr", tmp_path / ENDINGS[target])
    assert made.difference.borders.largest < 0.05
    assert made.difference.within > 0.999
    assert (made.difference.lost, made.difference.gained) == ({}, {})
    assert made.difference.connections_lost == made.difference.connections_gained == []
    assert made.difference.connections > 0 or name == "sharp_curve"


@pytest.mark.parametrize("between", ["lanelet2", "sumo"])
def test_the_way_there_and_back_keeps_borders_and_connections(between: str, tmp_path: Path) -> None:
    path = LIBRARY / "roundabout.xodr"
    there = maps.convert(path, tmp_path / ENDINGS[between])
    back = maps.convert(there.path, tmp_path / "back.xodr")
    difference = maps.compare(path, back.path)
    assert difference.within > 0.95
    assert difference.connections_kept == 1.0 and not difference.connections_gained


def hill_map() -> RoadMap:
    """A road over a sharp crest, and a banked one that crosses it 20 m below."""
    lane = LaneDesign("driving", (Cubic(0.0, 3.5),))
    sections = (SectionDesign(0.0, {-1: lane, -2: lane}),)
    common = {"sections": sections, "type": "rural", "speed_limit": 20.0, "name": ""}
    crest = (Cubic(0.0, 10.0, 0.2), Cubic(50.0, 20.0, -0.2))
    roads = (
        RoadDesign("1", start=PlanPose(0.0, 0.0, 0.0), plan=(line(100.0),), elevation=crest,
            **common),  # type: ignore[arg-type]
        RoadDesign(
            "2", start=PlanPose(50.0, -60.0, math.pi / 2), plan=(line(50.0), arc(70.0, 0.01)),
            superelevation=(Cubic(0.0, 0.0, 0.001),), **common,  # type: ignore[arg-type]
        ),
    )  # fmt: skip
    return RoadMap("hill", roads)


def hill(path: Path) -> Path:
    return hill_map().write(path)


@pytest.mark.parametrize("between", ["lanelet2", "commonroad", "geojson", "sumo"])
def test_the_way_there_and_back_keeps_heights(between: str, tmp_path: Path) -> None:
    path = hill(tmp_path / "hill.xodr")
    assert maps.compare(path, path).heights.largest < 1e-9  # the lower road is not the upper one
    there = maps.convert(path, tmp_path / ENDINGS[between])
    back = maps.convert(there.path, tmp_path / "back.xodr")
    for difference in (there.difference, back.difference, maps.compare(path, back.path)):
        assert difference.heights.largest < 0.05 and difference.heights.places > 400


@pytest.mark.parametrize("between", ["lanelet2", "sumo"])
def test_a_ramp_of_two_turns_comes_back(between: str, tmp_path: Path) -> None:
    """Each turn lies over the other: the nearest border in the plan may be that of another, with
    its height."""
    lane = LaneDesign("driving", (Cubic(0.0, 2.0),))
    ramp = RoadDesign(
        "1", start=PlanPose(0.0, 0.0, 0.0), plan=(arc(125.0, 0.1),), type="rural",
        speed_limit=5.0, name="", sections=(SectionDesign(0.0, {1: lane, -1: lane}),),
        elevation=(Cubic(0.0, 0.0, 0.06),),
    )  # fmt: skip
    path = RoadMap("ramp", (ramp,)).write(tmp_path / "ramp.xodr")
    there = maps.convert(path, tmp_path / ENDINGS[between])
    back = maps.convert(there.path, tmp_path / "back.xodr")
    difference = compare(there.source, back.result)
    assert difference.within == 1.0 and difference.heights.largest < 0.05


def test_a_mirrored_road_leans_to_the_other_side(tmp_path: Path) -> None:
    design = hill_map()
    for side, built in ((-1, design), (1, design.mirrored())):
        road = xodr.load(built.write(tmp_path / f"{side}.xodr")).roads["2"]
        low = road.pose(120.0, side * 7.0)
        assert low.z == pytest.approx(-7.0 * math.sin(0.12))
        assert road.pose(120.0, -side * 7.0).z == pytest.approx(7.0 * math.sin(0.12))


@pytest.mark.parametrize("text", ["high", "nan", "inf"])
def test_a_height_that_is_no_number_is_refused(text: str, tmp_path: Path) -> None:
    there = maps.convert(hill(tmp_path / "hill.xodr"), tmp_path / "map.osm")
    content = there.path.read_text(encoding="utf-8")
    there.path.write_text(content.replace('k="ele" v="10.0000"', f'k="ele" v="{text}"', 1))
    with pytest.raises(InvalidFile, match=r"ele=.* is no finite number"):
        maps.info(there.path)


def told(difference: maps.MapDifference) -> list[bool]:
    return [bool(difference.lost), bool(difference.gained), bool(difference.connections_lost)]


def test_a_map_is_no_distance_from_itself(source: Path) -> None:
    """Curved and banked: cross sections do not stand upright on the middle of a lane."""
    difference = maps.compare(source, source)
    assert difference.borders.largest < 1e-9 and difference.within == 1.0


def test_what_differs_is_told() -> None:
    one, other = (of_network(xodr.load(LIBRARY / "intersection_four_way.xodr")) for _ in range(2))
    assert compare(one, other).borders.largest < 0.001
    first = next(iter(other.lanes.values()))
    first.left = first.left + np.array([0.0, 0.0, 1.5])
    first.right = first.right + np.array([0.0, 0.0, 1.5])
    first.__dict__.pop("centre", None)
    assert compare(one, other).heights.largest == pytest.approx(1.5)
    source, target = next((lane, name) for lane in other.lanes.values() for name in lane.successors)
    source.successors.remove(target)
    assert compare(one, other).connections_lost == [(source.id, target)]
    assert compare(other, one).connections_gained == [(source.id, target)]
    del other.lanes[target]
    difference = compare(one, other)
    assert list(difference.lost) == [target] and told(compare(other, one)) == [False, True, False]


def test_a_border_that_is_moved_is_measured() -> None:
    one, other = (of_network(xodr.load(LIBRARY / "highway_straight.xodr")) for _ in range(2))
    for lane in other.lanes.values():
        lane.right = lane.right + np.array([0.0, -0.2, 0.0])
        lane.__dict__.pop("centre", None)
    difference = compare(one, other)
    assert difference.borders.largest == pytest.approx(0.2, abs=1e-6)
    assert difference.within == 0.0


# the matrix --------------------------------------------------------------------------------------


def corner(made: LaneMap) -> list[float]:
    projector = Projector.of(made)
    assert projector is not None
    longitude, latitude, _ = projector.to_geodetic(np.array([[10.0, 20.0, 0.0]]))
    return [float(longitude[0]), float(latitude[0])]


def kinds(made: LaneMap) -> list[str]:
    return sorted(lane.type for lane in made.lanes.values())


def same_areas(made: maps.MapConversion) -> bool:
    ours, theirs = (
        [shapely.Polygon(area.outline[:, :2]) for area in one.crosswalks]
        for one in (made.source, made.result)
    )
    pairs = zip(ours, theirs, strict=True)
    close = all(a.symmetric_difference(b).area < 0.01 * a.area for a, b in pairs)
    return len(ours) == 2 and min(area.area for area in ours) > 20.0 and close


def same_signs(made: maps.MapConversion) -> bool:
    """Whether there is one sign, of the same meaning at the same place, that
    holds on as many lanes.
    """
    (ours,), (theirs,) = (
        [signal for signal in one.signals if signal.kind == "sign"]
        for one in (made.source, made.result)
    )
    meaning = [
        (each.type, each.subtype, each.country, each.value, each.unit, len(each.lanes))
        for each in (ours, theirs)
    ]
    turned = math.remainder(ours.heading - theirs.heading, math.tau)
    near = math.dist(ours.place, theirs.place) < 0.05 and abs(turned) < 0.02
    return meaning[0] == meaning[1] and ours.value == 50.0 and near


def same_stop_line(made: maps.MapConversion) -> bool:
    """Whether there is one stop line, at the same place, across one lane."""
    (ours,), (theirs,) = made.source.stop_lines, made.result.stop_lines
    away = shapely.LineString(ours.line).hausdorff_distance(shapely.LineString(theirs.line))
    heights = abs(ours.line[0, 2] - theirs.line[0, 2])
    return len(ours.lanes) == len(theirs.lanes) == 1 and max(away, heights) < 0.05


def same_pole(made: maps.MapConversion) -> bool:
    (ours,), (theirs,) = made.source.poles, made.result.poles
    return ours.height == theirs.height == 4.0 and math.dist(ours.place, theirs.place) < 0.05


def names(made: maps.MapConversion) -> set[str]:
    """Names of lanes in the result: road/section/lane; SUMO has roads and lanes, in a parameter."""
    if made.target_format != "sumo":
        return set(made.result.lanes)
    found = {
        param.get("value") for param in etree.parse(made.path).iterfind(".//param[@key='origId']")
    }
    return {name for name in made.source.lanes if "_".join(name.split("/")[::2]) in found}


CHECKS: dict[str, Callable[[maps.MapConversion], bool]] = {
    "lane borders": lambda made: made.difference.borders.largest < 0.05,
    "centre lines": lambda made: made.difference.centres.largest < 0.05,
    "heights": lambda made: made.difference.heights.largest < 0.05,
    "lane types": lambda made: not made.difference.types,
    "road types": lambda made: {each.road_type for each in made.result.lanes.values()}
    == {each.road_type for each in made.source.lanes.values()},
    "speed limits": lambda made: all(here is None for _, here, _ in made.difference.limits),
    "road marks": lambda made: [each.marks for each in made.result.lanes.values()]
    == [each.marks for each in made.source.lanes.values()],
    "lane links": lambda made: made.difference.connections == 5
    and not made.difference.connections_lost + made.difference.connections_gained,
    "neighbours": lambda made: sum(each.beside[1] is not None for each in made.result.lanes.values())
    >= 4,
    "crosswalks": same_areas,
    "traffic lights": lambda made: sum(each.kind == "light" for each in made.result.signals) == 1,
    "signs": lambda made: same_signs(made),
    "stop lines": same_stop_line,
    "poles": same_pole,
    "other objects": lambda made: "oak" in made.path.read_text(encoding="utf-8"),
    "projection": lambda made: np.allclose(corner(made.result), corner(made.source), atol=1e-7,
        rtol=0.0),
    "offset": lambda made: np.allclose(made.result.offset, made.source.offset),
    "names and ids": lambda made: names(made) == set(made.source.lanes),
}  # fmt: skip
"""What is true of a conversion that keeps a field"""


@pytest.mark.parametrize("target", FATES)
def test_each_format_declares_the_fate_of_each_field(target: str) -> None:
    assert fates.undeclared(MAP_FIELDS, FATES[target]) == []


@pytest.fixture(scope="module")
def made(source: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, maps.MapConversion]:
    """The source in each format; as OpenDRIVE by way of GeoJSON."""
    folder = tmp_path_factory.mktemp("made")
    found = {
        target: maps.convert(source, folder / ENDINGS[target])
        for target in FATES
        if target != "opendrive"
    }
    found["opendrive"] = maps.convert(found["geojson"].path, folder / ENDINGS["opendrive"])
    return found


def same_kinds(made: maps.MapConversion) -> bool:
    """Whether types of road marks are the same, whatever their colours and widths."""
    ours, theirs = (
        Counter(mark[0] for lane in one.lanes.values() for mark in lane.marks)
        for one in (made.source, made.result)
    )
    return ours == theirs


def beside(made: LaneMap) -> int:
    """Number of neighbours that lead the same way."""
    return sum(side is not None and side[1] for lane in made.lanes.values() for side in lane.beside)


def of_type(made: LaneMap, *types: str) -> int:
    return sum(lane.type in types for lane in made.lanes.values())


def plane(made: LaneMap) -> list[float]:
    return [made.offset[index] for index in (0, 1, 3)]


CHANGED: dict[tuple[str, str], Callable[[maps.MapConversion], bool]] = {
    ("opendrive", "road marks"): same_kinds,
    ("opendrive", "neighbours"): lambda made: beside(made.result) == beside(made.source),
    ("opendrive", "rule of traffic"): lambda made: not made.result.left_hand,
    ("opendrive", "names and ids"): lambda made: made.path.read_text().count('name="1/0/') > 0,
    ("lanelet2", "road marks"): same_kinds,
    ("lanelet2", "neighbours"): lambda made: 0 < beside(made.result) <= beside(made.source),
    ("lanelet2", "names and ids"): lambda made: all(
        f'k="name" v="{name}"' in made.path.read_text() for name in made.source.lanes
    ),
    ("sumo", "lane borders"): lambda made: made.difference.borders.largest < 0.05,
    ("sumo", "neighbours"): lambda made: beside(made.result) >= beside(made.source) > 0,
    ("sumo", "traffic lights"): lambda made: [one.kind for one in made.result.signals] == ["light"],
    ("sumo", "offset"): lambda made: plane(made.result) == pytest.approx(plane(made.source)),
    ("sumo", "stop lines"): lambda made: made.result.stop_lines[0].line[:, :2].mean(axis=0)
    == pytest.approx(made.source.stop_lines[0].line[:, :2].mean(axis=0), abs=0.3),
    ("commonroad", "poles"): lambda made: made.result.poles[0].place[:2]
    == pytest.approx(made.source.poles[0].place[:2], abs=1e-3),
    ("commonroad", "lane types"): lambda made: of_type(made.result, "sidewalk", "shoulder")
    == of_type(made.source, "sidewalk", "shoulder", "walking", "stop"),
    ("commonroad", "road types"): lambda made: {one.road_type for one in made.result.lanes.values()}
    <= {"town", "motorway", "rural", "unknown"},
    ("commonroad", "road marks"): same_kinds,
    ("commonroad", "traffic lights"): lambda made: [one.kind for one in made.result.signals]
    == ["light"],
    ("commonroad", "offset"): lambda made: plane(made.result) == pytest.approx(plane(made.source)),
}  # fmt: skip
"""What is true of a conversion that changes a field; junctions have a test of their own"""


@pytest.mark.parametrize("target", FATES)
def test_the_matrix_is_what_is_read_back(target: str, made: dict[str, maps.MapConversion]) -> None:
    """A field that is kept, or changed, is there; one that is lost is not."""

    def holds(check: Callable[[maps.MapConversion], bool]) -> bool:
        try:
            return check(made[target])
        except ValueError:  # not as many of them
            return False

    wrong = []
    for field, fate in FATES[target].items():
        if field in _ELSEWHERE:
            continue
        check = CHANGED.get((target, field), CHECKS[field])
        if fate.outcome == fates.CHANGED:
            check = CHANGED[target, field]
        if holds(check) != (fate.outcome != fates.LOST):
            wrong.append(field)
    assert wrong == []


_ELSEWHERE = {"junctions", "junction priorities", "rule of traffic", "lateral profiles"}
"""Fields of the following tests, and the one that lanes have not"""


@pytest.mark.parametrize("target", ["lanelet2", "sumo", "commonroad", "geojson"])
def test_what_a_format_has_not_is_said_with_the_reason(
    target: str, made: dict[str, maps.MapConversion]
) -> None:
    said = [note for note in made[target].notes if " are left out, " in note]
    lacking = {field for field, fate in FATES[target].items() if fate.outcome == fates.LOST}
    named = {note.partition(" are left out, ")[0] for note in said}
    assert "other objects" in named and named <= lacking
    assert lacking - named <= {"junctions", "junction priorities", "rule of traffic",
                               "lateral profiles", "names and ids"}  # fmt: skip
    assert all(
        note.endswith(f": {FATES[target][note.partition(' are ')[0]].text}") for note in said
    )
    assert any("(tree 1)" in note for note in said)


HALT = (
    '<signal id="7" name="halt" s="20" t="0" zOffset="0" height="0.1" dynamic="no"'
    ' orientation="+" type="{}" subtype="-1" country="DE" value="-1">{}</signal>'
)


@pytest.mark.parametrize("target", FATES)
@pytest.mark.parametrize(
    "signal",
    [
        HALT.format("294", ""),
        HALT.format("77", '<semantics><priority type="stopLine"/></semantics>'),
    ],
    ids=["sign 294", "semantics"],
)
def test_a_signal_that_is_a_stop_line_becomes_one_across_its_lanes(
    target: str, signal: str, tmp_path: Path
) -> None:
    path = tmp_path / "halt.xodr"
    text = straight()
    added = f"</lanes><signals>{signal}</signals>"
    path.write_text(text.replace("</lanes>", added, 1), encoding="utf-8")
    source = of_network(xodr.load(path))
    (stop,) = source.stop_lines
    assert source.signals == [] and len(stop.lanes) > 1
    assert stop.line[:, 0] == pytest.approx(20.0, abs=1e-6)
    if target == "opendrive":
        path = maps.convert(path, tmp_path / "between.geojson").path
    made = maps.convert(path, tmp_path / ENDINGS[target])
    (found,) = made.result.stop_lines
    assert len(found.lanes) == len(stop.lanes)
    assert {tuple(point) for point in np.round(found.line[[0, -1], :2], 1)} == {
        tuple(point) for point in np.round(stop.line[:, :2], 1)
    }


@pytest.mark.parametrize("known", [True, False], ids=["known", "made"])
def test_the_light_of_lanelets_refers_to_its_stop_line(known: bool, tmp_path: Path) -> None:
    """A line that no map has is made, and is none when it is read again."""
    path = tmp_path / "light.xodr"
    line = STOP_LINE if known else ""
    path.write_text(road().replace("</objects>", f"{line}</objects>"), encoding="utf-8")
    there = maps.convert(path, tmp_path / "light.osm")
    root = etree.parse(there.path)
    (ref,) = root.xpath("//relation[tag/@v='traffic_light']/member[@role='ref_line']/@ref")
    tags = {tag.get("k"): tag.get("v") for tag in root.xpath(f"//way[@id='{ref}']/tag")}
    assert tags["type"] == "stop_line"
    assert tags.get("name") == ("1/12" if known else None)
    assert [stop.id for stop in there.result.stop_lines] == (["1/12"] if known else [])


def test_a_pole_of_a_lanelet_map_may_be_a_way_from_foot_to_top(tmp_path: Path) -> None:
    (tmp_path / "map.xodr").write_text(straight(), encoding="utf-8")
    there = maps.convert(tmp_path / "map.xodr", tmp_path / "map.osm")
    nodes = "".join(
        f'<node id="{90000 + n}" lat="0" lon="0"><tag k="local_x" v="30"/><tag k="local_y" v="-20"/>'
        f'<tag k="ele" v="{2 * n}"/></node>'
        for n in (1, 0)
    )
    way = (
        '<way id="95000"><nd ref="90001"/><nd ref="90000"/><tag k="type" v="pole"/>'
        '<tag k="name" v="P"/></way>'
    )
    text = there.path.read_text(encoding="utf-8")
    text = text.replace("<way", f"{nodes}<way", 1).replace("<relation", f"{way}<relation", 1)
    there.path.write_text(text, encoding="utf-8")
    back = maps.convert(there.path, tmp_path / "back.xodr")
    assert [tuple(np.round(pole.place, 3)) for pole in back.result.poles] == [(30.0, -20.0, 0.0)]
    assert [pole.height for pole in back.result.poles] == [2.0]


@pytest.mark.parametrize("target", FATES)
def test_junctions_and_their_priorities_and_the_rule_are_as_the_matrix_says(
    target: str, tmp_path: Path
) -> None:
    def there(path: Path) -> maps.MapConversion:
        between = tmp_path / f"{path.stem}.geojson"
        if target == "opendrive":
            path = maps.convert(path, between, overwrite=True).path
        return maps.convert(path, tmp_path / f"{path.stem}.{ENDINGS[target]}")

    made = there(LIBRARY / "t_junction_two_lanes.xodr")
    outcomes = {field: fate.outcome for field, fate in FATES[target].items()}
    junctions = any(lane.in_junction for lane in made.result.lanes.values())
    assert junctions == (outcomes["junctions"] != fates.LOST)
    assert bool(made.result.priorities) == (outcomes["junction priorities"] == fates.KEPT)
    left = there(hill_map().mirrored().write(tmp_path / "left.xodr"))
    assert left.source.left_hand
    assert left.result.left_hand == (outcomes["rule of traffic"] == fates.KEPT)


@pytest.mark.parametrize("target", ["lanelet2", "commonroad"])
@pytest.mark.parametrize(
    "outline",
    ["", '<outline><cornerLocal u="0" v="0" z="0"/><cornerLocal u="3" v="0" z="0"/></outline>'],
    ids=["no size", "two corners"],
)
def test_a_crosswalk_without_an_area_is_left_out_by_name(
    target: str, outline: str, tmp_path: Path
) -> None:
    source = tmp_path / "line.xodr"
    crossing = f'<object id="10" type="crosswalk" s="80" t="0" zOffset="0">{outline}</object>'
    source.write_text(road().replace("</objects>", f"{crossing}</objects>"), encoding="utf-8")
    made = maps.convert(source, tmp_path / ENDINGS[target])
    assert "crosswalks without an area are left out: 1/10" in made.notes
    assert made.result.crosswalks == []


def test_a_link_that_would_turn_a_road_about_is_left_out_by_name(tmp_path: Path) -> None:
    """Files of others exchange what comes before a lane and what comes after it."""
    there = maps.convert(LIBRARY / "highway_on_ramp.xodr", tmp_path / "map.geojson")
    content = json.loads(there.path.read_text(encoding="utf-8"))
    lanes = [
        item["properties"] for item in content["features"] if "successors" in item["properties"]
    ]
    first, second = next((lane["id"], name) for lane in lanes for name in lane["successors"])
    for lane in lanes:
        lane["successors"] = [first] if lane["id"] == second else []
    there.path.write_text(json.dumps(content), encoding="utf-8")
    made = maps.convert(there.path, tmp_path / "back.xodr")
    assert any(note.endswith(f"behind the end of the one before: {second} to {first}")
               for note in made.notes)  # fmt: skip
    assert made.difference.within > 0.95 and not made.difference.lost


def strips() -> RoadMap:
    """Two linked roads with a sidewalk each, a parking lane that tapers off at
    both ends, a border and a median.
    """
    tapered = (
        Cubic(0.0, 0.0, 0.1, 0.0, 0.0),
        Cubic(20.0, 2.0, 0.0, 0.0, 0.0),
        Cubic(40.0, 2.0, -0.1, 0.0, 0.0),
    )
    kinds = ("median", "driving", "parking", "border", "sidewalk")
    lanes = {
        -number: LaneDesign(
            kind, tapered if kind == "parking" else (Cubic(0.0, 2.0, 0.0, 0.0, 0.0),), "solid",
            -number, -number
        )
        for number, kind in enumerate(kinds, 1)
    }  # fmt: skip
    roads = [
        RoadDesign(
            str(number), "", start, (line(60.0),), (SectionDesign(0.0, lanes, "none"),), "town",
            50 / 3.6,
            predecessor=before, successor=after,
        )
        for number, start, before, after in (
            (1, PlanPose(0.0, 0.0, 0.0), None, RoadLink("road", "2", "start")),
            (2, PlanPose(60.0, 0.0, 0.0), RoadLink("road", "1", "end"), None),
        )
    ]  # fmt: skip
    return RoadMap("strips", tuple(roads))


def test_lanelet2_keeps_sidewalks_linked_and_lanes_without_traffic_as_areas(
    tmp_path: Path,
) -> None:
    source = strips().write(tmp_path / "strips.xodr")
    there = maps.convert(source, tmp_path / "map.osm")
    back = maps.convert(there.path, tmp_path / "back.xodr")
    difference = compare(there.source, back.result)
    assert difference.connections == 5 and difference.connections_lost == []
    assert difference.within > 0.98 and difference.types == [] and difference.lost == {}
    assert there.path.read_text(encoding="utf-8").count('v="multipolygon"') == 6


def sumo_case(tmp_path: Path) -> maps.MapConversion:
    """The strips on a bank, with a sidewalk alone on the other side, as a network of SUMO."""
    walk = LaneDesign("sidewalk", (Cubic(0.0, 2.0, 0.0, 0.0, 0.0),), "solid", 1, 1)
    roads = [
        replace(
            road,
            superelevation=(Cubic(0.0, 0.0, 0.004, 0.0, 0.0), Cubic(30.0, 0.12, 0.0, 0.0, 0.0)),
            sections=tuple(
                replace(section, lanes={**section.lanes, 1: walk}) for section in road.sections
            ),
        )
        for road in strips().roads
    ]
    source = RoadMap("strips", tuple(roads)).write(tmp_path / "strips.xodr")
    return maps.convert(source, tmp_path / "map.net.xml")


def test_a_network_keeps_widths_and_slopes_that_change_and_lanes_without_traffic(
    tmp_path: Path,
) -> None:
    there = sumo_case(tmp_path)
    back = maps.convert(there.path, tmp_path / "back.xodr")
    assert any("SUMO has their mean width" in note for note in there.notes)
    for difference in (there.difference, compare(there.source, back.result)):
        assert difference.within > 0.98 and difference.lost == difference.gained == {}
        assert difference.connections == 6 and difference.connections_lost == []
        assert difference.heights.largest < 0.05 and difference.types == []


@pytest.mark.parametrize("name", ["highway_off_ramp", "highway_on_ramp"])
def test_a_lane_that_ends_or_opens_inside_a_junction_is_an_edge_without_traffic(
    name: str, tmp_path: Path
) -> None:
    """SUMO's ways through junctions lead from lane to lane: this one has none before or after."""
    there = maps.convert(LIBRARY / f"{name}.xodr", tmp_path / "map.net.xml")
    assert any(note.startswith("edges without traffic") and note.endswith(": 101/0/-3")
               for note in there.notes)  # fmt: skip
    back = maps.convert(there.path, tmp_path / "back.xodr")
    for difference in (there.difference, compare(there.source, back.result)):
        assert difference.within > 0.999 and difference.lost == {}
        assert difference.connections == 16 and difference.connections_lost == []
    # Nobody is sent there.
    root = etree.parse(there.path)
    assert root.xpath("//edge[starts-with(@id, 'strip/')]/lane/@disallow") == ["all"]
    assert not root.xpath("//connection[contains(@from, 'strip/') or contains(@to, 'strip/')]")
    drives = maps.drive_connections(there.path)
    assert drives and not [each for each in drives if each.problem]


def test_borders_of_a_lane_that_was_moved_in_a_network_are_left_out(tmp_path: Path) -> None:
    there = sumo_case(tmp_path)
    tree = etree.parse(there.path)
    lane = next(
        lane for lane in tree.iter("lane") if lane.find("param[@key='border.left']") is not None
    )
    lane.set("shape", "0,50 60,50")
    tree.write(there.path)
    made = maps.read_map(there.path)
    assert any(note.endswith(str(lane.get("id"))) and "left out" in note for note in made.notes)
    assert made.lanes[str(lane.get("id"))].centre[:, 1] == pytest.approx(50.0)
    lane.find("param[@key='border.left']").set("value", "0,50,nan 1,2")  # type: ignore[union-attr]
    tree.write(there.path)
    with pytest.raises(InvalidFile, match=r"map.net.xml:\d+: param: value='0,50,nan' is no point"):
        maps.read_map(there.path)


def one_road(plan: tuple[Clothoid, ...], ring: bool, roll: float) -> RoadMap:
    """A road of two lanes, linked to itself or not, that leans to one side (rad)."""
    width = (Cubic(0.0, 3.0, 0.0, 0.0, 0.0),)
    lanes = {-number: LaneDesign("driving", width, "solid", -number, -number) for number in (1, 2)}
    own = [RoadLink("road", "1", at) if ring else None for at in ("end", "start")]
    road = RoadDesign(
        "1", "", PlanPose(0.0, 0.0, 0.0), plan, (SectionDesign(0.0, lanes, "none"),), "town",
        50 / 3.6,
        predecessor=own[0], successor=own[1], superelevation=(Cubic(0.0, roll, 0.0, 0.0, 0.0),),
    )  # fmt: skip
    return RoadMap("one", (road,))


@pytest.mark.parametrize(
    ("made", "links"),
    [
        (one_road((arc(2.0 * math.pi * 40.0, 1 / 40.0),), True, 0.0), 2),
        (one_road((arc(60.0, 1 / 80.0),), False, math.radians(40.0)), 0),
    ],
    ids=["ring", "banked"],
)
def test_a_ring_and_a_steep_bank_come_back_where_they_were(
    made: RoadMap, links: int, tmp_path: Path
) -> None:
    """A ring begins where it ends; lanes on a bank are narrower as seen from above."""
    there = maps.convert(made.write(tmp_path / "one.xodr"), tmp_path / "map.osm")
    back = maps.convert(there.path, tmp_path / "back.xodr")
    difference = compare(there.source, back.result)
    assert difference.within > 0.98 and difference.lost == {}
    assert difference.connections == links and difference.connections_lost == []
    assert difference.heights.most < 0.05


def test_a_lane_that_turns_about_a_border_is_left_out_by_name(tmp_path: Path) -> None:
    """Its border has no length; the file was refused by its own reader."""
    source = one_road((arc(9.0, -1 / 6.0),), False, 0.0).write(tmp_path / "corner.xodr")
    made = maps.convert(source, tmp_path / "map.osm")
    said = "lanes are left out, since a border of them is shorter than 0.1 m: 1/0/-2"
    assert said in made.notes
    assert len(made.source.lanes) == 2 and len(made.result.lanes) == 1


def test_a_border_that_is_short_as_it_is_written_is_left_out_by_name(tmp_path: Path) -> None:
    """Ends nearer than 2 cm are one node: this border of 0.105 m has 0.09 m in the file."""
    source = one_road((arc(0.109, 0.0),), False, 0.0).write(tmp_path / "short.xodr")
    lanes = maps.read_map(source)
    for lane in lanes.lanes.values():
        lane.right = lane.right[0] + np.outer([0.0, 0.09, 0.075], [1.0, 0.0, 0.0])
    content, notes = lanelet2_lanes.write(lanes)
    assert notes[0].startswith("lanes are left out") and b"lanelet" not in content


SHIFT = (Cubic(0.0, 0.0, 0.0, 0.012, -0.00016), Cubic(50.0, 10.0, 0.0, 0.0, 0.0))
BAY = (
    Cubic(0.0, 0.0, 0.0, 0.15, -0.01), Cubic(10.0, 5.0, 0.0, 0.0, 0.0),
    Cubic(70.0, 5.0, 0.0, -0.15, 0.01),
)  # fmt: skip


@pytest.mark.parametrize("kind", ["shift", "bay"])
def test_a_lane_away_from_its_road_comes_back_from_a_network(kind: str, tmp_path: Path) -> None:
    """Its width is along the normals of the road, that of SUMO across the lane."""
    bare = one_road((arc(80.0, 0.0),), False, 0.0).roads[0]
    lanes = dict(bare.sections[0].lanes)
    lanes[-1] = replace(lanes[-1], width=BAY if kind == "bay" else lanes[-1].width)
    section = replace(bare.sections[0], lanes=lanes)
    road = replace(bare, sections=(section,), offset=SHIFT if kind == "shift" else ())
    there = maps.convert(
        RoadMap("away", (road,)).write(tmp_path / "a.xodr"), tmp_path / "a.net.xml"
    )
    back = maps.convert(there.path, tmp_path / "back.xodr")
    difference = compare(there.source, back.result)
    assert there.difference.within == 1.0 and difference.within > 0.98
    assert there.difference.borders.largest < 0.04


@pytest.mark.parametrize("between", ["lanelet2", "geojson", "commonroad"])
def test_a_lane_that_opens_by_a_bend_and_its_counterbend_is_sampled_along_both(
    between: str, tmp_path: Path
) -> None:
    """The middle of such a border lies on the line between its ends, which was taken for it."""
    bare = one_road((arc(80.0, 0.0),), False, 0.0).roads[0]
    lanes = {-1: replace(bare.sections[0].lanes[-1], width=BAY)}
    road = replace(bare, sections=(replace(bare.sections[0], lanes=lanes),))
    source = RoadMap("bay", (road,)).write(tmp_path / "bay.xodr")
    made = maps.convert(source, tmp_path / ENDINGS[between])
    right = next(iter(made.result.lanes.values())).right
    at = np.array([2.0, 5.0, 8.0])
    wide = 0.15 * at**2 - 0.01 * at**3
    assert np.interp(at, right[:, 0], -right[:, 1]) == pytest.approx(wide, abs=0.02)


def test_a_median_beside_shoulders_gets_no_lane_before_it(tmp_path: Path) -> None:
    """The lane that maps of others lack between two is one of traffic."""

    def lane(kind: str, link: int | None) -> LaneDesign:
        return LaneDesign(kind, (Cubic(0.0, 3.0, 0.0, 0.0, 0.0),), "solid", link, link)

    kinds = {-1: "shoulder", -2: "median", -3: "shoulder"}
    sections = (
        SectionDesign(
            0.0, {at: lane("none" if at == -2 else kind, at) for at, kind in kinds.items()}, "none"
        ),
        SectionDesign(30.0, {at: lane(kind, at) for at, kind in kinds.items()}, "none"),
    )
    made = one_road((arc(60.0, 0.0),), False, 0.0)
    made = replace(made, roads=(replace(made.roads[0], sections=sections),))
    there = maps.convert(made.write(tmp_path / "median.xodr"), tmp_path / "map.osm")
    back = maps.convert(there.path, tmp_path / "back.xodr")
    assert there.difference.gained == compare(there.source, back.result).gained == {}


@pytest.mark.parametrize("between", ["lanelet2", "geojson"])
def test_the_right_of_way_is_that_of_the_source(between: str, tmp_path: Path) -> None:
    source = LIBRARY / "t_junction_two_lanes.xodr"
    there = maps.convert(source, tmp_path / ENDINGS[between])
    back = maps.convert(there.path, tmp_path / "back.xodr")
    ranks = [
        {(places(made, high), places(made, low)) for high, low in made.priorities}
        for made in (there.source, there.result, back.result)
    ]
    assert len(ranks[0]) == 12
    assert ranks[0] == ranks[1]
    assert ranks[0] <= ranks[2]  # roads of two lanes are ranked with both


def places(made: LaneMap, name: str) -> tuple[float, ...]:
    """Middles of the ends of a lane, rounded to metres."""
    centre = made.lanes[name].centre
    return tuple(np.round(centre[[0, -1], :2].ravel()).tolist())


STREETS = """<osm version="0.6">
<node id="1" lat="48.1000" lon="11.5000"/><node id="2" lat="48.1000" lon="11.5030"/><node id="3" lat="48.1000" lon="11.5060"/>
<node id="4" lat="48.1020" lon="11.5030"/>
<way id="5"><nd ref="1"/><nd ref="2"/><nd ref="3"/><tag k="highway" v="primary"/><tag k="lanes" v="4"/><tag k="maxspeed" v="70"/></way>
<way id="6"><nd ref="2"/><nd ref="4"/><tag k="highway" v="residential"/></way></osm>"""


def test_openstreetmap_becomes_roads_where_it_is_and_is_said_to_be_rough(tmp_path: Path) -> None:
    source = tmp_path / "streets.osm"
    source.write_text(STREETS, encoding="utf-8")
    made = maps.convert(source, tmp_path / "streets.xodr")
    assert any("netconvert guessed" in note for note in made.notes)
    limits = [lane.limit for lane in made.result.lanes.values() if not lane.in_junction]
    assert any(limit == pytest.approx(70 / 3.6, abs=0.01) for limit in limits)
    projector = Projector.of(made.result)
    assert projector is not None
    (crossing,) = projector.to_map(np.array([[11.5030, 48.1000, 0.0]]))
    points = np.vstack([lane.centre for lane in made.result.lanes.values()])
    assert np.hypot(*(points - crossing)[:, :2].T).min() < 10.0
    assert made.difference.connections > 5 and made.difference.connections_lost == []


def test_a_wrong_map_is_converted_with_remarks(tmp_path: Path) -> None:
    """Bounds exchanged, as a map has them whose axis points down: its lanes make no roads."""
    there = maps.convert(LIBRARY / "roundabout.xodr", tmp_path / "map.xml")
    assert not any("is the source right" in note for note in there.notes)
    text = there.path.read_text(encoding="utf-8")
    for here, other in (
        ("leftBound", "middle"),
        ("rightBound", "leftBound"),
        ("middle", "rightBound"),
    ):
        text = text.replace(f"{here}>", f"{other}>")
    there.path.write_text(text, encoding="utf-8")
    made = maps.convert(there.path, tmp_path / "back.xodr")
    said = " ".join(made.notes)
    count = len(made.source.lanes)
    assert f"lies to the right of the right one on {count} of {count} lanes: 1 2" in said
    assert made.difference.within < 0.9 and f"only {made.difference.within:.1%} of" in said


# files ------------------------------------------------------------------------------------------


def test_a_format_that_is_not_known_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"names end in \.xodr"):
        maps.convert(LIBRARY / "sharp_curve.xodr", tmp_path / "map.shp")
    for name, meant in (("lanelet2", ".osm"), ("sumo", ".net.xml"), ("xord", ".xodr")):
        with pytest.raises(UsageError, match=f"did you mean '{re.escape(meant)}'"):
            maps.convert(LIBRARY / "sharp_curve.xodr", tmp_path / f"map.{name}")
    with pytest.raises(UsageError, match="both opendrive"):
        maps.convert(LIBRARY / "sharp_curve.xodr", tmp_path / "map.xodr")


def test_a_file_in_the_way_stays(tmp_path: Path) -> None:
    (tmp_path / "map.osm").write_text("mine")
    with pytest.raises(UsageError, match="--overwrite"):
        maps.convert(LIBRARY / "sharp_curve.xodr", tmp_path / "map.osm")
    assert (tmp_path / "map.osm").read_text() == "mine"


def net(attributes: str, shape: str = "0,0 10,0") -> str:
    """A network of one lane."""
    lane = f'<lane id="e_0" {attributes} shape="{shape}"/>'
    return (
        '<net><location netOffset="0,0" projParameter="+proj=utm"/><edge '
        f'id="e">{lane}</edge></net>'
    )


def commonroad(height: str) -> str:
    """A map of one lanelet with a light at x = 9."""
    bounds = "".join(
        f"<{side}Bound>{''.join(f'<point><x>{x}</x><y>{y}</y>{height}</point>' for x in (0, 10))}</{side}Bound>"
        for side, y in (("left", 3), ("right", 0))
    )
    lanelet = (
        f'<lanelet id="1">{bounds}<laneletType>urban</laneletType><trafficLightRef '
        'ref="2"/></lanelet>'
    )
    light = (
        '<trafficLight id="2"><position><point><x>9</x><y>0</y></point></position></trafficLight>'
    )
    return f"<commonRoad>{lanelet}{light}</commonRoad>"


_NODES = "".join(
    f"<node id='{number}' lat='{y}e-5' lon='{x}e-5'><tag k='local_x' v='{x}'/>"
    f"<tag k='local_y' v='{y}'/></node>"
    for number, (x, y) in enumerate([(0, 3), (9, 3), (0, 0), (9, 0)], 1)
)
OFFSET_IN_WORDS = (
    f"<osm xosc_projection='+proj=utm +zone=31' xosc_offset='a b c d'>{_NODES}"
    "<way id='5'><nd ref='1'/><nd ref='2'/></way><way id='6'><nd ref='3'/><nd ref='4'/></way>"
    "<relation id='7'><member type='way' ref='5' role='left'/>"
    "<member type='way' ref='6' role='right'/><tag k='type' v='lanelet'/></relation></osm>"
)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        (
            "a.net.xml",
            "<net><edge id='e'><lane id='e_0' shape='0,0 x,1'/></edge></net>",
            "is no point",
        ),
        ("a.net.xml", "<nets/>", "is net"),
        (
            "a.net.xml",
            net("").replace(
                "</edge>", "</edge><edge id='f'><lane id='e_0' shape='0,0 1,1'/></edge>", 1
            ),
            "'e_0' is used twice",
        ),
        ("a.xml", "<commonRoad/>", "no lanelet"),
        ("a.xml", "<other/>", "of no map format"),
        ("a.geojson", "{}", "no GeoJSON"),
        ("a.osm", "<osm><relation id='1'><tag k='type' v='lanelet'/></relation></osm>", "left"),
        ("a.osm", OFFSET_IN_WORDS, "osm: xosc_offset has four numbers: x, y, z and heading"),
        ("a.geojson", "[" * 100_000, "RecursionError"),
        ("a.net.xml", net('index="one"'), "lane: index='one' is no finite number"),
        ("a.net.xml", net('speed="fast"'), "lane: speed='fast' is no finite number"),
        ("a.net.xml", net('width="nan"'), "a.net.xml:1: lane: width='nan' is no finite number"),
        (
            "a.net.xml",
            net('width="1e300"'),
            "lane e_0: a border of the lane has coordinates beyond",
        ),
        ("a.net.xml", net('width="2"', "0,0 9e7,0"), "lanes are longer than 20,000 km"),
        (
            "a.net.xml",
            net("").replace('netOffset="0,0', 'netOffset="a,b'),
            "netOffset='a,b' is no point",
        ),
        (
            "a.net.xml",
            net("").replace('netOffset="0,0', 'netOffset="1e300,0'),
            "the map's offset has numbers beyond 1e\\+08",
        ),
        ("a.xml", commonroad("<z>high</z>"), "a.xml:1: z: 'high' is no measured value"),
        ("a.xml", commonroad("").replace("<x>9", "<x>q"), "x: 'q' is no measured value"),
        (
            "a.xml",
            re.sub("(<lanelet .*</lanelet>)", r"\1\1", commonroad(""), flags=re.DOTALL),
            "is used twice",
        ),
    ],
)
def test_bad_input_is_one_line_with_the_file(
    name: str, text: str, said: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(InvalidFile, match=said) as error:
        maps.read_map(tmp_path / name)
    assert str(tmp_path / name) in str(error.value) and "\n" not in str(error.value)


def test_a_projection_that_is_not_understood_is_left_out(source: Path, tmp_path: Path) -> None:
    """Older maps of CARLA name an origin without a projection."""
    text = source.read_text(encoding="utf-8")
    path = tmp_path / "old.xodr"
    path.write_text(re.sub(r"\+proj=\S+", "", text), encoding="utf-8")
    assert path.read_text(encoding="utf-8") != text
    for target in ("lanelet2", "commonroad", "geojson", "sumo"):
        made = maps.convert(path, tmp_path / ENDINGS[target])
        assert any("is not understood" in note and "left out" in note for note in made.notes)
        assert made.result.projection is None and made.difference.within > 0.99


def test_lanes_wider_than_the_earth_are_refused(tmp_path: Path) -> None:
    """They were compared every metre: of a width of 1e11 m that filled the memory."""
    text = (LIBRARY / "roundabout.xodr").read_text()
    (tmp_path / "wide.xodr").write_text(re.sub(r'(<width[^>]*) a="[^"]*"', r'\1 a="1e11"', text))
    with pytest.raises(InvalidFile, match=r"wide.xodr: lane .*: a border of the lane has"):
        maps.convert(tmp_path / "wide.xodr", tmp_path / "map.geojson")


def test_the_same_map_gives_the_same_bytes(source: Path, tmp_path: Path) -> None:
    for ending in ENDINGS.values():
        if ending != "map.xodr":
            for folder in ("a", "b"):
                maps.convert(source, tmp_path / folder / ending)
            assert (tmp_path / "a" / ending).read_bytes() == (tmp_path / "b" / ending).read_bytes()


# parts, repairs, drives --------------------------------------------------------------------------


def test_a_part_is_closed_and_can_be_loaded(tmp_path: Path) -> None:
    content, notes = maps.cut_roads(LIBRARY / "roundabout.xodr", box=(-60.0, -60.0, 0.0, 60.0))
    (tmp_path / "part.xodr").write_bytes(content)
    part, whole = (
        xodr.load(tmp_path / "part.xodr", strict=True),
        xodr.load(LIBRARY / "roundabout.xodr"),
    )
    assert 0 < len(part.roads) < len(whole.roads)
    assert any("roads are left out" in note for note in notes)
    for path in ("sharp_curve", "roundabout"):
        with pytest.raises(UsageError, match="no road"):
            maps.cut_roads(LIBRARY / f"{path}.xodr", box=(9e5, 9e5, 9e5 + 1, 9e5 + 1))


def test_faults_with_one_mend_are_mended_by_name(tmp_path: Path) -> None:
    text = (LIBRARY / "sharp_curve.xodr").read_text()
    broken = tmp_path / "broken.xodr"
    broken.write_text(text.replace('elementType="road"', "").replace("<line/>", "<line/>"))
    shutil.copy(LIBRARY / "sharp_curve.xodr", tmp_path / "sound.xodr")
    assert maps.repair(tmp_path / "sound.xodr").remarks == []
    start = text.index("<header")
    broken.write_text(text[:start] + text[text.index(">", start) + 1 :])
    made = maps.repair(broken)
    assert made.remarks and "header" in made.remarks[0]
    (tmp_path / "mended.xodr").write_bytes(made.content)
    xodr.load(tmp_path / "mended.xodr", strict=True)


@pytest.mark.parametrize(("apart", "linked"), [(0.9, True), (1.1, False)])
def test_lanes_whose_ends_lie_apart_are_linked_up_to_a_metre(
    apart: float, linked: bool, tmp_path: Path
) -> None:
    """Ways through SUMO's junctions do not end across the lanes that they lead into."""
    made = maps.read_map(LIBRARY / "roundabout.xodr")
    lane = next(lane for lane in made.lanes.values() if len(lane.successors) == 1)
    lane.right[-1, 0] += apart
    content, notes = lanelet2_lanes.write(made)
    (tmp_path / "map.osm").write_bytes(content)
    lost = compare(made, maps.read_map(tmp_path / "map.osm")).connections_lost
    assert lost == ([] if linked else [(lane.id, lane.successors[0])])
    assert any("their lanes end more than 1 m apart" in note for note in notes) is not linked


def test_a_long_border_whose_end_is_moved_turns_in_its_last_metres(tmp_path: Path) -> None:
    """All 80 m of it turned, and two thirds of the lanes of an intersection were elsewhere."""
    made = maps.read_map(LIBRARY / "intersection_four_way.xodr")
    lane = next(
        lane for lane in made.lanes.values() if lane.length > 40.0 and len(lane.successors) == 3
    )
    lane.right[-1, :2] += 0.9 * (lane.left[-1] - lane.right[-1])[:2] / 3.5
    content, _ = lanelet2_lanes.write(made)
    (tmp_path / "map.osm").write_bytes(content)
    difference = compare(made, maps.read_map(tmp_path / "map.osm"))
    assert difference.connections_lost == [] and difference.within > 0.97


def test_a_network_of_places_that_are_no_numbers_is_not_driven(
    tmp_path: Path, command: Command
) -> None:
    """SUMO goes by the lengths of its lanes, and drives on it."""
    net = maps.convert(LIBRARY / "intersection_four_way.xodr", tmp_path / "map.net.xml").path
    text = net.read_text(encoding="utf-8")
    net.write_text(re.sub('shape="[^,]*,', 'shape="nan,', text), encoding="utf-8")
    answer = command("xosc-road", "drive", net)
    assert answer.code == 3 and "is no point" in answer.err and answer.err.count("\n") == 1


def test_each_connection_is_driven_and_a_broken_one_is_named(tmp_path: Path) -> None:
    net = maps.convert(LIBRARY / "intersection_four_way.xodr", tmp_path / "map.net.xml").path
    drives = maps.drive_connections(net)
    assert len(drives) == 12 and not [each for each in drives if each.problem]
    text = net.read_text(encoding="utf-8").replace('cont="0"', 'cont="nan"')
    net.write_text(text, encoding="utf-8")
    with pytest.raises(InvalidFile, match="SUMO does not load this network"):
        maps.drive_connections(net)


def test_the_page_and_the_picture_have_all_lanes(tmp_path: Path) -> None:
    from xodr.formats.maps.page import MapFinding, write_page, write_picture

    made = of_network(xodr.load(LIBRARY / "roundabout.xodr"))
    page = write_page(made, [MapFinding(1.0, 2.0, "a <fault>")]).decode()
    assert all(lane in page for lane in made.lanes)
    assert "a &lt;fault&gt;" in page and "http" not in page
    write_picture(made, str(tmp_path / "map.png"))
    assert (tmp_path / "map.png").stat().st_size > 10_000


def test_faults_are_shown_where_their_road_is(tmp_path: Path) -> None:
    path = tmp_path / "faults.xodr"
    text = straight()
    signal = (
        '<signal id="7" name="" s="{}" t="0" zOffset="0" dynamic="no" orientation="+" type="206"'
        ' subtype="-1" country="DE" value="-1"/>'
    )
    signals = signal.format(20) + signal.format(70)
    text = text.replace("</lanes>", f"</lanes><signals>{signals}</signals>", 1)
    path.write_text(text.replace('revMinor="7"', 'revMinor="9"'), encoding="utf-8")
    located, _ = maps.faults(path)
    places = [(finding.x, finding.text) for finding in located if "id '7'" in finding.text]
    assert [x for x, _ in places] == [pytest.approx(70.0, abs=1e-6)]
    assert places[0][1].startswith("line ")


def test_info_says_what_is_there(source: Path) -> None:
    about = maps.info(source)
    assert (about.roads, about.junctions, about.lanes) == (2, 0, 10)
    assert about.signals == {"light": 1, "sign": 1}
    assert about.corner == pytest.approx((48.09, 11.55), abs=0.1)
    assert about.limited.keys() == about.limits.keys()
    assert {road for roads in about.limited.values() for road in roads} == set(
        xodr.load(source).roads
    )
    assert sum(about.lengths.values()) == pytest.approx(sum(
        lane.length for lane in of_network(xodr.load(source)).lanes.values()))  # fmt: skip


@pytest.mark.parametrize("call", ["convert", "show"])
def test_the_command_replaces_a_file_when_it_is_asked_to(
    call: str, tmp_path: Path, command: Command
) -> None:
    out = tmp_path / {"convert": "map.geojson", "show": "map.html"}[call]
    out.write_text("mine")
    asked = ("xosc-road", call, LIBRARY / "sharp_curve.xodr", "--out", out)
    refused = command(*asked)
    assert refused.code == 2 and "--overwrite replaces it" in refused.err
    assert out.read_text() == "mine"
    assert command(*asked, "--overwrite").code == 0
    assert out.stat().st_size > 1000
