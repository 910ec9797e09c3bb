"""Contacts between participants: which bounding boxes overlap or touch, from when to when."""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter
from typing import TYPE_CHECKING

from runner.participants.boxes import overlap, reach

if TYPE_CHECKING:
    from runner.contracts.run import Run
    from runner.participants.entity import Entity

_by_x = attrgetter("x")
_by_name = attrgetter("name")


class Contacts:
    """Who touches whom now, by sweep and prune over x; begin and end of each contact go to the event log.

    A tractor and the trailer on its hitch do not count: their boxes may overlap by construction.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._reach: dict[str, float] = {}
        self._widest = 0.0
        for entity in run.entities.values():
            self.enter(entity)
        self._partners: dict[str, list[Entity]] = {}
        self.pairs: set[tuple[str, str]] = set()
        self.history: list[tuple[float, str, str]] = []
        """Beginnings of contacts: time (s) and the two names in alphabetical order."""

    def enter(self, entity: Entity) -> None:
        """Take a participant into account that was not there at the beginning."""
        self._reach[entity.name] = reach(entity.box)
        self._widest = max(self._widest, self._reach[entity.name])

    def update(self) -> None:
        """Look at all present entities once a step."""
        order = [entity for entity in self._run.entities.values() if entity.active and entity.placed]
        if len(order) > 2:
            order.sort(key=_by_x)
        found: list[tuple[Entity, Entity]] = []
        for index, a in enumerate(order):
            near = self._reach[a.name] + self._widest
            for b in order[index + 1 :]:
                dx = b.x - a.x
                if dx > near:
                    break
                if (
                    dx >= -near
                    and abs(b.y - a.y) <= near
                    and a.controls.trailer is not b
                    and b.controls.trailer is not a
                    and overlap(a, b)
                ):
                    found.append((a, b))
        if found or self.pairs:
            self._compare(found)

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
        """Those that an entity touches now, by name."""
        return sorted(self._partners.get(entity.name, ()), key=_by_name)
