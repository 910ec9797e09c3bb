"""The system under test `bridge`: another process drives the ego over a socket; docs/ego-from-outside.md has the messages."""

from __future__ import annotations

import json
import math
import os
import secrets
import sys
from dataclasses import dataclass, field
from typing import Any

from runner.outside.frames import Frames, accept
from runner.outside.truth import Truth
from runner.sut.base import Control, Observation, Participant
from schemas.errors import ToolchainError, UsageError

SYSTEMS = {
    "bridge": ("Bridge", "another process over a socket"),
}
VERSION = 2
"""Version of the messages"""
_FIELDS = {"acceleration", "steering", "reason"}
_LONGEST_SHOWN = 60
TOKEN = "XOSC_BRIDGE_TOKEN"  # noqa: S105  # the name of the variable
"""Environment variable with what a client has to know; the bridge makes one up, and prints it, where it is not set"""


@dataclass(slots=True)
class Bridge:
    """Sends each observation to a client as an OSI GroundTruth, and does what it answers.

    Each run waits for a client of its own, one at a time, that sends the token of `XOSC_BRIDGE_TOKEN`. Needs the extra `osi`.

    Args:
        port: where the client connects to.
        host: the address to listen at; other machines can connect only if it is not the loopback's.
        wait: time that the client has to connect, s.
        answer: time that it has for each answer, s.
    """

    port: int = 48100
    host: str = "127.0.0.1"
    wait: float = 60.0
    answer: float = 10.0
    _client: Frames | None = field(init=False, default=None, repr=False)
    _truth: Truth = field(init=False, repr=False)
    _token: str = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not 0 < self.port < 65_536:
            raise UsageError(f"the bridge's port is from 1 to 65535, not {self.port}")
        if not (self.wait > 0.0 and self.answer > 0.0):
            raise UsageError("the bridge's times to wait are more than 0 s")
        self._truth = Truth()
        self._token = os.environ.get(TOKEN, "")
        if not self._token:
            self._token = secrets.token_urlsafe(24)
            print(
                f"the bridge at {self.host}:{self.port} waits for a client with {TOKEN}={self._token}",
                file=sys.stderr,
                flush=True,
            )

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Wait for a client, and greet it."""
        self.close()
        self._truth = Truth()
        self._client = accept(self.host, self.port, self.wait, self.answer, self._token)
        limits = {name: value if math.isfinite(value) else None for name, value in ego.performance._asdict().items()}
        steering = ego.max_steering or None
        start = {"bridge": VERSION, "ego": ego.name, "timestep": timestep, "seed": seed}
        self._client.send(_json({**start, "limits": {**limits, "max_steering": steering}}))

    def control(self, observation: Observation, dt: float) -> Control:
        """Return the client's answer."""
        client = self._client
        if client is None:
            raise ToolchainError("the bridge has no client: reset() comes first")
        client.send(_json({"time": observation.time, "target_speed": observation.target_speed}))
        client.send(self._truth.of(observation).SerializeToString(deterministic=True))
        return control_of(client.receive())

    def close(self) -> None:
        """End the connection: the run is over."""
        if self._client is not None:
            self._client.close()
            self._client = None


def _json(message: dict[str, Any]) -> bytes:
    return json.dumps(message).encode()


def control_of(body: bytes) -> Control:
    """A client's answer.

    Raises:
        ToolchainError: it is none.
    """
    shown = repr(body[:_LONGEST_SHOWN].decode(errors="replace"))
    try:
        answer = json.loads(body)
    except (ValueError, RecursionError):
        raise ToolchainError(f"the client of the bridge answers {shown}, a JSON object is expected") from None
    if not isinstance(answer, dict) or not answer.keys() <= _FIELDS:
        raise ToolchainError(f"the client of the bridge answers {shown}, acceleration, steering and reason are expected")
    for name in ("acceleration", "steering"):
        value = answer.get(name)
        if value is not None and (isinstance(value, bool) or not isinstance(value, int | float) or not _finite(value)):
            raise ToolchainError(f"the client of the bridge answers {shown}, a finite number or null is expected as {name}")
    if not isinstance(answer.get("reason", ""), str):
        raise ToolchainError(f"the client of the bridge answers {shown}, a text is expected as reason")
    return Control(answer.get("acceleration"), answer.get("steering"), answer.get("reason", ""))


def _finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond all floats
        return False
