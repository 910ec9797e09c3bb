"""OpenDRIVE files placed elsewhere, joined, and cut along a route: places on
earth, ids and links are what they were.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import xodr
from schemas.common.array_types import FloatArray
from schemas.common.errors import InvalidFile, Unsupported, UsageError
from tests.runner.matrix_case import road
from xodr.formats.maps import files as maps
from xodr.graph.network import RoadNetwork
from xodr.lookup.geo import GeoReference

LIBRARY = Path(xodr.__file__).parent / "library"
TMERC = "+proj=tmerc +lat_0=48.1 +lon_0=11.5 +datum=WGS84 +units=m +no_defs"


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two linked roads on a projection with an offset that turns, with heights."""
    path = tmp_path_factory.mktemp("map") / "source.xodr"
    path.write_text(road(), encoding="utf-8")
    return path


def written(content: bytes, path: Path) -> RoadNetwork:
    path.write_bytes(content)
    return xodr.load(path, strict=True)


def on_earth(network: RoadNetwork) -> FloatArray:
    places = GeoReference(network)
    return np.array(
        [places.to_geodetic(*pose(network, name)[:3]) for name in sorted(network.roads)]
    )


def pose(network: RoadNetwork, name: str) -> tuple[float, ...]:
    there = network.roads[name].pose(17.0, -2.0)
    return there.x, there.y, there.z, there.h


MOVES = st.floats(-5e3, 5e3)


@settings(max_examples=15, deadline=None)
@given(
    move=st.tuples(MOVES, MOVES, st.floats(-50, 50)),
    turn=st.floats(-4, 4),
    about=st.tuples(MOVES, MOVES),
)
def test_a_moved_map_stays_where_it_is_on_earth(
    source: Path, tmp_path_factory: pytest.TempPathFactory,
    move: tuple[float, float, float], turn: float, about: tuple[float, float],
) -> None:  # fmt: skip
    content, _ = maps.place_map(source, move=move, turn=turn, about=about)
    moved = written(content, tmp_path_factory.mktemp("moved") / "moved.xodr")
    there, here = on_earth(moved), on_earth(xodr.load(source))
    assert np.abs(there[:, :2] - here[:, :2]).max() < 1e-9
    assert np.abs(there[:, 2] - here[:, 2]).max() < 1e-6
    old, new = (pose(each, "1") for each in (xodr.load(source), moved))
    assert math.remainder(new[3] - old[3] - turn, math.tau) == pytest.approx(0.0, abs=1e-9)
    assert new[2] - old[2] == pytest.approx(move[2], abs=1e-9)


def test_elsewhere_moves_it_on_earth(source: Path, tmp_path: Path) -> None:
    content, _ = maps.place_map(source, move=(100.0, 0.0, 0.0), elsewhere=True)
    moved = written(content, tmp_path / "moved.xodr")
    assert moved.header == xodr.load(source).header
    assert pose(moved, "1")[0] == pytest.approx(pose(xodr.load(source), "1")[0] + 100.0)


def test_without_offset_coordinates_are_those_of_the_projection(
    source: Path, tmp_path: Path
) -> None:
    content, _ = maps.place_map(source, move=(7.0, -3.0, 2.0), turn=1.0, without_offset=True)
    plain = written(content, tmp_path / "plain.xodr")
    assert plain.header.offset == (0.0, 0.0, 0.0, 0.0)
    assert np.abs(on_earth(plain) - on_earth(xodr.load(source))).max() < 1e-6
    assert 689_000 < pose(plain, "1")[0] < 691_000


def test_another_projection_says_what_does_not_fit(source: Path, tmp_path: Path) -> None:
    content, notes = maps.place_map(source, projection=TMERC)
    made = written(content, tmp_path / "made.xodr")
    assert made.geo_reference == TMERC
    rest = float(notes[0].split("within ")[1].split()[0])
    assert 0.0 < rest < 0.05
    apart = np.abs(on_earth(made)[:, :2] - on_earth(xodr.load(source))[:, :2]).max()
    assert apart * 111_000 < 2 * rest + 1e-3


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"projection": "+proj=nonsense"}, "is not understood"),
        ({"turn": math.nan}, "finite"),
        ({"move": (math.inf, 0.0, 0.0)}, "finite"),
    ],
)
def test_a_place_without_meaning_is_refused(
    settings: dict[str, object], said: str, source: Path
) -> None:
    with pytest.raises(UsageError, match=said):
        maps.place_map(source, **settings)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="names no projection"):
        maps.place_map(LIBRARY / "sharp_curve.xodr", projection=TMERC)


def test_a_surface_in_its_own_coordinates_is_refused_by_line(source: Path, tmp_path: Path) -> None:
    path = tmp_path / "surface.xodr"
    surface = (
        '<surface>\n<CRG file="a.crg" sStart="0" sEnd="9" orientation="same" '
        'mode="global"/></surface>'
    )
    path.write_text(source.read_text().replace("</road>", f"{surface}</road>", 1))
    with pytest.raises(Unsupported, match=r"surface\.xodr:\d+: .*mode='global'"):
        maps.place_map(path, turn=1.0)


@pytest.mark.parametrize("work", [lambda path: maps.place_map(path, move=(1.0, 2.0, 3.0)),
                                  lambda path: maps.join_maps([path, path])])  # fmt: skip
def test_bounds_that_are_no_numbers_are_refused_by_line(
    work: Callable[[Path], object], tmp_path: Path
) -> None:
    text = (LIBRARY / "narrow_road.xodr").read_text(encoding="utf-8")
    bounds = '<header west="abc" south="0" east="9" north="9" '
    path = tmp_path / "a.xodr"
    path.write_text(text.replace("<header ", bounds, 1), encoding="utf-8")
    with pytest.raises(InvalidFile, match=r"a\.xodr:3: header: west='abc' is not a number"):
        work(path)


def test_grids_of_heights_that_are_no_numbers_are_refused_by_line(tmp_path: Path) -> None:
    text = (LIBRARY / "roundabout.xodr").read_text(encoding="utf-8")
    grid = '<elevationGrid><elevation center="1 x"/></elevationGrid></junction>'
    path = tmp_path / "a.xodr"
    path.write_text(text.replace("</junction>", grid, 1), encoding="utf-8")
    with pytest.raises(InvalidFile, match=r"elevation: center='1 x': numbers are expected"):
        maps.place_map(path, move=(0.0, 0.0, 3.0))


def test_roads_without_heights_and_signals_rise_with_the_map(tmp_path: Path) -> None:
    text = (LIBRARY / "sharp_curve.xodr").read_text()
    assert "<elevation " not in text
    content, notes = maps.place_map(LIBRARY / "sharp_curve.xodr", move=(0.0, 0.0, 12.5))
    made = written(content, tmp_path / "made.xodr")
    assert made.roads["1"].pose(700.0).z == 12.5
    assert notes == ["the file names no projection: it has no place on earth"]


def test_namespaces_of_newer_files_stay(source: Path, tmp_path: Path) -> None:
    path = tmp_path / "named.xodr"
    named = '<OpenDRIVE xmlns="http://code.asam.net/simulation/standard/opendrive_schema/">'
    path.write_text(source.read_text().replace("<OpenDRIVE>", named))
    assert xodr.load(path).roads.keys() == {"1", "2"}
    for content, count in (
        (maps.cut_roads(path, roads=["1"])[0], 1),
        (maps.place_map(path, move=(1.0, 0.0, 0.0))[0], 2),
        (maps.repair(path).content, 2),
        (maps.join_maps([path, LIBRARY / "sharp_curve.xodr"])[0], 3),
    ):
        assert len(written(content, tmp_path / "made.xodr").roads) == count
        assert named.encode() in content and b'xmlns=""' not in content


# joined -----------------------------------------------------------------------------------------


def test_parts_of_a_map_joined_are_the_map(source: Path, tmp_path: Path) -> None:
    whole = xodr.load(source)
    for name in ("1", "2"):
        (tmp_path / f"{name}.xodr").write_bytes(maps.cut_roads(source, roads=[name])[0])
    content, notes = maps.join_maps([tmp_path / "1.xodr", tmp_path / "2.xodr"])
    joined = written(content, tmp_path / "joined.xodr")
    assert notes == ["1 pairs of open ends are linked"]
    assert joined.roads["1"].successor == whole.roads["1"].successor
    assert joined.roads["2"].predecessor == whole.roads["2"].predecessor
    for lane in whole.roads["1"].lane_ids(0.0):
        for forward in (True, False):
            assert joined.links("1", lane, forward) == whole.links("1", lane, forward)


def test_a_map_in_another_projection_is_moved_to_the_first(source: Path, tmp_path: Path) -> None:
    one, two = tmp_path / "1.xodr", tmp_path / "2.xodr"
    one.write_bytes(maps.cut_roads(source, roads=["1"])[0])
    two.write_bytes(maps.cut_roads(source, roads=["2"])[0])
    two.write_bytes(maps.place_map(two, move=(900.0, 50.0, 3.0), turn=0.7, without_offset=True)[0])
    content, notes = maps.join_maps([one, two])
    joined = written(content, tmp_path / "joined.xodr")
    assert "moved to the coordinates of 1.xodr" in notes[0]
    assert pose(joined, "2") == pytest.approx(pose(xodr.load(source), "2"), abs=1e-6)
    assert joined.roads["1"].successor == xodr.load(source).roads["1"].successor


def test_ids_in_use_become_others_with_all_that_names_them(tmp_path: Path) -> None:
    path = LIBRARY / "intersection_four_way.xodr"
    aside = tmp_path / "aside.xodr"
    aside.write_bytes(maps.place_map(path, move=(5000.0, 0.0, 0.0))[0])
    content, notes = maps.join_maps([path, aside])
    joined, one = written(content, tmp_path / "joined.xodr"), xodr.load(path)
    assert len(joined.roads) == 2 * len(one.roads)
    assert len(joined.junctions) == 2 * len(one.junctions)
    assert any("ids of road elements are in use" in note for note in notes)
    made = maps.read_map(tmp_path / "joined.xodr")
    links = sum(len(lane.successors) for lane in made.lanes.values())
    assert links == 2 * sum(len(lane.successors) for lane in maps.read_map(path).lanes.values())
    signals = [s.id for each in joined.roads.values() for s in each.signals]
    assert len(signals) == len(set(signals))
    assert maps.join_maps([path, aside])[0] == content


def test_ends_that_meet_several_stay_open(tmp_path: Path) -> None:
    path = LIBRARY / "highway_straight.xodr"
    length = xodr.load(path).roads["1"].length
    onward = tmp_path / "onward.xodr"
    onward.write_bytes(maps.place_map(path, move=(length, 0.0, 0.0))[0])
    joined = written(maps.join_maps([path, onward])[0], tmp_path / "joined.xodr")
    assert joined.roads["1"].successor is not None and joined.links("1", -1, True)
    content, notes = maps.join_maps([path, onward, onward])
    assert written(content, tmp_path / "several.xodr").roads["1"].successor is None
    assert "would need a junction" in notes[-1] and "0 pairs" in notes[-2]


def test_opposite_traffic_is_not_linked(tmp_path: Path) -> None:
    """A carriageway of one direction, turned about: borders meet, and traffic would meet too."""
    path = LIBRARY / "highway_straight.xodr"
    one = xodr.load(path).roads["1"]
    assert {one.direction(lane) for lane in one.lane_ids(0.0)} == {1}
    driven = [lane for lane in one.lane_ids(0.0) if one.lane_type(0.0, lane) == "driving"]
    border = -sum(one.lane_width(0.0, lane) for lane in driven)
    turned = tmp_path / "turned.xodr"
    move = (2 * one.length, border, 0.0)
    turned.write_bytes(maps.place_map(path, turn=math.pi, move=move)[0])
    content, _ = maps.join_maps([path, turned])
    joined = written(content, tmp_path / "joined.xodr")
    assert driven and not any(joined.links("1", lane, True) for lane in driven)


def test_a_join_of_one_is_refused() -> None:
    with pytest.raises(UsageError, match="two maps or more"):
        maps.join_maps([LIBRARY / "sharp_curve.xodr"])


# cut along a route --------------------------------------------------------------------------------


def test_the_roads_of_a_route_are_cut_out(tmp_path: Path) -> None:
    path = LIBRARY / "intersection_four_way.xodr"
    whole = xodr.load(path)
    arms = sorted(name for name, each in whole.roads.items() if each.junction_id is None)
    content, _ = maps.cut_roads(path, route=arms[:2])
    part = written(content, tmp_path / "part.xodr")
    assert set(arms[:2]) < set(part.roads) and len(part.roads) == 3
    for route, said in ((arms[:1], "two roads or more"), (["nowhere", arms[0]], "no road")):
        with pytest.raises(UsageError, match=said):
            maps.cut_roads(path, route=route)
