"""Failures run again: whether they fail again, and how often they fail with other seeds.

A run is a function of its values and its seed, unless its system has chance of its own (a learnt
policy that samples, a clock, threads). The run of such a failure's file may pass. A run
with the same seed shows that. Runs with other seeds say how often the values fail: the
run that found the failure is not among them, since a search prefers those that failed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Self

import numpy as np

from schemas.common.array_types import BoolArray, IntArray
from schemas.common.terminal.text import many

Run = Callable[[int], tuple[BoolArray, BoolArray]]
"""Runs all failures with a seed: which were executed (n,), and which failed (n,)"""


class Repeats(NamedTuple):
    """Repetitions of failures, one a row.

    Attributes:
        again: whether each fails again with the seed of the search (n,).
        failing, runs: how many runs with other seeds fail, of those executed (n,).
    """

    again: BoolArray
    failing: IntArray
    runs: IntArray

    @classmethod
    def of(cls, count: int, run: Run, seed: int, number: int) -> Repeats:
        """Run failures again.

        Args:
            count: how many there are.
            seed: that they were found with. number: how many other seeds are tried.
        """
        failing, runs = np.zeros(count, np.int64), np.zeros(count, np.int64)
        if not count:
            return cls(np.zeros(0, bool), failing, runs)
        executed, again = run(seed)
        for other in range(seed + 1, seed + 1 + number):
            tested, failed = run(other)
            runs += tested
            failing += tested & failed
        return cls(executed & again, failing, runs)

    def take(self, rows: BoolArray | IntArray) -> Self:
        """Return some of them, by a mask (n,) or by indices."""
        return type(self)(self.again[rows], self.failing[rows], self.runs[rows])

    @property
    def lost(self) -> int:
        """Number of failures that do not fail again."""
        return int((~self.again).sum())

    @property
    def gone(self) -> int:
        """Number of failures that fail in none of their repetitions."""
        return int((~self.again & (self.failing == 0)).sum())

    def as_json(self) -> dict[str, Any]:
        """Return the counts as a JSON object, for files."""
        return {
            "failures": len(self.again),
            "again": int(self.again.sum()),
            "other_seeds": {"runs": int(self.runs.sum()), "failing": int(self.failing.sum())},
        }

    def __str__(self) -> str:
        failures = many(len(self.again), "failure")
        same = "with the same seed"
        found = (
            f"{self.lost} of {failures} did not fail again {same}: chance decides in the system"
            if self.lost
            else (
                f"{failures}, repeated {same}: "
                f"{'all fail' if len(self.again) > 1 else 'it fails'} again"
            )
        )
        runs = int(self.runs.sum())
        if not runs:
            more = "; --repeat N tells how often each fails" if self.lost else ""
            return f"{found}{more}"
        shares = self.failing / np.maximum(self.runs, 1)
        least = int(np.argmin(np.where(self.runs > 0, shares, np.inf)))
        seeds = f"{int(self.failing.sum())} of {many(runs, 'run')} with other seeds fail"
        return f"{found}; {seeds}, of the least one {self.failing[least]} of {self.runs[least]}"
