"""Scenes: a stretch of a recording as one vehicle, the ego, lives through it, with everyone who comes near."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from runner.recording import Recording, Track
from xodr.array_types import FloatArray, IntArray

EGO = "Ego"
"""Name of the ego in every scenario."""

_SAME_TIME = 1e-6
"""Times (s) that are the same but for rounding."""


@dataclass(frozen=True)
class Scope:
    """What belongs to a scene.

    Attributes:
        reach: distance (m) within which others matter, at any time of the scene.
        tolerance: how far (m) a trajectory may leave the recorded positions, where that saves vertices.
        turn: how far (rad) its headings may leave the recorded ones.
    """

    reach: float = 100.0
    tolerance: float = 0.02
    turn: float = 0.01


class Part(NamedTuple):
    """A participant of a scene.

    name: in the scenario. track: in the recording. rows: the vertices of its trajectory, as rows of the track.
    """

    name: str
    track: Track
    rows: IntArray

    @property
    def time(self) -> FloatArray:
        """Times of the vertices, in the recording (s)."""
        return self.track.columns["time"][self.rows]

    def column(self, name: str) -> FloatArray:
        """Values at the vertices."""
        return self.track.columns[name][self.rows]


@dataclass(frozen=True)
class Scene:
    """A stretch of a recording; times are those of the recording, s."""

    start: float
    end: float
    parts: tuple[Part, ...]
    """the ego first"""

    @property
    def ego(self) -> Part:
        """The participant called `EGO`."""
        return self.parts[0]


class SceneCutter:
    """A recording, ready for scenes to be cut from it."""

    def __init__(self, recording: Recording, scope: Scope) -> None:
        self.recording, self.scope = recording, scope
        self._tracks = list(recording.tracks.values())
        self._first = np.array([track.columns["time"][0] for track in self._tracks])
        self._last = np.array([track.columns["time"][-1] for track in self._tracks])

    def cut(self, ego: str, start: float, end: float) -> Scene:
        """The scene of an ego from its first row to its last one between two times (s)."""
        track = self.recording.tracks[ego]
        time = track.columns["time"]
        mine = _between(time, start, end)
        start, end = float(time[mine[0]]), float(time[mine[-1]])
        parts = [Part(EGO, track, mine[self._vertices(track, mine)])]
        taken = {EGO}
        for other in self._others(track, mine, start, end):
            rows = _between(other.columns["time"], start, end)
            name = _free(f"{other.category}_{other.name}".replace("::", "_").replace("$", "_"), taken)
            parts.append(Part(name, other, rows[self._vertices(other, rows)]))
        return Scene(start, end, tuple(parts))

    def _others(self, ego: Track, mine: IntArray, start: float, end: float) -> Iterator[Track]:
        """Those who come near the ego, for two frames at least."""
        frames = self._frames(ego, mine)
        for index in np.flatnonzero((self._first < end) & (self._last > start)):
            other = self._tracks[index]
            rows = _between(other.columns["time"], start, end)
            if other is ego or len(rows) < 2:
                continue
            _, own, theirs = np.intersect1d(frames, self._frames(other, rows), assume_unique=True, return_indices=True)
            dx, dy = (ego.columns[axis][mine[own]] - other.columns[axis][rows[theirs]] for axis in ("x", "y"))
            if len(own) and np.hypot(dx, dy).min() <= self.scope.reach:
                yield other

    def _frames(self, track: Track, rows: IntArray) -> IntArray:
        return np.round(track.columns["time"][rows] / self.recording.timestep).astype(np.int64)

    def _vertices(self, track: Track, rows: IntArray) -> IntArray:
        columns, scope = track.columns, self.scope
        x, y, h = (columns[name][rows] for name in ("x", "y", "h"))
        values = np.column_stack([x / scope.tolerance, y / scope.tolerance, np.unwrap(h) / scope.turn])
        return needed(columns["time"][rows], values)


def needed(time: FloatArray, values: FloatArray) -> IntArray:
    """Rows between which values (n, k) are linear in time but for less than 1, ends included (Douglas and Peucker, 1973)."""
    kept = {0, len(time) - 1}
    pending = [(0, len(time) - 1)]
    while pending:
        a, b = pending.pop()
        if b - a < 2:
            continue
        share = (time[a : b + 1] - time[a]) / (time[b] - time[a])
        line = values[a] + share[:, None] * (values[b] - values[a])
        off = np.abs(values[a : b + 1] - line).max(axis=1)
        worst = int(off.argmax())
        if off[worst] > 1.0:
            kept.add(a + worst)
            pending += [(a, a + worst), (a + worst, b)]
    return np.array(sorted(kept), np.int64)


def _between(time: FloatArray, start: float, end: float) -> IntArray:
    """Rows from start to end."""
    return np.arange(*np.searchsorted(time, [start - _SAME_TIME, end + _SAME_TIME]))


def _free(name: str, taken: set[str]) -> str:
    """A name that is not taken yet; it is entered in those taken."""
    while name in taken:
        name += "_"
    taken.add(name)
    return name
