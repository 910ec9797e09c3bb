"""LaneChangeAction, LaneOffsetAction and LateralDistanceAction, by the
standard's formulas. All begin at 1 s.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runner
from runner import RunResult
from runner.judging.execution import prepare
from runner.judging.settings import RunSettings
from schemas import check
from schemas.common.errors import InvalidFile
from tests.conformance.support import SCENARIOS, at, changed, events, run, track

DT = 0.01
WIDTH, LANE = 2.0, 3.5
ROADS = {"RHT": "../roads/straight.xodr", "LHT": "../roads/straight_lht.xodr"}


# LaneChangeAction ---------------------------------------------------------------------------


def change_run(**parameters: object) -> RunResult:
    return run("LaneChangeAction", world="kinematic", parameters=parameters)


@pytest.mark.parametrize(
    ("shape", "value"),
    [
        ("linear", lambda p: p),
        ("cubic", lambda p: 3 * p**2 - 2 * p**3),
        ("sinusoidal", lambda p: (1 - np.cos(np.pi * p)) / 2),
    ],
)
def test_a_lane_change_follows_its_shape_over_time(shape: str, value: Any) -> None:
    result = change_run(Shape=shape, Dimension="time", Value=4.0)
    car = track(result, "Car")
    progress = np.clip((car["time"] - 1.0) / 4.0, 0.0, 1.0)
    assert np.allclose(car["y"], -LANE / 2 - LANE * value(progress), atol=1e-6)
    assert events(result, "endTransition", "CarAction")[0].time == pytest.approx(5.0 - DT)


@pytest.mark.parametrize(("steps", "offset", "told"), [(0, 0.0, 1), (0, 0.5, 0), (-1, 0.0, 0)])
def test_a_lane_change_into_the_own_lane_is_a_remark(steps: int, offset: float, told: int) -> None:
    remarks = change_run(Steps=steps, Offset=offset).remarks
    assert sum("Car is in lane -1 already" in remark for remark in remarks) == told


def test_the_speed_is_that_along_the_slanting_path() -> None:
    car = track(change_run(Shape="linear", Value=2.0), "Car")
    assert np.allclose(np.hypot(np.diff(car["x"]), np.diff(car["y"])), 10.0 * DT)


def test_the_heading_is_that_of_the_path_and_returns_to_the_lanes() -> None:
    car = track(change_run(Shape="linear", Value=2.0), "Car")
    assert at(car, 2.0, "h") == pytest.approx(-math.asin(LANE / 2.0 / 10.0), abs=1e-6)
    assert car["h"][-1] == 0.0


@pytest.mark.parametrize(
    ("shape", "duration"), [("linear", 3.5), ("cubic", 5.25), ("sinusoidal", 3.5 * math.pi / 2)]
)
def test_a_rate_is_the_greatest_lateral_speed(shape: str, duration: float) -> None:
    result = change_run(Shape=shape, Dimension="rate", Value=1.0)
    assert np.abs(np.diff(track(result, "Car")["y"])).max() / DT == pytest.approx(1.0, rel=1e-3)
    assert events(result, "endTransition", "CarAction")[0].time == pytest.approx(
        1.0 + duration, abs=2 * DT
    )


def test_a_distance_is_that_travelled() -> None:
    result = change_run(Shape="sinusoidal", Dimension="distance", Value=50.0)
    car = track(result, "Car")
    end = events(result, "endTransition", "CarAction")[0].time
    moved = (car["time"] > 1.0 - DT / 2) & (car["time"] < end + 1.5 * DT)
    way = np.hypot(np.diff(car["x"][moved]), np.diff(car["y"][moved])).sum()
    assert way == pytest.approx(50.0, abs=0.2)


@pytest.mark.parametrize(("dimension", "value"), [("time", 0.0), ("distance", 0.0)])
def test_a_change_that_takes_nothing_is_there_after_one_step(dimension: str, value: float) -> None:
    car = track(change_run(Dimension=dimension, Value=value), "Car")
    assert at(car, 1.0 + DT, "y") == pytest.approx(-1.5 * LANE)


@pytest.mark.parametrize("dimension", ("time", "distance"))
def test_what_stands_does_not_slide(dimension: str) -> None:
    result = change_run(Speed=0.0, Dimension=dimension)
    assert np.allclose(track(result, "Car")["y"], -LANE / 2)
    assert not events(result, "endTransition", "CarAction")


def test_what_creeps_moves_no_more_sideways_than_it_travels() -> None:
    car = track(change_run(Speed=0.5, Value=1.0), "Car")
    assert np.abs(np.diff(car["y"])).max() <= 0.5 * DT + 1e-9
    assert car["y"][-1] == pytest.approx(-1.5 * LANE)


@pytest.mark.parametrize("rule", ROADS)
@pytest.mark.parametrize("facing", (1, -1))
@pytest.mark.parametrize("side", (1, -1))
def test_relative_lanes_count_to_the_left_of_the_entity(rule: str, facing: int, side: int) -> None:
    """The sign matrix: traffic rule × direction of travel × side, from one of
    the direction's two lanes to the other.
    """
    own_side = facing if rule == "LHT" else -facing
    lane = own_side * (1 if side * facing == own_side else 2)
    result = change_run(Road=ROADS[rule], Lane=lane, Steps=side)
    car = track(result, "Car")
    assert car["y"][-1] - car["y"][0] == pytest.approx(side * facing * LANE)
    assert math.cos(car["h"][0]) == pytest.approx(facing)


@pytest.mark.parametrize(
    ("lane", "steps", "reached"),
    [("-1", 1, 1), ("-1", 2, 2), ("1", 1, -1), ("-2", -1, -3), ("-1", 0, -1)],
)
def test_the_centre_lane_is_not_counted(lane: str, steps: int, reached: int) -> None:
    car = track(change_run(Lane=lane, Steps=steps), "Car")
    assert int(car["lane_id"][-1]) == reached


@pytest.mark.parametrize(
    ("lane", "heading", "offset"), [("-1", 0.0, 0.5), ("-1", math.pi, -0.5), ("1", 0.0, 0.5)]
)
def test_the_target_lane_offset_is_in_the_roads_t_direction(
    lane: str, heading: float, offset: float
) -> None:
    car = track(change_run(Lane=lane, Heading=heading, Steps=0, Offset=offset), "Car")
    assert car["lane_offset"][-1] == pytest.approx(offset)
    assert car["y"][-1] - car["y"][0] == pytest.approx(offset)


def test_an_absolute_lane_is_reached_across_others() -> None:
    car = track(change_run(Target="2"), "Other")
    assert (int(car["lane_id"][-1]), car["y"][-1]) == (2, pytest.approx(1.5 * LANE))


def test_a_lane_that_does_not_exist_there_is_named() -> None:
    with pytest.raises(
        InvalidFile,
        match=r"LaneChangeAction\.xosc:\d+: LaneChangeAction: .* can't change to "
        r"lane .* has the lanes",
    ):
        change_run(Steps=-5)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (
            {"Target": "-7"},
            (
                "AbsoluteTargetLane: value='-7' is no lane of any road; lanes there "
                "are: -3, -2, -1, 1, 2, 3"
            ),
        ),
        (
            {"Steps": -6},
            (
                "RelativeTargetLane: value='-6' leads beyond the lanes of any "
                "road, which has 6 at most"
            ),
        ),
    ],
)
def test_a_lane_that_exists_nowhere_is_named_before_the_run(
    parameters: dict[str, object], message: str
) -> None:
    with pytest.raises(InvalidFile, match=re.escape(message)):
        prepare(SCENARIOS / "LaneChangeAction.xosc", parameters)


@pytest.mark.parametrize("target", ("0", "left", "-1.5"))
def test_what_is_no_lane_is_refused(target: str) -> None:
    with pytest.raises(InvalidFile, match="AbsoluteTargetLane"):
        change_run(Target=target)


@pytest.mark.parametrize("dimension", ("time", "distance"))
def test_a_lane_change_goes_on_where_the_next_road_is_laid_the_other_way_round(
    dimension: str,
) -> None:
    value = 4.0 if dimension == "time" else 40.0
    car = track(
        change_run(
            Road="../roads/opposed.xodr", S=270.0, Shape="linear", Dimension=dimension, Value=value
        ),
        "Car",
    )
    assert set(car["road_id"]) == {"1", "2"}
    assert np.abs(np.diff(car["y"])).max() <= LANE / 4.0 * DT * 1.01
    assert (car["y"][-1], int(car["lane_id"][-1])) == (pytest.approx(-1.5 * LANE), 2)
    assert np.diff(car["x"]).min() > 0.0


ENDING = """<road id="{id}" length="{length}" junction="-1"><link>{link}</link>
<planView><geometry s="0" x="{x}" y="0" hdg="0" length="{length}"><line/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>{lanes}</right></laneSection></lanes></road>"""
ENDING_LANE = (
    '<lane id="{}" type="driving"><link>{}</link><width sOffset="0" a="3.5" b="0" c="0" '
    'd="0"/></lane>'
)


def test_a_change_to_a_lane_that_does_not_go_on_ends_in_the_lane_that_does(tmp_path: Path) -> None:
    onward, back = (
        '<{} elementType="road" elementId="{}" contactPoint="{}"/>'.format(*link)
        for link in (("successor", 2, "start"), ("predecessor", 1, "end"))
    )
    lanes = ENDING_LANE.format(-1, '<successor id="-1"/>') + ENDING_LANE.format(-2, "")
    first = ENDING.format(id=1, length=300, link=onward, x=0, lanes=lanes)
    second = ENDING.format(
        id=2, length=700, link=back, x=300, lanes=ENDING_LANE.format(-1, '<predecessor id="-1"/>')
    )
    path = tmp_path / "ending.xodr"
    path.write_text(
        f'<OpenDRIVE><header revMajor="1" revMinor="6"/>{first}{second}</OpenDRIVE>',
        encoding="utf-8",
    )
    car = track(change_run(Road=str(path), S=270.0, Shape="sinusoidal", Value=4.0), "Car")
    assert set(car["road_id"]) == {"1", "2"}
    steps = np.hypot(np.diff(car["x"]), np.diff(car["y"]))
    assert steps == pytest.approx(steps[0], abs=1e-4), "without a jump"
    assert np.abs(np.diff(car["h"])).max() < 0.2, "without sliding sideways"
    assert (car["y"][-1], int(car["lane_id"][-1])) == (pytest.approx(-0.5 * LANE), -1)


# LaneOffsetAction ---------------------------------------------------------------------------


def offset_run(**parameters: object) -> RunResult:
    return run("LaneOffsetAction", world="kinematic", parameters=parameters)


@pytest.mark.parametrize(
    ("shape", "duration"), [("sinusoidal", math.pi / math.sqrt(2.0)), ("cubic", math.sqrt(6.0))]
)
def test_an_offset_takes_the_time_that_its_lateral_acceleration_needs(
    shape: str, duration: float
) -> None:
    result = offset_run(Shape=shape, MaxLateralAcc=1.0, Offset=1.0)
    car = track(result, "Car")
    assert np.abs(np.diff(car["y"], 2)).max() / DT**2 == pytest.approx(1.0, rel=0.02)
    assert car["y"][-1] == pytest.approx(-LANE / 2 + 1.0)
    assert events(result, "endTransition", "CarAction")[0].time == pytest.approx(
        1.0 + duration, abs=2 * DT
    )


def test_an_offset_moves_sideways_on_top_of_the_way_along_the_lane() -> None:
    assert np.allclose(np.diff(track(offset_run(), "Car")["x"]), 10.0 * DT)


@pytest.mark.parametrize(
    ("lane", "heading"), [("-1", 0.0), ("-1", math.pi), ("1", 0.0), ("1", math.pi)]
)
@pytest.mark.parametrize("offset", (0.7, -0.7))
def test_an_offset_is_in_the_roads_t_direction(lane: str, heading: float, offset: float) -> None:
    car = track(offset_run(Lane=lane, Heading=heading, Offset=offset), "Car")
    assert car["y"][-1] - car["y"][0] == pytest.approx(offset)
    assert car["lane_offset"][-1] == pytest.approx(offset)


@pytest.mark.parametrize("continuous", (True, False))
def test_an_offset_stays_on_its_side_where_the_next_road_is_laid_the_other_way_round(
    continuous: bool,
) -> None:
    car = track(
        offset_run(Road="../roads/opposed.xodr", S=280.0, Offset=0.7, Continuous=continuous), "Car"
    )
    assert set(car["road_id"]) == {"1", "2"}
    assert car["y"][-1] == pytest.approx(-LANE / 2 + 0.7)
    assert car["lane_offset"][-1] == pytest.approx(-0.7)


@pytest.mark.parametrize("lane", [-2, -1])
def test_a_relative_offset_is_from_the_references_place_on_the_road(lane: int) -> None:
    center = (lane + 0.5) * LANE
    result = offset_run(Continuous=False, Offset=1.0, Lane=lane)
    assert track(result, "Other")["t"][-1] == pytest.approx(
        center + 0.5
    )  # the reference was on its centre at the start
    result = offset_run(Continuous=True, Offset=1.0, Lane=lane)
    assert track(result, "Other")["t"][-1] == pytest.approx(center + 1.5)
    assert not events(result, "endTransition", "OtherAction")


def test_a_relative_offset_counts_across_the_border_of_roads(tmp_path: Path) -> None:
    other = ('roadId="1" laneId="-2" s="$S" offset="0"', 'roadId="2" laneId="1" s="250" offset="0"')
    path = changed(SCENARIOS / "LaneOffsetAction.xosc", tmp_path, other)
    roads = str(SCENARIOS.parent / "roads" / "opposed.xodr")
    parameters = {"Road": roads, "S": 250.0, "Lane": -2, "Offset": 0.0, "Continuous": False}
    columns = track(
        run(str(path.with_suffix("")), world="kinematic", parameters=parameters, max_time=8.0),
        "Other",
    )
    assert columns["y"][-1] == pytest.approx(-1.5 * LANE - 0.5, abs=0.01)  # +t of its road is -y


def test_a_step_offset_is_there_at_once_and_no_acceleration_never() -> None:
    assert at(track(offset_run(Shape="step"), "Car"), 1.0 + DT, "lane_offset") == pytest.approx(1.0)
    assert np.allclose(track(offset_run(MaxLateralAcc=0.0), "Car")["lane_offset"], 0.0)


# LateralDistanceAction ----------------------------------------------------------------------


def lateral_run(**parameters: object) -> RunResult:
    return run("LateralDistanceAction", world="kinematic", parameters=parameters)


@pytest.mark.parametrize("rule", ROADS)
@pytest.mark.parametrize("lane", ("-1", "1"))
@pytest.mark.parametrize(
    ("displacement", "side"), [("leftToReferencedEntity", 1), ("rightToReferencedEntity", -1)]
)
@pytest.mark.parametrize("system", ("entity", "road", "lane"))
def test_a_lateral_distance_is_kept_on_the_references_side(
    rule: str, lane: str, displacement: str, side: int, system: str
) -> None:
    result = lateral_run(Road=ROADS[rule], Lane=lane, Displacement=displacement, System=system)
    facing = 1 if (lane == "-1") == (rule == "RHT") else -1
    left = (track(result, "Rigid")["y"] - track(result, "Reference")["y"]) * facing
    assert np.allclose(left[110:], side * (1.0 + WIDTH), atol=1e-6)


@pytest.mark.parametrize(
    ("displacement", "side"), [("leftToReferencedEntity", 1), ("rightToReferencedEntity", -1)]
)
def test_a_limited_lateral_distance_is_reached_within_the_limits(
    displacement: str, side: int
) -> None:
    result = lateral_run(Displacement=displacement, Continuous=False, Freespace=False)
    limited, reference = track(result, "Limited"), track(result, "Reference")
    assert (limited["y"] - reference["y"])[-1] == pytest.approx(side * 1.0, abs=0.06)
    end = events(result, "endTransition", "LimitedAction")[0].time
    assert np.abs(np.diff(limited["y"][limited["time"] < end], 2)).max() / DT**2 <= 1.0 + 1e-3


def test_any_side_is_the_one_that_it_is_on() -> None:
    result = lateral_run(Displacement="any", Freespace=False)
    left = track(result, "Rigid")["y"] - track(result, "Reference")["y"]
    assert left[-1] == pytest.approx(1.0)


def test_a_lateral_distance_goes_on_while_continuous() -> None:
    assert not events(lateral_run(Continuous=True), "endTransition", "RigidAction")
    assert events(lateral_run(Continuous=False), "endTransition", "RigidAction")


def test_a_distance_in_the_entitys_coordinates_needs_no_road(tmp_path: Path) -> None:
    text = (SCENARIOS / "LateralDistanceAction.xosc").read_text(encoding="utf-8")
    text = re.sub(r"<RoadNetwork>.*</RoadNetwork>", "<RoadNetwork/>", text, flags=re.DOTALL)
    text = re.sub(
        r"<LanePosition [^>]*>.*?</LanePosition>",
        '<WorldPosition x="500" y="0"/>',
        text,
        flags=re.DOTALL,
    )
    path = tmp_path / "entity.xosc"
    path.write_text(text, encoding="utf-8")
    result = runner.run(
        path,
        parameters={"System": "entity", "Freespace": False},
        sut=None,
        timestep=DT,
        world="kinematic",
    )
    assert track(result, "Rigid")["y"][-1] == pytest.approx(1.0)
    with pytest.raises(InvalidFile, match="not on a road"):
        runner.run(path, parameters={"System": "road"}, sut=None, timestep=DT, world="kinematic")


def test_a_continuous_offset_from_ones_own_counts_from_the_start(tmp_path: Path) -> None:
    own = (
        '<RelativeTargetLaneOffset entityRef="Car"',
        '<RelativeTargetLaneOffset entityRef="Other"',
    )
    path = changed(SCENARIOS / "LaneOffsetAction.xosc", tmp_path, own)
    settings = RunSettings(sut=None, world="kinematic", max_time=20.0)
    result = runner.run(path, settings, parameters={"Continuous": True})
    assert sum("can't keep" in remark for remark in result.remarks) == 1
    offsets = track(result, "Other")["lane_offset"]
    assert abs(offsets[-1] - offsets[0]) > 0.1
    assert offsets[-1] == pytest.approx(offsets[len(offsets) // 2])
    with pytest.raises(InvalidFile, match="can't keep"):
        runner.run(path, replace(settings, strict=True), parameters={"Continuous": True})


@pytest.mark.parametrize(
    ("continuous", "reference", "named"),
    [("true", "Other", 1), ("true", "Car", 0), ("false", "Other", 0)],
)
def test_the_check_names_a_continuous_offset_from_ones_own(
    continuous: str, reference: str, named: int, tmp_path: Path
) -> None:
    """The action of the file with a reference is that of the entity Other."""
    kept = (
        'name="Continuous" parameterType="boolean" value="false"',
        f'name="Continuous" parameterType="boolean" value="{continuous}"',
    )
    own = (
        '<RelativeTargetLaneOffset entityRef="Car"',
        f'<RelativeTargetLaneOffset entityRef="{reference}"',
    )
    path = changed(SCENARIOS / "LaneOffsetAction.xosc", tmp_path, kept, own)
    assert sum("own lane offset" in problem.message for problem in check(path)) == named


def test_headings_are_the_lanes_where_it_slants(tmp_path: Path) -> None:
    """Lane -1 widens by 2 cm a metre, so that lane -2 and its traffic go 2 cm to
    the right with every metre.
    """
    road = (SCENARIOS.parent / "roads" / "straight.xodr").read_text(encoding="utf-8")
    before, after = road.split('<lane id="-1"')
    after = re.sub(r'(<width [^>]*?)b="[^"]*"', r'\1b="0.02"', after, count=1)
    (tmp_path / "slanting.xodr").write_text(f'{before}<lane id="-1"{after}', encoding="utf-8")
    parameters = {
        "Road": str(tmp_path / "slanting.xodr"),
        "Lane": "-2",
        "Offset": 0.0,
        "Shape": "step",
    }
    car = track(
        run("LaneOffsetAction", parameters=parameters, world="kinematic", max_time=3.0), "Car"
    )
    assert np.allclose(car["h"], -math.atan(0.02), atol=1e-9), "from the beginning on"
    moved = np.hypot(np.diff(car["x"]), np.diff(car["y"]))
    assert np.allclose(moved, car["speed"][1:] * DT, rtol=1e-6)


def test_a_heading_has_no_jump_where_a_lane_change_crosses_a_border(tmp_path: Path) -> None:
    road = (SCENARIOS.parent / "roads" / "straight.xodr").read_text(encoding="utf-8")
    start, end = road.index("<laneSection"), road.index("</laneSection>") + len("</laneSection>")
    second = re.sub(r'<laneSection s="[^"]*"', '<laneSection s="540"', road[start:end])
    (tmp_path / "sections.xodr").write_text(road[:end] + second + road[end:], encoding="utf-8")
    car = track(
        run(
            "LaneChangeAction",
            parameters={"Road": str(tmp_path / "sections.xodr"), "Shape": "sinusoidal"},
            world="kinematic",
        ),
        "Car",
    )
    assert np.ptp(car["h"]) > 0.01
    assert np.abs(np.diff(car["h"])).max() < 0.005
