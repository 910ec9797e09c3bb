"""Strategies that several baselines share: genetic operators, a perceptron, other rewards."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from torch import nn

from generation.search.outcomes import Episodes
from generation.search.problem import Calls, History, Search, SearchProblem
from schemas.common.array_types import FloatArray
from schemas.common.packages import optional


@dataclass(frozen=True)
class GeneticSettings:
    """Settings of the search.

    Attributes:
        population: points to a generation.
        distance: index of polynomial mutation: the smaller, the further.
    """

    population: int = 50
    distance: float = 20.0


def evolve(
    problem: SearchProblem,
    budget: int,
    seed: int,
    start: FloatArray,
    fitness: Callable[[Episodes], FloatArray],
    distance: float = GeneticSettings.distance,
) -> History:
    """Maximise the fitness (n,) of episodes: pymoo's GA with its tournament, simulated binary
    crossover, polynomial mutation.

    Args:
        start: first population (n, d) in the unit cube.
        distance: index of polynomial mutation.

    Raises:
        UsageError: pymoo is not installed.
    """
    algorithms, cores, statics, mutations = (
        optional(f"pymoo.{name}")
        for name in (
            "algorithms.soo.nonconvex.ga",
            "core.problem",
            "problems.static",
            "operators.mutation.pm",
        )
    )
    evaluator = optional("pymoo.core.evaluator").Evaluator()
    box = cores.Problem(n_var=start.shape[1], n_obj=1, xl=0.0, xu=1.0)
    algorithm = algorithms.GA(
        pop_size=len(start), sampling=start, mutation=mutations.PM(eta=distance)
    )
    algorithm.setup(box, termination=("n_gen", budget), seed=seed, verbose=False)
    calls = Calls(problem, budget)
    while calls.left:
        population = algorithm.ask()
        episodes = calls(problem.space.scaled(population.get("X")))
        if calls.left:
            evaluator.eval(statics.StaticProblem(box, F=-fitness(episodes)[:, None]), population)
            algorithm.tell(infills=population)
    return calls.history


HIDDEN = 64


def perceptron(inputs: int, outputs: int) -> nn.Sequential:
    """Two hidden layers: (n, inputs) to (n, outputs)."""
    return nn.Sequential(
        nn.Linear(inputs, HIDDEN),
        nn.Tanh(),
        nn.Linear(HIDDEN, HIDDEN),
        nn.Tanh(),
        nn.Linear(HIDDEN, outputs),
    )


def rewarded(
    search: Search, problem: SearchProblem, budget: int, seed: int, **changes: Any
) -> History:
    """Search by the problem's reward with some changes; the history has the problem's own rewards.

    Args:
        search: the method.
        problem, budget, seed: what it is given.
        changes: fields of `generation.search.problem.Reward`.
    """
    found = search(replace(problem, reward=replace(problem.reward, **changes)), budget, seed)
    return found._replace(rewards=problem.reward(found.theta, found.outcomes))
