"""What estimates on the twin are held against: crude Monte Carlo with many draws."""

from __future__ import annotations

import numpy as np

from generation.density.gate import Share
from generation.density.prior import Prior
from generation.search.problem import Plays

_SEED = 1_000_000
"""No seed of an estimate"""


def crude(prior: Prior, twin: Plays, draws: int) -> Share:
    """The share of so many draws of a prior that collide on the twin."""
    return Share.of(twin(prior.sample(draws, np.random.default_rng(_SEED))))
