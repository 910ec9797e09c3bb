"""Shared parts of run exports: points fixed to an entity, rates, standstill, iteration over steps,
refusals."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from schemas.common.array_types import FloatArray
from schemas.common.errors import Unsupported
from xosc.document import load

if TYPE_CHECKING:
    from runner.judging.result import RunResult
    from runner.recording import Recording, Track

_STILL = 1e-9
"""Largest distance (m) from its first position of an entity that counts as standing"""
Moment = tuple[float, list[tuple[int, int]]]
"""Time (s), and for every present entity the numbers of its track and row."""


def fixed_point(track: Track, x: float, y: float, z: float) -> FloatArray:
    """World positions (n, 3) in m of a point of a participant's own frame (m from its reference
    point) at every row.

    The frame is turned by heading, then pitch, then roll about the axes turned with it (ISO 8855).
    """
    columns = track.columns
    (ch, cp, cr), (sh, sp, sr) = (
        [turn(columns[name].astype(float)) for name in ("h", "pitch", "roll")]
        for turn in (np.cos, np.sin)
    )
    return np.column_stack(
        [
            columns["x"]
            + x * ch * cp
            + y * (ch * sp * sr - sh * cr)
            + z * (ch * sp * cr + sh * sr),
            columns["y"]
            + x * sh * cp
            + y * (sh * sp * sr + ch * cr)
            + z * (sh * sp * cr - ch * sr),
            columns["z"] - x * sp + y * cp * sr + z * cp * cr,
        ]
    )


def box_centre(track: Track) -> FloatArray:
    """World positions (n, 3) in m of the centre of a participant's bounding box."""
    return fixed_point(track, track.box.x, track.box.y, track.box.z)


def rate(values: FloatArray, time: FloatArray) -> FloatArray:
    """Derivative of the rows of `values` by time (s), zero where there is one row only."""
    return np.gradient(values, time, axis=0) if len(time) > 1 else np.zeros_like(values)


def wrapped(angles: FloatArray) -> FloatArray:
    """Angles (rad) from -π to π."""
    return np.arctan2(np.sin(angles), np.cos(angles))


def stands(track: Track) -> bool:
    """Whether it is a thing that never gets away from where it was first."""
    return track.kind == "miscellaneous" and bool(np.ptp(box_centre(track), axis=0).max() < _STILL)


def date(result: RunResult) -> str:
    """Date and time that the scenario's FileHeader names, to the second, without zone: the same
    whenever it is exported."""
    return str(load(result.scenario).node.need("FileHeader").get("date"))[:19]


def decimal(value: float) -> str:
    """A decimal as XML Schema has it, to the millionth."""
    return f"{value:.6f}".rstrip("0").rstrip(".")


def moments(recording: Recording) -> Iterator[Moment]:
    """Yield the times of a recording in order, with the present entities."""
    there: dict[float, list[tuple[int, int]]] = {}
    for number, track in enumerate(recording.tracks.values()):
        for row, time in enumerate(track.columns["time"].tolist()):
            there.setdefault(time, []).append((number, row))
    yield from sorted(there.items())


def unsupported(result: RunResult, entity: str | None, message: str) -> Unsupported:
    """An Unsupported, to be raised by the caller, at the ScenarioObject of an entity or else at the
    scenario's root."""
    root = load(result.scenario).node
    places = [node for node in root.iter("ScenarioObject") if node.get("name", None) == entity]
    return (places or [root])[0].unsupported(message)
