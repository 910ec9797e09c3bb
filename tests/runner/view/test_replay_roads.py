"""Roads as replays draw them: surfaces of the right size, marks where the file has them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from shapely.geometry import LineString, Polygon

import xodr
from runner.view.replay.scene_roads import Area, Marks, marks, objects, signals, surfaces
from xodr.graph.network import RoadNetwork

EVERYWHERE = Area(-1e6, -1e6, 1e6, 1e6)


def road(
    folder: Path, marks_of_center: str, marks_of_right: str, more: str = "", line: str = "<line/>"
) -> RoadNetwork:
    """A road of 100 m, from the origin along x, with a lane of 3 m on each side,
    the right one a shoulder.
    """
    lane = (
        '<lane id="{0}" type="{1}" level="false"><width sOffset="0" a="3" b="0" c="0" '
        'd="0"/>{2}</lane>'
    )
    (folder / "road.xodr").write_text(
        '<OpenDRIVE><header revMajor="1" revMinor="6"/><road name="" length="100" id="1" '
        'junction="-1">'
        '<planView><geometry s="0" x="0" y="0" hdg="0" '
        f'length="100">{line}</geometry></planView><lanes><laneSection s="0">'
        f"<left>{lane.format(1, 'driving', '')}</left>"
        f'<center><lane id="0" type="none" level="false">{marks_of_center}</lane></center>'
        f"<right>{lane.format(-1, 'shoulder', marks_of_right)}</right></laneSection></lanes>{more}</road></OpenDRIVE>"
    )
    return xodr.load(folder / "road.xodr")


def test_surfaces_have_the_size_of_their_lanes(tmp_path: Path) -> None:
    found = surfaces(road(tmp_path, "", ""), EVERYWHERE)
    assert sorted(found) == ["road", "shoulder"]
    for rings in found.values():
        assert sum(Polygon(ring).area for ring in rings) == pytest.approx(300.0)
    assert np.all(found["road"][0][:, 1] >= 0.0)


def test_what_is_far_away_is_left_out(tmp_path: Path) -> None:
    near = Area(20.0, -100.0, 50.0, 100.0)
    network = road(tmp_path, '<roadMark sOffset="0" type="solid"/>', "")
    assert sum(Polygon(ring).area for ring in surfaces(network, near)["road"]) == pytest.approx(
        90.0
    )
    assert all(
        line[:, 0].min() >= 20.0 and line[:, 0].max() <= 50.0
        for lines in marks(network, near).values()
        for line in lines
    )
    assert surfaces(network, Area(500.0, 0.0, 600.0, 10.0))["road"] == []


def test_marks_have_their_pattern_colour_width_and_place(tmp_path: Path) -> None:
    center = '<roadMark sOffset="0" type="solid broken" color="yellow" width="0.2"/>'
    right = (
        '<roadMark sOffset="0" type="broken"/><roadMark sOffset="40" type="none"/><roadMark '
        'sOffset="60" type="curb"/>'
    )
    found = {
        (look.pattern, look.colour, look.width): lines
        for look, lines in marks(road(tmp_path, center, right), EVERYWHERE).items()
    }
    (solid,), (dashed,) = found["solid", "yellow", 0.2], found["broken", "yellow", 0.2]
    assert solid[0] == pytest.approx(
        [0.0, 0.2, 0.0]
    )  # on the centre line the left one is named first
    assert dashed[0] == pytest.approx([0.0, -0.2, 0.0])
    (first,), (second,) = found["broken", "standard", 0.12], found["solid", "standard", 0.12]
    assert LineString(first).equals(LineString([(0, -3), (40, -3)]))
    assert LineString(second).equals(LineString([(60, -3), (100, -3)]))


def test_borders_without_marks_are_shown_as_such(tmp_path: Path) -> None:
    assert {
        look.pattern: len(lines)
        for look, lines in marks(road(tmp_path, "", ""), EVERYWHERE).items()
    } == {"unmarked": 3}
    none, late = '<roadMark sOffset="0" type="none"/>', '<roadMark sOffset="60" type="solid"/>'
    found = {
        look.pattern: lines for look, lines in marks(road(tmp_path, none, late), EVERYWHERE).items()
    }
    assert sorted(np.ptp(line[:, 0]) for line in found["unmarked"]) == [60.0, 100.0, 100.0]
    assert [np.ptp(line[:, 0]) for line in found["solid"]] == [40.0]


def test_bends_are_smooth_and_hills_keep_their_heights(tmp_path: Path) -> None:
    """Borders of a lane have as many points; chords stay within 3 cm of a bend
    of 15 m and of a parabola of heights.
    """
    hill = '<elevationProfile><elevation s="0" a="2" b="0.05" c="-0.001" d="0"/></elevationProfile>'
    hill += '<lateralProfile><superelevation s="0" a="0.03" b="0" c="0" d="0"/></lateralProfile>'
    network = road(tmp_path, "", "", hill, '<arc curvature="0.0666666667"/>')
    (ring,) = surfaces(network, EVERYWHERE)["shoulder"]
    inner, outer = ring[: len(ring) // 2], ring[len(ring) // 2 :][::-1]
    for border, radius, lower in ((inner, 15.0, 0.0), (outer, 18.0, 0.09)):
        middles = (border[1:] + border[:-1]) / 2
        assert np.hypot(middles[:, 0], middles[:, 1] - 15.0) == pytest.approx(radius, abs=0.03)
        s = 15.0 * np.unwrap(np.arctan2(middles[:, 0], 15.0 - middles[:, 1]))
        assert middles[:, 2] == pytest.approx(2.0 + 0.05 * s - 0.001 * s**2 - lower, abs=0.03)
    assert len(inner) == len(outer) < 100


def test_objects_stand_where_and_as_they_are(tmp_path: Path) -> None:
    outline = "".join(
        f'<cornerLocal u="{u}" v="{v}" z="0"/>' for u, v in ((2, 1), (-2, 1), (-2, -1), (2, -1))
    )
    more = (
        '<objects><object id="1" type="crosswalk" s="10" t="0" '
        f'hdg="{math.pi / 2}"><outline>{outline}</outline></object>'
        '<object id="2" type="pole" s="20" t="5" radius="0.5" height="6" zOffset="1.5"/>'
        '<object id="3" type="tree" s="30" t="5"/></objects>'
        '<signals><signal id="7" s="40" t="-4" dynamic="yes" name="light" zOffset="3" '
        'orientation="+"/></signals>'
    )
    network = road(tmp_path, "", "", more)
    found = objects(network, EVERYWHERE)
    ((crosswalk, flat),) = found["crosswalk"]
    assert (crosswalk.min(axis=0), crosswalk.max(axis=0)) == (
        pytest.approx([9.0, -2.0, 0.0]),
        pytest.approx([11.0, 2.0, 0.0]),
    )
    ((pole, tall),) = found["pole"]
    assert pole.mean(axis=0) == pytest.approx([20.0, 5.0, 1.5])
    assert np.hypot(*(pole[:, :2] - (20.0, 5.0)).T) == pytest.approx(np.full(len(pole), 0.5))
    ((tree, usual),) = found["tree"]
    assert len(tree) > 2
    assert (flat, tall, usual) == (0.0, 6.0, 5.0)
    (light,) = signals(network, EVERYWHERE)
    assert light == {
        "id": "7",
        "x": 40.0,
        "y": -4.0,
        "z": 0.0,
        "name": "light",
        "dynamic": True,
    } | {
        "up": 3.0,
        "type": "",
        "h": pytest.approx(math.pi),
        "both": False,
    }
    assert objects(network, Area(0, 0, 5, 5)) == {}
    assert signals(network, Area(0, 0, 5, 5)) == []


def test_bridges_have_parapets_and_tunnels_walls_beside_the_stretch_that_they_cover(
    tmp_path: Path,
) -> None:
    more = (
        '<objects><bridge id="b" s="10" length="20" type="steel"/><tunnel id="t" s="60" '
        'length="80" type="standard"/></objects>'
    )
    found = objects(road(tmp_path, "", "", more), EVERYWHERE)
    assert [(round(float(block.ring[:, 0].min())), block.height) for block in found["barrier"]] == [
        (10, 1.0), (10, 1.0), (60, 4.7), (60, 4.7),
    ]  # fmt: skip
    assert all(np.abs(block.ring[:, 1]).min() == pytest.approx(3.0) for block in found["barrier"])
    (covered,) = found["covered"]
    assert Polygon(covered.ring).bounds == pytest.approx((60.0, -3.0, 100.0, 3.0)), (
        "it ends with the road"
    )


def test_a_cross_path_is_a_crosswalk_and_the_boundary_of_its_junction_a_closed_line() -> None:
    network = xodr.load(Path(__file__).parents[2] / "conformance" / "roads" / "crosswalk.xodr")
    (block,) = objects(network, EVERYWHERE)["crosswalk"]
    assert block.height == 0.0
    assert Polygon(block.ring[:, :2]).equals(
        Polygon([(49, -4.5), (51, -4.5), (51, 4.5), (49, 4.5)])
    )
    assert "crosswalk" not in objects(network, Area(0.0, -10.0, 30.0, 10.0))
    edges = marks(network, EVERYWHERE)[Marks("unmarked", "standard", 0.12)]
    (boundary,) = [Polygon(line[:, :2]) for line in edges if np.array_equal(line[0], line[-1])]
    assert boundary.equals(Polygon([(40, -5.5), (60, -5.5), (60, 5.5), (40, 5.5)]))
    assert boundary.exterior.is_ccw and boundary.exterior.length == pytest.approx(62.0)


def test_temporary_marks_are_yellow_and_lie_above_the_permanent_ones(tmp_path: Path) -> None:
    works = (
        '<lanes layer="temporary"><laneSection s="40" length="20">'
        '<center><lane id="0"><roadMark sOffset="0" type="none"/></lane></center>'
        '<right><lane id="-1" type="driving"><width sOffset="0" a="2.5" b="0" c="0" d="0"/>'
        '<roadMark sOffset="0" type="solid" color="standard"/></lane></right></laneSection></lanes>'
    )
    solid = '<roadMark sOffset="0" type="solid" color="{}"/>'
    network = road(tmp_path, solid.format("white"), solid.format("yellow"), works)
    found = marks(network, EVERYWHERE)
    assert [look.colour for look in found if look.pattern == "solid"] == ["white", "yellow"]
    yellow = found[next(look for look in found if look.colour == "yellow")]
    assert sorted((line[0, 0], line[-1, 0], line[0, 1]) for line in yellow) == [
        (0.0, 100.0, -3.0),
        (40.0, 60.0, -2.5),
    ]
    assert sum(
        Polygon(ring).area for ring in surfaces(network, EVERYWHERE)["shoulder"]
    ) == pytest.approx(300.0)
