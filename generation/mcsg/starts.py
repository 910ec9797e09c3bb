"""What the episodes of MCSG start from."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from generation.mcsg.settings import McsgSettings
from generation.outcomes.outcomes import Episodes
from generation.search.diversity import diverse
from generation.search.problem import Problem
from xodr.array_types import FloatArray


class Starts(Protocol):
    """Draws what episodes start from."""

    def add(self, episodes: Episodes) -> None:
        """Take note of episodes."""

    def draw(self, n: int, spent: float, generator: np.random.Generator) -> FloatArray:
        """Starts (n, d), when that share of the budget is spent."""


class EliteStarts:
    """Real scenarios (or what was found before) at first, then the elite of all episodes so far.

    The elite is chosen by criticality − w·t·max((NLL − Q99)/IQR, 0), t the share of the budget that is spent. The reward's
    realism term is the same far from traffic as a little outside; this one goes on falling, so that what is critical is drawn
    back to where traffic is, and it grows with time, so that it is critical first.
    """

    def __init__(self, problem: Problem, settings: McsgSettings) -> None:
        self._problem, self._settings = problem, settings
        self._theta, self._critical, self._excess = np.empty((0, len(problem.space.parameters))), np.empty(0), np.empty(0)

    def add(self, episodes: Episodes) -> None:
        """Take note of episodes."""
        reward = self._problem.reward
        self._theta = np.concatenate([self._theta, episodes.theta])
        self._critical = np.concatenate([self._critical, reward.criticality(episodes.outcomes)])
        self._excess = np.concatenate([self._excess, reward.realism.excess(episodes.theta)])

    def draw(self, n: int, spent: float, generator: np.random.Generator) -> FloatArray:
        """Starts (n, d), when that share of the budget is spent."""
        if len(self._theta) < self._settings.batch:
            return uniform_rows(self._problem.starts, n, generator)
        score = self._critical - self._problem.reward.weight * spent * self._excess
        count = max(int(self._settings.elite * len(score)), self._settings.batch // 2)
        ranked = self._theta[np.argsort(-score, kind="stable")]
        elite = ranked[diverse(self._problem.space.unit(ranked), self._settings.apart, count)]
        return uniform_rows(elite, n, generator)


class RealStarts:
    """Real scenarios, or what was found before; no episode is carried on."""

    def __init__(self, problem: Problem, settings: McsgSettings) -> None:
        self._starts = problem.starts

    def add(self, episodes: Episodes) -> None:
        """Episodes change nothing."""

    def draw(self, n: int, spent: float, generator: np.random.Generator) -> FloatArray:
        """Starts (n, d)."""
        return uniform_rows(self._starts, n, generator)


def uniform_rows(rows: FloatArray, n: int, generator: np.random.Generator) -> FloatArray:
    """Rows (n, d) drawn with replacement, each as likely as the others."""
    return rows[generator.integers(len(rows), size=n)]
