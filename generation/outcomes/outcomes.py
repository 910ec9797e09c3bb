"""How episodes ended, and episodes with the points they were run at."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from xodr.array_types import BoolArray, FloatArray, IntArray

RISK_WINDOW = 3.0
"""Time (s) up to the conflict over which `Outcomes.risk` is measured"""
NOTHING: Mapping[str, Any] = {
    "collision": False,
    "r_risk": 0.0,
    "min_ttc": math.inf,
    "end_time": 0.0,
    "status": "completed",
    "error": "",
    "risk": 0.0,
    "max_drac": 0.0,
    "clearance": math.inf,
    "conflict": 0.0,
    "impact_speed": 0.0,
    "side": "",
    "striking": False,
}
"""The outcome of an episode in which nothing happens, by the names of `Outcomes`."""


@dataclass(frozen=True, eq=False)
class Outcomes:
    """How n episodes ended; arrays of length n.

    Args:
        collision: whether the ego touched another participant.
        r_risk: share of the time steps, up to a collision, in which a participant is nearer than both RSS distances; 0 to 1. It
            depends on how long the scene is, and serves the published reward alone.
        min_ttc: least time to collision with the lead, s; 0 with a collision, infinite where there never was a lead.
        end_time: simulated time at the end, s.
        status: `completed` (by the stop trigger), `timeout`, or `error`: no run took place, and the other values say nothing.
        error: what went wrong; empty where nothing did.
        risk: share of the `RISK_WINDOW` up to the conflict in which a participant is nearer than both RSS distances; time before
            the scene's start counts as safe, so that a short scene gains nothing.
        max_drac: greatest deceleration that just avoids a collision with the lead, m/s²; 0 where there never was a lead.
        clearance: least distance of the ego's box to another one, m; 0 with a collision, infinite where nobody was there.
        conflict: time of the first contact, else of the least clearance, s.
        impact_speed: relative speed at the first contact, m/s; 0 without one.
        side: side of the ego that is touched first: `front`, `rear`, `left`, `right`; empty without contact.
        striking: whether the ego hit the other one; false where it was hit, and without contact.
    """

    collision: BoolArray
    r_risk: FloatArray
    min_ttc: FloatArray
    end_time: FloatArray
    status: NDArray[np.str_]
    error: NDArray[np.str_]
    risk: FloatArray
    max_drac: FloatArray
    clearance: FloatArray
    conflict: FloatArray
    impact_speed: FloatArray
    side: NDArray[np.str_]
    striking: BoolArray

    @classmethod
    def of(cls, n: int, **known: Any) -> Outcomes:
        """Of n episodes, with what is known of them; the rest as where nothing happens."""
        columns = {name: np.asarray(known.get(name, [value] * n), type(value)) for name, value in NOTHING.items()}
        return cls(**columns)

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

    @property
    def critical(self) -> BoolArray:
        """The episodes that took place and have a collision or a violation of RSS distances."""
        return self.executed & (self.collision | (self.r_risk > 0.0))

    def take(self, chosen: BoolArray | IntArray) -> Outcomes:
        """Some of the episodes, by a mask (n,) or by indices."""
        return Outcomes(**{each.name: getattr(self, each.name)[chosen] for each in fields(Outcomes)})


class Episodes(NamedTuple):
    """Points (n, d), what came of them, and their rewards (n,)."""

    theta: FloatArray
    outcomes: Outcomes
    rewards: FloatArray


def joined(parts: Sequence[Outcomes]) -> Outcomes:
    """Outcomes one after the other."""
    return Outcomes(**{each.name: np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(Outcomes)})
