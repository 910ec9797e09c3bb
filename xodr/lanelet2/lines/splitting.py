"""Cutting lanelets in two."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import count

import numpy as np

from xodr.lanelet2.lanelet import Lanelet, Neighbour, Points
from xodr.lanelet2.lines.polylines import Frame, crossing, lengths, points_at


def parts_of(name: str, among: Iterable[str]) -> list[str]:
    """The parts of a lanelet that was split, or itself: the first one keeps its id, others have theirs after a slash."""
    return [one for one in among if one == name or one.startswith(f"{name}/")]


def row_of(table: dict[str, Lanelet], lanelet: Lanelet) -> list[Lanelet]:
    """A lanelet and its neighbours, from left to right; the lanelets of the table name their right ones."""
    left_of = {one.beside_right.id: one.id for one in table.values() if one.beside_right}
    first = lanelet.id
    while first in left_of:
        first = left_of[first]
    row = [table[first]]
    while (beside := row[-1].beside_right) is not None:
        row.append(table[beside.id])
    return row


def split(table: dict[str, Lanelet], row: Sequence[Lanelet], frame: Frame) -> dict[str, str]:
    """Replace lanelets that lie beside each other by their parts before and after a line across them.

    The lanelets of the table name their successors and right neighbours only.

    Returns:
        the id of each lanelet's second part.
    """
    seconds = {lanelet.id: _free(lanelet.id, table) for lanelet in row}
    for lanelet in row:
        (left, left_rest), (right, right_rest) = (_parts(line, frame) for line in (lanelet.left, lanelet.right))
        name = seconds[lanelet.id]
        beside = Neighbour(seconds[lanelet.beside_right.id], True) if lanelet.beside_right else None
        # read anew: it may follow itself, or another one of the row
        table[name] = replace(table[lanelet.id], id=name, left=left_rest, right=right_rest, beside_right=beside)
        table[lanelet.id] = replace(lanelet, left=left, right=right, successors=(name,), lights=())
    return seconds


def _free(name: str, table: Mapping[str, Lanelet]) -> str:
    whole = name.partition("/")[0]
    return next(free for number in count(2) if (free := f"{whole}/{number}") not in table)


def _parts(line: Points, frame: Frame) -> tuple[Points, Points]:
    """The parts of a line before and after it crosses a frame; near its end where it does not cross it within."""
    s, at = crossing(line, frame)[0], lengths(line)
    s = min(max(s, 0.05 * at[-1]), 0.95 * at[-1])
    cut = points_at(line, np.array([s]))
    return np.concatenate([line[at < s], cut]), np.concatenate([cut, line[at > s]])
