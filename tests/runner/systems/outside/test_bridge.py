"""The bridge: a client drives as a system in this process does, and nothing that
it does makes a run hang.
"""

from __future__ import annotations

import json
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

import runner
from runner.systems import Control, Pose
from runner.systems.kinds.bridge import Bridge, answer_of
from runner.systems.kinds.commanded import Scripted
from schemas.checks.osi import breaches
from schemas.common.errors import ToolchainError, UsageError
from schemas.osi.traces import TraceMessage
from tests.commands import Command
from tests.conformance.support import at, track
from tests.runner.files import distribution, scenario
from xosc.listing import LIBRARY

osi = pytest.importorskip("osi3.osi_groundtruth_pb2")
CLIENT = Path(__file__).parents[4] / "docs" / "examples" / "bridge_client.py"
Answer = Callable[[socket.socket, dict[str, Any], Any], None]


TOKEN = "a token of the tests"


@pytest.fixture(autouse=True)
def token(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XOSC_BRIDGE_TOKEN", TOKEN)


@pytest.fixture
def port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return int(free.getsockname()[1])


def connected(port: int) -> socket.socket:
    for _ in range(200):
        with suppress(ConnectionRefusedError):
            return socket.create_connection(("127.0.0.1", port), timeout=10)
        time.sleep(0.02)
    raise AssertionError("nobody listens")


def frame(body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + body


def hello(token: object) -> bytes:
    return frame(json.dumps({"token": token}).encode())


def received(connection: socket.socket) -> bytes:
    def exactly(count: int) -> bytes:
        data = b""
        while len(data) < count:
            more = connection.recv(count - len(data))
            if not more:
                raise EOFError
            data += more
        return data

    return exactly(struct.unpack(">I", exactly(4))[0])


@contextmanager
def client(port: int, answer: Answer) -> Iterator[list[Any]]:
    """A client in a thread, with what it has received: the greeting, then (step,
    GroundTruth) each time.
    """
    seen: list[Any] = []

    def drive() -> None:
        with connected(port) as connection, suppress(EOFError, OSError):
            connection.sendall(hello(TOKEN))
            seen.append(json.loads(received(connection)))
            while True:
                step, truth = (
                    json.loads(received(connection)),
                    osi.GroundTruth.FromString(received(connection)),
                )
                seen.append((step, truth))
                answer(connection, step, truth)

    thread = Thread(target=drive, daemon=True)
    thread.start()
    yield seen
    thread.join(10)
    assert not thread.is_alive()


def braking(connection: socket.socket, step: dict[str, Any], truth: Any) -> None:
    control = {"acceleration": -2.0, "reason": "braking"} if step["time"] >= 0.5 else {}
    connection.sendall(frame(json.dumps(control).encode()))


# driving ------------------------------------------------------------------------------------


@pytest.mark.parametrize("world", ["kinematic", "sumo"])
def test_a_client_drives_as_the_same_system_in_this_process(
    tmp_path: Path, world: str, port: int
) -> None:
    file = scenario(tmp_path, stop=1.5)
    with client(port, braking) as seen:
        result = runner.run(file, world=world, sut=Bridge(port))
    same = runner.run(
        file, world=world, sut=Scripted([(0.5, Control(acceleration=-2.0, reason="braking"))])
    )
    assert result.trajectories.equals(same.trajectories) and result.events == same.events
    assert len(seen) == 1 + 30
    assert (
        seen[0]["bridge"],
        seen[0]["ego"],
        seen[0]["timestep"],
        seen[0]["limits"]["max_speed"],
    ) == (3, "Ego", 0.05, 70.0)
    assert [step["time"] for step, _ in seen[1:]] == [
        round(0.05 * number, 9) for number in range(30)
    ]
    assert {step["target_speed"] for step, _ in seen[1:]} == {20.0}


def test_messages_are_ground_truth(tmp_path: Path, port: int) -> None:
    from runner.exchange.exports.osi import ground_truths

    with client(port, braking) as seen:
        result = runner.run(scenario(tmp_path, stop=1.0), world="kinematic", sut=Bridge(port))
    messages = [truth for _, truth in seen[1:]]
    assert list(breaches([TraceMessage(1, messages[0], messages[0])])) == []
    assert not messages[1].lane
    for message, exported in zip(messages, ground_truths(result), strict=False):
        assert message.timestamp == exported.timestamp
        for ours, theirs in zip(message.moving_object, exported.moving_object, strict=True):
            assert list(ours.source_reference[0].identifier) == list(
                theirs.source_reference[0].identifier
            )
            assert ours.vehicle_classification == theirs.vehicle_classification
            for part in ("dimension", "position", "orientation"):
                assert getattr(ours.base, part) == getattr(theirs.base, part)
            assert ours.base.velocity.x == pytest.approx(theirs.base.velocity.x, abs=0.11)
        assert message.host_vehicle_id == message.moving_object[0].id


def test_the_example_drives_a_run_of_the_command(port: int, command: Command) -> None:
    assert len(CLIENT.read_text(encoding="utf-8").splitlines()) <= 70
    process = subprocess.Popen([sys.executable, str(CLIENT), str(port)], stdout=subprocess.PIPE)
    try:
        answer = command(
            "xosc-run",
            "--sut",
            f"bridge:port={port}",
            "--world",
            "kinematic",
            LIBRARY / "highway_lead_brake.xosc",
        )
        greeting, _ = process.communicate(timeout=20)
    finally:
        process.kill()
    assert answer.code == 0 and "PASSED" in answer.out
    assert b"'ego': 'Ego'" in greeting and process.returncode == 0


def test_each_run_of_a_batch_takes_a_client(tmp_path: Path, port: int) -> None:
    file, bridge = scenario(tmp_path, stop=0.2), Bridge(port)
    for _ in range(2):
        with client(port, braking) as seen:
            runner.run(file, world="kinematic", sut=bridge)
        assert len(seen) == 1 + 4


# strangers ----------------------------------------------------------------------------------


STRANGERS = {
    "port probe": b"",
    "HTTP": b"GET / HTTP/1.1\r\n\r\n",
    "garbage": b"\x00\x00\x00\x04\xff\xfe\xfd\xfc",
    "no JSON": frame(b"{"),
    "deep JSON": frame(b"[" * 1000),
    "oversize": struct.pack(">I", 2**32 - 1) + b"x" * 100_000,
    "longer than a hello": frame(b" " * 1025),
    "no token": frame(b"{}"),
    "wrong token": hello("another"),
    "longer token": hello(TOKEN + "x"),
    "token of another type": hello([TOKEN]),
    "lone surrogate": frame(b'{"token": "\\ud800"}'),
}


@pytest.mark.parametrize("stranger", STRANGERS)
def test_a_stranger_ends_no_run_and_drives_nothing(
    stranger: str, tmp_path: Path, port: int
) -> None:
    answers: list[bytes] = []

    def intrude() -> None:
        with connected(port) as connection, suppress(OSError):
            connection.sendall(STRANGERS[stranger])
            connection.shutdown(socket.SHUT_WR)
            answers.append(connection.recv(100))
        with client(port, braking):
            pass

    thread = Thread(target=intrude, daemon=True)
    thread.start()
    result = runner.run(scenario(tmp_path, stop=1.0), world="kinematic", sut=Bridge(port))
    thread.join(10)
    assert "braking" in str(result.events)
    assert answers in ([b""], [])


@pytest.mark.slow
def test_who_sends_slowly_or_nothing_is_in_no_ones_way(tmp_path: Path, port: int) -> None:
    slow: list[socket.socket] = []

    def crowd() -> None:
        for _ in range(40):  # more than are kept open
            slow.append(connected(port))
            slow[-1].sendall(hello(TOKEN)[:9])

    def drive() -> None:
        crowd()
        with client(port, braking):
            pass

    thread, begun = Thread(target=drive, daemon=True), time.monotonic()
    thread.start()
    runner.run(scenario(tmp_path, stop=0.2), world="kinematic", sut=Bridge(port))
    thread.join(10)
    assert time.monotonic() - begun < 10.0
    for each in slow:
        each.close()


def test_a_run_with_strangers_only_waits_until_its_time_and_counts_them(
    tmp_path: Path, port: int
) -> None:
    def probe() -> None:
        for _ in range(3):
            connected(port).close()

    thread = Thread(target=probe, daemon=True)
    thread.start()
    with pytest.raises(ToolchainError, match=r"within 1 s; 3 without its token were turned away"):
        runner.run(scenario(tmp_path), world="kinematic", sut=Bridge(port, wait=1.0))
    thread.join(10)


def test_without_the_variable_a_token_is_made_up_and_printed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], port: int
) -> None:
    monkeypatch.delenv("XOSC_BRIDGE_TOKEN")
    made = [Bridge(port) for _ in range(2)]
    told = capsys.readouterr().err
    assert len({each._token for each in made}) == 2
    assert all(
        f"XOSC_BRIDGE_TOKEN={each._token}\n" in told and each._token not in repr(each)
        for each in made
    )


# clients that do not play along -------------------------------------------------------------


def raw(body: bytes) -> Answer:
    return lambda connection, step, truth: connection.sendall(body)


def leave(connection: socket.socket, step: dict[str, Any], truth: Any) -> None:
    connection.close()


def drip(connection: socket.socket, step: dict[str, Any], truth: Any) -> None:
    for byte in frame(b'{"acceleration": -1.0}'):
        connection.sendall(bytes([byte]))
        time.sleep(0.1)


@pytest.mark.parametrize(
    ("answer", "complaint"),
    [
        (raw(b"GET / HTTP/1.1\r\n\r\n"), "a frame of 1195725856 bytes, at most 65536 are expected"),
        (raw(frame(b"\xff\x00")), "a JSON object is expected"),
        (raw(frame(b"[" * 60_000)), "a JSON object is expected"),
        (raw(frame(b"")), "a JSON object is expected"),
        (raw(b""), "has not answered within 0.3 s"),
        (raw(b"\0\0\0\x09{"), "has not answered within 0.3 s"),
        (drip, "has not answered within 0.3 s"),
        (leave, "has closed the connection"),
    ],
)
def test_a_run_ends_with_one_line(
    answer: Answer, complaint: str, tmp_path: Path, port: int
) -> None:
    begun = time.monotonic()
    with client(port, answer), pytest.raises(ToolchainError) as error:
        runner.run(scenario(tmp_path, stop=5.0), world="kinematic", sut=Bridge(port, answer=0.3))
    assert complaint in str(error.value) and "\n" not in str(error.value)
    assert time.monotonic() - begun < 5.0


@pytest.mark.parametrize(
    ("body", "complaint"),
    [
        (b"[]", "acceleration, steering and reason, or pose and reason, are expected"),
        (b'{"speed": 3}', "or pose and reason, are expected"),
        (
            b'{"pose": {"x": 1, "y": 2, "h": 0}, "steering": 0.1}',
            "or pose and reason, are expected",
        ),
        (b'{"pose": {"x": 1, "y": 2}}', "x, y, h and speed are expected in pose"),
        (b'{"pose": [1, 2, 3]}', "x, y, h and speed are expected in pose"),
        (b'{"pose": {"x": 1, "y": null, "h": 0}}', "a finite number is expected as y"),
        (
            b'{"pose": {"x": 1, "y": 2, "h": 0, "speed": "3"}}',
            "a finite number or null is expected as speed",
        ),
        (b'{"acceleration": "3"}', "expected as acceleration"),
        (b'{"acceleration": true}', "expected as acceleration"),
        (b'{"acceleration": 1' + b"0" * 400 + b"}", "expected as acceleration"),
        (b'{"steering": NaN}', "expected as steering"),
        (b'{"steering": 1e999}', "expected as steering"),
        (b'{"reason": 3}', "expected as reason"),
    ],
)
def test_answers_that_are_none_are_refused(body: bytes, complaint: str) -> None:
    with pytest.raises(ToolchainError, match=complaint):
        answer_of(body)


def test_answers_may_leave_everything_out() -> None:
    assert answer_of(b'{"acceleration": null}') == answer_of(b"{}") == Control()
    assert answer_of(b'{"acceleration": -1, "steering": 0.5, "reason": "r"}') == Control(
        -1, 0.5, "r"
    )


def test_a_client_may_answer_with_poses(tmp_path: Path, port: int) -> None:
    def drawn(connection: socket.socket, step: dict[str, Any], truth: Any) -> None:
        base = next(each.base for each in truth.moving_object if each.id == truth.host_vehicle_id)
        pose = {
            "x": base.position.x - 1.5 + 0.95,
            "y": base.position.y,
            "h": base.orientation.yaw,
            "speed": 19.0,
        }
        connection.sendall(frame(json.dumps({"pose": pose}).encode()))

    with client(port, drawn):
        result = runner.run(scenario(tmp_path, stop=1.0), world="kinematic", sut=Bridge(port))
    ego = track(result, "Ego")
    assert at(ego, 1.0, "speed") == 19.0 and at(ego, 1.0, "x") - at(ego, 0.0, "x") == pytest.approx(
        19.0
    )
    assert answer_of(b'{"pose": {"x": 1, "y": 2, "h": 3, "speed": null}, "reason": "r"}') == Pose(
        1, 2, 3, None, "r"
    )


def test_clients_one_after_another_each_drive_a_run_of_the_command(
    tmp_path: Path, port: int, command: Command
) -> None:
    """Four runs of a variation file, four clients: each is connected to one run,
    and none to another.
    """
    runs: list[int] = []

    def clients() -> None:
        for _ in range(4):
            with client(port, braking) as seen:
                pass
            runs.append(len(seen))

    thread = Thread(target=clients, daemon=True)
    thread.start()
    scenario(tmp_path)
    file = distribution(tmp_path, "gaps", {"Gap": (20.0, 50.0, 10.0)})
    answer = command(
        "xosc-run",
        "--sut",
        f"bridge:port={port}",
        "--world",
        "kinematic",
        "--max-time",
        "0.5",
        file,
    )
    thread.join(10)
    assert answer.code == 0 and not thread.is_alive()
    assert runs == [1 + 10] * 4


def test_there_is_one_client(tmp_path: Path, port: int) -> None:
    def intrude(connection: socket.socket, step: dict[str, Any], truth: Any) -> None:
        with pytest.raises(ConnectionError):
            socket.create_connection(("127.0.0.1", port), timeout=1)
        braking(connection, step, truth)

    with client(port, intrude) as seen:
        runner.run(scenario(tmp_path, stop=0.1), world="kinematic", sut=Bridge(port))
    assert len(seen) == 1 + 2


def test_no_client_and_no_port(tmp_path: Path, port: int, command: Command) -> None:
    answer = command(
        "xosc-run",
        "--sut",
        f"bridge:port={port},wait=0.1",
        "--world",
        "kinematic",
        scenario(tmp_path),
    )
    assert answer.code == 5
    assert f"no client has connected to the bridge at 127.0.0.1:{port} within 0.1 s" in answer.err
    with (
        socket.create_server(("127.0.0.1", port)),
        pytest.raises(UsageError, match="can't listen at"),
    ):
        runner.run(scenario(tmp_path), world="kinematic", sut=Bridge(port))
    with pytest.raises(UsageError, match="from 1 to 65535, not 0"):
        Bridge(0)
    with pytest.raises(UsageError, match="more than 0 s"):
        Bridge(answer=-1.0)


def test_a_client_without_osi_reads_participants_as_json(tmp_path: Path, port: int) -> None:
    steps: list[dict[str, Any]] = []

    def drive() -> None:
        with connected(port) as connection, suppress(EOFError, OSError):
            connection.sendall(hello(TOKEN))
            json.loads(received(connection))
            while True:
                steps.append(json.loads(received(connection)))
                braking(connection, steps[-1], None)

    thread = Thread(target=drive)
    thread.start()
    file = scenario(tmp_path, stop=1.5)
    result = runner.run(file, world="kinematic", sut=f"bridge:port={port},osi=false")
    thread.join(10)
    ego = steps[-1]["ego"]
    track = result.recording.tracks["Ego"].columns
    row = len(steps) - 1
    assert [ego[name] for name in ("x", "y", "speed")] == [
        track[name][row] for name in ("x", "y", "speed")
    ]
    assert ego["name"] == "Ego" and ego["box"]["length"] > 0.0 and ego["speed"] < 20.0
    assert {one["name"] for one in steps[0]["participants"]} == result.recording.tracks.keys() - {
        "Ego"
    }
