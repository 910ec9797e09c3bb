"""Searches in lockstep: what all of them ask for is played at once, as a thousand points play
nearly as fast as fifty.

One search works at a time, and they take turns in their order, so that a repetition gives the same.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

import numpy as np

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
        self._resume, self._paused = threading.Semaphore(0), threading.Semaphore(0)
        threading.Thread(target=self._run, args=(work,), daemon=True).start()

    def go(self) -> None:
        """Let it work until it asks or ends."""
        self._resume.release()
        self._paused.acquire()
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
    turns = [_Turn(work) for work in works]
    for each in turns:
        each.go()
    while waiting := [each for each in turns if each.asked is not None]:
        _answer(waiting, plays)
        for each in waiting:
            each.go()
    return [each.result[0] for each in turns]


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
