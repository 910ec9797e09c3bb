"""GACS: a genetic algorithm for critical scenarios, without regard to how plausible they are."""

from __future__ import annotations

import numpy as np

from generation.search.problem import History, SearchProblem
from studies.generation.strategies import GeneticSettings, evolve

METHODS = {
    "gacs": {"title": "GACS", "meaning": "genetic algorithm on criticality", "realistic": False}
}


def gacs(
    problem: SearchProblem,
    budget: int,
    seed: int,
    settings: GeneticSettings = GeneticSettings(),  # noqa: B008 - frozen
) -> History:
    """From a uniform population, by criticality alone.

    Raises:
        UsageError: pymoo is not installed.
    """
    start = np.random.default_rng(seed).random((settings.population, len(problem.space.parameters)))
    return evolve(
        problem,
        budget,
        seed,
        start,
        lambda found: problem.reward.criticality(found.outcomes),
        settings.distance,
    )
