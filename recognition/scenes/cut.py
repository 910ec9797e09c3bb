"""Scenes cut out of recordings: participants, and the fewest vertices that keep their motion."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from runner.engine.motion.schedules import quadratic
from runner.recording import Recording, Track
from schemas.common.array_types import BoolArray, FloatArray, IntArray

_FIRST = 1.6
"""Time (s) between vertices to begin with; halved as often as needed."""


class Tolerance(NamedTuple):
    """Largest differences of a run from the recording: m, rad, m/s, m/s²."""

    place: float = 0.03
    heading: float = 0.01
    speed: float = 0.05
    acceleration: float = 0.6


def needed(time: FloatArray, values: FloatArray) -> IntArray:
    """Rows between which values (n, k) are linear in time but for less than 1, ends included
    (Douglas and Peucker, 1973)."""
    kept = {0, len(time) - 1}
    # A stack of its own: halves of a long track nest deeper than Python's calls may.
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


def vertices(columns: Mapping[str, np.ndarray], tolerance: Tolerance) -> IntArray:
    """Rows of a track that its trajectory has vertices at, ends included, ascending."""
    time, last = columns["time"], len(columns["time"]) - 1
    recorded = _Motion.of(columns)
    marks = np.arange(time[0], time[-1], _FIRST)
    # A row may be at a mark but for rounding.
    chosen = np.unique(np.append(np.searchsorted(time, marks - 1e-6), last))
    while True:
        bad = _off(recorded, chosen, tolerance)
        # A stretch is halved if any of its rows is off, its ends included.
        split = (
            np.add.reduceat(bad[:-1] | bad[1:], chosen[:-1]) > 0 if last > 0 else np.zeros(0, bool)
        )
        # Without a row between them there is nothing to halve.
        split &= np.diff(chosen) > 1
        if not split.any():
            return chosen
        chosen = np.union1d(chosen, (chosen[:-1] + chosen[1:])[split] // 2)


class _Motion(NamedTuple):
    """Recorded motion of a track (n,) each: s; m; rad, unwrapped; m/s and m/s² along its direction,
    forward or back."""

    time: FloatArray
    x: FloatArray
    y: FloatArray
    h: FloatArray
    speed: FloatArray
    acceleration: FloatArray

    @classmethod
    def of(cls, columns: Mapping[str, np.ndarray]) -> _Motion:
        """Build it from the columns of a track."""
        time, x, y, h, speed, acceleration = (
            columns[name] for name in ("time", "x", "y", "h", "speed", "acceleration")
        )
        sign = np.where(speed < 0.0, -1.0, 1.0)
        # Unwrapped: between vertices headings are interpolated, which must not go round by ±π.
        return cls(time, x, y, np.unwrap(h), sign * speed, sign * acceleration)


def _off(recorded: _Motion, chosen: IntArray, tolerance: Tolerance) -> BoolArray:
    """Rows at which a run by the chosen vertices is further than tolerated from the recording."""
    time, x, y, h, speed, acceleration = recorded
    dx, dy = np.diff(x[chosen]), np.diff(y[chosen])
    chord = np.hypot(dx, dy)
    stations = np.append(0.0, np.cumsum(chord))
    # Where the way turns back the vehicle comes to rest, so that its speed is 0 there.
    rests = np.isin(stations, stations[1:-1][dx[1:] * dx[:-1] + dy[1:] * dy[:-1] < 0.0])
    pieces, _ = quadratic(time[chosen], stations, float(speed[0]), rests)
    if not len(pieces):
        return np.zeros(len(time), bool)
    piece = pieces[np.maximum(np.searchsorted(pieces[:, 0], time, side="right") - 1, 0)]
    past = time - piece[:, 0]
    station = piece[:, 1] + past * (piece[:, 2] + 0.5 * past * piece[:, 3])
    driven = piece[:, 2] + past * piece[:, 3]
    away = np.hypot(
        np.interp(station, stations, x[chosen]) - x, np.interp(station, stations, y[chosen]) - y
    )
    turn = np.abs(np.interp(station, stations, h[chosen]) - h)
    faster, harder = np.abs(driven - speed), np.abs(piece[:, 3] - acceleration)
    wrong = (away > tolerance.place) | (turn > tolerance.heading)
    return wrong | (faster > tolerance.speed) | (harder > tolerance.acceleration)


EGO = "Ego"
"""Name of the ego in every scenario."""

_SAME_TIME = 1e-6
"""Times (s) that are the same but for rounding."""
_STEP, _SOON = 0.05, 0.25
"""Step of runs (s): an entity that enters between two steps is late by up to one. Latest entry (s)
instead."""


@dataclass(frozen=True)
class Scope:
    """Extent of a scene: its tracks and times.

    Attributes:
        reach: distance (m) within which others matter, at any time of the scene.
        tolerance: how far the run of a trajectory may leave the recorded motion, where that saves
            vertices.
        bystanders: the same for participants beside an event: neither the ego nor its partner.
    """

    reach: float = 100.0
    tolerance: Tolerance = field(default_factory=Tolerance)
    bystanders: Tolerance = field(default_factory=lambda: Tolerance(0.1, 0.02, 0.3, 2.0))


class Part(NamedTuple):
    """A participant of a scene.

    name: in the scenario. track: in the recording. rows: the vertices of its trajectory, as rows of
    the track.
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
class Excerpt:
    """A stretch of a recording; times are those of the recording, s."""

    start: float
    end: float
    parts: tuple[Part, ...]
    """the ego first"""

    @property
    def ego(self) -> Part:
        """The participant called `EGO`."""
        return self.parts[0]


class _FrameRows(NamedTuple):
    """The rows of all tracks (n,) in the order of their frames: number of the
    track, and place (m).
    """

    frame: IntArray
    track: IntArray
    x: FloatArray
    y: FloatArray

    @classmethod
    def of(cls, tracks: Sequence[Track], frames: Sequence[IntArray]) -> _FrameRows:
        """Rows of tracks with the frames of each."""
        track = np.repeat(np.arange(len(tracks)), [len(frame) for frame in frames])
        x, y = (
            np.concatenate([np.zeros(0), *(track.columns[axis] for track in tracks)])
            for axis in "xy"
        )
        frame = np.concatenate([np.zeros(0, np.int64), *frames])
        order = np.argsort(frame, kind="stable")
        return cls(frame[order], track[order], x[order], y[order])


class SceneCutter:
    """A recording, ready for scenes to be cut from it."""

    def __init__(self, recording: Recording, scope: Scope) -> None:
        self.recording, self.scope = recording, scope
        self._vertices: dict[tuple[str, Tolerance], IntArray] = {}
        self._numbers: dict[str, IntArray] = {}
        self._tracks = list(recording.tracks.values())
        self._rows = _FrameRows.of(self._tracks, [self._frames(track) for track in self._tracks])

    def cut(
        self, ego: str, start: float, end: float, involved: Collection[str] | None = None
    ) -> Excerpt:
        """Return the scene of an ego from its first row to its last one between two times (s).

        Args:
            involved: tracks beside the ego that keep the narrow tolerance; None for all.
        """
        track = self.recording.tracks[ego]
        time = track.columns["time"]
        mine = _between(time, start, end)
        start, end = float(time[mine[0]]), float(time[mine[-1]])
        parts = [self._part(EGO, track, mine, self.scope.tolerance)]
        taken = {EGO}
        for other in self._others(track, mine, start, end):
            rows = _between(other.columns["time"], start, end)
            rows = rows[_entrance(other.columns["time"][rows] - start) :]
            # `::` parts references to story elements in OpenSCENARIO, and `$` begins parameters.
            name = _free(
                f"{other.category}_{other.name}".replace("::", "_").replace("$", "_"), taken
            )
            # Bystanders may be further off, which saves vertices: most participants are such.
            beside = involved is not None and other.name not in involved
            parts.append(
                self._part(
                    name, other, rows, self.scope.bystanders if beside else self.scope.tolerance
                )
            )
        return Excerpt(start, end, tuple(parts))

    def _others(self, ego: Track, mine: IntArray, start: float, end: float) -> Iterator[Track]:
        """Yield the tracks near the ego for two frames or more."""
        frames, theirs = self._frames(ego)[mine], self._rows
        rows = np.arange(*np.searchsorted(theirs.frame, [frames[0], frames[-1] + 1]))
        own = np.searchsorted(frames, theirs.frame[rows])
        dx, dy = (
            ego.columns["x"][mine[own]] - theirs.x[rows],
            ego.columns["y"][mine[own]] - theirs.y[rows],
        )
        # A frame that the ego lacks is compared with its row before or after, and dropped here.
        near = (np.hypot(dx, dy) <= self.scope.reach) & (frames[own] == theirs.frame[rows])
        for index in np.unique(theirs.track[rows[near]]):
            other = self._tracks[index]
            if other is not ego and len(_between(other.columns["time"], start, end)) >= 2:
                yield other

    def _frames(self, track: Track) -> IntArray:
        """Numbers of the frames of all rows of a track."""
        if track.name not in self._numbers:
            self._numbers[track.name] = np.round(
                track.columns["time"] / self.recording.timestep
            ).astype(np.int64)
        return self._numbers[track.name]

    def _part(self, name: str, track: Track, rows: IntArray, tolerance: Tolerance) -> Part:
        """A participant with the vertices of its track within the scene, and its first and last row
        there."""
        key = track.name, tolerance
        # Scenes of one recording overlap: the vertices of a track are chosen once, and shared.
        if key not in self._vertices:
            self._vertices[key] = vertices(track.columns, tolerance)
        found = self._vertices[key]
        # Vertices strictly within the scene: its first and last row are added themselves.
        first, last = np.searchsorted(found, [rows[0] + 1, rows[-1]])
        return Part(name, track, np.concatenate([rows[:1], found[first:last], rows[1:][-1:]]))


def _between(time: FloatArray, start: float, end: float) -> IntArray:
    """Rows from start to end."""
    return np.arange(*np.searchsorted(time, [start - _SAME_TIME, end + _SAME_TIME]))


def _entrance(time: FloatArray) -> int:
    """First row of an entering vehicle, at times (s) from the scene's start, that is at a step of
    usual runs."""
    soon = time[
        : min(int(np.searchsorted(time, time[0] + _SOON)), len(time) - 1)
    ]  # a trajectory has two rows
    at_step = np.abs(np.remainder(soon / _STEP + 0.5, 1.0) - 0.5) < _SAME_TIME / _STEP
    return int(np.argmax(at_step))


def _free(name: str, taken: set[str]) -> str:
    """A name that is not taken yet; it is entered in those taken."""
    while name in taken:
        name += "_"
    taken.add(name)
    return name
