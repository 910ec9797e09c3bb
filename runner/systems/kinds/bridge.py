"""The system under test `bridge`: another process drives the ego over a socket;
docs/ego-from-outside.md has the messages, `runner.systems.isolation.frames` the frames that hold
them.
"""

from __future__ import annotations

import hmac
import json
import math
import os
import secrets
import selectors
import socket
import sys
import time
from dataclasses import dataclass, field
from typing import Any

from runner.systems.base import Control, Observation, Participant, Pose
from runner.systems.isolation.frames import LENGTH, FrameConnection
from runner.systems.outside.osmp import Truth
from schemas.common.errors import ToolchainError, UsageError

_PEER = "the client of the bridge"
_LONGEST_HELLO = 1024
"""Bytes that the frame with the token may have"""
_OPEN = 16
"""Connections that may be open until one of them has sent the token"""


def accept(host: str, port: int, wait: float, limit: float, token: str) -> FrameConnection:
    """Listen until a client has connected and sent a frame with `{"token": …}`; others are turned
    away, further ones refused.

    Any number of connections may be open meanwhile, so that one which sends nothing, or slowly,
    delays no other.

    Args:
        wait: time (s) in which it has to connect and send the token.
        limit: time (s) for each frame.
        token: what it has to know.

    Raises:
        UsageError: the address can't be listened at.
        ToolchainError: no client with the token connects.
    """
    try:
        listener = socket.create_server((host, port), backlog=_OPEN)
    except OSError as error:
        raise UsageError(
            f"the bridge can't listen at {host}:{port}: {error.strerror or error}"
        ) from None
    turned_away = 0
    with listener, selectors.DefaultSelector() as selector:
        listener.setblocking(False)
        selector.register(listener, selectors.EVENT_READ)
        waiting: dict[socket.socket, bytes] = {}
        end = time.monotonic() + wait
        try:
            while (left := end - time.monotonic()) > 0.0:
                for key, _ in selector.select(left):
                    connection = key.fileobj
                    assert isinstance(connection, socket.socket)
                    if connection is listener:
                        turned_away += _admit(listener, selector, waiting)
                        continue
                    known = _hear(connection, waiting, token)
                    if known is not None:
                        selector.unregister(connection)
                        del waiting[connection]
                        if known:
                            return FrameConnection(connection, limit, _PEER)
                        connection.close()
                        turned_away += 1
        finally:
            for connection in waiting:
                connection.close()
    strangers = (
        f"; {turned_away + len(waiting)} without its token were turned away"
        if turned_away or waiting
        else ""
    )
    raise ToolchainError(
        f"no client has connected to the bridge at {host}:{port} within {wait:g} s{strangers}"
    )


def _admit(
    listener: socket.socket, selector: selectors.BaseSelector, waiting: dict[socket.socket, bytes]
) -> int:
    """Accept a connection; return the number of older, silent connections that were closed for
    it."""
    try:
        connection, _ = listener.accept()
    except OSError:  # it has gone already
        return 0
    connection.setblocking(False)
    selector.register(connection, selectors.EVENT_READ)
    waiting[connection] = b""
    if len(waiting) <= _OPEN:
        return 0
    oldest = next(iter(waiting))
    selector.unregister(oldest)
    del waiting[oldest]
    oldest.close()
    return 1


def _hear(
    connection: socket.socket, waiting: dict[socket.socket, bytes], token: str
) -> bool | None:
    """Whether a connection has sent the token; None while its frame is not complete."""
    # No byte beyond the token's frame: the next frame belongs to the connection that follows.
    missing = LENGTH.size - len(waiting[connection])
    if missing <= 0:
        (length,) = LENGTH.unpack(waiting[connection][: LENGTH.size])
        if length > _LONGEST_HELLO:
            return False
        missing = length + LENGTH.size - len(waiting[connection])
    try:
        more = connection.recv(missing) if missing > 0 else b""
    except BlockingIOError:
        return None
    except OSError:
        return False
    if not more and missing > 0:
        return False
    waiting[connection] += more
    data = waiting[connection]
    if len(data) < LENGTH.size:
        return None
    (length,) = LENGTH.unpack(data[: LENGTH.size])
    # Strangers get no memory before they have shown the token.
    if length > _LONGEST_HELLO:
        return False
    return None if len(data) < LENGTH.size + length else _knows(data[LENGTH.size :], token)


def _knows(body: bytes, token: str) -> bool:
    try:
        said = json.loads(body)
    # Deeply nested JSON ends in a RecursionError.
    except (ValueError, RecursionError):
        return False
    given = said.get("token") if isinstance(said, dict) else None
    # In constant time: response times must not tell how much of a guess is right.
    return isinstance(given, str) and hmac.compare_digest(
        given.encode(errors="replace"), token.encode(errors="replace")
    )


SYSTEMS = {
    "bridge": ("Bridge", "another process over a socket"),
}
VERSION = 3
"""Version of the messages"""
_CONTROL = {"acceleration", "steering", "reason"}
_POSE = {"x", "y", "h", "speed"}
_LONGEST_SHOWN = 60
TOKEN = "XOSC_BRIDGE_TOKEN"  # noqa: S105  # the name of the variable
"""Environment variable with what a client has to know; the bridge makes one up, and prints it,
where it is not set"""


@dataclass(slots=True)
class Bridge:
    """Sends each observation to a client as an OSI GroundTruth, or as JSON, and returns its answer.

    Each run waits for a client of its own, one at a time, that sends the token of
    `XOSC_BRIDGE_TOKEN`. Needs the extra `osi`, unless all is sent as JSON.

    Args:
        port: where the client connects to.
        host: the address to listen at; other machines can connect only if it is not the loopback's.
        wait: time that the client has to connect, s.
        answer: time that it has for each answer, s.
        osi: whether participants are sent as OSI; otherwise they are in the JSON of each step.
    """

    one_run = "its client drives one ego"
    port: int = 48100
    host: str = "127.0.0.1"
    wait: float = 60.0
    answer: float = 10.0
    osi: bool = True
    _client: FrameConnection | None = field(init=False, default=None, repr=False)
    _truth: Truth | None = field(init=False, repr=False, default=None)
    _token: str = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not 0 < self.port < 65_536:
            raise UsageError(f"the bridge's port is from 1 to 65535, not {self.port}")
        if not (self.wait > 0.0 and self.answer > 0.0):
            raise UsageError("the bridge's times to wait are more than 0 s")
        self._truth = Truth() if self.osi else None
        self._token = os.environ.get(TOKEN, "")
        if not self._token:
            self._token = secrets.token_urlsafe(24)
            print(
                f"the bridge at {self.host}:{self.port} waits for a client with "
                f"{TOKEN}={self._token}",
                file=sys.stderr,
                flush=True,
            )

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Wait for a client, and greet it."""
        self.close()
        self._truth = Truth() if self.osi else None
        self._client = accept(self.host, self.port, self.wait, self.answer, self._token)
        # JSON has no infinity.
        limits = {
            name: value if math.isfinite(value) else None
            for name, value in ego.performance._asdict().items()
        }
        steering = ego.max_steering or None
        start = {"bridge": VERSION, "ego": ego.name, "timestep": timestep, "seed": seed}
        self._client.send(_json({**start, "limits": {**limits, "max_steering": steering}}))

    def control(self, observation: Observation, dt: float) -> Control | Pose:
        """Return the client's answer."""
        client = self._client
        if client is None:
            raise ToolchainError("the bridge has no client: reset() comes first")
        line = observation.stop_line
        step = {
            "time": observation.time,
            "target_speed": observation.target_speed,
            "signals": [signal._asdict() for signal in observation.signals],
            "stop_line": line._asdict() if line is not None else None,
        }
        if self._truth is None:
            step["ego"] = _told(observation.ego)
            step["participants"] = [_told(one) for one in observation.others]
        client.send(_json(step))
        if self._truth is not None:
            client.send(self._truth.of(observation).SerializeToString(deterministic=True))
        return answer_of(client.receive())

    def close(self) -> None:
        """End the connection: the run is over."""
        if self._client is not None:
            self._client.close()
            self._client = None


_STATE = ("x", "y", "z", "h", "pitch", "roll", "speed", "acceleration", "vx", "vy", "ax", "ay")


def _told(one: Participant) -> dict[str, Any]:
    """Participant as JSON: kind, state, and bounding box."""
    about = {name: getattr(one, name) for name in ("name", "kind", "category", *_STATE)}
    return {**about, "box": {name: getattr(one.box, name) for name in _BOX}}


_BOX = ("x", "y", "z", "length", "width", "height")


def _json(message: dict[str, Any]) -> bytes:
    return json.dumps(message).encode()


def answer_of(body: bytes) -> Control | Pose:
    """A client's answer.

    Raises:
        ToolchainError: it is none.
    """
    shown = repr(body[:_LONGEST_SHOWN].decode(errors="replace"))
    try:
        answer = json.loads(body)
    except (ValueError, RecursionError):
        raise ToolchainError(
            f"the client of the bridge answers {shown}, a JSON object is expected"
        ) from None
    if not isinstance(answer, dict) or not (
        answer.keys() <= _CONTROL or answer.keys() <= {"pose", "reason"}
    ):
        expected = "acceleration, steering and reason, or pose and reason,"
        raise ToolchainError(f"the client of the bridge answers {shown}, {expected} are expected")
    reason = answer.get("reason", "")
    if not isinstance(reason, str):
        raise ToolchainError(
            f"the client of the bridge answers {shown}, a text is expected as reason"
        )
    if "pose" not in answer:
        return Control(
            _number(answer, "acceleration", shown), _number(answer, "steering", shown), reason
        )
    pose = answer["pose"]
    if not isinstance(pose, dict) or not _POSE - {"speed"} <= pose.keys() <= _POSE:
        raise ToolchainError(
            f"the client of the bridge answers {shown}, x, y, h and speed are expected in pose"
        )
    x, y, h = (_number(pose, name, shown, needed=True) for name in ("x", "y", "h"))
    assert x is not None and y is not None and h is not None
    return Pose(x, y, h, _number(pose, "speed", shown), reason)


def _number(answer: dict[str, Any], name: str, shown: str, needed: bool = False) -> float | None:
    """A value of an answer; None where that is left out or null and not needed."""
    value = answer.get(name)
    if value is None and not needed:
        return None
    # Booleans are integers in Python.
    if isinstance(value, bool) or not isinstance(value, int | float) or not _finite(value):
        expected = "a finite number" if needed else "a finite number or null"
        raise ToolchainError(
            f"the client of the bridge answers {shown}, {expected} is expected as {name}"
        )
    return value


def _finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond all floats
        return False
