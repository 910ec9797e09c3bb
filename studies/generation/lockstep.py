"""Searches in lockstep: what all of them ask for is played at once, as a thousand points play
nearly as fast as fifty.

One search works at a time, and they take turns in their order, so that a repetition gives the same.
Each has the global random numbers of numpy and torch to itself: its result is
that of a search alone.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Generic, TypeVar

import numpy as np
import torch

from generation.search.outcomes import Outcomes
from generation.search.problem import Plays
from schemas.common.array_types import FloatArray

_Result = TypeVar("_Result")
Work = Callable[[Plays], _Result]
"""Work that plays points with what it is given"""


class _Turn(Generic[_Result]):
    """One work in a thread of its own, which runs only between `go` and its next question or its
    end."""

    def __init__(self, work: Work[_Result]) -> None:
        self.asked: tuple[FloatArray, str | None] | None = None
        self.answer: Outcomes | None = None
        self.result: list[_Result] = []
        self.error: BaseException | None = None
        self._random = _random()
        self._resume, self._paused = threading.Semaphore(0), threading.Semaphore(0)
        threading.Thread(target=self._run, args=(work,), daemon=True).start()

    def go(self) -> None:
        """Let it work until it asks or ends."""
        others = _random()
        _set_random(self._random)
        self._resume.release()
        self._paused.acquire()
        self._random = _random()
        _set_random(others)
        if self.error is not None:
            raise self.error

    def _run(self, work: Work[_Result]) -> None:
        self._resume.acquire()
        try:
            self.result.append(work(self._play))
        except BaseException as error:  # handed to the caller of `go`
            self.error = error
        self._paused.release()

    def _play(self, theta: FloatArray, sut: str | None = None) -> Outcomes:
        self.asked = theta, sut
        self._paused.release()
        self._resume.acquire()
        found, self.answer = self.answer, None
        assert found is not None
        return found


def together(works: Sequence[Work[_Result]], plays: Plays) -> list[_Result]:
    """Results of the works in their order, all played together."""
    found = dict(as_ended(works, plays))
    return [found[number] for number in range(len(works))]


def as_ended(works: Sequence[Work[_Result]], plays: Plays) -> Iterator[tuple[int, _Result]]:
    """Numbers and results of the works as they end, all played together."""
    turns = [_Turn(work) for work in works]
    working = list(range(len(turns)))
    while working:
        for number in working:
            turns[number].go()
        for number in working:
            if turns[number].result:
                yield number, turns[number].result[0]
        working = [number for number in working if not turns[number].result]
        _answer([turns[number] for number in working], plays)


def _answer(turns: Sequence[_Turn[_Result]], plays: Plays) -> None:
    """Play what the turns ask for, those with the same system at once."""
    asked = [each.asked for each in turns if each.asked is not None]
    for sut in dict.fromkeys(sut for _, sut in asked):
        some = [each for each, (_, name) in zip(turns, asked, strict=True) if name == sut]
        thetas = [theta for theta, name in asked if name == sut]
        found, start = plays(np.concatenate(thetas), sut), 0
        for each, theta in zip(some, thetas, strict=True):
            each.asked, each.answer = None, found.take(np.arange(start, start + len(theta)))
            start += len(theta)


def _random() -> tuple[Any, Any]:
    """States of the global random numbers of numpy and torch."""
    return np.random.get_state(), torch.get_rng_state()


def _set_random(state: tuple[Any, Any]) -> None:
    """Go on with random numbers from a state of `_random`."""
    np.random.set_state(state[0])
    torch.set_rng_state(state[1])
