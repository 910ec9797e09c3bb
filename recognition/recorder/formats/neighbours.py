"""Who drives around whom on a straight motorway: the neighbours that highD names.

Neighbours in a lane are those whose centres are in it. Beside the ego ("alongside") is who overlaps it along the road;
preceding and following in the lanes beside is the nearest one that does not.
"""

from __future__ import annotations

import numpy as np

from xodr.array_types import BoolArray, FloatArray, IntArray

ABSENT = -1
_SPAN = 1e6
"""More than any position along the road, m."""


class Traffic:
    """Everybody in every frame.

    Args:
        frame: of each row. lane: number, counted from left to right as the driver sees them, equal in no two carriageways.
        along: position in the direction of travel, m. length: m.
    """

    def __init__(self, frame: IntArray, lane: IntArray, along: FloatArray, length: FloatArray) -> None:
        self._lane, self._along, self._length = lane, along, length
        self._strip = frame * (int(lane.max()) + 3)
        key = self._key(lane)
        self._order = np.argsort(key, kind="stable")
        self._sorted = key[self._order]
        self._group = (self._strip + lane)[self._order]

    def _key(self, lane: IntArray) -> FloatArray:
        return (self._strip + lane) * _SPAN + self._along

    def ahead(self) -> IntArray:
        """Row of the nearest vehicle in front in the own lane, or `ABSENT`."""
        return self._own(1)

    def behind(self) -> IntArray:
        """Row of the nearest vehicle behind in the own lane, or `ABSENT`."""
        return self._own(-1)

    def _own(self, side: int) -> IntArray:
        place = np.empty_like(self._order)
        place[self._order] = np.arange(len(place))
        return self._at(place + side, self._strip + self._lane)

    def beside(self, lanes: int) -> tuple[IntArray, IntArray, IntArray]:
        """Rows of preceding, alongside and following in the lane that lies `lanes` to the right (negative: left)."""
        group = self._strip + self._lane + lanes
        front = np.searchsorted(self._sorted, self._key(self._lane + lanes))
        ahead, alongside_ahead = self._beyond(front, 1, group)
        behind, alongside_behind = self._beyond(front - 1, -1, group)
        both = np.stack((alongside_ahead, alongside_behind))
        distance = np.where(both == ABSENT, np.inf, np.abs(self._along[both] - self._along))
        return ahead, both[distance.argmin(axis=0), np.arange(len(front))], behind

    def _beyond(self, place: IntArray, side: int, group: IntArray) -> tuple[IntArray, IntArray]:
        """From places in the order on: the first that does not overlap, and the first where it does."""
        first = found = self._at(place, group)
        while (overlapping := self._overlaps(found)).any():
            place = place + side * overlapping
            found = self._at(place, group)
        return found, np.where(self._overlaps(first), first, ABSENT)

    def _overlaps(self, other: IntArray) -> BoolArray:
        near = np.abs(self._along[other] - self._along) < 0.5 * (self._length[other] + self._length)
        return near & (other != ABSENT)

    def _at(self, place: IntArray, group: IntArray) -> IntArray:
        """Rows at places in the order, where they are in the asked lane and frame."""
        inside = np.clip(place, 0, len(self._order) - 1)
        there = (place == inside) & (self._group[inside] == group)
        return np.where(there, self._order[inside], ABSENT)
