"""OSI traces: read back by ASAM's own packages."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shapely import LineString, Point
from typer.testing import CliRunner

import runner
import xosc
from runner import xosc_run
from runner.exchange.exports import osi
from runner.exchange.exports.moments import box_centre
from schemas.checks.osi import breaches
from schemas.common.errors import UsageError
from schemas.osi.traces import TraceMessage
from tests.runner.files import car, place, scenario, speed_action, story
from xosc.exports.draft import Folder

pytest.importorskip("osi3", reason="the extra `osi` is not installed")
osi_utilities = pytest.importorskip("osi_utilities", reason="the extra `osi` is not installed")


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ego in a curve, and a car that comes towards it and brakes."""
    brake = speed_action(0, 'dynamicsShape="linear" dynamicsDimension="rate" value="5"')
    return scenario(
        tmp_path_factory.mktemp("osi"),
        road="curve",
        entities=[car("Ego"), car("Other")],
        init=place("Ego", 20, 10) + place("Other", 150, 10, lane=1),
        stories=story("Other", [(0.5, brake)]),
        stop=2.0,
    )


@pytest.fixture(scope="module")
def result(path: Path) -> runner.RunResult:
    return runner.run(path, world="kinematic", timestep=0.1, sut="none")


def read(path: Path) -> list:
    """All messages of a trace, read with the reader that the packages take for its ending."""
    specification = osi_utilities.ChannelSpecification(
        path, message_type=osi_utilities.MessageType.GROUND_TRUTH
    )
    with osi_utilities.open_channel(specification) as reader:
        return list(reader)


def broken(messages: list[Any]) -> list[str]:
    """Return the breaches of OSI's rules: uid and text."""
    return [
        f"{rule.uid}: {text}"
        for _, rule, text in breaches(
            TraceMessage(n, each, each) for n, each in enumerate(messages, 1)
        )
    ]


@pytest.mark.parametrize("suffix", osi.FORMATS)
def test_a_trace_tells_where_everyone_was(
    result: runner.RunResult, suffix: str, tmp_path: Path
) -> None:
    osi.write_trace(result, tmp_path / f"trace{suffix}")
    messages = read(tmp_path / f"trace{suffix}")
    tracks = result.recording.tracks
    assert len(messages) == len(tracks["Ego"].columns["time"])
    for row, message in enumerate(messages):
        time = message.timestamp.seconds + message.timestamp.nanos / 1e9
        assert time == pytest.approx(tracks["Ego"].columns["time"][row])
        assert [each.source_reference[0].identifier[0] for each in message.moving_object] == [
            "Ego",
            "Other",
        ]
        assert message.host_vehicle_id.value == message.moving_object[0].id.value
        for each, track in zip(message.moving_object, tracks.values(), strict=True):
            yaw, position, rear = (
                each.base.orientation.yaw,
                each.base.position,
                each.vehicle_attributes.bbcenter_to_rear,
            )
            assert math.cos(yaw - track.columns["h"][row]) == pytest.approx(1.0)
            x = position.x + rear.x * math.cos(yaw) - rear.y * math.sin(yaw)
            y = position.y + rear.x * math.sin(yaw) + rear.y * math.cos(yaw)
            assert (x, y, position.z + rear.z) == pytest.approx(
                [track.columns[axis][row] for axis in "xyz"], abs=1e-3
            )


def test_motion_is_that_of_the_world_frame(result: runner.RunResult, tmp_path: Path) -> None:
    osi.write_trace(result, tmp_path / "trace.osi")
    ego, other = read(tmp_path / "trace.osi")[10].moving_object
    assert math.hypot(ego.base.velocity.x, ego.base.velocity.y) == pytest.approx(10.0, rel=0.02)
    assert math.atan2(ego.base.velocity.y, ego.base.velocity.x) == pytest.approx(
        ego.base.orientation.yaw, abs=0.05
    )
    braking = np.array([other.base.acceleration.x, other.base.acceleration.y])
    facing = np.array([math.cos(other.base.orientation.yaw), math.sin(other.base.orientation.yaw)])
    assert float(braking @ facing) == pytest.approx(-5.0, rel=0.05)
    assert ego.vehicle_classification.type == ego.vehicle_classification.TYPE_CAR
    assert (ego.base.dimension.length, ego.base.dimension.width, ego.base.dimension.height) == (
        5.0,
        2.0,
        1.5,
    )


def test_traces_are_named_as_the_standard_names_them(
    result: runner.RunResult, tmp_path: Path
) -> None:
    osi.export(result, "a_run~1", Folder(tmp_path))
    first, second, road = sorted(tmp_path.iterdir(), key=lambda each: each.suffix)
    assert road.name == read(second)[0].map_reference
    assert (first.suffix, second.suffix, first.stem) == (
        ".mcap",
        ".osi",
        second.stem.replace("_gt_", "_multi_"),
    )
    parsed = osi_utilities.parse_osi_trace_filename(second.name)
    assert (parsed["message_type"].name, parsed["number_of_frames"]) == (
        "GROUND_TRUTH",
        len(read(second)),
    )
    assert parsed["osi_version"] == "{0.version_major}.{0.version_minor}.{0.version_patch}".format(
        read(second)[0].version
    )


def test_the_ego_has_a_command_and_updates(result: runner.RunResult, tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    osi.write_trace(result, path)
    track = result.recording.tracks["Ego"]
    centre, time = box_centre(track), track.columns["time"]

    def messages(topic: str, kind: Any) -> list[Any]:
        specification = osi_utilities.ChannelSpecification(path, message_type=kind, topic=topic)
        with osi_utilities.open_channel(specification) as reader:
            return list(reader)

    (command,) = messages("traffic_command", osi_utilities.MessageType.TRAFFIC_COMMAND)
    updates = messages("traffic_update", osi_utilities.MessageType.TRAFFIC_UPDATE)
    (action,) = command.action
    points = action.follow_trajectory_action.trajectory_point
    assert command.HasField("version") and len(points) == len(updates) == len(time)
    for row, (point, update) in enumerate(zip(points, updates, strict=True)):
        (each,) = update.update
        assert update.HasField("version") and each.id == command.traffic_participant_id
        for stamp, at in (
            (point.timestamp, point.position),
            (update.timestamp, each.base.position),
        ):
            assert stamp.seconds + stamp.nanos / 1e9 == pytest.approx(time[row])
            assert (at.x, at.y, at.z) == pytest.approx(centre[row].tolist())


@pytest.mark.parametrize("suffix", osi.FORMATS)
def test_the_same_run_gives_the_same_bytes(
    result: runner.RunResult, suffix: str, tmp_path: Path
) -> None:
    for name in ("a", "b"):
        osi.write_trace(result, tmp_path / f"{name}{suffix}")
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_the_command_writes_a_trace_beside_its_table(path: Path, tmp_path: Path) -> None:
    arguments = [
        str(path),
        "--world",
        "kinematic",
        "--sut",
        "none",
        "--osi",
        str(tmp_path / "t.osi"),
    ]
    assert CliRunner().invoke(xosc_run.app, arguments).exit_code == 0
    assert read(tmp_path / "t.osi")[0].map_reference == "curve.xodr"


def test_one_trace_is_of_one_run(path: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="one trace is of one run"):
        list(osi.alone(iter([1, 2]), tmp_path / "t.osi"))  # type: ignore[list-item]
    with pytest.raises(UsageError, match=r"\.osi or \.mcap"):
        list(osi.alone(iter([]), tmp_path / "t.txt"))


LIBRARY = Path(xosc.__file__).parent / "library"
ROADS = [
    "ramp_exiting_highway",
    "roundabout_exiting",
    "intersection_pedestrian_crossing",
    "turn_off_t_junction",
]


@pytest.fixture(scope="module", params=ROADS)
def driven(request: pytest.FixtureRequest) -> runner.RunResult:
    """Runs of the library on highways, roundabouts and intersections."""
    return runner.run(
        LIBRARY / f"{request.param}.xosc",
        world="kinematic",
        timestep=0.5,
        sut="none",
        max_time=10.0,
    )


def test_traces_keep_the_rules_of_the_standard(driven: runner.RunResult, tmp_path: Path) -> None:
    osi.write_trace(driven, tmp_path / "trace.osi")
    messages = read(tmp_path / "trace.osi")
    assert broken(messages) == []
    assert all(message.lane and message.lane_boundary for message in messages)


def test_everyone_is_between_the_boundaries_of_the_lane_that_is_assigned(
    result: runner.RunResult,
) -> None:
    for message in osi.ground_truths(result):
        lanes = {lane.id.value: lane.classification for lane in message.lane}
        lines = {each.id.value: LineString([(p.position.x,
            p.position.y) for p in each.boundary_line])
                 for each in message.lane_boundary}  # fmt: skip
        for each in message.moving_object:
            (assigned,) = each.moving_object_classification.assigned_lane_id
            lane = lanes[assigned.value]
            here = Point(each.base.position.x, each.base.position.y)
            centre = LineString([(p.x, p.y) for p in lane.centerline])
            assert centre.distance(here) < 0.3
            ahead = Point(
                here.x + math.cos(each.base.orientation.yaw),
                here.y + math.sin(each.base.orientation.yaw),
            )
            assert centre.project(ahead) > centre.project(here), (
                "centre lines lead in driving direction"
            )
            (left,), (right,) = lane.left_lane_boundary_id, lane.right_lane_boundary_id
            side = [math.cos(each.base.orientation.yaw), math.sin(each.base.orientation.yaw)]
            for boundary, sign in ((left, 1.0), (right, -1.0)):
                nearest = lines[boundary.value].interpolate(lines[boundary.value].project(here))
                assert (
                    sign * (side[0] * (nearest.y - here.y) - side[1] * (nearest.x - here.x)) > 0.5
                )
        (host,) = [number for number, lane in lanes.items() if lane.is_host_vehicle_lane]
        assert (
            host == message.moving_object[0].moving_object_classification.assigned_lane_id[0].value
        )


def interpolated(points: Any, s: float, *values: str) -> list[float]:
    """Values along a line of OSI at an s; a name with a dot is of a part of its points."""
    along = [point.s_position for point in points]
    return [
        float(np.interp(s, along, [attrgetter(name)(point) for point in points])) for name in values
    ]


def test_places_on_logical_lanes_are_those_of_the_world(driven: runner.RunResult) -> None:
    count = 0
    for message in list(osi.ground_truths(driven))[::4]:
        lanes = {each.id.value: each for each in message.logical_lane}
        lines = {each.id.value: each.poly_line for each in message.reference_line}
        borders = {each.id.value: each.boundary_line for each in message.logical_lane_boundary}
        assert all(
            math.dist(
                (a.world_position.x, a.world_position.y), (b.world_position.x, b.world_position.y)
            )
            <= b.s_position - a.s_position + 1e-6
            for line in lines.values()
            for a, b in pairwise(line)
        )
        for each in message.moving_object:
            for assigned in each.moving_object_classification.logical_lane_assignment:
                lane, s, t = (
                    lanes[assigned.assigned_lane_id.value],
                    assigned.s_position,
                    assigned.t_position,
                )
                x, y, axis = interpolated(
                    lines[lane.reference_line_id.value],
                    s,
                    "world_position.x",
                    "world_position.y",
                    "t_axis_yaw",
                )
                found = (x + t * math.cos(axis), y + t * math.sin(axis))
                assert math.dist(found, (each.base.position.x, each.base.position.y)) < 0.15
                ((left,), (right,)) = (
                    interpolated(borders[ids[0].value], s, "t_position")
                    for ids in (lane.left_boundary_id, lane.right_boundary_id)
                )
                assert right - 0.02 <= t <= left + 0.02
                forward = lane.move_direction == lane.MOVE_DIRECTION_INCREASING_S
                assert (
                    each.type == each.TYPE_PEDESTRIAN
                    or (math.cos(assigned.angle_to_lane) > 0.5) == forward
                )
                count += 1
    assert count


def test_logical_lanes_know_their_neighbours_and_what_comes_next(driven: runner.RunResult) -> None:
    message = next(osi.ground_truths(driven))
    lanes = {each.id.value: each for each in message.logical_lane}
    borders = {each.id.value: each.boundary_line for each in message.logical_lane_boundary}
    for lane in lanes.values():
        for relation in lane.left_adjacent_lane:
            other = lanes[relation.other_lane_id.value]
            assert lane.id.value in [each.other_lane_id.value for each in other.right_adjacent_lane]
            assert other.right_boundary_id[0].value == lane.left_boundary_id[0].value
        for connection in lane.successor_lane:
            other = lanes[connection.other_lane_id.value]
            back = (
                other.predecessor_lane
                if connection.at_begin_of_other_lane
                else other.successor_lane
            )
            assert lane.id.value in [each.other_lane_id.value for each in back]
            ends = [
                borders[ids[0].value][-1].position
                for ids in (lane.left_boundary_id, lane.right_boundary_id)
            ]
            there = 0 if connection.at_begin_of_other_lane else -1
            begins = [
                borders[ids[0].value][there].position
                for ids in (other.left_boundary_id, other.right_boundary_id)
            ]
            assert math.dist(middle(ends), middle(begins)) < 0.1


def middle(points: list[Any]) -> tuple[float, float]:
    """The point half-way between two."""
    a, b = points
    return 0.5 * (a.x + b.x), 0.5 * (a.y + b.y)


BREAKS = [
    (lambda m: m.ClearField("host_vehicle_id"),
        "groundtruth.host_vehicle_id.is_set: host_vehicle_id is not set"),
    (lambda m: setattr(m.host_vehicle_id, "value", 999),
        "refers_to: host_vehicle_id 999 is of no MovingObject"),
    (lambda m: setattr(m.moving_object[1].id, "value", m.moving_object[0].id.value),
        "is_globally_unique: moving_object 0"),
    (lambda m: setattr(m.moving_object[0].base.orientation, "yaw", 4.0),
        "an angle is not from -pi to pi"),
    (lambda m: m.moving_object[0].base.ClearField("velocity"),
        "moving_object 0: velocity is not set in full"),
    (lambda m: setattr(m.moving_object[0].base.position, "x", math.nan),
        "moving_object 0: position is no number"),
    (lambda m: setattr(m.moving_object[0].base.dimension, "width", -1.0),
        "width is -1, >= 0 is expected"),
    (lambda m: m.moving_object[0].ClearField("vehicle_attributes"),
        "vehicle_attributes is not set, as type 2 demands"),
    (lambda m: setattr(m.moving_object[0], "type", 0), "moving_object 0: the type is unknown"),
    (lambda m: setattr(m.lane[0].classification, "type", 0), "the type is unknown"),
    (lambda m: setattr(m, "country_code", 1000), "country_code is 1000, 1 to 999 is expected"),
    (lambda m: m.lane[0].classification.ClearField("left_lane_boundary_id"),
        "a left and a right boundary"),
    (lambda m: setattr(m.lane[0].classification.right_lane_boundary_id[0], "value", 999),
        "the boundary 999 is not in the trace"),
    (lambda m: m.lane[0].classification.ClearField("centerline"), "less than two points"),
    (lambda m: setattr(m.lane_boundary[0].classification, "color", 0),
        "the type or colour is unknown"),
    (lambda m: setattr(m.timestamp, "seconds", -1), "seconds is -1, >= 0 is expected"),
    (lambda m: setattr(m.lane[0].id, "value", 0), "is_globally_unique"),
]  # fmt: skip


@pytest.mark.parametrize(("damage", "rule"), BREAKS, ids=[rule for _, rule in BREAKS])
def test_the_checker_finds_what_breaks_a_rule(
    damage: Callable[[Any], object], rule: str, result: runner.RunResult
) -> None:
    first, second, *_ = osi.ground_truths(result)
    assert broken([first, second]) == []
    damage(first)
    assert any(rule in each for each in broken([first, second]))
    assert broken([second, second]) == [
        "xosc.toolchain:osi:3.8.0:timestamp.ascends: the timestamp does not ascend"
    ]
