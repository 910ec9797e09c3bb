"""Whom the ego has most to do with at each instant: pages keep both in sight and measure between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from runner.measures.criticality import Criticality

_FAR = 100.0
"""Others farther away than this do not matter, m"""
_SHORT = 1.0
"""Whoever is nearest for less than this is passed over, s"""

Stretches = list[tuple[int, str]]
"""Numbers of samples from which on something holds, and what"""


def main_partner(measures: Criticality) -> str | None:
    """The other one of the whole run: of the contact, else of the least time to collision, else of the least distance."""
    if measures.impact is not None:
        return measures.impact.other
    extremes = [measures.summary[name] for name in ("min_ttc", "min_distance")]
    return next((str(extreme["other"]) for extreme in extremes if extreme is not None), None)


def partners(measures: Criticality, dt: float, stride: int) -> Stretches:
    """The partner over time: the main one while it is near, else whoever is nearest, if near; empty for nobody."""
    near = measures.distance.valid & (measures.distance.value <= _FAR)
    found = np.where(near, measures.nearest, "").astype(object)
    main = main_partner(measures)
    if main is not None:
        other = measures.other(main)
        rows, theirs = (np.rint(time / dt).astype(np.int64) for time in (measures.time, other.time))
        _, mine, its = np.intersect1d(rows, theirs, return_indices=True)
        away = np.hypot(measures.ego.x[mine] - other.x[its], measures.ego.y[mine] - other.y[its])
        found[mine[away <= _FAR]] = main
    return _steady(stretches(measures.time, found, dt, stride), round(_SHORT / (dt * stride)))


def stretches(time: NDArray[np.float64], values: Sequence[str] | NDArray[np.object_], dt: float, stride: int) -> Stretches:
    """Names over time as stretches of samples."""
    ticks = np.rint(time / dt).astype(np.int64)
    found: Stretches = []
    for tick, name in zip(ticks.tolist(), values, strict=True):
        if tick % stride == 0 and (not found or found[-1][1] != name):
            found.append((tick // stride, str(name)))
    return found


def _steady(found: Stretches, shortest: int) -> Stretches:
    """Without stretches that are too short to look at: whoever was there before stays."""
    kept: Stretches = []
    ends = [start for start, _ in found[1:]]
    for index, (start, name) in enumerate(found):
        lasting = index == len(ends) or ends[index] - start >= shortest
        if (not kept or lasting) and not (kept and kept[-1][1] == name):
            kept.append((start, name))
    return kept
