"""Verdicts on failures during a search: whether one of the judges prevents them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import cdist

from generation.search.outcomes import JUDGES, Drivers, Outcomes, survivors
from generation.space.space import Space, distinctive, diverse
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.terminal.text import many

ALIKE, _SEVERAL = 0.1, 3
"""Distance in the unit cube, root mean square, within which so many judged failures of one verdict
settle that of others"""
_APART, _ROUNDS = 0.05, 5
"""Least distance of failures that are judged at once, and how often; at last all that are left"""


class JudgeCounts(NamedTuple):
    """Counts of what was judged during a search.

    Attributes:
        runs: runs that judges have driven.
        judged, assumed: failures that they have judged, and failures with the verdict of those
            around them.
        unprevented: failures that no judge prevents, of both.
    """

    runs: int
    judged: int
    assumed: int
    unprevented: int

    def __str__(self) -> str:
        alike = f", and {self.assumed} more by those around them" if self.assumed else ""
        return (
            f"{many(self.judged, 'failure')} judged by {many(self.runs, 'run')} of careful "
            f"drivers{alike}: "
            f"{self.unprevented} that none of them prevents, set aside"
        )


NOT_JUDGED = JudgeCounts(0, 0, 0, 0)
"""Counts where nothing was judged"""


class Judging:
    """Judges failures, each as far as those around it leave it open.

    Args:
        space: of the points.
        drivers: runs points with a system under test of a name.
        judges: their names.

    Attributes:
        runs: runs that judges have driven.
    """

    def __init__(self, space: Space, drivers: Drivers, judges: Sequence[str] = JUDGES) -> None:
        self._space, self._drivers, self._judges = space, drivers, judges
        self._told = distinctive(space)
        self._reach = float(np.sqrt(self._told.sum()))
        self._unit, self._verdicts = np.empty((0, int(self._told.sum()))), np.empty(0, bool)
        self.runs = self._failures = self._unprevented = 0

    @property
    def counts(self) -> JudgeCounts:
        """Counts so far."""
        judged = len(self._unit)
        return JudgeCounts(self.runs, judged, self._failures - judged, self._unprevented)

    def __call__(self, theta: FloatArray, most: int) -> BoolArray:
        """Failures (n, d) that a judge prevents (n,).

        Args:
            most: runs that judges may drive.
        """
        unit, most = self._space.unit(theta)[:, self._told], most + self.runs
        # In rounds: verdicts of the first failures settle many of the others without a run.
        for number in range(_ROUNDS):
            left = np.flatnonzero(self._open(unit))
            some = diverse(unit[left], _APART) if number < _ROUNDS - 1 else np.arange(len(left))
            self._judge(theta, unit, left[some], most)
        prevented = self._nearest(unit)
        self._failures += len(theta)
        self._unprevented += int((~prevented).sum())
        return prevented

    def _open(self, unit: FloatArray) -> BoolArray:
        """Points (n, k) that judged ones around them do not settle (n,)."""
        far = cdist(unit, self._unit) / self._reach
        near = far < ALIKE
        prevented = (near & self._verdicts).sum(axis=1)
        agreed = (prevented == 0) | (prevented == near.sum(axis=1))
        # A failure that was judged itself is settled, whatever is around it.
        return ~((near.sum(axis=1) >= _SEVERAL) & agreed | (far <= 0.0).any(axis=1))

    def _judge(self, theta: FloatArray, unit: FloatArray, rows: IntArray, most: int) -> None:
        """Ask judges about rows of points, as long as they may drive."""
        # Each row costs a run of every judge.
        rows = rows[: max(most - self.runs, 0) // len(self._judges)]
        verdicts = survivors(theta[rows], self._asked, self._judges)
        self._unit = np.concatenate([self._unit, unit[rows]])
        self._verdicts = np.concatenate([self._verdicts, verdicts])

    def _asked(self, theta: FloatArray, sut: str) -> Outcomes:
        self.runs += len(theta)
        return self._drivers(theta, sut)

    def _nearest(self, unit: FloatArray) -> BoolArray:
        """Verdicts (n,) of the judged points that are nearest to points (n, k); prevented where
        nothing is judged."""
        if not len(self._unit):
            # Without a verdict a failure stays one: it may not be set aside unjudged.
            return np.ones(len(unit), bool)
        return self._verdicts[cdist(unit, self._unit).argmin(axis=1)]


def aside(outcomes: Outcomes, rows: BoolArray) -> Outcomes:
    """Outcomes in which the failures of some rows (n,) are no failures, and no near misses."""
    return replace(
        outcomes,
        # All that a search is led by: a near miss beside it would lead back to what no driver
        # prevents.
        collision=outcomes.collision & ~rows,
        clearance=np.where(rows, np.inf, outcomes.clearance),
        max_drac=np.where(rows, 0.0, outcomes.max_drac),
        margin=np.where(rows, np.inf, outcomes.margin),
    )
