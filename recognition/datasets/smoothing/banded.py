"""Smoothing of tracks: states of all rows at once, by least squares over chains.

The states that a Rauch-Tung-Striebel smoother gives are the minimum of a sum of squares in which each residual is of one row or
of two neighbouring ones; iterated for a model that is not linear, it is Gauss-Newton on that sum (Bell, SIAM J. Optim. 4, 1994).
The normal equations are banded, and SciPy's Cholesky factorisation of the band does what the recursions forward and backward do,
for many tracks at once, with rows any time apart, robust weights, and limits as residuals.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from xodr.array_types import FloatArray, IntArray

_ITERATIONS = 60
_ENOUGH = 1e-4
"""Tracks whose cost falls by less than this share of it are done."""
_DAMPING, _LEAST_DAMPING, _EASIER, _HARDER = 1e-3, 1e-9, 0.2, 10.0


class Terms(NamedTuple):
    """Residuals and what they depend on, for n rows of d states each.

    rows, rows_by: residuals of rows over their standard deviation (n, k), and their derivatives by the row's state (n, k, d).
    between: residuals of the intervals between rows (n - 1, m); 0 where a track ends.
    by_before, by_after: their derivatives by the states of the rows before and after (n - 1, m, d).
    cost: of each row and the interval after it (n,).
    """

    rows: FloatArray
    rows_by: FloatArray
    between: FloatArray
    by_before: FloatArray
    by_after: FloatArray
    cost: FloatArray


def minimum(z: FloatArray, starts: IntArray, scale: FloatArray, terms: Callable[[FloatArray], Terms]) -> FloatArray:
    """States that minimise the cost of each track, by Levenberg and Marquardt's method.

    Args:
        z: states to begin with (n, d).
        starts: first row of each track, and n.
        scale: a usual change of each state in one step (d,).
        terms: residuals for states.
    """
    sizes, heads = np.diff(starts), starts[:-1]
    damping = np.full(len(heads), _DAMPING)
    now = terms(z)
    cost = np.add.reduceat(now.cost, heads)
    for _ in range(_ITERATIONS):
        moved = z + _step(now, np.repeat(damping, sizes)[:, None] / scale**2)
        then = terms(moved)
        costs = np.add.reduceat(then.cost, heads)
        better = costs <= cost
        slack = _ENOUGH * (1.0 + cost)
        done = np.abs(cost - costs) <= slack
        rows = np.repeat(better, sizes)
        z = np.where(rows[:, None], moved, z)
        if (done & (damping <= _DAMPING)).all():
            break
        now, cost = _chosen(rows, then, now), np.where(better, costs, cost)
        damping = np.where(better | done, np.maximum(_EASIER * damping, _LEAST_DAMPING), _HARDER * damping)
    return z


def _chosen(rows: NDArray[np.bool_], these: Terms, those: Terms) -> Terms:
    """The first terms in the rows of an array of truths, the others elsewhere."""
    if rows.all():
        return these

    def choose(this: FloatArray, that: FloatArray) -> FloatArray:
        return np.where(rows[: len(this)].reshape(-1, *[1] * (this.ndim - 1)), this, that)

    return Terms(*(choose(this, that) for this, that in zip(these, those, strict=True)))


def _step(terms: Terms, damping: FloatArray) -> FloatArray:
    """The step (n, d) to the minimum of the squares of the residuals and of the damped step."""
    n, _, d = terms.rows_by.shape
    own = terms.rows_by.mT @ terms.rows_by
    own[:, range(d), range(d)] += damping
    own[:-1] += terms.by_before.mT @ terms.by_before
    own[1:] += terms.by_after.mT @ terms.by_after
    slope = _weighed(terms.rows_by, terms.rows)
    slope[:-1] += _weighed(terms.by_before, terms.between)
    slope[1:] += _weighed(terms.by_after, terms.between)
    band = _band(own, terms.by_after.mT @ terms.by_before)
    return solveh_banded(band, -slope.ravel(), lower=True, overwrite_ab=True, check_finite=False).reshape(n, d)


def _weighed(slopes: FloatArray, values: FloatArray) -> FloatArray:
    return (slopes.mT @ values[:, :, None])[:, :, 0]


def _band(own: FloatArray, across: FloatArray) -> FloatArray:
    """Lower band (2d, n d) of the symmetric matrix with diagonal blocks (n, d, d) and blocks below them (n - 1, d, d)."""
    n, d, _ = own.shape
    band = np.zeros((2 * d, n, d))
    for column in range(d):
        for row in range(column, d):
            band[row - column, :, column] = own[:, row, column]
        for row in range(d):
            band[d + row - column, :-1, column] = across[:, row, column]
    return band.reshape(2 * d, n * d)
