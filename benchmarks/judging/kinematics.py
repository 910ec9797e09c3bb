"""Moments of a vehicle that plain kinematics single out: a criterion for draws in which no rule,
model or lane has a part.

It singles out far more than the events of the 17 classes, and nothing says which of them, if any:
it raises the share of stretches in which something happens, so that reviewers label events instead
of waiting for them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from runner.recording import Recording, Track
from schemas.common.array_types import BoolArray, FloatArray, IntArray

REASONS = ("turns", "shifts", "brakes", "meets", "parts", "crosses")
_WINDOW = 5.0
"""Time (s) within which a heading turns or a place shifts"""
_TURN, _STEADY = np.radians(30.0), np.radians(10.0)
"""Change of heading that counts as a turn; greatest one that counts as none"""
_SHIFT = 2.0
"""Displacement to the side (m) at an unchanged heading"""
_BRAKING = -2.5
"""Acceleration (m/s²)"""
_AHEAD, _BESIDE, _AROUND = 30.0, 2.0, 1.0
"""A box is ahead at centres up to so many m ahead and to the side; the heading is steady for so
many s before and after"""
_MOVING = 3.0
"""Least speed (m/s) of a vehicle that meets or crosses another one"""
_NEAR, _APART = 2.0, 4.0
"""Ways cross at centres closer than this (m), passed within so many s"""
_EVERY = 5
"""Ways are compared at each so many frames"""


class Instant(NamedTuple):
    """A moment that kinematics single out, with its reason and time (s)."""

    reason: str
    time: float


class _Way(NamedTuple):
    """A track as arrays: frame numbers, x and y (n, 2), heading without jumps,
    speed, acceleration.
    """

    frame: IntArray
    place: FloatArray
    heading: FloatArray
    speed: FloatArray
    acceleration: FloatArray


def instants(recording: Recording) -> dict[str, list[Instant]]:
    """Return the moments of each vehicle by name: at most one of each reason, the strongest or
    first one.

    - *turns*: the heading changes by 30 degrees or more within 5 s.
    - *shifts*: 2 m or more to the side of its mean heading within 5 s, at a heading that changes by
      less than 10 degrees.
    - *brakes*: 2.5 m/s² or more.
    - *meets*, *parts*: another vehicle comes from the side to within 30 m ahead, or leaves
      sideways, at a steady heading.
    - *crosses*: another vehicle passes a place of its way within 4 s, at an angle of 30 to 150
      degrees.
    """
    step = recording.timestep
    ways = {
        name: _way(track, step)
        for name, track in recording.tracks.items()
        if track.kind == "vehicle"
    }
    return {name: [*_own(way, step), *_with_others(name, ways, step)] for name, way in ways.items()}


def _way(track: Track, step: float) -> _Way:
    columns = track.columns
    frame = np.rint(columns["time"] / step).astype(int)
    place = np.column_stack((columns["x"], columns["y"]))
    return _Way(frame, place, np.unwrap(columns["h"]), columns["speed"], columns["acceleration"])


def _own(way: _Way, step: float) -> Iterator[Instant]:
    frames = min(round(_WINDOW / step), len(way.frame) - 1)
    if frames < 1:
        return
    start, end = way.heading[:-frames], way.heading[frames:]
    turned = np.abs(end - start)
    middle = way.frame[frames // 2 :]
    if turned.max() >= _TURN:
        yield Instant("turns", float(middle[int(turned.argmax())] * step))
    normal = np.column_stack((-np.sin(0.5 * (start + end)), np.cos(0.5 * (start + end))))
    shifted = np.abs(((way.place[frames:] - way.place[:-frames]) * normal).sum(axis=1)) * (
        turned < _STEADY
    )
    if shifted.max() >= _SHIFT:
        yield Instant("shifts", float(middle[int(shifted.argmax())] * step))
    if way.acceleration.min() <= _BRAKING:
        yield Instant("brakes", float(way.frame[int(way.acceleration.argmin())] * step))


def _with_others(name: str, ways: dict[str, _Way], step: float) -> Iterator[Instant]:
    own, found = ways[name], {reason: [] for reason in ("meets", "parts", "crosses")}
    around = max(round(_AROUND / step), 1)
    steady = _steady(own, around) & (own.speed >= _MOVING)
    for other in (way for each, way in ways.items() if each != name):
        _, mine, theirs = np.intersect1d(
            own.frame, other.frame, assume_unique=True, return_indices=True
        )
        if len(mine) > 1:
            offset, heading = other.place[theirs] - own.place[mine], own.heading[mine]
            ahead = offset[:, 0] * np.cos(heading) + offset[:, 1] * np.sin(heading)
            side = np.abs(offset[:, 1] * np.cos(heading) - offset[:, 0] * np.sin(heading))
            inside = side <= _BESIDE
            possible = steady[mine][1:] & (ahead[1:] > 0.0) & (ahead[1:] <= _AHEAD)
            for reason, changed in (
                ("meets", inside[1:] & ~inside[:-1]),
                ("parts", inside[:-1] & ~inside[1:]),
            ):
                found[reason] += own.frame[mine[1:][changed & possible]].tolist()
        found["crosses"] += _crossings(own, other, step).tolist()
    yield from (
        Instant(reason, float(min(frames) * step)) for reason, frames in found.items() if frames
    )


def _steady(way: _Way, around: int) -> BoolArray:
    """Whether the heading is steady around each frame."""
    later = np.minimum(np.arange(len(way.frame)) + around, len(way.frame) - 1)
    earlier = np.maximum(np.arange(len(way.frame)) - around, 0)
    return np.abs(way.heading[later] - way.heading[earlier]) < _STEADY


def _crossings(own: _Way, other: _Way, step: float) -> IntArray:
    """Frames at which a vehicle is where another one's way crosses its own."""
    mine, theirs = (np.flatnonzero(way.speed >= _MOVING)[::_EVERY] for way in (own, other))
    if not (len(mine) and len(theirs)):
        return np.empty(0, dtype=int)
    apart = np.hypot(*(own.place[mine][:, None] - other.place[theirs][None]).transpose(2, 0, 1))
    between = np.abs(own.frame[mine][:, None] - other.frame[theirs][None]) * step
    across = np.abs(np.sin(own.heading[mine][:, None] - other.heading[theirs][None])) > np.sin(
        _TURN
    )
    return own.frame[mine[((apart < _NEAR) & (between <= _APART) & across).any(axis=1)]]
