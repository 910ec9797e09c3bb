"""The gap of two boxes that is measured only when their motion relative to each other may have used it up."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from runner.participants.boxes import plane_gap

if TYPE_CHECKING:
    from runner.participants.entity import Entity


class Separation:
    """Two participants, with their gap in the plane when it was last measured, and how they stood to each other then.

    Since then no point of one box has come nearer to one of the other than both reference points have moved relative to each
    other, and the boxes have turned about them.
    """

    __slots__ = ("_a", "_b", "_gap", "_ha", "_hb", "_x", "_y")

    def __init__(self, a: Entity, b: Entity) -> None:
        self._a, self._b = a, b
        self._gap = -math.inf
        self._x = self._y = self._ha = self._hb = 0.0

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
