"""One clock over all phases of a search: draws, plays, runs, judges, estimate, edge cases."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator

import numpy as np

from generation.search.outcomes import Outcomes, joined
from schemas.common.array_types import FloatArray

SEARCHED = 0.7
"""Share of the time after which nothing more is sought: edge cases are chosen
and written in the rest
"""
_ENDS = (SEARCHED,), (0.5, 0.75), (0.35, 0.55, 0.75)
"""The same with one or two phases after the search, and shares after which these end"""
_LEAST = 0.15
"""Share of the time that search and estimate have in any case"""
_MINUTE, _PART = 60.0, 50
_BLOCK = 1024
"""Points that drivers run between two looks at the clock"""
PLAYED = 16_384
"""Points that a process plays in arrays between two looks at the clock"""
_DRIVERS = 9
"""Runs that an edge case takes: judges, other reference drivers, its repetition and its replay"""


class TimeOver(Exception):
    """The time of a search is over."""


class SearchClock:
    """Clock of a search, which starts with it.

    Args:
        minutes: time of the search; None for no limit.
        spent: seconds that were spent for it before.
        tell: called with the name of each phase as it begins.
    """

    def __init__(
        self,
        minutes: float | None,
        spent: float = 0.0,
        tell: Callable[[str], object] = lambda phase: None,
    ) -> None:
        self._start, self._tell = time.monotonic() - spent, tell
        self._limit = math.inf if minutes is None else _MINUTE * minutes
        self._ends = iter(_ENDS[0])
        self._until = next(self._ends)

    def shared(self, searches: int, tell: Callable[[str], object]) -> SearchClock:
        """Clock of the next of some searches that share what is left."""
        left = max(self._limit - self._spent, 0.0)
        return SearchClock(None if math.isinf(left) else left / _MINUTE / searches, tell=tell)

    def begin(self, more: int) -> None:
        """Begin the search.

        Args:
            more: phases after it that have shares of the time of their own, two at most.
        """
        self._ends = iter(_ENDS[more])
        self._until = next(self._ends)

    def phase(self, name: str, own: bool = False) -> None:
        """Begin a phase.

        Args:
            own: whether it is the next one that has a share of its own.
        """
        if own:
            self._until = next(self._ends)
            self.grant()
        self._tell(name)

    def grant(self) -> None:
        """Give what begins a least share of the time, also where that is more than was left: on a
        busy machine a phase before it may have taken all."""
        if self.finite and self._limit > 0.0:
            self._until = max(self._until, self._spent / self._limit + _LEAST)

    @property
    def finite(self) -> bool:
        """Whether there is a limit."""
        return not math.isinf(self._limit)

    @property
    def _spent(self) -> float:
        return time.monotonic() - self._start

    @property
    def over(self) -> bool:
        """Whether the time for runs of this phase is over."""
        return self._spent >= self._until * self._limit

    @property
    def left(self) -> float:
        """Seconds that are left for runs of this phase; infinite without a limit."""
        return max(self._until * self._limit - self._spent, 0.0)

    def check(self) -> None:
        """Go on.

        Raises:
            TimeOver: the time for runs is over.
        """
        if self.over:
            raise TimeOver

    def parts(self, theta: FloatArray, until: float) -> Iterator[FloatArray]:
        """Yield parts of points (n, d), one at least, for as long as a share of the phase's time
        lasts."""
        # The first part in any case: of a search without a single run nothing could be said.
        yield theta[:_PART]
        for start in range(_PART, len(theta), _PART):
            if self._spent >= until * self._until * self._limit:
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

    def most(self, most: int, runs: int, cut: bool, repeated: int = 0) -> int:
        """Edge cases that there is time for, one at least, at the rate of the runs so far.

        Args:
            most: how many are asked for.
            cut: whether the time has ended the search.
            repeated: runs of each with other seeds.
        """
        if not cut or math.isinf(self._limit):
            return most
        left = max(self._limit - self._spent, 0.0)
        # At least one second spent: a search that was cut at once has no rate.
        return int(np.clip(left * runs / max(self._spent, 1.0) / (_DRIVERS + repeated), 1, most))


class TimedPlays:
    """Plays in arrays within the time and the number of a search: counts them, and tells how many
    are left.

    A play of n points takes a + b·n: steps of the scenario, and what each point adds to them. Both
    are measured by the smallest and the largest play so far.

    Args:
        plays: plays points. clock: of the search. block: points between two looks at the clock.
        most: points that the system under test is to drive, about.

    Attributes:
        played: points that the system under test of the search has driven.
    """

    def __init__(
        self,
        plays: Callable[..., Outcomes],
        clock: SearchClock,
        block: int,
        most: float = math.inf,
    ) -> None:
        self._plays, self._clock, self._block, self._most = plays, clock, block, most
        self._times: dict[int, float] = {}
        self.played = 0

    def __call__(self, theta: FloatArray, sut: str | None = None) -> Outcomes:
        """The outcomes at points (n, d).

        Raises:
            TimeOver: the time for runs is over.
        """
        return self._clock.limited(self._timed, self._block)(theta, sut)

    def _timed(self, theta: FloatArray, sut: str | None) -> Outcomes:
        begun = time.monotonic()
        outcomes = self._plays(theta, sut)
        # Other drivers are judges, whose plays the number of the search does not count.
        if sut is None and len(theta):
            self.played += len(theta)
            taken = time.monotonic() - begun
            # The least of equal numbers: other work on the machine only makes a play slower.
            self._times[len(theta)] = min(taken, self._times.get(len(theta), math.inf))
        return outcomes

    def _rates(self) -> tuple[int, float]:
        """Points of the smallest play, and seconds that each further point takes."""
        few, many = min(self._times), max(self._times)
        # Of one play it is not known what its points add: as much as they can.
        added = self._times[many] / many
        if few < many:
            added = max((self._times[many] - self._times[few]) / (many - few), added / _DRIVERS)
        return few, added

    def within(self, share: float) -> float:
        """Points that can be played in a share of the time, and of the number, that is left;
        infinite without limits.

        Where nothing was played before, it is 0 with a limit of time.
        """
        left = share * max(self._most - self.played, 0.0)
        seconds = share * self._clock.left
        if math.isinf(seconds):
            return left
        if not self._times:
            return 0.0
        few, added = self._rates()
        return max(min((seconds - self._times[few]) / added + few, left), 0.0)
