"""The extras of quality-diversity search for any method: runs are spent only on what is foreseeable, unlike known failures, and
fails on the twin in a way that a careful driver prevents; without a twin, is likely to fail by the runs so far."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from generation.outcomes.outcomes import Outcomes, joined
from generation.search.problem import BATCH, History, Problem, Search
from generation.search.screen import Screen
from xodr.array_types import FloatArray

LEAST = 0.05
"""Distance from which failures differ, as that of quality-diversity search"""


def screened(search: Search, proposals: int) -> Search:
    """The method, with a budget of proposals; it ends before, once the runs are spent.

    What is not worth a try is answered as a scenario in which nothing happens, the rest by the twin. Without a twin, the most
    promising proposals are run, as many as the budget has for so many proposals, the rest is answered by the run most like it.

    Args:
        proposals: points that the method may propose at most.
    """

    def searching(problem: Problem, budget: int, seed: int) -> History:
        answers = _Answers(Screen(problem, budget, LEAST, pace=proposals / budget))
        with suppress(_Spent):
            search(replace(problem, evaluate=answers), proposals, seed)
        answers.screen.spend()
        return answers.screen.history

    return searching


class _Spent(Exception):
    """The runs are spent, whatever the method had in mind."""


class _Answers:
    """Answers a method's proposals."""

    def __init__(self, screen: Screen) -> None:
        self.screen = screen

    def __call__(self, theta: FloatArray) -> Outcomes:
        screen = self.screen
        if not screen.left:
            raise _Spent
        tried = np.flatnonzero(screen.worth(theta))
        found = np.arange(len(theta))
        found[tried] = len(theta) + np.arange(len(tried))
        outcomes = screen.attempt(theta[tried]).outcomes if len(tried) else Outcomes.of(0)
        if screen.waiting >= min(BATCH, screen.left):
            screen.spend()
        return joined([Outcomes.of(len(theta)), outcomes]).take(found)
