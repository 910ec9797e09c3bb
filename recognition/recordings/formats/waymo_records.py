"""Scenarios of Waymo Open Motion in TFRecord files, as objects in the form of GPUDrive's JSON;
without TensorFlow.

Source: the data set's scenario.proto and map.proto (version 1.3); the formats of TFRecord (length,
masked CRC-32C of it, content, masked CRC-32C of that) and of protocol buffers. Only fields that a
recording needs are read; all others, laser data among them, are skipped.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from schemas.common.array_types import FloatArray
from schemas.common.errors import InvalidFile
from schemas.common.policy import current
from schemas.common.storage import MAX_BYTES

_HEAD, _FOOT = struct.Struct("<QI"), struct.Struct("<I")
_DOUBLE, _FLOAT = struct.Struct("<d"), struct.Struct("<f")
_VARINT, _EIGHT, _BYTES, _FOUR = 0, 1, 2, 5
"""Wire types"""
_TIMES, _TRACKS, _ID, _EGO, _LIGHTS, _MAP = 1, 2, 5, 6, 7, 8
"""Fields of Scenario"""
_POINT = struct.Struct("<BdBdBd")
_POINT_TAGS = (0x09, 0x11, 0x19)
"""Layout of a MapPoint with all three coordinates, which nearly all have"""
_STEP, _TOLERANCE = 0.1, 0.01
_KINDS = ("unset", "vehicle", "pedestrian", "cyclist", "other")
_STATES = (
    "unknown", "arrow_stop", "arrow_caution", "arrow_go", "stop", "caution", "go", "flashing_stop",
    "flashing_caution",
)  # fmt: skip
_MPH = 0.44704
_LANE, _LINE, _EDGE, _CROSSWALK = 3, 4, 5, 8
"""Fields of MapFeature"""
_MOST_RECORDS = 100_000

Message = dict[int, list[Any]]
"""Values by field: numbers, or bytes for doubles, floats and nested messages"""


class RecordSpan(NamedTuple):
    """A record in a file: where its content begins, its length and its masked checksum."""

    start: int
    length: int
    checksum: int


def places(path: Path) -> list[RecordSpan]:
    """The records of a file, without reading them.

    Raises:
        InvalidFile: the file is cut short, or no TFRecord.
    """
    current().admit(path)
    found: list[RecordSpan] = []
    try:
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            at = 0
            while at < size:
                head = file.read(_HEAD.size)
                if len(head) < _HEAD.size:
                    raise _fault(path, len(found), "it is cut short")
                length, checksum = _HEAD.unpack(head)
                # A damaged length would lead anywhere in the file.
                if _masked(head[:8]) != checksum:
                    raise _fault(path, len(found), "its length has another checksum")
                start = at + _HEAD.size
                at = start + length + _FOOT.size
                if length > MAX_BYTES or at > size or len(found) >= _MOST_RECORDS:
                    raise _fault(path, len(found), "it is cut short, or too long")
                file.seek(start + length)
                found.append(RecordSpan(start, length, *_FOOT.unpack(file.read(_FOOT.size))))
    except OSError as error:
        raise InvalidFile(f"not readable: {error.strerror}", path=path) from None
    return found


def is_scenario(path: Path) -> bool:
    """Whether the first record of a file looks like a Scenario; other records of the data set's
    files do not."""
    try:
        first = places(path)[:1]
        if not first:
            return False
        kinds = {field: wire for field, wire, _ in _fields(_content(path, 0, first[0]))}
    except (InvalidFile, ValueError):
        return False
    return kinds.get(_TRACKS) == _BYTES and kinds.get(_EGO) == _VARINT


def scene(path: Path, number: int) -> dict[str, Any]:
    """The scenario of a record, from 0, in the form of GPUDrive's JSON; lanes also with
    `speed_limit` (m/s) and `exits`.

    Raises:
        InvalidFile: the record is damaged, or no Scenario; names the record.
    """
    return _scene(path, number, path.stat().st_mtime_ns)


@lru_cache(maxsize=1)  # roads, lights and the recording of one scene are asked for in turn
def _scene(path: Path, number: int, _version: int) -> dict[str, Any]:
    found = places(path)
    if not 0 <= number < len(found):
        raise InvalidFile(f"the file has {len(found)} records, no record {number}", path=path)
    try:
        return _document(_message(_content(path, number, found[number])))
    except (ValueError, IndexError, struct.error) as error:
        raise _fault(path, number, f"it is no Scenario: {error}") from None


def _fault(path: Path, number: int, message: str) -> InvalidFile:
    return InvalidFile(message, path=path, element=f"record {number}")


def _content(path: Path, number: int, place: RecordSpan) -> memoryview:
    with path.open("rb") as file:
        file.seek(place.start)
        content = file.read(place.length)
    if _masked(content) != place.checksum:
        raise _fault(path, number, "its content has another checksum: it is damaged")
    return memoryview(content)


# checksums ------------------------------------------------------------------------------------

_BLOCK = 4096
_POLYNOMIAL = 0x82F63B78
"""Of CRC-32C, reflected"""


@lru_cache(maxsize=1)
def _tables() -> NDArray[np.uint32]:
    """Change of the checksum (k, 256) by a byte that k more bytes follow."""
    first = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        first = np.where(first & 1, (first >> 1) ^ np.uint32(_POLYNOMIAL), first >> 1)
    tables = np.empty((_BLOCK, 256), np.uint32)
    tables[0] = first
    for number in range(1, _BLOCK):
        before = tables[number - 1]
        tables[number] = (before >> 8) ^ first[before & 0xFF]
    return tables


def _masked(content: bytes) -> int:
    """Masked CRC-32C; a block at a time, since it is linear in the bytes."""
    tables, checksum = _tables(), 0xFFFFFFFF
    for start in range(0, len(content), _BLOCK):
        block = np.frombuffer(content[start : start + _BLOCK], np.uint8)
        # The checksum so far acts on the first bytes of the block, as if it were part of them.
        carried = np.zeros(max(len(block), 4), np.uint8)
        carried[:4] = np.frombuffer(checksum.to_bytes(4, "little"), np.uint8)
        mixed = block ^ carried[: len(block)]
        after = np.arange(len(block) - 1, -1, -1)
        rest = checksum >> (8 * len(block)) if len(block) < 4 else 0
        checksum = rest ^ int(np.bitwise_xor.reduce(tables[after, mixed]))
    checksum ^= 0xFFFFFFFF
    # TFRecord's mask: rotated right by 15 bits, plus a constant.
    return ((checksum >> 15 | checksum << 17) + 0xA282EAD8) & 0xFFFFFFFF


# protocol buffers ---------------------------------------------------------------------------


def _fields(content: memoryview) -> Iterator[tuple[int, int, Any]]:
    """Yield field, wire type and value of each part of a message.

    Raises:
        ValueError: it is cut short, or no message.
    """
    at, size = 0, len(content)
    while at < size:
        tag, at = _varint(content, at)
        field, wire = tag >> 3, tag & 7
        if wire == _VARINT:
            found, at = _varint(content, at)
            yield field, wire, found
            continue
        length = 8 if wire == _EIGHT else 4 if wire == _FOUR else None
        if length is None:
            if wire != _BYTES:
                raise ValueError(f"there is no wire type {wire}")
            length, at = _varint(content, at)
        if at + length > size:
            raise ValueError("a field is longer than its message")
        yield field, wire, content[at : at + length]
        at += length


def _varint(content: memoryview, at: int) -> tuple[int, int]:
    found = 0
    # Ten bytes hold 64 bits, 7 in each.
    for shift in range(0, 70, 7):
        if at >= len(content):
            raise ValueError("a number is cut short")
        byte = content[at]
        at += 1
        found |= (byte & 0x7F) << shift
        if byte < 0x80:
            return found, at
    raise ValueError("a number is too long")


def _message(content: memoryview) -> Message:
    found: Message = {}
    for field, _, value in _fields(content):
        found.setdefault(field, []).append(value)
    return found


def _last(message: Message, field: int, default: Any, read: Callable[[Any], Any]) -> Any:
    """A field that is there once; of several the last counts."""
    return read(message[field][-1]) if field in message else default


def _real(value: Any) -> float:
    form = {8: _DOUBLE, 4: _FLOAT}.get(len(value) if isinstance(value, memoryview) else 0)
    if form is None:
        raise ValueError("a real number is expected")
    return float(form.unpack(value)[0])


def _whole(value: Any) -> int:
    if not isinstance(value, int):
        raise ValueError("a whole number is expected")
    # Negative numbers are written in two's complement of 64 bits.
    return value - (1 << 64) if value >= 1 << 63 else value


def _nested(value: Any) -> Message:
    if not isinstance(value, memoryview):
        raise ValueError("a message is expected")
    return _message(value)


def _packed(values: Sequence[Any]) -> list[int]:
    """Whole numbers, packed or one by one."""
    found = []
    for value in values:
        if isinstance(value, int):
            found.append(_whole(value))
            continue
        at = 0
        while at < len(value):
            number, at = _varint(value, at)
            found.append(_whole(number))
    return found


# scenes -------------------------------------------------------------------------------------


def _document(scenario: Message) -> dict[str, Any]:
    times = _times(scenario.get(_TIMES, []))
    steps = np.diff(times)
    if len(steps) and abs(float(np.median(steps)) - _STEP) > _TOLERANCE:
        raise ValueError(f"its steps last {np.median(steps):g} s, {_STEP:g} s are expected")
    lights: dict[str, Any] = {}
    for number, moment in enumerate(scenario.get(_LIGHTS, [])):
        for state in _nested(moment).get(1, []):
            _add_light(lights, number, _nested(state))
    return {
        "name": _last(scenario, _ID, "", lambda text: bytes(text).decode(errors="replace")),
        "objects": [_track(_nested(track), len(times)) for track in scenario.get(_TRACKS, [])],
        "roads": [
            road for feature in scenario.get(_MAP, []) for road in _feature(_nested(feature))
        ],
        "tl_states": lights,
        "metadata": {"sdc_track_index": _last(scenario, _EGO, -1, _whole)},
    }


def _times(values: Sequence[Any]) -> FloatArray:
    """Times (n,), packed or one by one, s."""
    content = b"".join(bytes(value) for value in values)
    if len(content) % 8:
        raise ValueError("its times are no doubles")
    return np.frombuffer(content, "<f8").astype(np.float64)


def _add_light(lights: dict[str, Any], step: int, state: Message) -> None:
    lane, point = str(_last(state, 1, -1, _whole)), _last(state, 3, {}, _nested)
    light = lights.setdefault(lane, {"state": [], "x": [], "y": [], "time_index": []})
    kind = _last(state, 2, 0, _whole)
    light["state"].append(_STATES[kind] if 0 <= kind < len(_STATES) else "unknown")
    for axis, field in (("x", 1), ("y", 2)):
        light[axis].append(_last(point, field, 0.0, _real))
    light["time_index"].append(step)


def _track(track: Message, count: int) -> dict[str, Any]:
    states = [_nested(state) for state in track.get(3, [])]
    if len(states) != count:
        raise ValueError(f"a track has {len(states)} states for {count} times")
    kind = _last(track, 2, 0, _whole)
    valid = [bool(_last(state, 11, 0, _whole)) for state in states]

    def column(field: int) -> list[float]:
        return [_last(state, field, 0.0, _real) for state in states]

    x, y, vx, vy = (column(field) for field in (2, 3, 9, 10))
    sizes = {
        name: [
            _last(state, field, 0.0, _real)
            for state, there in zip(states, valid, strict=True)
            if there
        ]
        for name, field in (("length", 5), ("width", 6), ("height", 7))
    }
    return {
        "id": _last(track, 1, 0, _whole),
        "type": _KINDS[kind] if 0 <= kind < len(_KINDS) else "other",
        # Sizes vary from step to step, as they are estimated.
        **{name: float(np.median(values)) if values else 0.0 for name, values in sizes.items()},
        "valid": valid,
        "position": [{"x": a, "y": b} for a, b in zip(x, y, strict=True)],
        "heading": column(8),
        "velocity": [{"x": a, "y": b} for a, b in zip(vx, vy, strict=True)],
    }


def _feature(feature: Message) -> Iterator[dict[str, Any]]:
    name = str(_last(feature, 1, 0, _whole))
    for lane in feature.get(_LANE, []):
        found = _nested(lane)
        # Field 1 is in miles per hour.
        limit = _last(found, 1, 0.0, _real)
        yield {
            "id": name,
            "type": "lane",
            "map_element_id": _last(found, 2, 0, _whole),
            "geometry": _line(found.get(8, [])),
            "exits": [str(number) for number in _packed(found.get(10, []))],
            **({"speed_limit": _MPH * limit} if limit > 0.0 else {}),
        }
    for field, kind, points in (
        (_LINE, "road_line", 2),
        (_EDGE, "road_edge", 2),
        (_CROSSWALK, "crosswalk", 1),
    ):
        for part in feature.get(field, []):
            yield {"id": name, "type": kind, "geometry": _line(_nested(part).get(points, []))}


def _line(points: Sequence[Any]) -> list[dict[str, float]]:
    found = []
    for point in points:
        if isinstance(point, memoryview) and len(point) == _POINT.size:
            a, x, b, y, c, _ = _POINT.unpack(point)
            if (a, b, c) == _POINT_TAGS:
                found.append({"x": x, "y": y})
                continue
        message = _nested(point)
        found.append({"x": _last(message, 1, 0.0, _real), "y": _last(message, 2, 0.0, _real)})
    return found
