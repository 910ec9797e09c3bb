"""The state and the actions of MCSG: the parameters of a real scenario are edited one after the other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from generation.density.base import Whitening
from generation.search.space import Space
from xodr.array_types import FloatArray


class Moves(NamedTuple):
    """How edits move θ.

    Attributes:
        rows: (d, d), row j the move of θ in the unit cube that an edit 1 of parameter j is.
        deviation: the edits (d,) that are one standard deviation of the real parameters.
    """

    rows: FloatArray
    deviation: FloatArray


def single(space: Space, real: FloatArray) -> Moves:
    """Edits that change one parameter each, by shares of its range."""
    return Moves(np.eye(len(space.parameters)), space.unit(real).std(axis=0))


def coordinated(space: Space, real: FloatArray) -> Moves:
    """Edits in standard deviations of real parameters (n, d), which the later parameters follow.

    With LLᵀ the covariance of the real ones in the unit cube, an edit δ of parameter j adds δ times column j of L: the parameter
    moves by δ standard deviations given those before it, and those after it move as they do together in traffic.
    """
    rows = np.ascontiguousarray(Whitening.of(space.unit(real)).factor.T)
    return Moves(rows, np.ones(len(rows)))


class Edits:
    """Episodes side by side, each in the state of having its first `step` parameters edited.

    Args:
        space: the box of θ.
        theta: the points (n, d) that the episodes start from, within the box.
        moves: how an edit moves them.

    Attributes:
        theta: the points with the edits so far.
        step: number of the parameter that is edited next; d at the end.
    """

    def __init__(self, space: Space, theta: FloatArray, moves: Moves) -> None:
        self.theta, self.step = np.array(theta, dtype=np.float64), 0
        self._space, self._rows = space, moves.rows

    @property
    def done(self) -> bool:
        """Whether all parameters have been edited."""
        return self.step == self.theta.shape[1]

    def observe(self) -> NDArray[np.float32]:
        """States (n, 2d): θ in the unit cube, and 1 at the place of the parameter that is edited next, if any."""
        n, d = self.theta.shape
        turn = np.zeros((n, d))
        turn[:, self.step : self.step + 1] = 1.0
        return np.hstack([self._space.unit(self.theta), turn]).astype(np.float32)

    def edit(self, change: FloatArray) -> None:
        """Edit the next parameter by the amounts (n,); nothing leaves the box."""
        unit = self._space.unit(self.theta) + change[:, None] * self._rows[self.step]
        changed = self._rows[self.step] != 0.0
        self.theta[:, changed] = self._space.scaled(np.clip(unit, 0.0, 1.0))[:, changed]
        self.step += 1
