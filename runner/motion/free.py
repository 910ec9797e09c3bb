"""Motion straight ahead, off any lane."""

from __future__ import annotations

import math

from runner.motion.placement import Placement
from runner.participants.state import EntityState


class FreeMotion:
    """Straight ahead in the direction faced, off any lane."""

    stands = True

    def advance(self, entity: EntityState, speed: float, dt: float) -> float:
        """Move along the heading."""
        distance = speed * dt
        entity.x += distance * math.cos(entity.h)
        entity.y += distance * math.sin(entity.h)
        return speed

    def distance_to(self, entity: EntityState, placement: Placement) -> float | None:
        """Return the distance to the place ahead."""
        dx, dy = placement.x - entity.x, placement.y - entity.y
        ahead = dx * math.cos(entity.h) + dy * math.sin(entity.h)
        return ahead if entity.speed >= 0.0 else -ahead


STRAIGHT_AHEAD = FreeMotion()
"""Motion of entities without lane, path or driver."""
