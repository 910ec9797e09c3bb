"""Each criterion over tracks that are drawn by hand: one that passes, one that
fails, one that can't be judged.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree

import xodr
from runner.engine.participants.declaration import BoundingBox
from runner.judging.criteria.criterion import Contact, CriterionFinding, Drive, kinds
from runner.recording import Recording, Track

ROADS = Path(__file__).parents[3] / "conformance" / "roads"
CAR = BoundingBox(1.5, 0.0, 0.75, 5.0, 2.0, 1.5)
"""From 1 m behind to 4 m ahead of the reference point, 1 m to each side."""
Place = tuple[float, float]


def track(way: Sequence[Place], dt: float = 0.1, h: float | None = None) -> Track:
    """A car whose reference point is at these places (m), a time step apart; it
    faces where it goes unless told otherwise.
    """
    x, y = np.array(way, float).T
    step = np.hypot(np.diff(x), np.diff(y))
    heading = np.arctan2(np.diff(y, append=y[-1]), np.diff(x, append=x[-1]))
    heading[-1] = heading[-2]
    n = len(x)
    columns = {
        name: np.zeros(n)
        for name in ("z", "pitch", "roll", "acceleration", "s", "t", "lane_offset")
    }
    columns |= {
        "time": np.arange(n) * dt,
        "x": x,
        "y": y,
        "h": heading if h is None else np.full(n, h),
    }
    columns |= {
        "speed": np.append(step, step[-1]) / dt,
        "lane_id": np.zeros(n, np.int64),
        "road_id": np.full(n, None, object),
    }
    return Track("Ego", "vehicle", "car", CAR, lambda: columns)


def drive(way: Sequence[Place], road: str | None = None, **more: Any) -> Drive:
    """A drive along these places on a road of the conformance tests."""
    network = xodr.load(ROADS / f"{road}.xodr") if road else None
    recorded = track(way, more.pop("dt", 0.1), more.pop("h", None))
    return Drive(recorded, Recording([recorded], 0.1, network), **more)


def ahead(start: float, end: float, y: float = -1.75, step: float = 1.0) -> list[Place]:
    """Places along the road; at 0.1 s a step of 1 m is 10 m/s."""
    direction = math.copysign(step, end - start)
    return [(start + direction * i, y) for i in range(round(abs(end - start) / step) + 1)]


def judge(name: str, driven: Drive, **parameters: float) -> CriterionFinding:
    """What a criterion finds."""
    kind = kinds()[name.casefold()]
    return kind.evaluate(driven, **kind.parameters | parameters)


def test_driven_distance() -> None:
    driven = drive(ahead(0, 60))
    assert judge("DrivenDistanceTest", driven, distance_success=50.0) == (
        True,
        60.0,
        "drove 60.0 m, more than 50 m",
        0.2,
    )
    assert judge("DrivenDistanceTest", driven, distance_success=60.0).passed is False


def test_driven_distance_counts_every_way_from_a_time_on() -> None:
    there_and_back = [*ahead(0, 20), *ahead(19, 0)]
    assert judge(
        "DrivenDistanceTest", drive(there_and_back), distance_success=30.0
    ).value == pytest.approx(40.0)
    assert judge(
        "DrivenDistanceTest", drive(there_and_back, since=2.0), distance_success=30.0
    ).value == pytest.approx(20.0)


def test_average_velocity() -> None:
    driven = drive([*ahead(0, 20), *[(20.0, -1.75)] * 20])
    assert judge("AverageVelocityTest", driven, velocity=4.9).passed is True
    assert judge("AverageVelocityTest", driven, velocity=5.1).passed is False


def test_max_velocity_is_that_of_the_whole_run() -> None:
    driven = drive([*ahead(0, 20), *ahead(20.5, 30, step=0.5)])
    assert judge("MaxVelocityTest", driven, max_velocity=10.1).passed is True
    failed = judge("MaxVelocityTest", driven, max_velocity=8.0)
    assert (
        failed.passed is False and failed.value == pytest.approx(10.0) and "0.00 s" in failed.reason
    )


def test_actor_blocked() -> None:
    driven = drive([*ahead(0, 5), *[(5.0, -1.75)] * 30, *ahead(6, 10)])
    assert judge("ActorBlockedTest", driven, min_speed=0.5, max_time=4.0).passed is True
    failed = judge("ActorBlockedTest", driven, min_speed=0.5, max_time=2.0)
    assert failed.passed is False and failed.value == pytest.approx(2.9)


def test_reached_region() -> None:
    region = {"min_x": 40.0, "max_x": 45.0, "min_y": -5.0, "max_y": 0.0}
    assert (
        judge("ReachedRegionTest", drive(ahead(0, 50)), **region).reason
        == "reached the region at 3.90 s"
    )
    missed = judge("ReachedRegionTest", drive(ahead(0, 30)), **region)
    assert missed.passed is False and missed.value == pytest.approx(8.5)


def test_collision() -> None:
    driven = drive(ahead(0, 60))
    assert judge("CollisionTest", driven) == (True, 0.0, "no collision", None)
    hits = (Contact(1.0, "A"), Contact(1.2, "B"), Contact(3.0, "A"), Contact(5.5, "C"))
    found = judge("CollisionTest", drive(ahead(0, 60), contacts=hits))
    assert found == (False, 2.0, "hit A at 1.00 s with 10.0 m/s", None)


def test_a_collision_in_standstill_is_not_its_fault() -> None:
    found = judge("CollisionTest", drive([(5.0, -1.75)] * 30, h=0.0, contacts=(Contact(2.0, "A"),)))
    assert found.passed is True and "stood when A touched it at 2.00 s" in found.reason


def test_off_road_looks_at_the_centre_and_adds_up_times() -> None:
    out_and_back = [*ahead(0, 20), *ahead(20, 30, y=-9.5), *ahead(30, 40)]
    assert judge("OffRoadTest", drive(ahead(0, 40), "straight")).passed is True
    failed = judge("OffRoadTest", drive(out_and_back, "straight", h=0.0))
    assert (
        failed.passed is False
        and failed.value == pytest.approx(1.0)
        and "first at 2.10 s" in failed.reason
    )
    assert judge("OffRoadTest", drive(out_and_back, "straight", h=0.0), duration=1.5).passed is True


def test_off_road_counts_the_sidewalk_as_off() -> None:
    assert judge("OffRoadTest", drive(ahead(0, 40, y=-8.0), "straight")).passed is False


def test_on_sidewalk() -> None:
    assert judge("OnSidewalkTest", drive(ahead(0, 40), "straight")).passed is True
    walked = judge("OnSidewalkTest", drive(ahead(0, 40, y=-8.0), "straight"))
    assert walked.passed is False and "first on a sidewalk at 0.00 s" in walked.reason
    outside = judge("OnSidewalkTest", drive(ahead(0, 40, y=-20.0), "straight"))
    assert outside.passed is False and "first off the carriageway at 0.00 s" in outside.reason


def test_a_wheel_on_the_carriageway_is_not_off_it() -> None:
    assert judge("OffRoadTest", drive(ahead(0, 40, y=4.4), "crossing")).passed is False
    assert judge("OnSidewalkTest", drive(ahead(20, 60, y=4.4), "crossing")).passed is True


def test_wrong_lane() -> None:
    assert judge("WrongLaneTest", drive(ahead(0, 40), "straight")).passed is True
    failed = judge(
        "WrongLaneTest", drive([*ahead(0, 20), *ahead(20, 40, y=1.75)], "straight", h=0.0)
    )
    assert (
        failed.passed is False
        and failed.value == pytest.approx(23.5)
        and "lane 1 of road 1" in failed.reason
    )


def test_wrong_lane_leaves_junctions_out() -> None:
    across = ahead(60, -60, y=1.75)
    assert judge("WrongLaneTest", drive(across, "crossing")).passed is True
    assert judge("WrongLaneTest", drive(ahead(60, -60, y=-1.75), "crossing")).passed is False
    assert judge("WrongLaneTest", drive(ahead(9, -9, y=-1.75), "crossing")).passed is True


def test_keep_lane() -> None:
    assert judge("KeepLaneTest", drive(ahead(0, 40), "straight")).passed is True
    touched = judge(
        "KeepLaneTest", drive([*ahead(0, 20), *ahead(20, 40, y=-2.6)], "straight", h=0.0)
    )
    assert (
        touched.passed is False
        and touched.reason == "crossed a lane marking at 2.10 s, from lane -1 to lane -2 of road 1"
    )


def test_keep_lane_leaves_junctions_out() -> None:
    assert judge("KeepLaneTest", drive(ahead(60, -60, y=1.75), "crossing")).passed is True


def test_end_of_road() -> None:
    assert judge("EndofRoadTest", drive(ahead(0, 40), "straight")).passed is True
    across = drive(ahead(60, -60, y=1.75), "crossing")
    assert judge("EndofRoadTest", across).passed is False
    assert judge("EndofRoadTest", across, duration=20.0).passed is True


LIGHTS = {"1": [(0.0, "green"), (3.0, "red")], "2": [(0.0, "off;off;on")]}


@pytest.mark.parametrize(
    ("start", "passed", "value"),
    [(367, True, 0.0), (365, False, 1.0), (390, True, 0.0), (300, False, 1.0)],
)
def test_running_red_light_by_its_state_when_the_front_passes_the_line(
    start: int, passed: bool, value: float
) -> None:
    found = judge("RunningRedLightTest", drive(ahead(start, 450), "signals", lights=LIGHTS))
    assert (found.passed, found.value) == (passed, value)


def test_lights_without_a_state_can_t_be_judged_and_red_ones_count_all_the_same() -> None:
    dark = judge("RunningRedLightTest", drive(ahead(380, 420), "signals"))
    assert dark.passed is None and "light 1" in dark.reason
    assert (
        judge(
            "RunningRedLightTest", drive(ahead(340, 520), "signals", lights={"1": LIGHTS["1"]})
        ).passed
        is False
    )
    assert (
        judge("RunningRedLightTest", drive(ahead(0, 60), "signals")).reason
        == "came past no traffic light"
    )


def test_lights_are_for_one_direction() -> None:
    assert (
        judge(
            "RunningRedLightTest", drive(ahead(450, 350, y=1.75), "signals", lights=LIGHTS)
        ).reason
        == "came past no traffic light"
    )


@pytest.fixture
def lit_crossing(tmp_path: Path) -> xodr.RoadNetwork:
    """The crossing with a light behind it on road 3, which holds by reference on the connecting
    road 102, as in CARLA's towns.
    """
    root = etree.parse(ROADS / "crossing.xodr").getroot()
    light = (
        's="5" t="6" id="ahead" name="" dynamic="yes" orientation="-" zOffset="4" type="1000001" '
        'subtype="-1" country="OpenDRIVE"'
    )
    for road, inside in (
        ("3", f'<signal {light}><validity fromLane="0" toLane="0"/></signal>'),
        (
            "102",
            (
                '<signalReference s="20" t="0" id="ahead" orientation="+"><validity fromLane="-1" '
                'toLane="-1"/></signalReference>'
            ),
        ),
    ):
        element = root.find(f"road[@id='{road}']")
        element.append(etree.fromstring(f"<signals>{inside}</signals>"))
    path = tmp_path / "lit.xodr"
    path.write_bytes(etree.tostring(root))
    return xodr.load(path)


@pytest.mark.parametrize(("red_from", "passed"), [(0.0, False), (6.0, True)])
def test_lights_of_a_junction_hold_where_it_is_entered(
    lit_crossing: xodr.RoadNetwork, red_from: float, passed: bool
) -> None:
    recorded = track(ahead(60, -60, y=1.75))
    states = {"ahead": [(0.0, "green"), (red_from, "red")]}
    found = judge(
        "RunningRedLightTest",
        Drive(recorded, Recording([recorded], 0.1, lit_crossing), lights=states),
    )
    assert found.passed is passed
    assert found.reason == (
        "traffic lights passed: 1, none of them red"
        if passed
        else "ran the red light ahead at 4.90 s"
    )


@pytest.fixture
def stop_sign(tmp_path: Path) -> xodr.RoadNetwork:
    """The straight road with a stop sign at s = 100 m for the right lanes, and
    at s = 300 m for one lane only.
    """
    text = (ROADS / "signals.xodr").read_text()
    signs = "".join(
        f'<signal s="{s}" t="-8" id="stop{s}" name="" dynamic="no" orientation="+" zOffset="0" '
        'type="206" subtype="-1" '
        f'country="OpenDRIVE">{inside}</signal>'
        for s, inside in ((100, ""), (300, '<validity fromLane="-2" toLane="-2"/>'))
    )
    path = tmp_path / "stop.xodr"
    path.write_text(text.replace("<signals>", f"<signals>{signs}"))
    return xodr.load(path)


def stopping(at: float, network: xodr.RoadNetwork, y: float = -1.75) -> Drive:
    """A drive from s = 50 m to 350 m with a pause of 1 s."""
    recorded = track([*ahead(50, at, y), *[(at, y)] * 10, *ahead(at + 1, 350, y)])
    return Drive(recorded, Recording([recorded], 0.1, network))


@pytest.mark.parametrize(
    ("front", "passed"), [(-0.5, True), (-3.5, True), (-4.5, False), (-20.0, False)]
)
def test_running_stop_needs_a_standstill_near_the_line(
    stop_sign: xodr.RoadNetwork, front: float, passed: bool
) -> None:
    found = judge("RunningStopTest", stopping(96.0 + front, stop_sign))
    assert found.passed is passed
    assert found.reason == (
        "stop signs passed: 1, all after a stop"
        if passed
        else "ran the stop sign stop100 at " + found.reason[-6:]
    )


def test_a_stop_sign_of_another_lane_is_not_met(stop_sign: xodr.RoadNetwork) -> None:
    assert judge("RunningStopTest", stopping(96.0, stop_sign)).passed is True
    assert judge("RunningStopTest", stopping(96.0, stop_sign, y=-5.25)).passed is False
    assert (
        judge("RunningStopTest", drive(ahead(0, 60), "straight")).reason == "came past no stop sign"
    )


def test_every_criterion_has_a_name_and_says_what_it_needs() -> None:
    assert len(kinds()) >= 13
    assert all(
        kind.summary and kind.unit and kind.name.endswith("Test") for kind in kinds().values()
    )


@pytest.mark.parametrize(
    ("name", "way", "road", "parameters", "margins"),
    [
        # 2 m wide in a lane of 3.5 m
        ("KeepLaneTest", ahead(0, 40), "straight", {}, 0.75),
        ("KeepLaneTest", ahead(0, 40, y=-2.25), "straight", {}, 0.25),
        ("MaxVelocityTest", ahead(0, 40), None, {"max_velocity": 12.5}, 0.2),
        ("MaxVelocityTest", ahead(0, 40), None, {"max_velocity": 8.0}, -0.25),
        ("AverageVelocityTest", ahead(0, 40), None, {"velocity": 8.0}, 0.25),
        ("ActorBlockedTest", [(5.0, 0.0)] * 21, None, {"min_speed": 1.0, "max_time": 4.0}, 0.5),
        ("ReachedRegionTest", ahead(0, 40), None,
         {"min_x": 45.0, "max_x": 50.0, "min_y": -5.0, "max_y": 5.0}, -3.5),
        ("OffRoadTest", [*ahead(0, 20), *ahead(20, 30, y=-9.5), *ahead(30, 40)], "straight", {}, -1.0),
    ],
)  # fmt: skip
def test_margins_lead_to_failures(
    name: str, way: Sequence[Place], road: str | None, parameters: dict[str, float], margins: float
) -> None:
    found = judge(name, drive(way, road, h=0.0), **parameters)
    assert found.signed == pytest.approx(margins, abs=0.02)
    assert (found.signed > 0.0) == found.passed


def test_the_margin_of_a_light_is_the_time_to_red() -> None:
    lights = {"1": [(0.0, "green"), (100.0, "red")], "2": [(0.0, "green")]}
    near = {"1": [(0.0, "red"), (1.0, "green"), (100.0, "red")], "2": [(0.0, "green")]}
    far, soon = (
        judge("RunningRedLightTest", drive(ahead(340, 520), "signals", lights=each))
        for each in (lights, near)
    )
    assert far.passed and soon.passed
    assert far.signed > 50.0 > soon.signed > 0.0


def test_room_to_the_road_s_edge_is_the_margin_of_off_road() -> None:
    middle, edge = (
        judge("OffRoadTest", drive(ahead(0, 40, y=y), "straight", h=0.0)) for y in (-1.75, -6.5)
    )
    assert middle.passed and edge.passed and middle.signed > edge.signed > 0.0


def test_speed_limits_are_those_of_the_road() -> None:
    # 27.78 m/s, that is 100 km/h
    slow, fast = (drive(ahead(0, 60, step=step), "straight") for step in (1.0, 3.0))
    kept, broken = judge("SpeedLimitTest", slow), judge("SpeedLimitTest", fast)
    assert kept.passed and kept.signed == pytest.approx(0.64)
    assert broken.passed is False and broken.signed == pytest.approx(-0.08)
    assert judge("SpeedLimitTest", fast, tolerance=3.0).passed
