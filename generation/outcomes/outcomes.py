"""How episodes ended, and episodes with the points they were run at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from xodr.array_types import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class Outcomes:
    """How n episodes ended; arrays of length n.

    Args:
        collision: whether the ego touched another participant.
        r_risk: share of the time steps, up to a collision, in which a participant is nearer than both RSS distances; 0 to 1.
        min_ttc: least time to collision with the lead, s; 0 with a collision, infinite where there never was a lead.
        end_time: simulated time at the end, s.
        status: `completed` (by the stop trigger), `timeout`, or `error`: no run took place, and the other values say nothing.
        error: what went wrong; empty where nothing did.
    """

    collision: BoolArray
    r_risk: FloatArray
    min_ttc: FloatArray
    end_time: FloatArray
    status: NDArray[np.str_]
    error: NDArray[np.str_]

    def __len__(self) -> int:
        return len(self.status)

    @property
    def executed(self) -> BoolArray:
        """The episodes that took place."""
        return self.status != "error"

    @property
    def survived(self) -> BoolArray:
        """The episodes that took place and have no collision."""
        return self.executed & ~self.collision


class Episodes(NamedTuple):
    """Points (n, d), what came of them, and their rewards (n,)."""

    theta: FloatArray
    outcomes: Outcomes
    rewards: FloatArray


def joined(parts: Sequence[Outcomes]) -> Outcomes:
    """Outcomes one after the other."""
    return Outcomes(**{each.name: np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(Outcomes)})
