"""Numbers as short text: quantised, differences of neighbours, variable-length integers, base64.

`page/play/data.js` reads what is written here.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

_GROUP = 7
"""Bits of a number in each byte; the eighth says that more follow."""


def pack(values: ArrayLike, step: float, order: int = 1) -> str:
    """A series of numbers as text.

    Args:
        values: finite numbers.
        step: what they are rounded to a multiple of.
        order: how often differences of neighbours are taken: 1 suits values that change little, 2 those that change steadily.
    """
    numbers = np.rint(np.asarray(values, np.float64) / step).astype(np.int64)
    for _ in range(order):
        numbers = np.diff(numbers, prepend=0)
    return base64.b64encode(_varints(np.where(numbers < 0, -2 * numbers - 1, 2 * numbers))).decode()


def _varints(numbers: NDArray[np.int64]) -> bytes:
    """Natural numbers in groups of 7 bits, the lowest first."""
    count = max(1, -(-int(numbers.max(initial=0)).bit_length() // _GROUP))
    groups = numbers[:, None] >> (_GROUP * np.arange(count))
    used = groups > 0
    used[:, 0] = True
    groups &= 127
    groups[:, :-1] |= np.where(used[:, 1:], 128, 0)
    return groups[used].astype(np.uint8).tobytes()


def pack_lines(lines: Sequence[NDArray[np.float64]], step: float) -> list[str]:
    """Polylines (rows x, y) as three texts: their numbers of points, and x and y of all points."""
    points = np.concatenate(lines) if lines else np.zeros((0, 2))
    lengths = [len(line) for line in lines]
    return [pack(lengths, 1.0, 0), pack(points[:, 0], step), pack(points[:, 1], step)]
