"""IBO: Bayesian optimisation of criticality with a Gaussian process."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from generation.search.problem import Calls, History, SearchProblem
from schemas.common.packages import optional

METHODS = {
    "ibo": {"title": "IBO", "meaning": "Bayesian optimisation of criticality", "realistic": False}
}


@dataclass(frozen=True)
class BayesSettings:
    """Settings of the search.

    Attributes:
        starts: Sobol points before the process is asked.
        batch: points that are asked for before any of them is answered.
    """

    starts: int = 20
    batch: int = 1


def ibo(
    problem: SearchProblem, budget: int, seed: int, settings: BayesSettings = BayesSettings()
) -> History:
    """Optuna's Gaussian process sampler.

    Raises:
        UsageError: optuna is not installed.
    """
    optuna = optional("optuna")
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    calls, names = Calls(problem, budget), problem.space.names
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore"
        )  # of an experimental option, and of points that are no power of two
        study = _study(optuna, seed, names, settings.starts)
    while calls.left:
        trials = [study.ask() for _ in range(min(settings.batch, calls.left))]
        unit = np.array(
            [[trial.suggest_float(name, 0.0, 1.0) for name in names] for trial in trials]
        )
        rewards = problem.reward.criticality(calls(problem.space.scaled(unit)).outcomes)
        for trial, reward in zip(trials, rewards.tolist(), strict=True):
            study.tell(trial, reward)
    return calls.history


def _study(optuna: Any, seed: int, names: Sequence[str], starts: int) -> Any:
    """A study whose first points are Sobol's."""
    from scipy.stats import qmc

    sampler = optuna.samplers.GPSampler(
        seed=seed, n_startup_trials=starts, deterministic_objective=True
    )
    study = optuna.create_study(direction="maximize", sampler=sampler)
    for point in qmc.Sobol(len(names), rng=seed).random(starts):
        study.enqueue_trial(dict(zip(names, point.tolist(), strict=True)))
    return study
