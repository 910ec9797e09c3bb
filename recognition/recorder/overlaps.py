"""Whether vehicles run into each other."""

from __future__ import annotations

import numpy as np

from recognition.recorder.motion import VehicleMotion
from xodr.array_types import BoolArray, FloatArray, IntArray


def overlaps(moving: VehicleMotion, length: FloatArray, width: FloatArray) -> tuple[IntArray, IntArray]:
    """Pairs of rows of one frame whose boxes overlap.

    Args:
        length, width: of each row's box, m.
    """
    order = np.lexsort((moving.x, moving.frame))
    frame, x, y = moving.frame[order], moving.x[order], moving.y[order]
    reach = 0.5 * np.hypot(length, width)[order]
    found: list[tuple[IntArray, IntArray]] = []
    here = np.arange(len(order) - 1)
    step = 1
    while len(here := here[here + step < len(order)]):
        there = here + step
        near = (frame[there] == frame[here]) & (x[there] - x[here] < reach[here] + reach.max())
        here, there = here[near], there[near]
        touching = np.hypot(x[there] - x[here], y[there] - y[here]) < reach[here] + reach[there]
        a, b = order[here[touching]], order[there[touching]]
        apart = _separated(moving, length, width, a, b) | _separated(moving, length, width, b, a)
        found.append((a[~apart], b[~apart]))
        step += 1
    first, second = zip(*found, strict=True) if found else ((), ())
    return np.concatenate([np.empty(0, np.int64), *first]), np.concatenate([np.empty(0, np.int64), *second])


def _separated(moving: VehicleMotion, length: FloatArray, width: FloatArray, a: IntArray, b: IntArray) -> BoolArray:
    """Whether one of the two axes of each box `a` separates it from the box `b`."""
    dx, dy = moving.x[b] - moving.x[a], moving.y[b] - moving.y[a]
    cos, sin = np.cos(moving.h[a]), np.sin(moving.h[a])
    turn = moving.h[b] - moving.h[a]
    along, across = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    ahead = np.abs(dx * cos + dy * sin) >= 0.5 * (length[a] + length[b] * along + width[b] * across)
    aside = np.abs(dy * cos - dx * sin) >= 0.5 * (width[a] + length[b] * across + width[b] * along)
    return ahead | aside
