"""Pairs of units that two actors drive at a time, around the same third one: what traffic does when two things happen at once."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from recognition.maneuvers.parameters import PARAMETERS
from recognition.maneuvers.unit import ACCELERATION, BRAKING
from recognition.maneuvers.units.samples import Samples
from xodr.array_types import FloatArray, IntArray

LENGTH = 4.5
"""Length (m) of a car, between the gap to its rear and the gap from its front"""
MOST_LAG = 4.0
"""Time (s) by which the two begin one after the other at most"""
_GAP, _SPEED, _DURATION = (list(PARAMETERS).index(role) for role in ("gap", "start_speed", "duration"))


@dataclass(frozen=True, eq=False)
class Pairs:
    """Two units each: of the actor that is nearer to the ego, and of the one ahead of that.

    Attributes:
        first, second: units, as many of each; `first.others` are the egos.
        ahead: gap from the first actor's front to the second one's rear when the first one begins, m (n,).
        lag: when the second one begins, after the first one, s (n,).
    """

    first: Samples
    second: Samples
    ahead: FloatArray
    lag: FloatArray

    def __len__(self) -> int:
        return len(self.lag)


def pairs(samples: Samples, first: str, second: str) -> Pairs:
    """The pairs of units of two kinds that overlap in time, have the same ego, and the second actor ahead of the first one.

    The second unit's ego may be the first actor instead, who is between the two by then. Speeds before the units are taken to be
    those at their beginning.
    """
    chosen = _overlapping(samples, first, second)
    one, two = samples.where(chosen[:, 0]), samples.where(chosen[:, 1])
    lag = two.times - one.times
    behind = two.others == one.actors
    followed = np.where(behind, one.theta[:, _SPEED], two.ego_speeds)
    ahead = two.theta[:, _GAP] - (two.theta[:, _SPEED] - followed) * lag
    ahead -= np.where(behind, 0.0, one.theta[:, _GAP] + LENGTH)
    kept = np.flatnonzero((ahead > 0.0) & (np.abs(lag) < MOST_LAG))
    return Pairs(one.where(kept), two.where(kept), ahead[kept], lag[kept])


@dataclass(frozen=True, eq=False)
class Followed:
    """Units while someone drives behind their egos.

    Attributes:
        units: as many.
        behind: gap from the front of the one behind to the ego's rear when the unit begins, m (n,).
    """

    units: Samples
    behind: FloatArray

    def __len__(self) -> int:
        return len(self.behind)


def followed(samples: Samples, kind: str) -> Followed:
    """The units of a kind whose egos brake or accelerate before someone else, within `MOST_LAG` of the unit's beginning.

    Where an ego does so several times, the time nearest to the unit's beginning counts. Speeds from one to the other are taken to
    be those of that time.
    """
    egos: dict[tuple[str, str], list[int]] = defaultdict(list)
    for row in np.flatnonzero(np.isin(samples.kinds, (BRAKING, ACCELERATION))).tolist():
        egos[samples.recordings[row], samples.actors[row]].append(row)
    found = []
    for row in np.flatnonzero(samples.kinds == kind).tolist():
        candidates = egos[samples.recordings[row], samples.others[row]]
        lags = {other: abs(samples.times[other] - samples.times[row]) for other in candidates}
        nearest = min(lags, key=lags.__getitem__, default=None)
        if nearest is not None and lags[nearest] < MOST_LAG and samples.others[nearest] != samples.actors[row]:
            found.append((row, nearest))
    chosen = np.array(found, np.int64).reshape(-1, 2)
    units, own = samples.where(chosen[:, 0]), samples.where(chosen[:, 1])
    behind = own.theta[:, _GAP] + (own.ego_speeds - own.theta[:, _SPEED]) * (own.times - units.times)
    kept = np.flatnonzero(behind > 0.0)
    return Followed(units.where(kept), behind[kept])


def _overlapping(samples: Samples, first: str, second: str) -> IntArray:
    """Rows (n, 2) of units of two actors at a time, around one ego."""
    end = samples.times + samples.theta[:, _DURATION]
    around: dict[tuple[str, str], list[int]] = defaultdict(list)
    for row in np.flatnonzero(samples.kinds == second).tolist():
        around[samples.recordings[row], samples.others[row]].append(row)
    found = []
    for row in np.flatnonzero(samples.kinds == first).tolist():
        recording, actor, ego = samples.recordings[row], samples.actors[row], samples.others[row]
        candidates = around[recording, ego] + (around[recording, actor] if first != second else [])
        found += [
            (row, other)
            for other in candidates
            if samples.actors[other] not in (actor, ego) and samples.times[row] < end[other] and samples.times[other] < end[row]
        ]
    return np.array(found, np.int64).reshape(-1, 2)
