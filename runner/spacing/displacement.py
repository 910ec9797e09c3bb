"""Bounds on the displacement of entities: pairs further apart cannot have met and need no measuring yet."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

from runner.participants.boxes import plane_gap

if TYPE_CHECKING:
    from runner.participants.entity import Entities, Entity

LONGEST = 1000.0
"""Growth (m) of `Displacement.total` when an entity appears or disappears: no conclusion reaches further."""
_ROUNDING = 1e-6


class Stepping(Protocol):
    """Used part of a run: its entities, and the number of steps done."""

    @property
    def entities(self) -> Entities: ...
    @property
    def step_index(self) -> int: ...


class Displacement:
    """A bound on the displacements since the beginning of a run.

    `total` (m) grows from one step in which it is asked for to the next by the greatest displacement of any participant: between
    two of these no reference point has moved further in the plane than it has grown. So two that are `d` apart are not nearer
    than `c` to each other before it has grown by (d - c) / 2, however they drive, and wherever actions put them.

    Args:
        run: whose participants they are.
    """

    def __init__(self, run: Stepping) -> None:
        self._run = run
        self._total = 0.0
        self._step = -1
        self._present: list[Entity] = []
        self._places: list[tuple[float, float]] = []

    @property
    def total(self) -> float:
        """The bound at the end of this step."""
        if self._step != self._run.step_index:
            self._step = self._run.step_index
            self._look()
        return self._total

    def _look(self) -> None:
        present = [entity for entity in self._run.entities.values() if entity.active and entity.placed]
        places = [(entity.x, entity.y) for entity in present]
        if present == self._present:
            self._total += max(map(math.dist, places, self._places), default=0.0)
        else:
            self._total += LONGEST
        self._present, self._places = present, places

    def after(self, way: float) -> float:
        """Total at which an entity may have covered a distance (m); the present one if that is not positive."""
        return self.total + min(max(way - _ROUNDING, 0.0), LONGEST)


class Separation:
    """Two participants, with their gap in the plane when it was last measured, and how they stood to each other then.

    Since then no point of one box has come nearer to one of the other than both reference points have moved relative to each
    other, and the boxes have turned about them.
    """

    __slots__ = ("_a", "_b", "_gap", "_ha", "_hb", "_x", "_y", "touching")

    def __init__(self, a: Entity, b: Entity) -> None:
        self._a, self._b = a, b
        self._gap = -math.inf
        self._x = self._y = self._ha = self._hb = 0.0
        self.touching = False
        """for the caller: whether they touched when it looked last"""

    def exceeds(self, distance: float) -> bool:
        """Whether the gap in the plane is certainly greater than a distance (m)."""
        a, b = self._a, self._b
        x, y, ha, hb = b.x - a.x, b.y - a.y, a.h, b.h
        left = self._gap - math.hypot(x - self._x, y - self._y)
        if ha != self._ha or hb != self._hb:
            left -= a.reach * abs(ha - self._ha) + b.reach * abs(hb - self._hb)
        if left > distance:
            return True
        self._x, self._y, self._ha, self._hb = x, y, ha, hb
        self._gap = plane_gap(a, b)
        return self._gap > distance
