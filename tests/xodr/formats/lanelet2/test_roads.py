"""Roads made of lanelets: right lanes at the right places, joined without gaps
or kinks, every connection kept.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import libsumo
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import schemas
import xodr
from schemas.common.errors import UsageError
from tests.xodr.formats.lanelet2.lanelet_maps import (
    WIDTH,
    LaneletMap,
    fork,
    four_way,
    merge,
    ring,
    straight,
    turn,
    two_lanes,
)
from xodr.formats import sumo_net
from xodr.formats.lanelet2 import Conversion, Lanelet, LaneletNeighbour, build, convert
from xodr.formats.lanelet2.conversion import deviation
from xodr.formats.lanelet2.lanelet import CrossLine, headings, winds
from xodr.formats.lanelet2.reader import read_lanelets
from xodr.formats.lanelet2.shapes import BorderCrossing, Mouth, shape

MAPS: dict[str, Callable[[], LaneletMap]] = {
    "two lanes": two_lanes,
    "fork": fork,
    "merge": merge,
    "four-way junction": four_way,
    "ring": ring,
}
every_map = pytest.mark.parametrize("name", MAPS)


@pytest.fixture(autouse=True)
def cache_folder(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XOSC_CACHE_DIR", str(tmp_path_factory.getbasetemp() / "cache"))


def converted(made: LaneletMap, folder: Path) -> tuple[Conversion, xodr.RoadNetwork]:
    conversion = convert(made.write(folder), None, folder / "map.xodr")
    return conversion, xodr.load(conversion.path)


@every_map
def test_maps_are_valid_and_where_they_were(name: str, tmp_path: Path) -> None:
    conversion, _ = converted(MAPS[name](), tmp_path)
    assert schemas.check(conversion.path) == []
    assert conversion.deviation < 0.15


@every_map
def test_every_connection_of_lanelets_is_one_of_lanes(name: str, tmp_path: Path) -> None:
    conversion, network = converted(MAPS[name](), tmp_path)
    lanelets = read_lanelets(tmp_path / "map.osm", None).lanes
    pairs = [
        (last_part(conversion, one.id), conversion.lanelets[other])
        for one in lanelets
        for other in one.successors
    ]
    assert pairs or name == "two lanes"
    for (road, lane), target in pairs:
        assert (road, lane) == target or target in {
            (link.road_id, link.lane_id) for link in network.links(road, lane, True)
        }


def last_part(conversion: Conversion, name: str) -> tuple[str, int]:
    return conversion.lanelets.get(f"{name}/2", conversion.lanelets[name])


@every_map
def test_lanes_go_on_without_gap_or_kink(name: str, tmp_path: Path) -> None:
    _, network = converted(MAPS[name](), tmp_path)
    for road in network.roads.values():
        for lane in road.lane_ids(0.0):
            for link in network.links(road.id, lane, True):
                end, start = (
                    lane_pose(road, road.length, lane),
                    lane_pose(network.roads[link.road_id], 0.0, link.lane_id),
                )
                assert math.dist(end[:2], start[:2]) < 1e-6
                assert abs(math.remainder(end[2] - start[2], math.tau)) < 0.01
                there = network.roads[link.road_id]
                assert there.lane_width(0.0, link.lane_id) == pytest.approx(
                    road.lane_width(road.length, lane), abs=1e-6
                )


def lane_pose(road: xodr.Road, s: float, lane: int) -> tuple[float, float, float]:
    """Place and direction of a lane's centre."""
    pose = road.pose(s, road.lane_t(s, lane))
    return (
        pose.x,
        pose.y,
        pose.h
        + math.atan(road.lane_slope(s, lane) / (1.0 - road.curvature(s) * road.lane_t(s, lane))),
    )


@every_map
def test_same_map_gives_the_same_bytes(name: str, tmp_path: Path) -> None:
    first = converted(MAPS[name](), tmp_path)[0].path.read_bytes()
    assert converted(MAPS[name](), tmp_path)[0].path.read_bytes() == first


def test_neighbours_are_lanes_of_one_road(tmp_path: Path) -> None:
    conversion, network = converted(two_lanes(speed_limit="80 km/h"), tmp_path)
    assert conversion.lanelets == {"1": ("1", -1), "2": ("1", -2)}
    road = network.road("1")
    assert road.length == pytest.approx(100.0)
    assert [road.lane_width(50.0, lane) for lane in (-1, -2)] == pytest.approx([WIDTH, WIDTH])
    assert network.locate(30.0, -2.0).lane_id == -2
    assert road.speed_limit(50.0, -2) == pytest.approx(80 / 3.6)


def test_opposite_lanes_are_roads_of_their_own(tmp_path: Path) -> None:
    made = LaneletMap()
    centre = straight((0.0, 0.0), (100.0, 0.0))
    made.lanelet(1, centre, straight((0.0, 0.0), (100.0, 0.0), -WIDTH))
    made.lanelet(2, centre, straight((0.0, 0.0), (100.0, 0.0), WIDTH))
    conversion, network = converted(made, tmp_path)
    headings = {
        name: network.roads[road].heading(0.0) for name, (road, _) in conversion.lanelets.items()
    }
    assert math.cos(headings["1"]) == pytest.approx(1.0)
    assert math.cos(headings["2"]) == pytest.approx(-1.0)


def test_lanelets_one_after_the_other_are_one_lane(tmp_path: Path) -> None:
    conversion, network = converted(fork(), tmp_path)
    assert conversion.lanelets["2"] == conversion.lanelets["4"]
    assert network.roads[conversion.lanelets["2"][0]].length == pytest.approx(100.0, abs=0.1)


def test_a_fork_at_the_edge_of_a_map_is_a_direct_junction(tmp_path: Path) -> None:
    _, network = converted(fork(), tmp_path)
    assert [junction.type for junction in network.junctions.values()] == ["direct"]
    assert all(road.junction_id is None for road in network.roads.values())


def test_what_crosses_is_one_junction(tmp_path: Path) -> None:
    conversion, network = converted(four_way(), tmp_path)
    (junction,) = network.junctions.values()
    assert junction.type == "default"
    across = {
        conversion.lanelets[f"{100 + 10 * here + there}"][0]
        for here in range(1, 5)
        for there in range(1, 5)
        if here != there
    }
    assert {road.id for road in network.roads.values() if road.junction_id == junction.id} == across
    assert len(across) == 12


@pytest.mark.parametrize(("length", "junctions"), [(30.0, 1), (200.0, 0)])
def test_roads_cross_at_a_junction_or_on_a_bridge(
    length: float, junctions: int, tmp_path: Path
) -> None:
    made = LaneletMap()
    for axis in (0, 1):
        ends = [
            (place, 0.0) if axis else (0.0, place)
            for place in (-length / 2 - 50, -length / 2, length / 2, length / 2 + 50)
        ]
        for number in range(3):
            sides = (straight(*ends[number : number + 2], t) for t in (WIDTH / 2, -WIDTH / 2))
            made.lanelet(1 + number + 10 * axis, *sides)
    _, network = converted(made, tmp_path)
    assert len(network.junctions) == junctions
    assert len(network.roads) == 2 + 4 * junctions


def test_a_lane_that_splits_off_and_comes_back_makes_no_junction_of_the_road(
    tmp_path: Path,
) -> None:
    made = fork()
    made.lanelet(5, *([(50.0, t), (75.0, t - 3.0), (100.0, t)] for t in (WIDTH / 2, -WIDTH / 2)))
    conversion, network = converted(made, tmp_path)
    assert all(road.junction_id is None for road in network.roads.values())
    targets = {
        (link.road_id, link.lane_id) for link in network.links(*conversion.lanelets["5"], True)
    }
    assert targets == {conversion.lanelets["4"]}


def test_maps_can_be_mirrored(tmp_path: Path) -> None:
    built = build(read_lanelets(four_way().write(tmp_path), None).lanes, "mirrored")
    assert built.map.mirrored().mirrored() == built.map
    path = built.map.mirrored().write(tmp_path / "map.xodr")
    assert schemas.check(path) == []
    there, here = xodr.load(path), xodr.load(built.map.write(tmp_path / "other.xodr"))
    for name, (road, lane) in built.lanelets.items():
        s = here.road(road).length / 2
        pose, other = (
            here.pose(here.lane_point(road, lane, s)),
            there.pose(there.lane_point(road, -lane, s)),
        )
        assert (pose.x, -pose.y) == pytest.approx((other.x, other.y), abs=1e-9), name


def test_a_ring_leads_round(tmp_path: Path) -> None:
    conversion, network = converted(ring(), tmp_path)
    assert len(network.junctions) == 3
    inside = {
        name
        for name, (road, _) in conversion.lanelets.items()
        if network.roads[road].junction_id is not None
    }
    assert inside >= {"1", "2", "3"} and not inside & {"11", "12", "13"}
    road, lane = conversion.lanelets["11"]
    start = network.lane_point(road, lane, 1.0)
    poses = [
        network.pose(network.travel(start, distance, True).point)
        for distance in np.linspace(0.0, 126.0, 64)
    ]
    assert all(math.hypot(pose.x, pose.y) == pytest.approx(20.0, abs=0.2) for pose in poses)


def test_lanes_that_do_not_end_abreast_go_on_where_each_ends(tmp_path: Path) -> None:
    """Three lanes end 4 m after each other; the left one leads to the left, the
    right one to the right.
    """
    made = LaneletMap()
    corners = [(50.0, 5.25), (54.0, 1.75), (58.0, -1.75), (62.0, -5.25)]
    ends = [(90.0, 12.0), (90.0, 8.0), (90.0, 1.75), (90.0, -1.75), (90.0, -8.0), (90.0, -12.0)]
    for index in range(3):
        left, right = corners[index : index + 2]
        made.lanelet(1 + index, [(0.0, left[1]), left], [(0.0, right[1]), right])
        made.lanelet(11 + index, [left, ends[2 * index]], [right, ends[2 * index + 1]])
    conversion, network = converted(made, tmp_path)
    assert len({conversion.lanelets[name][0] for name in ("1", "2", "3")}) == 1
    assert network.road(conversion.lanelets["1"][0]).length == pytest.approx(50.0, abs=0.1)
    assert conversion.deviation < 0.2
    for index in (1, 2, 3):
        (link,) = network.links(*conversion.lanelets[str(index)], True)
        assert (link.road_id, link.lane_id) == conversion.lanelets[f"1{index}"]


# lanelets of other origin -------------------------------------------------------------------------


def test_lanelets_need_no_file() -> None:
    left, middle, right = (np.array(straight((0.0, 0.0), (40.0, 0.0), t)) for t in (3.0, 0.0, -3.0))
    lanelets = [
        Lanelet("a", left, middle, beside_right=LaneletNeighbour("b", True)),
        Lanelet(
            "b",
            middle,
            right,
            beside_left=LaneletNeighbour("a", True),
            type="biking",
            speed_limit=5.0,
        ),
    ]
    built = build(lanelets, "by hand")
    assert built.lanelets == {"a": ("1", -1), "b": ("1", -2)}
    assert [lane.type for lane in built.map.roads[0].sections[0].lanes.values()] == [
        "driving",
        "biking",
    ]


def test_declared_neighbours_that_are_apart_are_two_roads() -> None:
    left, right = (np.array(straight((0.0, 0.0), (40.0, 0.0), t)) for t in (3.0, 0.0))
    lanelets = [
        Lanelet("a", left, right, beside_right=LaneletNeighbour("b", True)),
        Lanelet("b", right - (0, 2), right - (0, 5)),
    ]
    built = build(lanelets, "apart")
    assert len(built.map.roads) == 2
    assert "a and b" in built.notes[0]


@pytest.mark.parametrize("wrong", ["twice", "elsewhere"])
def test_ids_that_mean_nothing_are_refused(wrong: str) -> None:
    left, right = (np.array(straight((0.0, 0.0), (40.0, 0.0), t)) for t in (3.0, 0.0))
    other = {
        "twice": Lanelet("a", left, right),
        "elsewhere": Lanelet("b", left, right, successors=("c",)),
    }[wrong]
    with pytest.raises(UsageError, match=r"same id|'c'"):
        build([Lanelet("a", left, right), other], "wrong")


@settings(max_examples=30)
@given(
    headings=st.tuples(st.floats(-1.4, 1.4), st.floats(-1.4, 1.4)),
    length=st.floats(20.0, 120.0),
    width=st.floats(2.5, 5.0),
    lanes=st.integers(1, 3),
)
def test_curves_keep_their_borders(
    headings: tuple[float, float],
    length: float,
    width: float,
    lanes: int,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    ends = (0.0, 0.0, headings[0]), (length, 0.0, headings[1])
    lines = [
        np.array(turn(*ends, (lanes / 2 - index) * width, int(length)))
        for index in range(lanes + 1)
    ]
    assume(
        min(np.hypot(*np.diff(line, axis=0).T).min() for line in lines) > 0.3
    )  # else too sharp for a road of that width
    row = [
        Lanelet(
            f"{n}",
            lines[n],
            lines[n + 1],
            beside_left=LaneletNeighbour(f"{n - 1}", True) if n else None,
        )
        for n in range(lanes)
    ]
    built = build(row, "curve")
    assert built.lanelets == {f"{number}": ("1", -number - 1) for number in range(lanes)}
    network = xodr.load(built.map.write(tmp_path_factory.getbasetemp() / "curve.xodr"))
    assert max(deviation(built.parts, built.lanelets, network).values()) < 0.2


# in SUMO ------------------------------------------------------------------------------------------


@pytest.fixture
def simulation() -> Iterator[Callable[[Path], sumo_net.SumoNet]]:
    """Starts SUMO on a road network."""

    def start(path: Path) -> sumo_net.SumoNet:
        net = sumo_net.build(path)
        libsumo.start(
            [
                "sumo",
                "-n",
                str(net.path),
                "--step-length",
                "0.5",
                "--no-step-log",
                "--no-warnings",
                "--time-to-teleport",
                "-1",
            ]
        )
        return net

    yield start
    libsumo.close()


@pytest.mark.parametrize("name", [name for name in MAPS if name != "two lanes"])
def test_sumo_drives_every_connection(
    name: str, tmp_path: Path, simulation: Callable[[Path], sumo_net.SumoNet]
) -> None:
    conversion, network = converted(MAPS[name](), tmp_path)
    net = simulation(conversion.path)
    lanes = [
        lane
        for lane in net.sumo_lanes
        if not lane.startswith(":") and "passenger" in libsumo.lane.getAllowed(lane)
    ]
    routes = [(lane, link[0]) for lane in lanes for link in libsumo.lane.getLinks(lane)]
    for number, (lane, target) in enumerate(routes):
        libsumo.route.add(f"{number}", [lane.rpartition("_")[0], target.rpartition("_")[0]])
        libsumo.vehicle.add(
            f"{number}", f"{number}", depart=str(12 * number), departLane=lane.rpartition("_")[2]
        )
    passed: set[str] = set()
    arrived = 0
    while arrived < len(routes):
        libsumo.simulationStep()
        arrived += libsumo.simulation.getArrivedNumber()
        assert not libsumo.simulation.getCollisions()
        assert libsumo.simulation.getTime() < 12 * len(routes) + 200
        passed |= {
            track.road_id
            for vehicle in libsumo.vehicle.getIDList()
            if (track := net.track(libsumo.vehicle.getLaneID(vehicle)))
        }
    assert passed == set(network.roads)


def _strip(
    name: str, start: tuple[float, float], end: tuple[float, float], width: float = 3.5, **more: Any
) -> Lanelet:
    """A straight lanelet to the east between two places on its middle."""
    (x0, y0), (x1, y1) = start, end
    sides = [np.array([(x0, y0 + aside), (x1, y1 + aside)]) for aside in (width / 2, -width / 2)]
    return Lanelet(name, *sides, **more)


def _borders_meet(network: xodr.RoadNetwork) -> bool:
    """Whether the borders of linked lanes meet, and so do the reference lines of
    roads that follow each other.
    """
    for road in network.roads.values():
        for lane in road.sections[-1].lanes:
            for link in network.links(road.id, lane, True) if lane else ():
                other = network.roads[link.road_id]
                for side in ("inner", "outer"):
                    here = road.pose(
                        road.length, getattr(road.lane(road.length, lane), side)(road.length)
                    )
                    there = other.pose(0.0, getattr(other.lane(0.0, link.lane_id), side)(0.0))
                    if math.hypot(here[0] - there[0], here[1] - there[1]) > 0.01:
                        return False
    return True


def test_lanes_meet_where_several_end_and_several_begin(tmp_path: Path) -> None:
    ways = ("c", "d")
    lanelets = [
        _strip("a", (0.0, 0.0), (50.0, 0.0), 3.5, successors=ways),
        _strip("b", (0.0, -9.0), (50.0, 0.2), 3.2, successors=ways),
        _strip("c", (50.0, 0.1), (90.0, 0.1), 3.6),
        _strip("d", (50.0, 0.0), (90.0, 12.0), 3.0),
    ]
    assert _borders_meet(xodr.load(build(lanelets, "x").map.write(tmp_path / "x.xodr")))


def test_a_road_whose_second_lane_ends_leads_on_from_its_reference_line(tmp_path: Path) -> None:
    lanelets = [
        _strip(
            "a",
            (0.0, 0.0),
            (50.0, 0.0),
            beside_right=LaneletNeighbour("b", True),
            successors=("c",),
        ),
        _strip("b", (0.0, -3.5), (50.0, -3.5)),
        _strip("c", (50.0, 0.0), (120.0, 0.0)),
    ]
    network = xodr.load(build(lanelets, "x").map.write(tmp_path / "x.xodr"))
    first, second = (network.roads[network.locate(x, 0.0).road_id] for x in (20.0, 100.0))
    assert np.allclose(first.pose(first.length, 0.0)[:2], second.pose(0.0, 0.0)[:2], atol=0.01)
    assert _borders_meet(network)


@pytest.mark.parametrize(("road_type", "inside"), [("town", 3), ("motorway", 0)])
def test_side_streets_that_turn_off_and_in_are_junctions_but_no_ramps_of_motorways(
    road_type: str, inside: int, tmp_path: Path
) -> None:
    angle = np.linspace(0.0, np.pi / 2.0, 20)
    arc = np.column_stack([np.sin(angle), np.cos(angle)])
    off = [np.array([50.0, -12.0]) + radius * arc for radius in (13.75, 10.25)]
    into = [
        np.array([100.0, -12.0]) + radius * arc[::-1] * (-1.0, 1.0) for radius in (13.75, 10.25)
    ]
    lanelets = [
        _strip("a", (0.0, 0.0), (50.0, 0.0), road_type=road_type, successors=("b", "off")),
        _strip("b", (50.0, 0.0), (75.0, 0.0), road_type=road_type, successors=("b2",)),
        _strip("b2", (75.0, 0.0), (100.0, 0.0), road_type=road_type, successors=("c",)),
        _strip("c", (100.0, 0.0), (150.0, 0.0), road_type=road_type),
        Lanelet("off", *off, road_type=road_type),
        Lanelet("into", *into, road_type=road_type, successors=("c",)),
    ]
    network = xodr.load(build(lanelets, "x").map.write(tmp_path / "x.xodr"))
    assert (
        len(
            [
                road
                for road in network.roads.values()
                if network.junctions and road.junction_id in network.junctions
            ]
        )
        == inside
    )
    assert _borders_meet(network)


def test_a_lane_whose_end_line_lies_along_it_does_not_run_back_to_its_corner() -> None:
    """Lanelets wider than long end on such lines: the road once looped by a
    whole turn on its way to the corner.
    """
    left, right = np.array([[0.0, 0.2], [30.0, -15.0]]), np.array([[0.0, 0.0], [30.0, -19.0]])
    begin, end = (
        CrossLine(7.0, -7.0, math.radians(45.0)),
        CrossLine(30.0, -17.0, math.radians(-30.0)),
    )
    mouths = [
        Mouth(frame, (BorderCrossing(-0.5 * width, 0.0), BorderCrossing(0.5 * width, 0.0))[::-1])
        for frame, width in ((begin, 10.0), (end, 4.0))
    ]
    road = shape([left, right], *mouths)
    assert road.length < 1.2 * math.hypot(30.0 - 7.0, -17.0 + 7.0)


def test_a_step_back_at_a_corner_is_no_turn_about() -> None:
    """As on the inner border of a sharp corner: the line was taken for one of three quarter turns
    to the left, and the road lost its border behind the corner."""
    corner = np.array([[0.0, 0.0], [20.0, 0.0], [17.5, 0.3], [17.5, -20.0]])
    assert headings(corner)[-1] == pytest.approx(-math.pi / 2)
    assert not winds(corner)
    circle = np.array([[math.cos(a), math.sin(a)] for a in np.linspace(0.0, 9.0, 60)]) * 8.0
    assert winds(circle) and np.ptp(headings(circle)) == pytest.approx(9.0, abs=0.6)


def test_no_junction_is_entered_from_inside_another_one(tmp_path: Path) -> None:
    # Two lanelets with different limits follow each other, and both are crossed.
    lanelets = [
        _strip("w0", (-50.0, 0.0), (0.0, 0.0), successors=("w1",)),
        _strip("w1", (0.0, 0.0), (20.0, 0.0), successors=("w2",)),
        _strip("w2", (20.0, 0.0), (40.0, 0.0), successors=("w3",), speed_limit=8.0),
        _strip("w3", (40.0, 0.0), (90.0, 0.0)),
    ]
    for name, x in (("p", 10.0), ("q", 30.0)):
        for number, (start, end) in enumerate(((-60.0, -8.0), (-8.0, 8.0), (8.0, 60.0))):
            sides = [np.array([(x + aside, start), (x + aside, end)]) for aside in (-1.75, 1.75)]
            onwards = (f"{name}{number + 1}",) if number < 2 else ()
            lanelets.append(Lanelet(f"{name}{number}", *sides, successors=onwards))
    path = build(lanelets, "x").map.write(tmp_path / "x.xodr")
    assert [problem for problem in schemas.check(path) if problem.level == "error"] == []
    network = xodr.load(path)
    between = network.roads[network.locate(20.5, 0.0).road_id]
    assert (between.junction_id, len(network.junctions)) == (None, 2)
    assert between.length == pytest.approx(1.0, abs=0.1)
