"""One clock over all phases of a search: draws, plays, runs, judges, edge cases."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator

import numpy as np

from generation.search.outcomes import Outcomes, joined
from schemas.common.array_types import FloatArray

SEARCHED = 0.7
"""Share of the time after which nothing more is sought: edge cases are chosen and written in the rest"""
_MINUTE, _PART = 60.0, 50
_BLOCK = 1024
"""Points that drivers run between two looks at the clock"""
PLAYED = 16_384
"""Points that a process plays in arrays between two looks at the clock"""
_DRIVERS = 8
"""Runs that an edge case takes: judges, other reference drivers, its replay"""


class TimeOver(Exception):
    """The time of a search is over."""


class SearchClock:
    """Clock of a search, which starts with it.

    Args:
        minutes: time of the search; None for no limit.
    """

    def __init__(self, minutes: float | None) -> None:
        self._start = time.monotonic()
        self._limit = math.inf if minutes is None else _MINUTE * minutes

    @property
    def _spent(self) -> float:
        return time.monotonic() - self._start

    @property
    def over(self) -> bool:
        """Whether the time for runs is over."""
        return self._spent >= SEARCHED * self._limit

    def check(self) -> None:
        """Go on.

        Raises:
            TimeOver: the time for runs is over.
        """
        if self.over:
            raise TimeOver

    def parts(self, theta: FloatArray, until: float) -> Iterator[FloatArray]:
        """Yield parts of points (n, d), one at least, for as long as a share of the time lasts."""
        yield theta[:_PART]
        for start in range(_PART, len(theta), _PART):
            if self._spent >= until * self._limit:
                break
            yield theta[start : start + _PART]

    def limited(
        self, drivers: Callable[..., Outcomes], block: int = _BLOCK
    ) -> Callable[..., Outcomes]:
        """The same drivers, or plays, which ask for the time in each block of points."""

        def driving(theta: FloatArray, sut: str | None = None) -> Outcomes:
            parts = [Outcomes.of(0)]
            for start in range(0, len(theta), block):
                self.check()
                parts.append(drivers(theta[start : start + block], sut))
            return joined(parts[1:] or parts)

        return driving

    def most(self, most: int, runs: int, cut: bool) -> int:
        """Edge cases that there is time for, one at least, at the rate of the runs so far."""
        if not cut or math.isinf(self._limit):
            return most
        left = max(self._limit - self._spent, 0.0)
        return int(np.clip(left * runs / max(self._spent, 1.0) / _DRIVERS, 1, most))
