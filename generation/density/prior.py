"""What traffic does, given what is pinned: p(θ | c), and which θ are foreseeable by it (METHOD §6)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from schemas.errors import UsageError
from xodr.array_types import BoolArray, FloatArray

FORESEEABLE = 0.01
"""Share of what is recorded (or, without recordings, stated) that is less likely than what counts as foreseeable."""
_TRIES = 200
"""Times that draws are made before it is given up."""


class Prior(ABC):
    """A density of the parameters that a search chooses, under the condition of those that are pinned.

    Columns are those of a space, in its order. Some may be nuisances: when a scene begins and ends. They are no part of the
    density, a search is not rewarded for them, and cases that differ in nothing else are the same. They are drawn with the
    others (`sample`, `with_nuisances`), or pinned.

    Attributes:
        names: of the columns (d,).
        low, high: the box (d,): what the scenario declares.
        nuisances: names of the columns that are nuisances.
        theta: recorded rows (m, d) inside the box; none without recordings.
        recordings: of each of these (m,).
    """

    names: tuple[str, ...]
    low: FloatArray
    high: FloatArray
    nuisances: tuple[str, ...] = ()
    theta: FloatArray
    recordings: NDArray[np.str_]

    @property
    def searched(self) -> tuple[str, ...]:
        """Names of the columns that are no nuisances."""
        return tuple(name for name in self.names if name not in self.nuisances)

    def columns(self, names: Sequence[str]) -> list[int]:
        """Indices of columns."""
        return [self.names.index(name) for name in names]

    def inside(self, theta: FloatArray) -> BoolArray:
        """Rows (n, d) that are in the box: (n,)."""
        return np.all((theta >= self.low) & (theta <= self.high), axis=1)

    @abstractmethod
    def possible(self, theta: FloatArray) -> BoolArray:
        """Rows (n, d) that are in the box and within the physical limits: (n,)."""

    @abstractmethod
    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p(searched | pinned) of rows (n, d), in the parameters' units: (n,); −∞ where they are not `possible`.

        Normalised over what is possible. The weights p/q of importance sampling are ratios of these where both draw nuisances
        alike.
        """

    @abstractmethod
    def _draw(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d), of which some may not be `possible`."""

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d), all `possible`: what is not is drawn again, nothing is moved onto a limit.

        Raises:
            UsageError: nearly nothing that it draws is possible.
        """
        return until_possible(self._draw, self.possible, n, generator)

    @abstractmethod
    def foreseeable(self, theta: FloatArray) -> BoolArray:
        """Rows (n, d) that traffic does: possible, and no less likely than 99 % of recorded units, each by the density of other
        recordings: (n,). Costs no simulation."""

    def judged(self, theta: FloatArray) -> tuple[FloatArray, BoolArray]:
        """`log_density` and `foreseeable` of rows (n, d)."""
        return self.log_density(theta), self.foreseeable(theta)

    def unjudged(self, theta: FloatArray) -> tuple[FloatArray, BoolArray]:
        """`log_density` of rows (n, d), and none of them foreseeable: for a density that does not pass the gate."""
        return self.log_density(theta), np.zeros(len(theta), bool)

    @abstractmethod
    def with_nuisances(self, theta: FloatArray) -> FloatArray:
        """Rows (n, d) with the nuisances of the recorded unit that is most like each of them."""


def until_possible(
    draw: Callable[[int, np.random.Generator], FloatArray],
    possible: Callable[[FloatArray], BoolArray],
    n: int,
    generator: np.random.Generator,
) -> FloatArray:
    """So many possible draws (n, d).

    Raises:
        UsageError: nearly no draw is possible.
    """
    parts: list[FloatArray] = []
    for _ in range(_TRIES):
        drawn = draw(max(n, 64), generator)
        parts.append(drawn[possible(drawn)])
        if sum(map(len, parts)) >= n:
            return np.concatenate(parts)[:n]
    raise UsageError("nearly nothing that the density draws is inside the limits of the parameters")
