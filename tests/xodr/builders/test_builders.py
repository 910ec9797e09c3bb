"""Map builders: valid, continuous, deterministic OpenDRIVE that SUMO's traffic can drive on."""

from __future__ import annotations

import importlib.metadata
import math
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import libsumo
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lxml import etree

import xodr
from schemas.common.errors import UsageError
from xodr import builders
from xodr.builders import RoadMap
from xodr.formats import sumo_net
from xodr.formats.sumo_net import SumoNet
from xodr.model import Junction

MAPS: dict[str, Callable[[str], RoadMap]] = {
    "straight_highway": lambda rule: builders.straight_highway(rule=rule),
    "highway with both carriageways": lambda rule: builders.straight_highway(
        lanes=2, opposite_lanes=3, rule=rule
    ),
    "on_ramp": lambda rule: builders.on_ramp(rule=rule),
    "off_ramp": lambda rule: builders.off_ramp(lanes=3, rule=rule),
    "sharp_curve": lambda rule: builders.sharp_curve(rule=rule),
    "right curve without transition": lambda rule: builders.sharp_curve(
        turn="right", transition=0.0, rule=rule
    ),
    "narrow_road": lambda rule: builders.narrow_road(rule=rule),
    "four_way_intersection": lambda rule: builders.four_way_intersection(rule=rule),
    "four arms with two lanes and lights": lambda rule: builders.four_way_intersection(
        lanes=2, signals=True, rule=rule
    ),
    "t_junction": lambda rule: builders.t_junction(rule=rule),
    "t junction with lights": lambda rule: builders.t_junction(lanes=2, signals=True, rule=rule),
    "roundabout": lambda rule: builders.roundabout(rule=rule),
    "roundabout with two lanes": lambda rule: builders.roundabout(
        arms=3, lanes=2, radius=22.0, rule=rule
    ),
}
JUNCTIONS = [
    name
    for name in MAPS
    if any(word in name for word in ("ramp", "four", "junction", "roundabout"))
]

both_sides = pytest.mark.parametrize("rule", ["RHT", "LHT"])
all_maps = pytest.mark.parametrize("name", MAPS)


@pytest.fixture(scope="module")
def schema() -> etree.XMLSchema:
    files = importlib.metadata.files("scenariogeneration") or []
    (path,) = (file.locate() for file in files if file.name == "opendrive_17_core.xsd")
    return etree.XMLSchema(etree.parse(str(path)))


@pytest.fixture(autouse=True)
def cache_folder(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XOSC_CACHE_DIR", str(tmp_path_factory.getbasetemp() / "cache"))


@both_sides
@all_maps
def test_maps_are_valid_opendrive(name: str, rule: str, schema: etree.XMLSchema) -> None:
    tree = etree.fromstring(MAPS[name](rule).to_xml())
    assert schema.validate(tree), schema.error_log
    assert {road.get("rule") for road in tree.iter("road")} == {rule}
    assert all(float(speed.get("max", 0)) > 0 for speed in tree.iter("speed"))


@both_sides
@all_maps
def test_every_joint_fits_in_position_heading_and_width(
    name: str, rule: str, tmp_path: Path
) -> None:
    network = xodr.load(MAPS[name](rule).write(tmp_path / "map.xodr"))
    joints = list(meeting_lanes(network))
    assert joints or len(network.roads) == 1
    for one, other in joints:
        assert math.dist(one[:2], other[:2]) < 1e-3
        assert abs(math.remainder(one[2] - other[2], math.tau)) < 1e-6
        assert one[3] == pytest.approx(other[3], abs=1e-6)


def meeting_lanes(
    network: xodr.RoadNetwork,
) -> Iterator[tuple[tuple[float, ...], tuple[float, ...]]]:
    """(x, y, direction of travel, width) of both lanes wherever one leads into the next."""
    for road in network.roads.values():
        for forward, s in ((False, 0.0), (True, road.length)):
            for lane_id in road.lane_ids(s):
                for link in network.links(road.id, lane_id, forward):
                    other = network.road(link.road_id)
                    there = 0.0 if link.at_start else other.length
                    yield (
                        lane_end(road, s, lane_id, not forward),
                        lane_end(other, there, link.lane_id, not link.at_start),
                    )


def lane_end(road: xodr.Road, s: float, lane_id: int, against: bool) -> tuple[float, ...]:
    pose = road.pose(s, road.lane_t(s, lane_id))
    return pose.x, pose.y, pose.h + (math.pi if against else 0.0), road.lane_width(s, lane_id)


@both_sides
@all_maps
def test_plan_view_pieces_follow_each_other(name: str, rule: str, tmp_path: Path) -> None:
    network = xodr.load(MAPS[name](rule).write(tmp_path / "map.xodr"))
    for road in network.roads.values():
        for border in road.line.starts[1:]:
            before, after = road.pose(border - 1e-7), road.pose(border + 1e-7)
            assert math.dist(before[:2], after[:2]) < 1e-5
            assert abs(math.remainder(before.h - after.h, math.tau)) < 1e-6


@all_maps
def test_same_arguments_give_the_same_bytes(name: str, tmp_path: Path) -> None:
    first, second = MAPS[name]("RHT"), MAPS[name]("RHT")
    assert first.to_xml() == second.to_xml()
    assert first.write(tmp_path / "map.xodr").read_bytes() == first.to_xml()


@both_sides
@pytest.mark.parametrize("name", JUNCTIONS)
def test_junctions_and_signals_are_read_as_they_were_built(
    name: str, rule: str, tmp_path: Path
) -> None:
    built = MAPS[name](rule)
    network = xodr.load(built.write(tmp_path / "map.xodr"))
    assert [unnumbered(junction) for junction in network.junctions.values()] == list(
        built.junctions
    )
    assert list(network.controllers.values()) == list(built.controllers)
    assert list(network.signals.values()) == [
        signal for road in built.roads for signal in road.signals
    ]
    assert "lights" not in name or network.signals
    assert "ramp" not in name or built.junctions[0].priorities


def unnumbered(junction: Junction) -> Junction:
    return replace(
        junction, connections=tuple(each._replace(id="") for each in junction.connections)
    )


@all_maps
def test_mirrored_twice_is_the_same_map(name: str) -> None:
    built = MAPS[name]("RHT")
    assert built.mirrored().mirrored().to_xml() == built.to_xml()
    assert built.mirrored().to_xml() == MAPS[name]("LHT").to_xml()


# in SUMO ----------------------------------------------------------------------------------------


@pytest.fixture
def simulation() -> Iterator[Callable[[RoadMap, Path], SumoNet]]:
    """Starts SUMO on a map."""

    def start(road_map: RoadMap, folder: Path) -> SumoNet:
        net = sumo_net.build(road_map.write(folder / "map.xodr"))
        quiet = ["--no-step-log", "--no-warnings", "--time-to-teleport", "-1"]
        libsumo.start(["sumo", "-n", str(net.path), "--step-length", "0.5", *quiet])
        return net

    yield start
    libsumo.close()


@both_sides
@pytest.mark.parametrize("name", JUNCTIONS)
def test_sumo_traffic_drives_every_connection(
    name: str, rule: str, tmp_path: Path, simulation: Callable
) -> None:
    road_map = MAPS[name](rule)
    net = simulation(road_map, tmp_path)
    connections = [
        (lane, link[0], link[4])
        for lane in net.sumo_lanes
        if not lane.startswith(":") and "passenger" in libsumo.lane.getAllowed(lane)
        for link in libsumo.lane.getLinks(lane)
    ]
    for number, (lane, target, _) in enumerate(connections):
        edge, index = lane.rsplit("_", 1)
        libsumo.route.add(f"route{number}", [edge, target.rpartition("_")[0]])
        position = max(0.0, libsumo.lane.getLength(lane) - 80.0)
        libsumo.vehicle.add(
            f"{number}",
            f"route{number}",
            depart=str(15 * number),
            departLane=index,
            departPos=str(position),
        )
        libsumo.vehicle.setLaneChangeMode(f"{number}", 0)
    passed = run_until_all_have_arrived(len(connections))
    for number, (_, _, inside) in enumerate(connections):
        assert net.track(inside) is None or inside in passed[str(number)]
    connecting = {str(road.id) for road in road_map.roads if road.junction != "-1"}
    assert (
        connecting
        == {track.road_id for lane in set().union(*passed.values()) if (track := net.track(lane))}
        & connecting
    )


def run_until_all_have_arrived(count: int) -> dict[str, set[str]]:
    """The SUMO lanes that each vehicle passed; nobody collides, everybody arrives."""
    passed: dict[str, set[str]] = defaultdict(set)
    arrived = 0
    while arrived < count:
        libsumo.simulationStep()
        arrived += libsumo.simulation.getArrivedNumber()
        assert not libsumo.simulation.getCollisions()
        assert libsumo.simulation.getTime() < 15 * count + 400
        for vehicle in libsumo.vehicle.getIDList():
            passed[vehicle].add(libsumo.vehicle.getLaneID(vehicle))
    return passed


@both_sides
def test_ramp_traffic_merges_into_a_flow(rule: str, tmp_path: Path, simulation: Callable) -> None:
    simulation(builders.on_ramp(rule=rule), tmp_path)
    libsumo.route.add("main", ["1/0+", "2/0+", "2/1+", "2/2+"])
    libsumo.route.add("ramp", ["3/0+", "2/0+", "2/1+", "2/2+"])
    for number in range(20):
        libsumo.vehicle.add(
            f"main{number}", "main", depart=str(3 * number), departLane="best", departSpeed="max"
        )
        libsumo.vehicle.add(f"ramp{number}", "ramp", depart=str(4 * number), departSpeed="max")
    passed = run_until_all_have_arrived(40)
    assert all(
        {"2/2+_1", "2/2+_2"} & passed[f"ramp{number}"] for number in range(20)
    )  # lane 0 is the shoulder


@both_sides
def test_traffic_leaves_by_the_deceleration_lane(
    rule: str, tmp_path: Path, simulation: Callable
) -> None:
    simulation(builders.off_ramp(rule=rule), tmp_path)
    libsumo.route.add("exit", ["1/0+", "1/1+", "1/2+", "3/0+"])
    for number in range(10):
        libsumo.vehicle.add(
            f"{number}", "exit", depart=str(3 * number), departLane="first", departSpeed="max"
        )
    passed = run_until_all_have_arrived(10)
    assert all("1/2+_1" in lanes for lanes in passed.values())


@both_sides
def test_roundabout_is_circulated_in_the_direction_of_the_rule(
    rule: str, tmp_path: Path, simulation: Callable
) -> None:
    """Back to the arm that one came from: round the whole island,
    counterclockwise in right-hand traffic.
    """
    net = simulation(builders.roundabout(arms=4, rule=rule), tmp_path)
    route = libsumo.simulation.findRoute("1/0-", "1/0+").edges
    assert [edge for edge in route if edge.startswith("1")] == [
        "1/0-",
        "11/0+",
        "12/0+",
        "13/0+",
        "14/0+",
        "1/0+",
    ]
    libsumo.route.add("round", route)
    libsumo.vehicle.add("car", "round")
    angles = []
    while libsumo.simulation.getMinExpectedNumber():
        libsumo.simulationStep()
        if "car" in libsumo.vehicle.getIDList():
            track = net.track(libsumo.vehicle.getLaneID("car"))
            if track and track.road_id.startswith("1") and len(track.road_id) == 2:
                x, y = libsumo.vehicle.getPosition("car")
                angles.append(math.atan2(y, x) % math.tau)
    assert angles == sorted(angles, reverse=rule == "LHT")


def test_who_circulates_goes_before_who_enters(tmp_path: Path, simulation: Callable) -> None:
    simulation(builders.roundabout(arms=4), tmp_path)
    for arm in range(1, 5):
        priority = {
            link[0].partition("/")[0]: link[1] for link in libsumo.lane.getLinks(f"{10 + arm}/0+_0")
        }
        assert priority[str(11 + arm % 4)]
        assert not any(link[1] for link in libsumo.lane.getLinks(f"{arm}/0-_0"))


def test_the_main_road_goes_first_at_the_t_junction(tmp_path: Path, simulation: Callable) -> None:
    simulation(builders.t_junction(), tmp_path)
    straight = {link[0].partition("/")[0]: link[1] for link in libsumo.lane.getLinks("1/0-_0")}
    assert straight["3"]
    assert not any(link[1] for link in libsumo.lane.getLinks("4/0-_0"))


# parameters -------------------------------------------------------------------------------------


@pytest.mark.slow
@settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    lanes=st.integers(1, 2),
    arms=st.integers(3, 6),
    width=st.floats(2.5, 4.5),
    radius=st.floats(10, 60),
    flare=st.floats(4, 30),
)
def test_roundabouts_of_all_sizes_fit(
    lanes: int,
    arms: int,
    width: float,
    radius: float,
    flare: float,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    road_map = builders.roundabout(
        arms=arms, lanes=lanes, lane_width=width, radius=radius, flare=flare
    )
    network = xodr.load(road_map.write(tmp_path_factory.mktemp("map") / "map.xodr"))
    for one, other in meeting_lanes(network):
        assert math.dist(one[:2], other[:2]) < 1e-3
        assert abs(math.remainder(one[2] - other[2], math.tau)) < 1e-6


@pytest.mark.parametrize(
    ("name", "arguments", "complaint"),
    [
        ("straight_highway", {"lanes": 0}, "lanes=0"),
        ("straight_highway", {"length": math.nan}, "length=nan"),
        ("straight_highway", {"rule": "left"}, "rule='left'"),
        ("sharp_curve", {"turn": "up"}, "turn='up'"),
        ("sharp_curve", {"radius": 3.0}, "radius=3.0"),
        ("sharp_curve", {"transition": 100.0}, "transition=100.0"),
        ("narrow_road", {"lane_width": -1.0}, "lane_width=-1.0"),
        ("on_ramp", {"taper": 0.0}, "taper=0.0"),
        ("off_ramp", {"angle": 3.0}, "angle=3.0"),
        ("four_way_intersection", {"lanes": 9}, "lanes=9"),
        ("t_junction", {"corner_radius": math.inf}, "corner_radius=inf"),
        ("roundabout", {"arms": 2}, "arms=2"),
    ],
)
def test_senseless_parameters_are_refused_by_name(
    name: str, arguments: dict[str, object], complaint: str
) -> None:
    with pytest.raises(UsageError, match=complaint.replace(".", r"\.")):
        getattr(builders, name)(**arguments)
