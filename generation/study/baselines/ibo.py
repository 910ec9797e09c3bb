"""IBO: Bayesian optimisation of criticality with a Gaussian process."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from generation.search.problem import Calls, History, Problem
from generation.study.strategies.optional import need

METHOD = {"title": "IBO", "meaning": "Bayesian optimisation of criticality", "realistic": False}
STARTS, TRIALS = 20, 60
"""Sobol points before the process is asked, and points in all before a new process begins: its cost grows with their cube."""


def search(problem: Problem, budget: int, seed: int) -> History:
    """Optuna's Gaussian process sampler, one point after the other, anew after every `TRIALS` points.

    Raises:
        UsageError: optuna is not installed.
    """
    optuna = need("optuna")
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    calls, run = Calls(problem, budget), 0
    while calls.left:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of an experimental option, and of points that are no power of two
            study = _study(optuna, 1000 * seed + run, problem.space.names)
        for _ in range(min(TRIALS, calls.left)):
            trial = study.ask()
            unit = np.array([trial.suggest_float(name, 0.0, 1.0) for name in problem.space.names])
            episodes = calls(problem.space.scaled(unit)[None])
            study.tell(trial, float(problem.reward.criticality(episodes.outcomes)[0]))
        run += 1
    return calls.history


def _study(optuna: Any, seed: int, names: Sequence[str]) -> Any:
    """A study whose first points are Sobol's."""
    from scipy.stats import qmc

    sampler = optuna.samplers.GPSampler(seed=seed, n_startup_trials=STARTS, deterministic_objective=True)
    study = optuna.create_study(direction="maximize", sampler=sampler)
    for point in qmc.Sobol(len(names), rng=seed).random(STARTS):
        study.enqueue_trial(dict(zip(names, point.tolist(), strict=True)))
    return study
