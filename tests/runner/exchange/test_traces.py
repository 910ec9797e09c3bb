"""Traces of ASAM OSI as recordings: what was exported comes back, maps are
found, and damaged files are refused in one line.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import runner
import xosc
from runner.exchange.exports import osi
from runner.exchange.exports.moments import box_centre
from runner.exchange.traces.maps import road_of
from runner.exchange.traces.reading import read
from runner.recording import Track
from runner.view import xosc_replay
from schemas.common.errors import InvalidFile, ToolchainError
from schemas.osi import traces as osi_traces
from schemas.osi.traces import Trace
from xodr.reader import load

groundtruth = pytest.importorskip(
    "osi3.osi_groundtruth_pb2", reason="the extra `osi` is not installed"
)
sensorview = pytest.importorskip(
    "osi3.osi_sensorview_pb2", reason="the extra `osi` is not installed"
)
mcap_writer = pytest.importorskip("mcap.writer", reason="the extra `osi` is not installed")

LIBRARY = Path(xosc.__file__).parent / "library"
SAMPLE = [
    "ramp_exiting_highway",
    "roundabout_exiting",
    "intersection_pedestrian_crossing",
    "cut_in_sharp_curve",
]
PLACE, TIME = 0.01, 0.001
"""m and s within which an exported run comes back"""


def run(name: str, timestep: float = 0.1) -> runner.RunResult:
    """A scenario of the library."""
    return runner.run(
        LIBRARY / f"{name}.xosc", world="kinematic", timestep=timestep, sut="none", max_time=10.0
    )


def apart(one: Track, other: Track) -> tuple[float, float]:
    """Greatest distances of two tracks: of the reference points, or of the boxes' centres for
    things (m), and of times (s).
    """
    a, b = (
        box_centre(track)
        if one.kind == "miscellaneous"
        else np.column_stack([track.columns[axis] for axis in "xyz"])
        for track in (one, other)
    )
    return float(np.linalg.norm(a - b, axis=1).max()), float(
        np.abs(one.columns["time"] - other.columns["time"]).max()
    )


@pytest.mark.parametrize("suffix", osi.FORMATS)
@pytest.mark.parametrize("name", SAMPLE)
def test_an_exported_run_comes_back(name: str, suffix: str, tmp_path: Path) -> None:
    result = run(name)
    osi.write_trace(result, tmp_path / f"trace{suffix}")
    found = read(tmp_path / f"trace{suffix}")
    assert found.ego == result.ego
    assert found.recording.timestep == pytest.approx(0.1)
    assert list(found.recording.tracks) == sorted(
        result.recording.tracks,
        key=lambda each: float(result.recording.tracks[each].columns["time"][0]),
    )
    for track in result.recording.tracks.values():
        back = found.recording.tracks[track.name]
        place, time = apart(track, back)
        assert place <= PLACE and time <= TIME
        assert np.abs(np.sin(track.columns["h"] - back.columns["h"])).max() < 1e-6
        assert (back.kind, back.category) == (
            track.kind,
            track.category,
        ) or track.kind == "miscellaneous"


@pytest.fixture(scope="module")
def result() -> runner.RunResult:
    return run("cut_in_four_way_intersection", 0.2)


@pytest.fixture
def exported(result: runner.RunResult, tmp_path: Path) -> Path:
    osi.write_trace(result, tmp_path / "trace.osi")
    return tmp_path / "trace.osi"


def on_road(path: Path, tracks: dict[str, Track]) -> float:
    """Share of the places of tracks that are on a lane of a road."""
    network = load(path)
    points = [
        network.on_road(network.locate(float(x), float(y)))
        for track in tracks.values()
        for x, y in zip(track.columns["x"], track.columns["y"], strict=True)
    ]
    return sum(points) / len(points)


def test_roads_are_drawn_from_the_lanes_of_a_trace(
    exported: Path, result: runner.RunResult, tmp_path: Path
) -> None:
    found = read(exported)
    made = road_of(exported, found, tmp_path / "roads")
    assert made is not None
    reference = Path(result.recording.network.path).name  # type: ignore[union-attr]
    assert made.notes[0].startswith(
        f"{reference}, which map_reference names, is not beside the trace: the roads are drawn"
    )
    assert on_road(made.path, found.recording.tracks) > 0.95


def test_the_road_that_is_named_counts_before_lanes(
    exported: Path, result: runner.RunResult, tmp_path: Path
) -> None:
    network = result.recording.network
    assert network is not None
    beside = tmp_path / network.path.name
    beside.write_bytes(Path(network.path).read_bytes())
    made = road_of(exported, read(exported), tmp_path / "roads")
    assert made is not None and made.path == beside


def test_replays_show_traces(exported: Path) -> None:
    answer = CliRunner().invoke(xosc_replay.app, [str(exported)])
    assert (answer.exit_code, answer.stdout.strip()) == (0, str(exported.with_suffix(".html")))
    assert "nothing was tested" in exported.with_suffix(".html").read_text(encoding="utf-8")


def mcap(
    path: Path,
    messages: list[Any],
    *,
    map_: bytes | None = None,
    channel: bool = False,
    late: int = 0,
) -> Path:
    """An MCAP file of GroundTruth messages, with a map as an attachment or in a
    channel as omega-prime has it.

    Args:
        late: by how much publish times are behind timestamps, ns.
    """
    with path.open("wb") as file:
        writer = mcap_writer.Writer(file)
        writer.start()
        schema = writer.register_schema("osi3.GroundTruth", "protobuf", b"")
        topic = writer.register_channel("ground_truth", "protobuf", schema)
        for message in messages:
            time = message.timestamp.seconds * 1_000_000_000 + message.timestamp.nanos
            writer.add_message(topic, time, message.SerializeToString(), time + late)
        if map_ is not None and channel:
            schema = writer.register_schema("osi3.MapAsamOpenDrive", "protobuf", b"")
            topic = writer.register_channel("ground_truth_map", "protobuf", schema)
            body = b"".join(
                bytes([number << 3 | 2]) + varint(len(text)) + text
                for number, text in ((1, b"road"), (2, map_))
            )
            writer.add_message(topic, 0, body, 0)
        elif map_ is not None:
            writer.add_attachment(0, 0, "road.xodr", "application/xml", map_)
        writer.finish()
    return path


def varint(number: int) -> bytes:
    """A number as protobuf writes lengths."""
    out = b""
    while number >= 128:
        out, number = out + bytes([number % 128 + 128]), number // 128
    return out + bytes([number])


def truths(count: int = 20, **changes: Any) -> list[Any]:
    """A car along x at 10 m/s, without a lane."""
    made = []
    for number in range(count):
        message = groundtruth.GroundTruth()
        message.timestamp.seconds, message.timestamp.nanos = divmod(
            number * 100_000_000, 1_000_000_000
        )
        each = message.moving_object.add()
        each.id.value, each.type = 7, each.TYPE_VEHICLE
        each.base.position.x, each.base.position.y, each.base.orientation.yaw = (
            10.0 + number,
            -1.5,
            0.0,
        )
        each.base.dimension.length, each.base.dimension.width, each.base.dimension.height = (
            4.0,
            2.0,
            1.5,
        )
        each.base.velocity.x = changes.get("speed", 10.0)
        made.append(message)
    return made


@pytest.mark.parametrize("channel", [False, True])
def test_a_map_inside_the_trace_is_its_road(
    channel: bool, result: runner.RunResult, tmp_path: Path
) -> None:
    network = result.recording.network
    assert network is not None
    content = Path(network.path).read_bytes()
    path = mcap(tmp_path / "trace.mcap", truths(), map_=content, channel=channel)
    made = road_of(path, read(path), tmp_path / "roads")
    assert made is not None and made.path.read_bytes() == content
    assert made.notes == (
        (
            f"the road is the one in the trace's {'channel' if channel else 'attachment'} "
            f"{'road' if channel else 'road.xodr'!r}"
        ),
    )


def test_a_trace_without_maps_and_lanes_has_no_road(tmp_path: Path) -> None:
    path = mcap(tmp_path / "trace.mcap", truths())
    assert road_of(path, read(path), tmp_path) is None


def write(path: Path, bodies: list[bytes]) -> Path:
    """An `.osi` file."""
    path.write_bytes(b"".join(struct.pack("<I", len(body)) + body for body in bodies))
    return path


def test_sensor_views_are_told_from_ground_truth(tmp_path: Path) -> None:
    views = [
        sensorview.SensorView(timestamp=each.timestamp, global_ground_truth=each)
        for each in truths()
    ]
    path = write(tmp_path / "trace.osi", [each.SerializeToString() for each in views])
    assert Trace(path).kind == osi_traces.SENSOR_VIEW
    assert list(read(path).recording.tracks) == ["7"]
    assert (
        Trace(write(tmp_path / "other.osi", [each.SerializeToString() for each in truths()])).kind
        == osi_traces.GROUND_TRUTH
    )


def test_velocities_that_contradict_positions_are_derived(tmp_path: Path) -> None:
    path = write(tmp_path / "trace.osi", [each.SerializeToString() for each in truths(speed=-3.0)])
    found = read(path)
    assert found.recording.tracks["7"].columns["speed"] == pytest.approx(10.0)
    assert (
        "7: the velocities contradict the positions, from which they are derived instead"
        in found.remarks
    )


def test_what_is_not_said_is_assumed_with_a_remark(tmp_path: Path) -> None:
    messages = truths()
    for each in messages:
        each.moving_object[0].base.ClearField("dimension")
        each.moving_object[0].base.ClearField("orientation")
        each.timestamp.seconds += 1_700_000_000
    found = read(write(tmp_path / "trace.osi", [each.SerializeToString() for each in messages]))
    assert found.recording.tracks["7"].columns["time"][0] == 0.0
    assert [each.partition(": ")[2] or each for each in found.remarks] == [
        "times are from the first message, which is at 1700000000.000 s of the trace's clock",
        "vehicles of type UNKNOWN are taken as cars",
        "sizes that are not given are the usual ones of a vehicle",
        "no bbcenter_to_rear, the rear axle is taken 0.3 of the length behind the centre",
        "no orientation, the heading is that of the motion",
    ]


# bad input ----------------------------------------------------------------------------------


def bodies(change: Callable[[list[Any]], object] = lambda _: None) -> list[bytes]:
    """A small trace's messages, after a change."""
    messages = truths()
    change(messages)
    return [each.SerializeToString() for each in messages]


def placed(value: float) -> Callable[[list[Any]], object]:
    return lambda messages: setattr(messages[3].moving_object[0].base.position, "x", value)


def packed(data: bytes, compression: str, size: int) -> bytes:
    """An MCAP file of one chunk with this content, as it declares it."""
    chunk = (
        struct.pack("<QQQI", 0, 0, size, 0)
        + struct.pack("<I", len(compression))
        + compression.encode()
    )
    chunk += struct.pack("<Q", len(data)) + data
    header = struct.pack("<II", 0, 0)
    body = b"".join(
        struct.pack("<BQ", code, len(text)) + text for code, text in ((1, header), (6, chunk))
    )
    return b"\x89MCAP0\r\n" + body


def bomb(size: int, declared: int, compression: str) -> bytes:
    """A chunk that decompresses to many zeros."""
    module = (
        pytest.importorskip("zstandard")
        if compression == "zstd"
        else pytest.importorskip("lz4.frame")
    )
    data = module.compress(b"\0" * size)
    return packed(data, compression, declared)


BAD = {
    "message 20 declares 91 bytes, of which the file has 86": lambda: joined(bodies())[:-5],
    "the file ends within the length of message 1": lambda: b"\x01\x02",
    "the trace has no message": lambda: b"",
    "message 1 declares 4294967295 bytes": lambda: b"\xff" * 30,
    "its messages are of no OSI message type": lambda: joined(
        [b"no message at all", b"\xff\xff\xff"]
    ),
    "message 4: moving_object 7 has the value nan": lambda: joined(bodies(placed(math.nan))),
    "message 4: moving_object 7 has the value inf": lambda: joined(bodies(placed(math.inf))),
    "message 4: moving_object 7 has the value 1e+300": lambda: joined(bodies(placed(1e300))),
    "message 20: timestamp 0 s comes after 1.8 s": lambda: joined(
        bodies(lambda each: each[-1].ClearField("timestamp"))
    ),
    "message 2: timestamp 0 s is there twice": lambda: joined([bodies()[0], *bodies()]),
    "moving_object 7 is there twice": lambda: joined(
        bodies(lambda each: each[0].moving_object.append(each[0].moving_object[0]))
    ),
    "moving_object 7 has no position": lambda: joined(
        bodies(lambda each: each[0].moving_object[0].base.ClearField("position"))
    ),
}


def joined(messages: list[bytes]) -> bytes:
    return b"".join(struct.pack("<I", len(body)) + body for body in messages)


@pytest.mark.parametrize("message", BAD)
def test_damaged_osi_files_are_refused(message: str, tmp_path: Path) -> None:
    path = tmp_path / "trace.osi"
    path.write_bytes(BAD[message]())
    refused(path, message)


BAD_MCAP = {
    "it begins or ends otherwise": lambda good: b"no MCAP" * 9,
    "the file ends within a record: it is truncated": lambda good: good[: len(good) // 2],
    "a chunk is damaged": lambda good: packed(struct.pack("<BQ", 5, 2**40) + b"?", "", 10),
    "the MCAP file is damaged": lambda good: good[:26] + b"\xff" + good[27:],
    "a chunk has 100 bytes, not the 99": lambda good: packed(b"\0" * 100, "", 99),
    "a chunk declares 1099511627776 bytes when decompressed": lambda good: bomb(
        1000, 2**40, "zstd"
    ),
    "a chunk decompresses to more than it declares": lambda good: bomb(10**8, 10, "zstd"),
    "a chunk has 11 bytes, not the 10": lambda good: bomb(10**8, 10, "lz4"),
    "a chunk can't be decompressed": lambda good: packed(b"nothing", "lz4", 10),
    "chunks compressed by 'xz'": lambda good: packed(b"nothing", "xz", 10),
}


@pytest.mark.parametrize("message", BAD_MCAP)
def test_damaged_mcap_files_are_refused(message: str, tmp_path: Path) -> None:
    good = mcap(tmp_path / "good.mcap", truths()).read_bytes()
    path = tmp_path / "trace.mcap"
    path.write_bytes(BAD_MCAP[message](good))
    refused(path, message)


def refused(path: Path, message: str) -> None:
    """A file is refused by one line that names it and the reason."""
    with pytest.raises(ToolchainError) as error:
        read(path)
    assert message in str(error.value) and str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_every_cut_of_a_trace_is_refused_or_read(tmp_path: Path) -> None:
    good = mcap(tmp_path / "good.mcap", truths()).read_bytes()
    for length in range(0, len(good), 7):
        path = tmp_path / "cut.mcap"
        path.write_bytes(good[:length])
        with pytest.raises(ToolchainError):
            read(path)


def test_changed_bytes_give_an_error_or_a_recording(tmp_path: Path) -> None:
    random, refusals = np.random.default_rng(0), 0
    for good, suffix in (
        (mcap(tmp_path / "good.mcap", truths()).read_bytes(), ".mcap"),
        (joined(bodies()), ".osi"),
    ):
        for _ in range(150):
            data = bytearray(good)
            for place in random.integers(0, len(data), 3):
                data[place] = int(random.integers(256))
            path = tmp_path / f"changed{suffix}"
            path.write_bytes(data)
            try:
                read(path)
            except ToolchainError:
                refusals += 1
    assert 100 < refusals < 300


def test_messages_of_another_kind_are_named(tmp_path: Path) -> None:
    update = pytest.importorskip("osi3.osi_trafficupdate_pb2").TrafficUpdate()
    update.update.add().base.position.x = 1.0
    update.timestamp.seconds = 1
    path = write(tmp_path / "trace.osi", [update.SerializeToString()])
    refused(
        path, "this is a trace of TrafficUpdate messages: GroundTruth or SensorView is expected"
    )


def test_a_map_that_is_no_road_is_refused(tmp_path: Path) -> None:
    path = mcap(tmp_path / "trace.mcap", truths(), map_=b"<OpenDRIVE/>")
    with pytest.raises(InvalidFile, match=r"the map 'road\.xodr' in the attachment of trace\.mcap"):
        road_of(path, read(path), tmp_path / "roads")
