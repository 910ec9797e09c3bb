"""Distances in all coordinate systems, with their signs for both traffic rules
and both directions.
"""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from runner.engine.motion.following import PathMotion
from runner.engine.motion.paths import Corner, Polyline
from runner.engine.motion.placement import Placement
from runner.engine.motion.spacing import (
    bearing,
    closing_euclidean,
    closing_lateral,
    closing_longitudinal,
    euclidean,
    footprint,
    lateral,
    longitudinal,
)
from runner.engine.participants.boxes import box_corners
from runner.engine.participants.declaration import BoundingBox
from runner.engine.participants.entity import Entity
from runner.engine.storyboard.simulation import Simulation
from tests.runner.scene import CAR, drive, put, put_free, scene, vehicle

SIDES = [("straight", -1), ("straight", 1), ("straight_lht", 1), ("straight_lht", -1)]
"""{RHT, LHT} × {lane of traffic with s, against s}: lanes −1 and 1 drive with
and against s, on LHT roads against and with.
"""


@pytest.mark.parametrize("system", ["entity", "road", "lane"])
@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize(("road", "lane"), SIDES)
def test_ahead_and_left_are_positive_whatever_the_traffic(
    road: str, lane: int, backwards: bool, system: str
) -> None:
    sim = scene("Ego", "Ahead", "Left", road=road)
    ego = put(sim, "Ego", lane, 500.0, backwards=backwards)
    towards_s = math.cos(ego.h) > 0
    ahead = put(sim, "Ahead", lane, 520.0 if towards_s else 480.0)
    left = put(sim, "Left", lane, 500.0, offset=3.0 if towards_s else -3.0)
    assert longitudinal(sim.roads, ego, ahead, system, False) == pytest.approx(20.0)
    assert lateral(sim.roads, ego, ahead, system, False) == pytest.approx(0.0, abs=1e-9)
    assert lateral(sim.roads, ego, left, system, False) == pytest.approx(3.0)
    assert longitudinal(sim.roads, ego, left, system, False) == pytest.approx(0.0, abs=1e-9)
    assert lateral(sim.roads, left, ego, system, False) == pytest.approx(
        -3.0 if not backwards else 3.0
    )


@pytest.mark.parametrize("system", ["entity", "road", "lane"])
@pytest.mark.parametrize(("road", "lane"), SIDES)
def test_freespace_is_the_gap_of_the_boxes(road: str, lane: int, system: str) -> None:
    sim = scene("Ego", "Other", road=road)
    ego = put(sim, "Ego", lane, 500.0)
    step = 1 if math.cos(ego.h) > 0 else -1
    other = put(sim, "Other", lane, 500.0 + 20.0 * step, offset=3.0 * step)
    assert longitudinal(sim.roads, ego, other, system, True) == pytest.approx(20.0 - 5.0)
    assert longitudinal(sim.roads, other, ego, system, True) == pytest.approx(-15.0)
    assert lateral(sim.roads, ego, other, system, True) == pytest.approx(3.0 - 2.0)
    assert euclidean(ego, other, True) == pytest.approx(math.hypot(15.0, 1.0))
    assert euclidean(ego, other) == pytest.approx(math.hypot(20.0, 3.0))
    beside = put(sim, "Other", lane, 500.0 + 2.0 * step, offset=3.0 * step)
    assert longitudinal(sim.roads, ego, beside, system, True) == 0.0


@pytest.mark.parametrize("system", ["entity", "road", "lane"])
def test_a_position_has_no_extent(system: str) -> None:
    sim = scene("Ego")
    ego = put(sim, "Ego", -1, 500.0)
    place = Placement(520.0, 1.25, 0.0, 0.0)
    assert longitudinal(sim.roads, ego, place, system, False) == pytest.approx(20.0)
    assert longitudinal(sim.roads, ego, place, system, True) == pytest.approx(16.0)
    assert lateral(sim.roads, ego, place, system, False) == pytest.approx(3.0)
    assert lateral(sim.roads, ego, place, system, True) == pytest.approx(2.0)
    assert euclidean(ego, place, True) == pytest.approx(math.hypot(16.0, 2.0))


def test_oncoming_box_counts_with_the_end_that_faces() -> None:
    sim = scene("Ego", "Other")
    ego = put(sim, "Ego", -1, 500.0)
    oncoming = put(sim, "Other", 1, 530.0)
    for system in ("entity", "road", "lane"):
        assert longitudinal(sim.roads, ego, oncoming, system, True) == pytest.approx(
            30.0 - 4.0 - 4.0
        )


def test_road_distance_follows_the_curve_and_lane_distance_its_own_radius() -> None:
    sim = scene("Ego", "Other", road="curve")
    assert sim.roads.network is not None
    road = sim.roads.network.road("1")
    s, curvature = 20.0, road.curvature(20.0)
    ego, other = put(sim, "Ego", -1, s), put(sim, "Other", -1, s + 60.0)
    t = road.lane_t(s, -1)
    assert longitudinal(sim.roads, ego, other, "road", False) == pytest.approx(60.0)
    assert longitudinal(sim.roads, ego, other, "lane", False) == pytest.approx(
        60.0 * (1.0 - curvature * t)
    )
    assert lateral(sim.roads, ego, other, "road", False) == pytest.approx(0.0, abs=1e-9)
    chord = 2.0 * (1.0 / curvature - t) * math.sin(60.0 * curvature / 2.0)
    assert euclidean(ego, other) == pytest.approx(abs(chord))


@given(st.floats(-0.02, 0.02), st.floats(-3.0, 3.0), st.floats(-0.5, 0.5))
def test_a_footprint_holds_the_corners_in_road_coordinates(
    curvature: float, t: float, turn: float
) -> None:
    road = _Arc(curvature)
    entity = vehicle("e", x=0.0, y=t, h=turn)
    found = footprint(road, _Point(t), turn, CAR)  # type: ignore[arg-type]
    places = [road.st(x, y) for x, y in box_corners(entity.x, entity.y, entity.h, entity.box)]
    assert found == pytest.approx(
        (
            min(s for s, _ in places),
            max(s for s, _ in places),
            min(q for _, q in places) - t,
            max(q for _, q in places) - t,
        ),
        abs=1e-6,
    )


class _Point:
    def __init__(self, t: float) -> None:
        self.s, self.t, self.offset = 0.0, t, 0.0


class _Arc:
    """A road that starts at the origin along x, with constant curvature."""

    def __init__(self, curvature: float) -> None:
        self._curvature = curvature

    def heading(self, s: float) -> float:
        return 0.0

    def curvature(self, s: float) -> float:
        return self._curvature

    def st(self, x: float, y: float) -> tuple[float, float]:
        k = self._curvature
        if abs(k) < 1e-9:
            return x, y
        angle = math.atan2(k * x, 1.0 - k * y)
        return angle / k, (1.0 - math.hypot(k * x, 1.0 - k * y)) / k


def test_without_a_road_network_only_entity_coordinates_exist() -> None:
    sim = scene("Ego", "Other", road=None)
    ego, other = put_free(sim, "Ego", 0.0, 0.0), put_free(sim, "Other", 10.0, 0.0)
    assert longitudinal(sim.roads, ego, other, "road", False) is None
    assert lateral(sim.roads, ego, other, "lane", True) is None
    assert longitudinal(sim.roads, ego, other, "trajectory", False) is None
    assert longitudinal(sim.roads, ego, other, "entity", False) == pytest.approx(10.0)


def test_trajectory_coordinates_are_those_of_the_trajectory_followed() -> None:
    sim = scene("Ego", "Other", road=None)
    ego, other = put_free(sim, "Ego", 5.0, 0.0), put_free(sim, "Other", 18.0, 20.0)
    path = Polyline([Corner(0.0, 0.0, 0.0), Corner(20.0, 0.0, 0.0), Corner(20.0, 40.0, 0.0)])
    ego.controls.motion = PathMotion(sim.roads, path, 5.0)
    assert longitudinal(sim.roads, ego, other, "trajectory", False) == pytest.approx(15.0 + 20.0)
    assert lateral(sim.roads, ego, other, "trajectory", False) == pytest.approx(2.0)


def test_the_bearing_says_how_many_lanes_lie_between() -> None:
    sim = scene("Ego", "Other")
    ego, other = put(sim, "Ego", -2, 100.0), put(sim, "Other", 1, 90.0)
    seen = bearing(sim.roads, ego, other, lane=False)
    assert seen is not None
    assert (seen.ds, seen.lanes, seen.aligned) == (pytest.approx(-10.0), 2, True)


def _rate(
    sim: Simulation, ego: Entity, other: Entity, kind: str, system: str, freespace: bool
) -> float:
    """Closing speed by moving both for a moment."""
    dt = 1e-4

    def distance() -> float:
        if kind == "euclidean":
            return euclidean(ego, other, freespace)
        measure = longitudinal if kind == "longitudinal" else lateral
        return abs(measure(sim.roads, ego, other, system, freespace) or 0.0)

    before = distance()
    for entity in (ego, other):
        entity.x += entity.vx * dt
        entity.y += entity.vy * dt
        sim.roads.leave_lane(entity)
    return (before - distance()) / dt


@pytest.mark.parametrize("road", ["straight", "curve"])
@pytest.mark.parametrize(
    ("kind", "system"),
    [
        (kind, system)
        for kind in ("longitudinal", "lateral")
        for system in ("entity", "road", "lane")
    ]
    + [("euclidean", "entity")],
)
def test_closing_speed_is_the_rate_at_which_the_distance_shrinks(
    kind: str, system: str, road: str
) -> None:
    sim = scene("Ego", "Other", road=road)
    ego, other = put(sim, "Ego", -2, 60.0, speed=20.0), put(sim, "Other", -1, 100.0, speed=-5.0)
    other.vx, other.vy = other.vx + 1.0, other.vy + 2.0
    if kind == "euclidean":
        found: float | None = closing_euclidean(ego, other, False)
    else:
        found = (closing_longitudinal if kind == "longitudinal" else closing_lateral)(
            sim.roads, ego, other, system, "undefined"
        )
    assert found == pytest.approx(_rate(sim, ego, other, kind, system, False), rel=1e-3, abs=1e-3)


def test_boxes_close_with_the_speed_of_their_nearest_points() -> None:
    sim = scene("Ego", "Other", road=None)
    ego, other = (
        put_free(sim, "Ego", 0.0, 0.0, speed=10.0),
        put_free(sim, "Other", 30.0, 1.0, speed=2.0),
    )
    assert closing_euclidean(ego, other, True) == pytest.approx(8.0, rel=1e-6)


def test_a_box_without_length_is_a_point() -> None:
    point = BoundingBox(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    sim = scene("Ego", "Other", road=None)
    ego, other = put_free(sim, "Ego", 0.0, 0.0), put_free(sim, "Other", 3.0, 4.0)
    ego.box = other.box = point
    assert euclidean(ego, other, True) == pytest.approx(5.0)


def test_trajectory_freespace_takes_the_box_along_the_tangent() -> None:
    sim = scene("Ego", "Other", road=None)
    ego, other = put_free(sim, "Ego", 5.0, 0.0), put_free(sim, "Other", 30.0, 3.0)
    ego.controls.motion = PathMotion(
        sim.roads, Polyline([Corner(0.0, 0.0, 0.0), Corner(50.0, 0.0, 0.0)]), 5.0
    )
    assert longitudinal(sim.roads, ego, other, "trajectory", True) == pytest.approx(25.0 - 5.0)
    assert lateral(sim.roads, ego, other, "trajectory", True) == pytest.approx(1.0)
    drive(ego, 20.0)
    drive(other, 5.0)
    assert closing_longitudinal(sim.roads, ego, other, "trajectory", "undefined") == pytest.approx(
        15.0
    )
