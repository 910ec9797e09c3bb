"""Contacts between participants: which bounding boxes overlap or touch, from when to when."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from operator import attrgetter
from typing import TYPE_CHECKING

from runner.engine.participants.boxes import overlap
from runner.engine.participants.entity import Separation

if TYPE_CHECKING:
    from runner.engine.compile.run import Run
    from runner.engine.participants.entity import Entity

_by_x = attrgetter("x")
_by_name = attrgetter("name")
_MARGIN = 10.0
"""Distance (m) up to which pairs are kept under observation beyond that at which they might touch"""
_FEW = 4
"""Number of entities up to which all pairs are checked: a search for near ones would cost more."""
_ROUNDING = 1e-6
_MARGIN_OF_REACH = 1e-3
"""Distance (m) that is no rounding of a reach"""


class Contacts:
    """Current contacts between entities; start and end of each are logged as events.

    Pairs near each other are found by sweep and prune over x. These are looked at in each step
    until others may have come near (Verlet, Computer Experiments on Classical Fluids, Physical
    Review 159, 1967).

    A tractor and the trailer on its hitch do not count: their boxes may overlap by construction.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._near: list[tuple[Entity, Entity, float, Separation]] = []
        """pairs that may touch soon, with the distance of their reference points along an axis (m) above which they do not"""
        self._everyone: list[Entity] = []
        """the participants when these were found"""
        self._changes = -1
        """`Run.changes` at the last full check: entities appear and disappear only with a change"""
        self._due = -math.inf
        """total displacement at which others may touch"""
        self._partners: dict[str, list[Entity]] = {}
        self.pairs: set[tuple[str, str]] = set()
        self.history: list[tuple[float, str, str]] = []
        """Beginnings of contacts: time (s) and the two names in alphabetical order."""

    def update(self) -> None:
        """Look at all present entities once a step."""
        run = self._run
        if self._changes != run.changes:
            self._changes = run.changes
            everyone = list(run.entities.values())
            if everyone != self._everyone:
                self._everyone, self._due = everyone, -math.inf
        if self._due != math.inf and (
            len(self._everyone) <= _FEW or run.displacement.total >= self._due
        ):
            self._near = self._look_around()
        found = []
        for a, b, reach, separation in self._near:
            if not -reach <= b.x - a.x <= reach or not -reach <= b.y - a.y <= reach:
                continue
            if (separation.touching or not separation.exceeds(_ROUNDING)) and _counts(a, b):
                separation.touching = overlap(a, b)
                if separation.touching:
                    found.append((a, b))
        if found or self.pairs:
            self._compare(found)

    def _look_around(self) -> list[tuple[Entity, Entity, float, Separation]]:
        """Pairs to check until an entity has moved far enough; every pair if there are few entities."""
        if len(self._everyone) <= _FEW:
            self._due = math.inf
            return [_pair(a, b) for a, b in combinations(self._everyone, 2)]
        order = [entity for entity in self._everyone if entity.active and entity.placed]
        order.sort(key=_by_x)
        widest = max((entity.reach for entity in order), default=0.0)
        found = []
        for index, a in enumerate(order):
            for b in order[index + 1 :]:
                dx = b.x - a.x
                if dx > a.reach + widest + _MARGIN:
                    break
                near = a.reach + b.reach + _MARGIN
                if dx <= near and abs(b.y - a.y) <= near:
                    found.append(_pair(a, b))
        self._due = self._run.displacement.after(_MARGIN / 2)
        return found

    def _compare(self, found: list[tuple[Entity, Entity]]) -> None:
        pairs: set[tuple[str, str]] = set()
        self._partners.clear()
        for a, b in found:
            pairs.add((a.name, b.name) if a.name < b.name else (b.name, a.name))
            self._partners.setdefault(a.name, []).append(b)
            self._partners.setdefault(b.name, []).append(a)
        for first, second in sorted(pairs - self.pairs):
            self.history.append((self._run.time, first, second))
            self._run.note("collision", first, f"touches {second}")
        for first, second in sorted(self.pairs - pairs):
            self._run.note("collisionEnd", first, f"no longer touches {second}")
        self.pairs = pairs

    def of(self, entity: Entity) -> Sequence[Entity]:
        """Return the entities in contact with an entity, by name."""
        touched = self._partners.get(entity.name)
        return sorted(touched, key=_by_name) if touched else ()


def _pair(a: Entity, b: Entity) -> tuple[Entity, Entity, float, Separation]:
    return a, b, a.reach + b.reach + _MARGIN_OF_REACH, Separation(a, b)


def _counts(a: Entity, b: Entity) -> bool:
    """Whether a contact of these two is one: both are there, and neither is the other's trailer."""
    there = a.active and a.placed and b.active and b.placed
    return there and a.controls.trailer is not b and b.controls.trailer is not a
