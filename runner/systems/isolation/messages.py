"""Messages between a run and a system under test in a process of its own: observations and answers
as bytes, both ways exact.

Numbers are doubles as they are in memory. What rarely changes (declarations, lights, weather,
roads) is sent as JSON when it changes. A message begins with a byte that says what it is:

| from the run | | from the system | |
|---|---|---|---|
| `D` | describe a class | `{` | done, a JSON object |
| `B` | build an instance | `A` | answer to `S` |
| `R` | reset | `E` | error of ours, in JSON: there is no such class or parameter |
| `S` | step: an observation | `F` | failure of the system, in JSON |
| `C` | the run is over | | |
| `M` | build for many runs | | |
| `N` | begin its runs: egos and seeds | | |
| `T` | step: observations of runs | `A` | answers to `T` |

In messages of many runs follow the length of a JSON object with shapes and objects, that object,
and the numbers of arrays. An array that is as it was in the message before is not sent again.
"""

from __future__ import annotations

import json
import math
import os
import struct
from collections.abc import Callable, Iterator
from datetime import datetime
from types import MappingProxyType
from typing import Any

import numpy as np

from runner.engine.participants.declaration import BoundingBox, Performance
from runner.engine.worlds.aspects import Aspect
from runner.engine.worlds.signals_ahead import SignalAhead, StopLine
from runner.engine.worlds.surroundings import Environment
from runner.systems.arrays import Answers, BatchObservation, BatchParticipants, objects
from runner.systems.base import Control, Observation, Participant, Pose
from schemas.common.array_types import IntArray
from xodr.graph.network import RoadNetwork

DESCRIBE, BUILD, RESET, STEP, CLOSE = b"D", b"B", b"R", b"S", b"C"
DONE, ANSWER, ERROR, FAILURE = b"{", b"A", b"E", b"F"
_HEAD = struct.Struct("=cddddHI")
"""`S`, time, dt, target speed, distance of the stop line (NaN without one); signals, bytes of news
"""
_MOVING = struct.Struct("=H13d")
"""Number of a participant, and what changes at each step: the fields of `Participant` from x to
odometer"""
_pack, _participant = _MOVING.pack, tuple.__new__
_FIRST, _LAST = Participant._fields.index("x"), Participant._fields.index("odometer") + 1
_ANSWER = struct.Struct("=c?4d")
_MOST = 65_535
"""Participants that have a number of their own; further ones start the numbering anew"""


_Declared = tuple[tuple[Any, ...], tuple[Any, ...]]
"""Fields of a `Participant` that hardly ever change: those before, and those after the moving ones
"""


class ObservationWriter:
    """Writes the observations of one run."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[int, tuple[Any, ...], tuple[Any, ...]]] = {}
        self._network: RoadNetwork | None = None
        self._environment: Environment | None = None
        self._signal = ""
        self._signals: list[tuple[str, str, str | None, Aspect | None]] = []

    def write(self, observation: Observation, dt: float) -> bytes:
        """The message of a step."""
        news: dict[str, Any] = {}
        # Numbers have 16 bits: a run that brings in traffic may use them up.
        if len(self._known) > _MOST - len(observation.others) - 1:
            self._known.clear()
        moving = [self._participant(observation.ego, news)]
        moving += [self._participant(participant, news) for participant in observation.others]
        if observation.network is not self._network:
            self._network = observation.network
            # The name as it was given for messages, and the absolute one: a class may change the
            # folder.
            path = None if self._network is None else str(self._network.path)
            news["network"] = path and [path, os.path.abspath(path)]
        if observation.environment is not self._environment:
            self._environment = observation.environment
            news["environment"] = environment_json(self._environment)
        stop = observation.stop_line
        if stop is not None and stop.signal != self._signal:
            news["signal"] = self._signal = stop.signal
        signals = observation.signals
        if signals or self._signals:
            named = [
                (signal.signal, signal.kind, signal.state, signal.aspect) for signal in signals
            ]
            if named != self._signals:
                news["signals"] = self._signals = named
        told = json.dumps(news).encode() if news else b""
        # NaN stands for none: answers and distances that count are finite.
        distance = math.nan if stop is None else stop.distance
        head = _HEAD.pack(
            STEP, observation.time, dt, observation.target_speed, distance, len(signals), len(told)
        )
        lines = struct.pack(f"={len(signals)}d", *(signal.distance for signal in signals))
        return b"".join((head, told, lines, *moving))

    def _participant(self, each: Participant, news: dict[str, Any]) -> bytes:
        before, after = each[:_FIRST], each[_LAST:]
        known = self._known.get(each[0])
        if known is None or known[1] != before or known[2] != after:
            number = known[0] if known is not None else len(self._known)
            news.setdefault("declared", []).append([number, declared_json(each)])
            # dicts that an action changes in place are compared by the values that they had
            kept = (*after[:-2], dict(each.lights), dict(each.overrides))
            self._known[each.name] = known = number, before, kept
        return _pack(known[0], *each[_FIRST:_LAST])


class ObservationReader:
    """Reads the observations of one run.

    Args:
        load: gives the road network of a path.
    """

    def __init__(self, load: Callable[[str, str], RoadNetwork]) -> None:
        self._load = load
        self._declared: dict[int, _Declared] = {}
        self._network: RoadNetwork | None = None
        self._environment = Environment()
        self._signal = ""
        self._signals: list[list[Any]] = []

    def read(self, body: bytes) -> tuple[Observation, float]:
        """The observation of a step, and its length (s)."""
        _, time, dt, target, distance, lights, length = _HEAD.unpack_from(body)
        begin = _HEAD.size + length
        if length:
            self._take(json.loads(body[_HEAD.size : begin]))
        signals = []
        for named, away in zip(
            self._signals, struct.unpack_from(f"={lights}d", body, begin), strict=True
        ):
            signal, kind, state, aspect = named
            meaning = None if aspect is None else Aspect(aspect)
            signals.append(SignalAhead(signal, kind, away, state, meaning))
        begin += 8 * lights
        ego, *others = map(self._participant, _MOVING.iter_unpack(memoryview(body)[begin:]))
        stop = None if math.isnan(distance) else StopLine(self._signal, distance)
        observation = Observation(
            time, ego, others, target, self._network, self._environment, stop, tuple(signals)
        )
        return observation, dt

    def _participant(self, values: tuple[Any, ...]) -> Participant:
        before, after = self._declared[values[0]]
        return _participant(Participant, before + values[1:] + after)

    def _take(self, news: dict[str, Any]) -> None:
        for number, values in news.get("declared", ()):
            participant = participant_of(values)
            self._declared[number] = participant[:_FIRST], participant[_LAST:]
        if "network" in news:
            self._network = self._load(*news["network"]) if news["network"] else None
        if "environment" in news:
            self._environment = environment_of(news["environment"])
        self._signal = news.get("signal", self._signal)
        self._signals = news.get("signals", self._signals)


# JSON ------------------------------------------------------------------------------------------


def declared_json(each: Participant) -> dict[str, Any]:
    """All fields of a participant by name, as JSON has them."""
    return each._asdict() | {"lights": dict(each.lights), "overrides": dict(each.overrides)}


def participant_of(values: dict[str, Any]) -> Participant:
    """The participant of `declared_json`."""
    return Participant(
        **values
        | {
            "box": BoundingBox(*values["box"]),
            "performance": Performance(*values["performance"]),
            "lights": MappingProxyType(values["lights"]),
            "overrides": MappingProxyType(values["overrides"]),
        }
    )


def environment_json(environment: Environment) -> dict[str, Any]:
    """All of an environment by name, as JSON has it."""
    day = environment.day
    return {
        "name": environment.name,
        "friction": environment.friction,
        "weather": dict(environment.weather),
        "day": None if day is None else day.isoformat(),
        "set_at": environment.set_at,
        "running": environment.running,
    }


def environment_of(values: dict[str, Any]) -> Environment:
    """The environment of `environment_json`."""
    day = values["day"]
    return Environment(
        **values
        | {
            "weather": MappingProxyType(values["weather"]),
            "day": None if day is None else datetime.fromisoformat(day),
        }
    )


# answers ---------------------------------------------------------------------------------------


def write_answer(answer: Control | Pose) -> bytes:
    """The message with a checked answer (`runner.systems.base.plain`)."""
    numbers: tuple[float | None, ...]
    if isinstance(answer, Pose):
        numbers = answer.x, answer.y, answer.h, answer.speed
    else:
        numbers = answer.acceleration, answer.steering, None, None
    doubles = [math.nan if value is None else value for value in numbers]
    # Reasons may hold lone surrogates, as names of files do that are no UTF-8.
    told = answer.reason.encode("utf-8", "surrogatepass")
    return _ANSWER.pack(ANSWER, isinstance(answer, Pose), *doubles) + told


def read_answer(body: bytes) -> Control | Pose:
    """The answer of a message."""
    _, is_pose, *doubles = _ANSWER.unpack_from(body)
    reason = body[_ANSWER.size :].decode("utf-8", "surrogatepass")
    first, second, third, fourth = (None if math.isnan(value) else value for value in doubles)
    if not is_pose:
        return Control(first, second, reason)
    assert first is not None and second is not None and third is not None
    return Pose(first, second, third, fourth, reason)


# many runs ---------------------------------------------------------------------------------

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


class ArrayWriter:
    """Writes the observations of many runs."""

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


class ArrayReader:
    """Reads the observations of many runs.

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
                array = objects([self._object(name, value) for value in values])
                self._arrays[name] = array[np.array(index, np.int64)].reshape(shape)
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
        return kind(*(self._arrays[f"{path}{name}.{field}"] for field in kind._fields))


def _plain_objects(name: str, values: Any) -> list[Any]:
    """Objects of an array as JSON has them, in a list; equal ones are one object."""
    known: dict[int, Any] = {}
    plain = []
    for value in values.ravel():
        # By identity: columns hold few objects many times, and comparing them would take longer.
        if id(value) not in known:
            known[id(value)] = _json(name, value)
        plain.append(known[id(value)])
    return plain


def _json(name: str, value: Any) -> Any:
    if name == "network":
        path = None if value is None else str(value.path)
        return None if path is None else [path, os.path.abspath(path)]
    if name == "environment":
        return None if value is None else environment_json(value)
    if name == "signals":
        return [[*part] for part in value]
    return value if isinstance(value, str) else dict(value)


def _distinct(values: list[Any]) -> tuple[list[Any], list[int]]:
    """Distinct objects, and the index of each object among them."""
    places: dict[int, int] = {}
    distinct: list[Any] = []
    for value in values:
        if id(value) not in places:
            places[id(value)] = len(distinct)
            distinct.append(value)
    return distinct, [places[id(value)] for value in values]


def write_answers(answers: Answers) -> bytes:
    """The message with checked answers."""
    return ANSWER + b"".join(np.asarray(answer).tobytes() for answer in answers)


def read_answers(body: bytes) -> Answers:
    """The answers of a message."""
    # Two arrays of doubles and three of truths.
    n = (len(body) - 1) // (2 * 8 + 3)
    kinds = (float, bool, float, bool, bool)
    found, place = [], 1
    for kind in kinds:
        values = np.frombuffer(body, kind, n, place)
        found.append(values)
        place += values.nbytes
    return Answers(*found)
