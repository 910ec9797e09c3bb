"""Messages between the runs of a batch and a system under test in a process of its own: arrays as bytes.

A message begins with a byte that says what it is, as in `runner.systems.isolation.messages`:

| from the batch | | from the system | |
|---|---|---|---|
| `M` | build the system for a batch | `{` | done, a JSON object |
| `N` | begin its runs: egos and seeds | `{` | done |
| `T` | step: observations of runs | `A` | answers |

Then follow the length of a JSON object with shapes and objects, that object, and the numbers as they
are in memory. An array that is as it was in the message before is not sent again.
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from runner.engine.participants.declaration import BoundingBox, Performance
from runner.engine.worlds.aspects import Aspect
from runner.engine.worlds.signals_ahead import SignalAhead, StopLine
from runner.systems.arrays import Answers, BatchObservation, BatchParticipants, objects
from runner.systems.base import Participant
from runner.systems.isolation.messages import (
    ANSWER,
    environment_json,
    environment_of,
)
from schemas.common.array_types import IntArray
from xodr.graph.network import RoadNetwork

BUILD_MANY, BEGIN_MANY, STEP_MANY = b"M", b"N", b"T"
_LENGTH = struct.Struct("=I")
_TUPLES: dict[str, Any] = {"box": BoundingBox, "performance": Performance, "stop_line": StopLine}


def _leaves(some: Any) -> Iterator[tuple[str, Any]]:
    """Arrays of an observation or of participants, with the path of their names."""
    pairs = vars(some).items() if isinstance(some, BatchParticipants) else some._asdict().items()
    for name, value in pairs:
        if isinstance(value, np.ndarray):
            yield name, value
        elif name != "facing":  # worked out
            for inner, values in _leaves(value):
                yield f"{name}.{inner}", values


class BatchWriter:
    """Writes the observations of one batch."""

    def __init__(self) -> None:
        self._sent: dict[str, tuple[tuple[int, ...], Any]] = {}

    def begin(self, egos: BatchParticipants, timestep: float, seeds: IntArray) -> bytes:
        """The message that begins the runs; timestep in s."""
        head = {"timestep": timestep, "seeds": seeds.tolist()}
        return self._write(BEGIN_MANY, egos, head)

    def step(self, observations: BatchObservation, dt: float) -> bytes:
        """The message of a step of dt (s)."""
        return self._write(STEP_MANY, observations, {"dt": dt})

    def _write(self, kind: bytes, some: Any, head: dict[str, Any]) -> bytes:
        told: dict[str, Any] = {}
        numbers: list[bytes] = []
        for name, values in _leaves(some):
            now: Any = _plain_objects(name, values) if values.dtype == object else values.tobytes()
            if self._sent.get(name) == (values.shape, now):
                continue
            self._sent[name] = values.shape, now
            if values.dtype == object:
                told[name] = [values.shape, None, _distinct(now)]
            else:
                told[name] = [values.shape, values.dtype.str, len(now)]
                numbers.append(now)
        text = json.dumps(head | {"arrays": told}).encode()
        return b"".join((kind, _LENGTH.pack(len(text)), text, *numbers))


class BatchReader:
    """Reads the observations of one batch.

    Args:
        load: gives the road network of a path.
    """

    def __init__(self, load: Callable[[str, str], RoadNetwork]) -> None:
        self._arrays: dict[str, Any] = {}
        self._networks: dict[str, RoadNetwork] = {}
        self._load = load

    def begin(self, body: bytes) -> tuple[BatchParticipants, float, IntArray]:
        """The egos, the timestep (s) and the seeds of the runs."""
        head = self._read(body)
        return self._participants(""), head["timestep"], np.array(head["seeds"], np.int64)

    def step(self, body: bytes) -> tuple[BatchObservation, float]:
        """The observations of a step, and its length (s)."""
        head = self._read(body)
        parts: dict[str, Any] = {
            "ego": self._participants("ego."),
            "others": self._participants("others."),
            "stop_line": self._tuple("stop_line", ""),
        }
        for name in BatchObservation._fields:
            if name not in parts:
                parts[name] = self._arrays[name]
        return BatchObservation(**parts), head["dt"]

    def _read(self, body: bytes) -> dict[str, Any]:
        (length,) = _LENGTH.unpack_from(body, 1)
        begin = 1 + _LENGTH.size
        head: dict[str, Any] = json.loads(body[begin : begin + length])
        place = begin + length
        for name, (shape, kind, told) in head["arrays"].items():
            if kind is None:
                values, index = told
                each = objects([self._object(name, value) for value in values])
                self._arrays[name] = each[np.array(index, np.int64)].reshape(shape)
                continue
            found = np.frombuffer(body, kind, int(np.prod(shape, dtype=np.int64)), place)
            self._arrays[name] = found.reshape(shape)
            place += told
        return head

    def _object(self, name: str, value: Any) -> Any:
        if name == "network" and value is not None:
            path, file = value
            if file not in self._networks:
                self._networks[file] = self._load(path, file)
            return self._networks[file]
        if name == "environment":
            return environment_of(value) if value is not None else None
        if name == "signals":
            return tuple(
                SignalAhead(signal, kind, away, state, None if aspect is None else Aspect(aspect))
                for signal, kind, away, state, aspect in value
            )
        return value

    def _participants(self, path: str) -> BatchParticipants:
        values = {
            name: self._tuple(name, path) if name in _TUPLES else self._arrays[path + name]
            for name in (*Participant._fields, "present")
        }
        return BatchParticipants(**values)

    def _tuple(self, name: str, path: str) -> Any:
        kind = _TUPLES[name]
        return kind(*(self._arrays[f"{path}{name}.{each}"] for each in kind._fields))


def _plain_objects(name: str, values: Any) -> list[Any]:
    """Objects of an array as JSON has them, in a list; equal ones are one object."""
    known: dict[int, Any] = {}
    plain = []
    for each in values.ravel():
        if id(each) not in known:
            known[id(each)] = _json(name, each)
        plain.append(known[id(each)])
    return plain


def _json(name: str, value: Any) -> Any:
    if name == "network":
        path = None if value is None else str(value.path)
        return None if path is None else [path, os.path.abspath(path)]
    if name == "environment":
        return None if value is None else environment_json(value)
    if name == "signals":
        return [[*each] for each in value]
    return value if isinstance(value, str) else dict(value)


def _distinct(values: list[Any]) -> tuple[list[Any], list[int]]:
    """Distinct objects, and which of them each one is."""
    places: dict[int, int] = {}
    distinct: list[Any] = []
    for each in values:
        if id(each) not in places:
            places[id(each)] = len(distinct)
            distinct.append(each)
    return distinct, [places[id(each)] for each in values]


def write_answers(answers: Answers) -> bytes:
    """The message with checked answers."""
    return ANSWER + b"".join(np.asarray(each).tobytes() for each in answers)


def read_answers(body: bytes) -> Answers:
    """The answers of a message."""
    n = (len(body) - 1) // (2 * 8 + 3)
    kinds = (float, bool, float, bool, bool)
    found, place = [], 1
    for kind in kinds:
        values = np.frombuffer(body, kind, n, place)
        found.append(values)
        place += values.nbytes
    return Answers(*found)
