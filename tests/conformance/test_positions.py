"""Every position kind of the standard, where it is and which way it faces; signs
for both traffic rules and directions.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import pytest

import runner
from runner.judging.execution import prepare
from schemas.common.errors import InvalidFile
from tests.conformance.support import SCENARIOS, at, run, track

ROADS = {"RHT": "../roads/straight.xodr", "LHT": "../roads/straight_lht.xodr"}
HALF_LANE = 1.75


def start(element: str, entity: str = "Car", **parameters: Any) -> dict[str, float]:
    """State of an entity at time 0."""
    columns = track(run(element, parameters=parameters, world="kinematic", max_time=0.02), entity)
    return {
        name: float(columns[name][0])
        for name in ("x", "y", "z", "s", "t", "pitch", "roll", "lane_offset")
    } | {
        "h": math.remainder(float(columns["h"][0]), math.tau),
        "lane": int(columns["lane_id"][0]),
    }


def refusal(element: str, **parameters: Any) -> InvalidFile:
    """The complaint that a scenario ends in."""
    with pytest.raises(InvalidFile) as caught:
        run(element, parameters=parameters, world="kinematic", max_time=0.02)
    assert caught.value.line is not None
    assert str(caught.value.path).endswith(f"{element}.xosc")
    return caught.value


def traffic(rule: str, lane: int) -> int:
    """+1 where the lane's traffic drives towards +s."""
    return 1 if (lane < 0) == (rule == "RHT") else -1


def angle(one: float, other: float) -> float:
    """Size of the difference of two headings."""
    return abs(math.remainder(one - other, math.tau))


# world ------------------------------------------------------------------------------------------


def test_world_position_is_where_it_says_and_follows_the_lane_there() -> None:
    columns = track(
        run("WorldPosition", parameters={"X": 100, "Y": -2.0, "H": 0.0}, world="kinematic"), "Car"
    )
    assert (columns["x"][0], columns["y"][0], columns["h"][0]) == pytest.approx((100.0, -2.0, 0.0))
    assert (columns["lane_id"][0], columns["lane_offset"][0]) == pytest.approx((-1, -0.25))
    assert at(columns, 1.0, "x") == pytest.approx(110.0)
    assert at(columns, 1.0, "y") == pytest.approx(-2.0)


def test_world_position_off_the_road_goes_straight_ahead() -> None:
    columns = track(
        run("WorldPosition", parameters={"X": 100, "Y": 50.0, "H": 0.5}, world="kinematic"), "Car"
    )
    assert at(columns, 1.0, "x") == pytest.approx(100.0 + 10.0 * math.cos(0.5))
    assert at(columns, 1.0, "y") == pytest.approx(50.0 + 10.0 * math.sin(0.5))


@pytest.mark.parametrize("rule", ROADS)
@pytest.mark.parametrize("lane", [-2, -1, 1, 2])
@pytest.mark.parametrize("heading", [0.0, 0.3, math.pi])
def test_whoever_faces_against_s_drives_against_s(rule: str, lane: int, heading: float) -> None:
    y = math.copysign(3.5 * abs(lane) - HALF_LANE, lane)
    columns = track(
        run(
            "WorldPosition",
            parameters={"Road": ROADS[rule], "Y": y, "H": heading},
            world="kinematic",
        ),
        "Car",
    )
    ahead = 1 if math.cos(heading) > 0 else -1
    assert at(columns, 1.0, "x") == pytest.approx(100.0 + 10.0 * ahead)
    assert at(columns, 1.0, "y") == pytest.approx(y)
    assert columns["lane_id"][0] == lane


# road and lane ----------------------------------------------------------------------------------


@pytest.mark.parametrize("rule", ROADS)
@pytest.mark.parametrize("lane", [-2, -1, 1, 2])
def test_lane_position_faces_the_traffic_and_counts_its_offset_towards_t(
    rule: str, lane: int
) -> None:
    direction = traffic(rule, lane)
    place = start("LanePosition", Road=ROADS[rule], Lane=str(lane), Offset=0.5)
    assert (place["x"], place["y"]) == pytest.approx(
        (500.0, math.copysign(3.5 * abs(lane) - HALF_LANE, lane) + 0.5)
    )
    assert angle(place["h"], 0.0 if direction > 0 else math.pi) < 1e-9
    columns = track(
        run("LanePosition", parameters={"Road": ROADS[rule], "Lane": str(lane)}, world="kinematic"),
        "Plain",
    )
    assert at(columns, 1.0, "x") == pytest.approx(500.0 + direction * 10.0)


@pytest.mark.parametrize("rule", ROADS)
@pytest.mark.parametrize("lane", [-1, 1])
def test_lane_position_counts_relative_headings_from_the_traffic_and_absolute_ones_from_the_world(
    rule: str, lane: int
) -> None:
    base = 0.0 if traffic(rule, lane) > 0 else math.pi
    parameters = {"Road": ROADS[rule], "Lane": str(lane), "H": 0.4}
    assert angle(start("LanePosition", **parameters)["h"], base + 0.4) < 1e-9
    assert angle(start("LanePosition", **parameters, Type="absolute")["h"], 0.4) < 1e-9


@pytest.mark.parametrize("rule", ROADS)
@pytest.mark.parametrize("t", [-5.25, 1.75])
def test_road_position_faces_along_s_whatever_the_traffic(rule: str, t: float) -> None:
    place = start("RoadPosition", "Plain", Road=ROADS[rule], T=t)
    assert (place["x"], place["y"], place["h"]) == pytest.approx((500.0, t, 0.0))
    assert start("RoadPosition", Road=ROADS[rule], T=t, H=0.4)["h"] == pytest.approx(0.4)


def test_positions_on_lanes_that_are_not_there_are_refused_with_their_line() -> None:
    assert "no lane 7" in refusal("LanePosition", Lane="7").message
    assert "'left' is not a number" in refusal("LanePosition", Lane="left").message


@pytest.mark.parametrize("rule", ROADS)
@pytest.mark.parametrize("lane", [-1, 1])
def test_relative_world_position_counts_along_the_axes_and_turns_with_the_entity(
    rule: str, lane: int
) -> None:
    y = math.copysign(HALF_LANE, lane)
    h = 0.0 if traffic(rule, lane) > 0 else math.pi
    parameters = {"Road": ROADS[rule], "Lane": str(lane), "Dx": 20, "Dy": 1}
    place = start("RelativeWorldPosition", **parameters)
    assert (place["x"], place["y"]) == pytest.approx((520.0, y + 1.0))
    assert angle(place["h"], h) < 1e-9
    turned = start("RelativeWorldPosition", "Turned", **parameters)
    assert angle(turned["h"], h + 0.5) < 1e-9
    assert turned["z"] == pytest.approx(0.25)


@pytest.mark.parametrize("rule", ROADS)
@pytest.mark.parametrize("lane", [-1, 1])
@pytest.mark.parametrize("dy", [-1.0, 1.0])
def test_relative_object_position_counts_in_the_entity_s_own_frame(
    rule: str, lane: int, dy: float
) -> None:
    direction = traffic(rule, lane)
    place = start("RelativeObjectPosition", Road=ROADS[rule], Lane=str(lane), Dx=20, Dy=dy)
    assert (place["x"], place["y"]) == pytest.approx(
        (500.0 + direction * 20.0, math.copysign(HALF_LANE, lane) + direction * dy)
    )
    assert angle(place["h"], 0.0 if direction > 0 else math.pi) < 1e-9


@pytest.mark.parametrize("rule", ROADS)
@pytest.mark.parametrize("lane", [-1, 1])
@pytest.mark.parametrize("ds", [-20.0, 20.0])
def test_relative_road_position_counts_in_s_and_t_whatever_the_entity_faces(
    rule: str, lane: int, ds: float
) -> None:
    place = start("RelativeRoadPosition", Road=ROADS[rule], Lane=str(lane), Ds=ds, Dt=1)
    assert (place["s"], place["t"]) == pytest.approx(
        (500.0 + ds, math.copysign(HALF_LANE, lane) + 1.0)
    )
    assert place["h"] == pytest.approx(0.0)


@pytest.mark.parametrize("rule", ROADS)
@pytest.mark.parametrize(
    ("lane", "lanes", "reached"),
    [(-1, 1, 1), (-1, -1, -2), (1, 1, 2), (1, -1, -1), (-2, 3, 2), (2, -3, -2)],
)
def test_relative_lane_position_counts_lanes_towards_t_without_the_centre_lane(
    rule: str, lane: int, lanes: int, reached: int
) -> None:
    parameters = {"Road": ROADS[rule], "Lane": str(lane), "Lanes": lanes, "Ds": 20, "Offset": 0.5}
    place = start("RelativeLanePosition", **parameters)
    assert (place["lane"], place["s"], place["lane_offset"]) == pytest.approx((reached, 520.0, 0.5))
    assert angle(place["h"], 0.0 if traffic(rule, lane) > 0 else math.pi) < 1e-9, (
        "as the reference entity does"
    )
    along = start("RelativeLanePosition", "Along", **parameters)
    assert angle(along["h"], 0.0 if traffic(rule, reached) > 0 else math.pi) < 1e-9, (
        "as the lane's traffic does"
    )
    assert (along["lane"], along["s"]) == pytest.approx(
        (reached, 500.0 + 20.0 * traffic(rule, lane))
    )


def test_ds_lane_counts_in_the_direction_that_the_entity_faces() -> None:
    against = start("RelativeLanePosition", "Along", Heading=math.pi, Lanes=0)
    assert against["s"] == pytest.approx(480.0)


def test_relative_lane_positions_that_do_not_exist_are_refused() -> None:
    assert "dLane=5 leads from 'Other'" in refusal("RelativeLanePosition", Lanes=5).message
    with pytest.raises(
        InvalidFile, match="dLane=7 leads beyond the lanes of any road, which has 6 at most"
    ):
        prepare(SCENARIOS / "RelativeLanePosition.xosc", {"Lanes": 7})


# routes, trajectories, geography ------------------------------------------------------------------


def test_route_position_counts_from_the_first_waypoint_along_the_route() -> None:
    place = start("RoutePosition", "Road", PathS=20)
    assert (place["x"], place["y"]) == pytest.approx((-71.5, -1.75))
    assert angle(place["h"], 0.0) < 1e-9
    lane = start("RoutePosition", "Lane", PathS=20)
    assert (lane["x"], lane["y"], lane["lane"]) == pytest.approx((-71.5, -2.25, 1))


def test_route_coordinates_are_mirrored_on_roads_that_run_against_the_first_one() -> None:
    # 80 m on the western arm towards the junction, 23 m through it, 17 m on
    # the eastern arm, whose s runs the other way
    place = start("RoutePosition", "Road", PathS=120)
    assert (place["x"], place["y"]) == pytest.approx((28.5, -1.75))
    lane = start("RoutePosition", "Lane", PathS=120)
    assert (lane["x"], lane["y"], lane["lane"]) == pytest.approx((28.5, -2.25, -1))
    assert angle(lane["h"], 0.0) < 1e-9


def test_route_position_of_an_entity_is_where_it_is_facing_along_the_route() -> None:
    place = start("RoutePosition", "Entity")
    assert (place["x"], place["y"]) == pytest.approx((-41.5, -1.75))
    assert angle(place["h"], 0.0) < 1e-9


def test_route_positions_beyond_the_route_are_at_its_end() -> None:
    beyond = run("RoutePosition", parameters={"PathS": 200}, world="kinematic", max_time=0.02)
    remarks = [each for each in beyond.remarks if "pathS=200 is not on the route" in each]
    assert remarks
    assert all(
        each.endswith(
            "its end is assumed [xosc.toolchain:xosc:1.0.0:positioning.position_is_on_the_road]"
        )
        for each in remarks
    )
    with pytest.raises(InvalidFile, match="pathS=200"):
        run("RoutePosition", parameters={"PathS": 200}, world="kinematic", strict=True)


def test_trajectory_position_counts_t_from_the_tangent() -> None:
    # 10 m east, then north: s = 15 is 5 m up the second line, t = 2 to its left
    place = start("TrajectoryPosition", S=15, T=2, H=0.25)
    assert (place["x"], place["y"], place["h"]) == pytest.approx((108.0, 5.0, math.pi / 2 + 0.25))
    plain = start("TrajectoryPosition", "Plain", S=15)
    assert (plain["x"], plain["y"], plain["h"]) == pytest.approx((110.0, 5.0, math.pi / 2))
    assert "s=21 is not on the trajectory" in refusal("TrajectoryPosition", S=21).message


def test_geo_position_is_projected_by_the_road_network_s_projection() -> None:
    # +proj=tmerc at 48° N, 11° E: 0.005° of longitude are 0.005 π/180 · N cos φ, N the prime
    # vertical radius (WGS 84)
    latitude = math.radians(48.0)
    prime = 6378137.0 / math.sqrt(1.0 - 0.00669437999014 * math.sin(latitude) ** 2)
    place = start("GeoPosition")
    assert place["x"] == pytest.approx(math.radians(0.005) * prime * math.cos(latitude), abs=1e-3)
    assert abs(place["y"]) < 0.02
    assert place["h"] == pytest.approx(0.0)
    old = start("GeoPosition", "Old")
    assert (old["x"], old["h"]) == pytest.approx((place["x"], 1.5), abs=1e-6)
    assert start("GeoPosition", Altitude=2)["z"] == pytest.approx(2.0)
    assert "the latitude of 91°" in refusal("GeoPosition", Latitude=91).message


def test_an_orientation_without_a_type_is_absolute_before_version_1_2(tmp_path: Any) -> None:
    text = (SCENARIOS / "LanePosition.xosc").read_text().replace('type="$Type" h="$H"', 'h="0.25"')
    text = text.replace("../roads", str(SCENARIOS.parent / "roads")).replace(
        'value="-1"', 'value="1"'
    )
    for minor, heading in ((3, math.pi + 0.25), (1, 0.25)):
        path = tmp_path / f"{minor}.xosc"
        path.write_text(text.replace('revMinor="3"', f'revMinor="{minor}"'))
        columns = track(runner.run(path, sut=None, world="kinematic", max_time=0.1), "Car")
        assert angle(float(columns["h"][0]), heading) < 1e-9


def test_ds_goes_round_a_ring_as_often_as_it_takes(tmp_path: Path) -> None:
    radius = 100.0
    length = math.tau * radius
    ring = (
        (SCENARIOS.parent / "roads" / "curve.xodr")
        .read_text(encoding="utf-8")
        .replace('length="300"', f'length="{length}"')
    )
    around = "".join(
        f'<{side} elementType="road" elementId="1" contactPoint="{end}"/>'
        for side, end in (("predecessor", "end"), ("successor", "start"))
    )
    ring = ring.replace("    <type ", f"    <link>{around}</link>\n    <type ", 1)
    lanes = r'<lane id="(-?[1-9])"([^>]*)>\s*<link/>'
    ring = re.sub(
        lanes, r'<lane id="\1"\2><link><predecessor id="\1"/><successor id="\1"/></link>', ring
    )
    (tmp_path / "ring.xodr").write_text(ring, encoding="utf-8")
    scenario = SCENARIOS / "RelativeRoadPosition.xosc"
    for ds in (25.0, -25.0, 3 * length + 25.0, -7 * length + 25.0):
        options = {"Road": str(tmp_path / "ring.xodr"), "Ds": ds, "Dt": 0}
        placed = track(
            runner.run(scenario, parameters=options, world="kinematic", sut=None, max_time=0.02),
            "Car",
        )
        origin = track(
            runner.run(
                scenario, parameters=options | {"Ds": 0}, world="kinematic", sut=None, max_time=0.02
            ),
            "Car",
        )
        assert math.remainder(placed["s"][0] - origin["s"][0] - ds, length) == pytest.approx(
            0.0, abs=1e-6
        )
