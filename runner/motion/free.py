"""Motion straight ahead, off any lane."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runner.interpreter.simulation import Simulation
    from runner.motion.placement import Placement
    from runner.participants.entity import Entity


class FreeMotion:
    """Straight ahead in the direction faced, off any lane."""

    def advance(self, entity: Entity, speed: float, dt: float) -> float:
        """Move along the heading."""
        distance = speed * dt
        entity.x += distance * math.cos(entity.h)
        entity.y += distance * math.sin(entity.h)
        return speed

    def distance_to(self, entity: Entity, placement: Placement, sim: Simulation) -> float | None:
        """How far ahead the place is."""
        dx, dy = placement.x - entity.x, placement.y - entity.y
        ahead = dx * math.cos(entity.h) + dy * math.sin(entity.h)
        return ahead if entity.speed >= 0.0 else -ahead
