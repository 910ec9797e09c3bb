"""How far participants can have moved: what is further apart than that has not met, and need not be looked at yet."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runner.participants.entity import Entities, Entity

LONGEST = 1000.0
"""What `Displacement.total` grows by where somebody has come or gone, m: no conclusion reaches further."""
_ROUNDING = 1e-6


class Displacement:
    """A bound on the displacements since the beginning of a run.

    `total` (m) grows in each step by the greatest displacement of any participant: between two instants no reference point has
    moved further in the plane than it has grown. So two that are `d` apart are not nearer than `c` to each other before it
    has grown by (d - c) / 2, however they drive, and wherever actions put them.

    Args:
        entities: everyone.
    """

    def __init__(self, entities: Entities) -> None:
        self.total = 0.0
        self._entities = entities
        self._present: list[Entity] = []
        self._places: list[tuple[float, float]] = []

    def update(self) -> None:
        """Look where everyone is now, once a step."""
        present = [entity for entity in self._entities.values() if entity.active and entity.placed]
        places = [(entity.x, entity.y) for entity in present]
        if present == self._present:
            self.total += max(map(math.dist, places, self._places), default=0.0)
        else:
            self.total += LONGEST
        self._present, self._places = present, places

    def after(self, way: float) -> float:
        """The total at which somebody may have covered a way (m); the present one where that is not positive."""
        return self.total + min(way - _ROUNDING, LONGEST) if way > _ROUNDING else self.total
