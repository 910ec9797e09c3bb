"""OSI traces: read back by ASAM's own packages."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import runner
from runner import cli
from runner.exports import osi
from schemas.errors import UsageError
from tests.runner.files import car, place, scenario, speed_action, story
from xosc.exports.folder import Folder

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
    specification = osi_utilities.ChannelSpecification(path, message_type=osi_utilities.MessageType.GROUND_TRUTH)
    with osi_utilities.open_channel(specification) as reader:
        return list(reader)


@pytest.mark.parametrize("suffix", osi.FORMATS)
def test_a_trace_tells_where_everyone_was(result: runner.RunResult, suffix: str, tmp_path: Path) -> None:
    osi.write_trace(result, tmp_path / f"trace{suffix}")
    messages = read(tmp_path / f"trace{suffix}")
    tracks = result.recording.tracks
    assert len(messages) == len(tracks["Ego"].columns["time"])
    for row, message in enumerate(messages):
        time = message.timestamp.seconds + message.timestamp.nanos / 1e9
        assert time == pytest.approx(tracks["Ego"].columns["time"][row])
        assert [each.source_reference[0].identifier[0] for each in message.moving_object] == ["Ego", "Other"]
        assert message.host_vehicle_id.value == message.moving_object[0].id.value
        for each, track in zip(message.moving_object, tracks.values(), strict=True):
            yaw, position, rear = each.base.orientation.yaw, each.base.position, each.vehicle_attributes.bbcenter_to_rear
            assert math.cos(yaw - track.columns["h"][row]) == pytest.approx(1.0)
            x = position.x + rear.x * math.cos(yaw) - rear.y * math.sin(yaw)
            y = position.y + rear.x * math.sin(yaw) + rear.y * math.cos(yaw)
            assert (x, y, position.z + rear.z) == pytest.approx([track.columns[axis][row] for axis in "xyz"], abs=1e-3)


def test_motion_is_that_of_the_world_frame(result: runner.RunResult, tmp_path: Path) -> None:
    osi.write_trace(result, tmp_path / "trace.osi")
    ego, other = read(tmp_path / "trace.osi")[10].moving_object
    assert math.hypot(ego.base.velocity.x, ego.base.velocity.y) == pytest.approx(10.0, rel=0.02)
    assert math.atan2(ego.base.velocity.y, ego.base.velocity.x) == pytest.approx(ego.base.orientation.yaw, abs=0.05)
    braking = np.array([other.base.acceleration.x, other.base.acceleration.y])
    facing = np.array([math.cos(other.base.orientation.yaw), math.sin(other.base.orientation.yaw)])
    assert float(braking @ facing) == pytest.approx(-5.0, rel=0.05)
    assert ego.vehicle_classification.type == ego.vehicle_classification.TYPE_CAR
    assert (ego.base.dimension.length, ego.base.dimension.width, ego.base.dimension.height) == (5.0, 2.0, 1.5)


def test_traces_are_named_as_the_standard_names_them(result: runner.RunResult, tmp_path: Path) -> None:
    osi.export(result, "a_run~1", Folder(tmp_path))
    first, second = sorted(tmp_path.iterdir())
    assert (first.suffix, second.suffix, first.stem) == (".mcap", ".osi", second.stem)
    parsed = osi_utilities.parse_osi_trace_filename(second.name)
    assert (parsed["message_type"].name, parsed["number_of_frames"]) == ("GROUND_TRUTH", len(read(second)))
    assert parsed["osi_version"] == "{0.version_major}.{0.version_minor}.{0.version_patch}".format(read(second)[0].version)


@pytest.mark.parametrize("suffix", osi.FORMATS)
def test_the_same_run_gives_the_same_bytes(result: runner.RunResult, suffix: str, tmp_path: Path) -> None:
    for name in ("a", "b"):
        osi.write_trace(result, tmp_path / f"{name}{suffix}")
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_the_command_writes_a_trace_beside_its_table(path: Path, tmp_path: Path) -> None:
    arguments = [str(path), "--world", "kinematic", "--sut", "none", "--osi", str(tmp_path / "t.osi")]
    assert CliRunner().invoke(cli.app, arguments).exit_code == 0
    assert read(tmp_path / "t.osi")[0].map_reference == "curve.xodr"


def test_one_trace_is_of_one_run(path: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="one trace is of one run"):
        list(osi.alone(iter([1, 2]), tmp_path / "t.osi"))  # type: ignore[list-item]
    with pytest.raises(UsageError, match=r"\.osi or \.mcap"):
        list(osi.alone(iter([]), tmp_path / "t.txt"))
