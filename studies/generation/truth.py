"""References for estimates in arrays: crude Monte Carlo with many draws, and their initial data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from generation.estimation.estimate import Known
from generation.search.gate import Share
from generation.search.methods.cover import cover
from generation.search.problem import Plays, SearchProblem
from generation.space.density.prior import Prior

_SEED = 1_000_000
"""No seed of an estimate"""


def crude(prior: Prior, plays: Plays, draws: int) -> Share:
    """The share of so many draws of a prior that collide in arrays."""
    return Share.of(plays(prior.sample(draws, np.random.default_rng(_SEED))))


def searched(problem: SearchProblem, budget: int, seed: int) -> Known:
    """The runs of a search in arrays as if it were SUMO, with nothing to screen what is run."""
    assert problem.plays is not None
    found = cover(replace(problem, evaluate=problem.plays, plays=None), budget, seed)
    return Known(found.theta, found.outcomes.collision)
