"""Contacts between participants: oriented boxes by the separating-axis theorem."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runner.entities import Entity
    from runner.simulation import Simulation

_HEIGHT = 2.5
"""Reference points further apart than this in z (m) are on different levels (bridges) and never touch."""


def radius(entity: Entity) -> float:
    """Radius about the reference point that holds the whole box, m."""
    box = entity.box
    return math.hypot(abs(box.x) + box.length / 2, abs(box.y) + box.width / 2)


def overlap(a: Entity, b: Entity) -> bool:
    """Whether the boxes of two entities overlap or touch in the plane, on the same level."""
    if abs(a.z - b.z) > _HEIGHT:
        return False
    reach = radius(a) + radius(b)
    dx, dy = b.x - a.x, b.y - a.y
    if dx * dx + dy * dy > reach * reach:
        return False
    return _separated(a, b) is False and _separated(b, a) is False


def _separated(a: Entity, b: Entity) -> bool:
    """Whether an axis of a's box separates the two boxes."""
    c, s = math.cos(a.h), math.sin(a.h)
    box = a.box
    front, rear = box.x + box.length / 2, box.x - box.length / 2
    left, right = box.y + box.width / 2, box.y - box.width / 2
    ahead, aside = zip(
        *(((x - a.x) * c + (y - a.y) * s, (y - a.y) * c - (x - a.x) * s) for x, y in b.corners()), strict=True
    )
    return min(ahead) > front or max(ahead) < rear or min(aside) > left or max(aside) < right


class Contacts:
    """Who touches whom now, by sweep and prune over x; begin and end of each contact go to the event log."""

    def __init__(self, sim: Simulation) -> None:
        self._sim = sim
        self._radii: dict[str, float] = {}
        self.pairs: set[tuple[str, str]] = set()
        self.history: list[tuple[float, str, str]] = []
        """Beginnings of contacts: time (s) and the two names."""

    def update(self) -> None:
        """Look at all present entities once a step."""
        spans = []
        for entity in self._sim.entities.values():
            if entity.active and entity.placed:
                name = entity.name
                r = self._radii.get(name)
                if r is None:
                    r = self._radii[name] = radius(entity)
                spans.append((entity.x - r, entity.x + r, r, entity))
        if len(spans) > 1:
            spans.sort(key=_left)
        found: set[tuple[str, str]] | None = None
        for i, (_, right, r, a) in enumerate(spans):
            for j in range(i + 1, len(spans)):
                left, _, r2, b = spans[j]
                if left > right:
                    break
                if abs(a.y - b.y) <= r + r2 and a.trailer is not b and b.trailer is not a and overlap(a, b):
                    found = found or set()
                    found.add((a.name, b.name) if a.name < b.name else (b.name, a.name))
        if found or self.pairs:
            self._compare(found or set())

    def _compare(self, found: set[tuple[str, str]]) -> None:
        for first, second in sorted(found - self.pairs):
            self.history.append((self._sim.time, first, second))
            self._sim.note("collision", first, f"touches {second}")
        for first, second in sorted(self.pairs - found):
            self._sim.note("contactEnd", first, f"no longer touches {second}")
        self.pairs = found

    def of(self, entity: Entity) -> list[str]:
        """Names of those that an entity touches now."""
        return [b if a == entity.name else a for a, b in sorted(self.pairs) if entity.name in (a, b)]


def _left(span: tuple[float, float, float, Entity]) -> float:
    return span[0]
