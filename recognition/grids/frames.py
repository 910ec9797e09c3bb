"""The rows of a recording by frame: who is where at the same instant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from runner.recording import Recording
from schemas.errors import UsageError
from xodr.array_types import BoolArray, FloatArray, IntArray

Moments = Sequence[tuple[str, float]]
"""Names of ego tracks and times, s."""
_MISSING = 0.25
"""The ego's row nearest to a requested time may be this far from it, s: a few frames may be missing in its track."""
_TIE = 1e-6
"""Of two rows that are equally near in time, within rounding (s), the earlier counts: so frames stay equally far apart."""


@dataclass(frozen=True)
class Frames:
    """All rows of a recording, sorted by frame.

    Attributes:
        x, y, h: centres (m) and headings (rad) of the boxes; vx, vy: velocities, m/s; length, width: of the boxes, m.
        time: s. frame, track: numbers of the row's frame and track. starts: first row of each frame, and the end.
        names: number of each track by its name. tracks: rows of each track in ascending time, one after the other, from
            `begins[number]` on.
    """

    x: FloatArray
    y: FloatArray
    h: FloatArray
    vx: FloatArray
    vy: FloatArray
    length: FloatArray
    width: FloatArray
    time: FloatArray
    frame: IntArray
    track: IntArray
    starts: IntArray
    names: dict[str, int]
    tracks: IntArray
    begins: IntArray


def frames_of(recording: Recording) -> Frames:
    """Sort the rows of a recording by frame: its timestep is the raster of the times."""
    tracks = list(recording.tracks.values())
    if not tracks:
        raise UsageError("the recording has no tracks")
    counts = [len(track.columns["time"]) for track in tracks]
    time, x, y, h, speed = (
        np.concatenate([track.columns[name] for track in tracks]) for name in ("time", "x", "y", "h", "speed")
    )
    who = np.repeat(np.arange(len(tracks)), counts)
    frame = np.rint((time - time.min()) / recording.timestep).astype(np.int64)
    order = np.argsort(frame, kind="stable")
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    frame, who = frame[order], np.repeat(np.arange(len(tracks)), counts)[order]
    x, y, h, speed = (np.concatenate([track.columns[name] for track in tracks])[order] for name in ("x", "y", "h", "speed"))
    ahead, left, length, width = np.array([(t.box.x, t.box.y, t.box.length, t.box.width) for t in tracks])[who].T
    cos, sin = np.cos(h), np.sin(h)
    return Frames(
        x=x + ahead * cos - left * sin,
        y=y + ahead * sin + left * cos,
        h=h,
        vx=speed * cos,
        vy=speed * sin,
        length=length,
        width=width,
        time=time[order],
        frame=frame,
        track=who,
        starts=np.searchsorted(frame, np.arange(frame[-1] + 2)),
        names={track.name: number for number, track in enumerate(tracks)},
        tracks=place,
        begins=np.concatenate([[0], np.cumsum(counts)]),
    )


def ego_rows(frames: Frames, moments: Moments, offsets: Sequence[float]) -> tuple[IntArray, BoolArray]:
    """Rows of the egos nearest to the requested times: (n, offsets); and whether each moment's are all near enough.

    Raises:
        UsageError: a moment names no track of the recording.
    """
    rows = np.empty((len(moments), len(offsets)), np.int64)
    requested = np.array([time for _, time in moments], float)[:, None] + np.asarray(offsets) - _TIE
    egos = np.array([_number(frames, ego) for ego, _ in moments], np.int64)
    for ego in np.unique(egos):
        mine = egos == ego
        own = frames.tracks[frames.begins[ego] : frames.begins[ego + 1]]
        middles = 0.5 * (frames.time[own[1:]] + frames.time[own[:-1]])
        rows[mine] = own[np.searchsorted(middles, requested[mine])]
    return rows, (np.abs(frames.time[rows] - requested) <= _MISSING).all(axis=1)


def covered(recording: Recording, moments: Moments, offsets: Sequence[float]) -> BoolArray:
    """Whether the ego's track is there at these times (s) about each moment, but for gaps of a few frames."""
    if not moments:
        return np.zeros(0, bool)
    return ego_rows(frames_of(recording), moments, offsets)[1]


def _number(frames: Frames, ego: str) -> int:
    number = frames.names.get(ego)
    if number is None:
        raise UsageError(f"the recording has no track {ego!r}")
    return number
