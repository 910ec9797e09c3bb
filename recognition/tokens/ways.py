"""How lanes relate: whose way leads to whose, how far, and how many lanes to the side."""

from __future__ import annotations

import heapq
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from recognition.sites.lanes import NOWHERE, LaneGraph
from xodr.array_types import BoolArray, FloatArray, IntArray
from xodr.graph.ways import DRIVABLE

_REACH = 250.0
"""Ways are followed so far, m."""


class Relations(NamedTuple):
    """How one strip lies to another one, for pairs of strips.

    Attributes:
        base: distance from where the first begins to where the second does, m; of ways that merge, by how much farther the first
            is from where they do. `base` + place along the second - place along the first is the distance along the lanes.
        lanes: how many lanes to the left the second is. same_way, merging: see `recognition.tokens.config.RELATIVE`.
    """

    base: FloatArray
    lanes: IntArray
    same_way: BoolArray
    merging: BoolArray


def relations(graph: LaneGraph, one: IntArray, other: IntArray) -> Relations:
    """Relations of pairs of strips; of NOWHERE there is none."""
    ways, side = _ways(graph), len(graph.strips) + 1
    pairs = (one - NOWHERE) * side + other - NOWHERE
    there = np.zeros(side * side, bool)
    there[pairs] = True
    which = (np.cumsum(there) - 1)[pairs]
    found = [ways.relation(pair // side + NOWHERE, pair % side + NOWHERE) for pair in np.flatnonzero(there).tolist()]
    base, lanes, same, merging = (np.array(values) for values in zip(*found, strict=True)) if found else ([], [], [], [])
    return Relations(
        np.asarray(base, np.float64)[which], np.asarray(lanes, np.int64)[which],
        np.asarray(same, bool)[which], np.asarray(merging, bool)[which],
    )  # fmt: skip


class _Ways:
    """The strips ahead of each, found once and kept."""

    def __init__(self, graph: LaneGraph) -> None:
        self._graph = graph
        self._beside: dict[tuple[str, int, bool], list[int]] = {}
        for number, strip in enumerate(graph.strips):
            if strip.kind in DRIVABLE:
                self._beside.setdefault((strip.road, strip.section, strip.forward), []).append(number)
        self._ahead: dict[int, dict[int, tuple[float, int]]] = {}

    def relation(self, one: int, other: int) -> tuple[float, int, bool, bool]:
        """Base, lanes to the left, whether one is on the way of the other, and whether they merge."""
        if NOWHERE in (one, other):
            return 0.0, 0, False, False
        ahead, behind = self.ahead(one), self.ahead(other)
        there, here = ahead.get(other), behind.get(one)
        if there is not None and (here is None or there[0] <= here[0]):
            return there[0], there[1], True, False
        if here is not None:
            return -here[0], -here[1], True, False
        both = [(ahead[strip][0] + behind[strip][0], strip) for strip in ahead.keys() & behind.keys() if not ahead[strip][1]]
        both = [one for one in both if not behind[one[1]][1]]
        if not both:
            return 0.0, 0, False, False
        meeting = min(both)[1]
        return ahead[meeting][0] - behind[meeting][0], 0, False, True

    def ahead(self, start: int) -> dict[int, tuple[float, int]]:
        """Strips on the way from one, itself included, and those beside them: distance between their beginnings, and lanes to the
        left. What is on the way itself counts before what is beside it."""
        if start not in self._ahead:
            self._ahead[start] = self._search(start)
        return self._ahead[start]

    def _search(self, start: int) -> dict[int, tuple[float, int]]:
        graph = self._graph
        found: dict[int, tuple[float, int]] = {}
        waiting = [(0, 0.0, start, 0)]
        while waiting:
            _, distance, number, lanes = heapq.heappop(waiting)
            if number in found:
                continue
            found[number] = distance, lanes
            strip = graph.strips[number]
            for other in self._beside.get((strip.road, strip.section, strip.forward), ()):
                aside = lanes + strip.place - graph.strips[other].place
                heapq.heappush(waiting, (abs(aside), distance, other, aside))
            beyond = distance + strip.length
            if beyond < _REACH:
                for after in graph.following[number]:
                    heapq.heappush(waiting, (abs(lanes), beyond, after, lanes))
        return found


@lru_cache(maxsize=8)
def _ways(graph: LaneGraph) -> _Ways:
    return _Ways(graph)
