"""Headings of recorded tracks where they stand.

A recorded position is a few centimetres off. While a vehicle stands, the lines from one recorded
position to the next lead anywhere, and their directions are no headings.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runner.engine.motion.paths import Corner

REACH = 0.2
"""Distance (m) within which a track that turns about is noise, not a motion: several times the
errors of recordings"""
_TURNED = math.radians(30.0)
"""Angle to the way through a place from which a line there is noise: no vehicle turns so far within
`REACH`"""


def steadied(corners: Sequence[Corner]) -> list[Corner] | None:
    """Corners of a polyline without headings, with a heading wherever the track stands; None if it
    stands throughout.

    A stretch stands where it stays within `REACH` of its first corner and a line in it turns away
    from the way through. It has the heading of the way by which it was reached, at the beginning
    that of the way on.
    """
    steady = list(corners)
    for first, last in _stretches(corners):
        before, after = max(first - 1, 0), min(last + 1, len(corners) - 1)
        if not _turns(corners, first, last, _direction(corners[before], corners[after])):
            continue
        x = sum(corner.x for corner in corners[first : last + 1]) / (last + 1 - first)
        y = sum(corner.y for corner in corners[first : last + 1]) / (last + 1 - first)
        middle = corners[first]._replace(x=x, y=y)
        # The nearest corner may be noise as well: only one at least `REACH` away gives a direction.
        behind = next((c for c in reversed(corners[:first]) if _apart(c, middle)), None)
        ahead = (
            next((c for c in corners[last + 1 :] if _apart(c, middle)), None)
            if behind is None
            else None
        )
        if behind is not None:
            heading, slope = _direction(behind, middle), _slope(behind, middle)
        elif ahead is not None:
            heading, slope = _direction(middle, ahead), _slope(middle, ahead)
        else:
            return None
        for index in range(first, last + 1):
            steady[index] = steady[index]._replace(h=heading, pitch=slope)
    return steady


def _stretches(corners: Sequence[Corner]) -> Iterator[tuple[int, int]]:
    """First and last corner of each stretch of two or more that stays within `REACH` of its first
    corner."""
    first = 0
    for index in range(1, len(corners) + 1):
        if index == len(corners) or _apart(corners[first], corners[index]):
            if index - 1 > first:
                yield first, index - 1
            first = index


def _turns(corners: Sequence[Corner], first: int, last: int, way: float) -> bool:
    """Whether a line of a stretch leads elsewhere than the way (rad) through it."""
    lines = (pair for pair in pairwise(corners[first : last + 1]) if pair[0][:2] != pair[1][:2])
    return any(abs(math.remainder(_direction(*line) - way, math.tau)) > _TURNED for line in lines)


def _apart(one: Corner, other: Corner) -> bool:
    return math.hypot(other.x - one.x, other.y - one.y) >= REACH


def _direction(one: Corner, other: Corner) -> float:
    return math.atan2(other.y - one.y, other.x - one.x)


def _slope(one: Corner, other: Corner) -> float:
    return -math.atan2(other.z - one.z, math.hypot(other.x - one.x, other.y - one.y))
