"""The lanelets of a map and how they follow each other, lie beside each other and cross."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from schemas.errors import UsageError
from xodr.lanelet2.lanelet import Lanelet, Neighbour, Points
from xodr.lanelet2.lines.polylines import middle, resampled

APART = 0.5
"""Bounds of neighbours that are farther apart than this [m] are not one border."""


class Graph:
    """Lanelets by id, with links that hold in both directions.

    Attributes:
        after, before: ids of the lanelets that follow and precede each one, sorted as the lanelets are.
        notes: what was declared but does not hold.

    Raises:
        UsageError: an id is used twice, or a lanelet refers to one that there is not.
    """

    def __init__(self, lanelets: Sequence[Lanelet]) -> None:
        self.lanelets = {lanelet.id: lanelet for lanelet in lanelets}
        if len(self.lanelets) < len(lanelets):
            raise UsageError("two lanelets have the same id")
        self.order = {name: number for number, name in enumerate(self.lanelets)}
        self.notes: list[str] = []
        pairs = {(lanelet.id, other) for lanelet in lanelets for other in lanelet.successors}
        pairs |= {(other, lanelet.id) for lanelet in lanelets for other in lanelet.predecessors}
        self.after: dict[str, list[str]] = defaultdict(list)
        self.before: dict[str, list[str]] = defaultdict(list)
        for one, other in sorted(pairs, key=lambda pair: (self._place(pair[0]), self._place(pair[1]))):
            self.after[one].append(other)
            self.before[other].append(one)
        self.right = self._right_neighbours()

    def _place(self, name: str) -> int:
        if name not in self.order:
            raise UsageError(f"there is no lanelet {name!r}, but another one refers to it")
        return self.order[name]

    def _right_neighbours(self) -> dict[str, str]:
        """The lanelet to the right of each one that leads the same way and shares the bound between them."""
        pairs: dict[str, str] = {}
        for lanelet in self.lanelets.values():
            if lanelet.beside_right and lanelet.beside_right.same_direction:
                pairs.setdefault(lanelet.id, lanelet.beside_right.id)
            if lanelet.beside_left and lanelet.beside_left.same_direction:
                pairs.setdefault(lanelet.beside_left.id, lanelet.id)
        found: dict[str, str] = {}
        taken: set[str] = set()
        for left, right in sorted(pairs.items(), key=lambda pair: self._place(pair[0])):
            gap = _gap(self.lanelets[left].right, self.lanelets[self._known(right)].left)
            if gap > APART or right in taken:
                self.notes.append(
                    f"lanelets {left} and {right} are declared neighbours, but are {gap:.2f} m apart: kept as two roads"
                )
                continue
            found[left] = right
            taken.add(right)
        return found

    def _known(self, name: str) -> str:
        self._place(name)
        return name

    def canonical(self) -> dict[str, Lanelet]:
        """The lanelets with all their successors and right neighbours, and nothing said twice."""
        return {
            name: replace(
                lanelet,
                predecessors=(),
                successors=tuple(self.after[name]),
                beside_left=None,
                beside_right=Neighbour(self.right[name], True) if name in self.right else None,
            )
            for name, lanelet in self.lanelets.items()
        }

    def rows(self) -> list[tuple[str, ...]]:
        """Lanelets that lie beside each other, from left to right; every lanelet is in one row."""
        inner = set(self.right.values())
        rows = [tuple(self._rightwards(name)) for name in self.lanelets if name not in inner]
        left_over = set(self.lanelets) - {name for row in rows for name in row}
        return rows + [(name,) for name in self.lanelets if name in left_over]

    def _rightwards(self, name: str) -> Iterator[str]:
        current: str | None = name
        while current is not None:
            yield current
            current = self.right.get(current)

    @cached_property
    def crossings(self) -> dict[str, set[str]]:
        """Lanelets whose centre lines cross, other than those that share where they come from or lead to."""
        from shapely import LineString, STRtree

        names = [name for name, lanelet in self.lanelets.items() if lanelet.type != "sidewalk"]
        lines = [LineString(middle(self.lanelets[name].left, self.lanelets[name].right)) for name in names]
        found: dict[str, set[str]] = defaultdict(set)
        if not lines:
            return found
        for one, other in STRtree(lines).query(lines, predicate="crosses").T:
            if one != other and not self._related(names[one], names[other]):
                found[names[one]].add(names[other])
        return found

    def _related(self, one: str, other: str) -> bool:
        ends = [(set(links[one]) & set(links[other])) for links in (self.before, self.after)]
        return any(ends) or other in self.after[one] or other in self.before[one]


def _gap(one: Points, other: Points, count: int = 20) -> float:
    """Largest distance between points at equal shares of the lengths of two lines, m."""
    return float(np.hypot(*(resampled(one, count) - resampled(other, count)).T).max())
