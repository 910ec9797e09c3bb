"""MCSG without a part of it: the reward's form or realism, coordination, elite, learning, manoeuvre
parameters, the policy."""

from __future__ import annotations

import numpy as np

from generation.search.methods.mcsg import McsgSettings, RealStarts, mcsg, single
from generation.search.outcomes import Outcomes
from generation.search.problem import COLLISION, RISK, SAFE, History, SearchProblem
from schemas.common.array_types import FloatArray
from studies.generation.strategies import GeneticSettings, evolve, rewarded

METHODS = {
    "exclusive": {
        "title": "exclusive reward",
        "meaning": "MCSG where a collision pays the same whatever R_risk",
        "realistic": True,
    },
    "no-coordination": {
        "title": "No-Coordination",
        "meaning": "MCSG with edits of single parameters",
        "realistic": True,
    },
    "no-elite": {
        "title": "No-Elite",
        "meaning": "MCSG that starts from real scenarios throughout",
        "realistic": True,
    },
    "no-kde": {"title": "No-KDE", "meaning": "MCSG without the realism term", "realistic": False},
    "no-learning": {
        "title": "No-Learning",
        "meaning": "MCSG with an untrained policy",
        "realistic": True,
    },
    "no-maneuver": {
        "title": "No-Maneuver",
        "meaning": "MCSG on trajectories, without manoeuvre parameters",
        "realistic": True,
    },
    "no-rl": {
        "title": "No-RL",
        "meaning": "MCSG's reward and starts, a genetic algorithm in place of the policy",
        "realistic": True,
    },
}


def exclusive(problem: SearchProblem, budget: int, seed: int) -> History:
    """MCSG by the exclusive reward."""
    return rewarded(mcsg, problem, budget, seed, criticality=exclusive_reward)


def exclusive_reward(outcomes: Outcomes) -> FloatArray:
    """0.25 with a collision, otherwise −0.1 + 0.2·R_risk: (n,)."""
    return np.where(outcomes.collision, COLLISION, SAFE + RISK * outcomes.r_risk)


def no_coordination(problem: SearchProblem, budget: int, seed: int) -> History:
    """MCSG with edits that no other parameter follows."""
    return mcsg(problem, budget, seed, edits=single)


def no_elite(problem: SearchProblem, budget: int, seed: int) -> History:
    """MCSG that carries no scenario on."""
    return mcsg(problem, budget, seed, starts=RealStarts)


def no_kde(problem: SearchProblem, budget: int, seed: int) -> History:
    """MCSG, rewarded for criticality alone."""
    return rewarded(mcsg, problem, budget, seed, weight=0.0)


def no_learning(problem: SearchProblem, budget: int, seed: int) -> History:
    """MCSG with a learning rate of 0."""
    return mcsg(problem, budget, seed, McsgSettings(rate=0.0))


def no_maneuver(problem: SearchProblem, budget: int, seed: int) -> History:
    """MCSG on the knots of trajectories, which the study gives it in place of
    manoeuvre parameters.
    """
    return mcsg(problem, budget, seed)


def no_rl(problem: SearchProblem, budget: int, seed: int) -> History:
    """From a population of real scenarios.

    Raises:
        UsageError: pymoo is not installed.
    """
    chosen = np.random.default_rng(seed).integers(
        len(problem.real), size=GeneticSettings.population
    )
    return evolve(
        problem,
        budget,
        seed,
        problem.space.unit(problem.real[chosen]),
        lambda episodes: episodes.rewards,
    )
