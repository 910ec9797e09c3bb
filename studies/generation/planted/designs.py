"""Designs: runs that are chosen before the first one, and learn nothing from outcomes."""

from __future__ import annotations

import numpy as np
from scipy.spatial.distance import cdist
from scipy.stats import norm, qmc

from generation.search.methods.models import Frame
from generation.search.problem import Calls, History, SearchProblem
from generation.space.density.prior import Prior
from schemas.common.array_types import FloatArray, IntArray


def cells(problem: SearchProblem, budget: int, seed: int) -> History:
    """One draw in each cell of equal probability: a design that covers the density evenly."""
    assert problem.prior is not None
    calls, generator = Calls(problem, budget), np.random.default_rng(seed)
    frame = Frame.of(problem.space, problem.prior, generator)
    calls(stratified(problem.prior, frame, budget, generator))
    return calls.history


def sobol(problem: SearchProblem, budget: int, seed: int) -> History:
    """Sobol points in the foreseeable set, spread beyond the density by `_WIDE`.

    I. M. Sobol, On the distribution of points in a cube and the approximate evaluation of
    integrals, 1967.
    """
    assert problem.prior is not None
    calls = Calls(problem, budget)
    frame = Frame.of(problem.space, problem.prior, np.random.default_rng(seed))
    sequence = qmc.Sobol(frame.dimension, seed=seed)
    while calls.left:
        unit = np.clip(sequence.random(_DRAWN), 1e-9, 1.0 - 1e-9)
        theta = frame.points(_WIDE * norm.ppf(unit))
        calls(theta[problem.prior.foreseeable(theta)])
    return calls.history


_WIDE = 1.5
"""Standard deviation of Sobol points, relative to that of recorded units"""
_DRAWN = 512
"""Sobol points at a time"""


def maximin(problem: SearchProblem, budget: int, seed: int) -> History:
    """Foreseeable draws, each the one that is furthest from those before: a design that covers the
    foreseeable set evenly.

    M. E. Johnson, L. M. Moore, D. Ylvisaker, Minimax and maximin distance designs, 1990.
    """
    assert problem.prior is not None
    calls, generator = Calls(problem, budget), np.random.default_rng(seed)
    frame = Frame.of(problem.space, problem.prior, generator)
    theta = problem.prior.sample(_PER_RUN * budget, generator)
    theta = theta[problem.prior.foreseeable(theta)]
    calls(theta[_furthest(frame.coordinates(theta), budget)])
    return calls.history


_PER_RUN = 8
"""Draws of the density for each run of a maximin design"""


def _furthest(rows: FloatArray, n: int) -> IntArray:
    """Indices of n rows (m, k), or all, each the furthest from those before."""
    chosen, least = [0], np.full(len(rows), np.inf)
    while len(chosen) < min(n, len(rows)):
        least = np.minimum(least, cdist(rows[chosen[-1:]], rows, "sqeuclidean")[0])
        chosen.append(int(np.argmax(least)))
    return np.array(chosen)


def stratified(prior: Prior, frame: Frame, n: int, generator: np.random.Generator) -> FloatArray:
    """One draw from each of n cells of equal probability, or up to twice as many (m, d), in a drawn
    order.

    The cells halve draws of the prior at the median of the coordinate in which they spread most.
    """
    depth = max(int(np.ceil(np.log2(max(n, 1)))), 0)
    drawn = prior.sample(_PER_CELL << depth, generator)
    rows, cells = frame.coordinates(drawn), [np.arange(len(drawn))]
    for _ in range(depth):
        cells = [half for cell in cells for half in _halves(rows, cell)]
    chosen = np.array([generator.choice(cell) for cell in cells])
    return drawn[generator.permutation(chosen)]


_PER_CELL = 4
"""Draws of the prior for each cell"""


def _halves(rows: FloatArray, cell: IntArray) -> tuple[IntArray, IntArray]:
    widest = int(np.argmax(rows[cell].std(axis=0)))
    order = cell[np.argsort(rows[cell, widest], kind="stable")]
    return order[: len(order) // 2], order[len(order) // 2 :]
