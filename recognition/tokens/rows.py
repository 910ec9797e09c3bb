"""Which rows of a recording a window is made of: the ego's, and those of the others that matter most to it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from recognition.labels.scene.leads import ABSENT
from recognition.labels.scene.scene import Scene
from recognition.tokens.config import Tokens
from schemas.errors import UsageError
from xodr.array_types import FloatArray, IntArray

Moments = Sequence[tuple[str, float]]
"""Names of ego tracks and times, s."""
_ANCHORS = 5
"""Frames of a window in which others are looked for."""
_ASIDE = 2.5
"""Distances to the side count so many times: who is on the same lane matters from farther away."""


class _Index:
    """The rows of a scene by track and frame, and by frame alone."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._frames = int(scene.frame.max(initial=0)) + 2
        self._keys = scene.track * self._frames + scene.frame
        self.by_frame = np.argsort(scene.frame, kind="stable")
        self.starts = np.searchsorted(scene.frame[self.by_frame], np.arange(self._frames + 1))

    def find(self, track: IntArray, frame: IntArray) -> IntArray:
        """The row of each track (ABSENT for none) in each frame, ABSENT where there is none."""
        key = track * self._frames + frame
        place = np.minimum(np.searchsorted(self._keys, key), len(self._keys) - 1)
        there = (self._keys[place] == key) & (track != ABSENT) & (frame >= 0) & (frame < self._frames)
        return np.where(there, place, ABSENT)


def window_rows(scene: Scene, moments: Moments, tokens: Tokens) -> IntArray:
    """Rows (n, participants, frames) of windows, ABSENT where a participant is not there.

    Raises:
        UsageError: a moment names no track.
    """
    numbers = {name: number for number, name in enumerate(scene.names)}
    unknown = next((ego for ego, _ in moments if ego not in numbers), None)
    if unknown is not None:
        raise UsageError(f"the recording has no vehicle {unknown!r}")
    index, begin = _Index(scene), scene.time.min(initial=np.inf) if len(scene.time) else 0.0
    egos = np.array([numbers[ego] for ego, _ in moments], np.int64)
    middle = np.array([time for _, time in moments], float) - begin
    frame = np.rint((middle[:, None] + np.array(tokens.offsets)) / scene.step).astype(np.int64)
    own = index.find(np.broadcast_to(egos[:, None], frame.shape), frame)
    others = _others(scene, index, own, egos, tokens)
    rows = index.find(np.broadcast_to(others[:, :, None], (*others.shape, tokens.frames)), frame[:, None, :])
    return np.concatenate([own[:, None], rows], axis=1)


def _others(scene: Scene, index: _Index, own: IntArray, egos: IntArray, tokens: Tokens) -> IntArray:
    """Tracks (n, others) of those that matter most in each window, ABSENT where there are fewer."""
    anchors = np.unique(np.linspace(0, tokens.frames - 1, _ANCHORS).round().astype(np.int64))
    window, track, distance = _near(scene, index, own[:, anchors], tokens.reach)
    order = np.lexsort((distance, track, window))
    window, track, distance = window[order], track[order], distance[order]
    nearest = np.ones(len(window), bool)
    nearest[1:] = (window[1:] != window[:-1]) | (track[1:] != track[:-1])
    nearest &= track != egos[window]
    window, track, distance = window[nearest], track[nearest], distance[nearest]
    order = np.lexsort((distance, window))
    window, track = window[order], track[order]
    rank = np.arange(len(window)) - np.searchsorted(window, window)
    chosen = np.full((len(own), tokens.others), ABSENT, np.int64)
    kept = rank < tokens.others
    chosen[window[kept], rank[kept]] = track[kept]
    return chosen


def _near(scene: Scene, index: _Index, own: IntArray, reach: float) -> tuple[IntArray, IntArray, FloatArray]:
    """Windows, tracks and distances of everybody near to egos' rows (n, anchors); leads and followers at distance 0."""
    window = np.repeat(np.arange(len(own)), own.shape[1])[own.ravel() != ABSENT]
    ego = own.ravel()[own.ravel() != ABSENT]
    start, end = index.starts[scene.frame[ego]], index.starts[scene.frame[ego] + 1]
    sizes = end - start
    first = np.repeat(start - np.concatenate([[0], np.cumsum(sizes)[:-1]]), sizes)
    other = index.by_frame[np.arange(len(first)) + first]
    window, ego = np.repeat(window, sizes), np.repeat(ego, sizes)
    dx, dy = scene.x[other] - scene.x[ego], scene.y[other] - scene.y[ego]
    cos, sin = np.cos(scene.h[ego]), np.sin(scene.h[ego])
    distance = np.hypot(dx * cos + dy * sin, _ASIDE * (dy * cos - dx * sin))
    leads = scene.leads
    close = (leads.row[ego] == other) | (leads.follower[ego] == other)
    kept = close | (np.hypot(dx, dy) < reach)
    return window[kept], scene.track[other[kept]], np.where(close, 0.0, distance)[kept]
