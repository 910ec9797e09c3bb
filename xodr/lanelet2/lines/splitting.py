"""Cutting lanelets in two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from xodr.lanelet2.lanelet import Lanelet, Neighbour, Points
from xodr.lanelet2.lines.polylines import Frame, crossing, lengths, points_at


def second(name: str) -> str:
    """Id of the second part of a lanelet that was split; the first one keeps its id."""
    return f"{name}/2"


def split(table: dict[str, Lanelet], row: Sequence[Lanelet], frame: Frame) -> None:
    """Replace lanelets that lie beside each other by their parts before and after a line across them.

    The lanelets of the table name their successors and right neighbours only.
    """
    for lanelet in row:
        (left, left_rest), (right, right_rest) = (_parts(line, frame) for line in (lanelet.left, lanelet.right))
        name = second(lanelet.id)
        beside = Neighbour(second(lanelet.beside_right.id), True) if lanelet.beside_right else None
        # read anew: it may follow itself, or another one of the row
        table[name] = replace(table[lanelet.id], id=name, left=left_rest, right=right_rest, beside_right=beside)
        table[lanelet.id] = replace(lanelet, left=left, right=right, successors=(name,), lights=())


def _parts(line: Points, frame: Frame) -> tuple[Points, Points]:
    """The parts of a line before and after it crosses a frame; near its end where it does not cross it within."""
    s, at = crossing(line, frame)[0], lengths(line)
    s = min(max(s, 0.05 * at[-1]), 0.95 * at[-1])
    cut = points_at(line, np.array([s]))
    return np.concatenate([line[at < s], cut]), np.concatenate([cut, line[at > s]])
