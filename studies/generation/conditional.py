"""A conditional flow as the density of pairs, against the mixture of Student's t that judges them
(METHOD §6).

Both give p(what the two do | the ego's speed), of logarithms. The mixture is conditioned in closed
form; the flow learns the condition.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from generation.space.density.base import Components, Whitening, folds
from generation.space.density.models.mixtures import Student
from schemas.common.array_types import FloatArray, IntArray
from studies.generation.packages import package
from studies.recognition.report.tables import Table, spread

_DRAWN, _LEAST = 400, 0.01
"""Draws for each recorded row, and the share of them that it may be less likely than"""


class Conditional(Protocol):
    """p(y | c) of the columns of a row after the first one, given that."""

    def fit(self, rows: FloatArray, groups: NDArray[Any]) -> None:
        """Learn from rows (n, d) of recordings (n,)."""
        ...

    def log_density(self, rows: FloatArray) -> FloatArray:
        """log p(y | c) of rows (n, d): (n,)."""
        ...

    def least(self, rows: FloatArray, seed: int) -> FloatArray:
        """log p(y | c) that 99 % of draws of y reach, for the c of each row (n, d): (n,)."""
        ...


class Closed:
    """The mixture of Student's t, conditioned in closed form."""

    def fit(self, rows: FloatArray, groups: NDArray[Any]) -> None:
        """Learn from rows (n, d) of recordings (n,)."""
        found = Student().fit(rows, groups).gaussians
        self._joint, self._given = found, found.marginal([0])

    def log_density(self, rows: FloatArray) -> FloatArray:
        """log p(y | c) of rows (n, d): (n,)."""
        return self._joint.log_density(rows) - self._given.log_density(rows[:, :1])

    def least(self, rows: FloatArray, seed: int) -> FloatArray:
        """log p(y | c) that 99 % of draws of y reach, for the c of each row (n, d): (n,)."""
        generator = np.random.default_rng(seed)
        return np.array([_least(self._joint.given([0], row[:1]), generator) for row in rows])


def _least(density: Components, generator: np.random.Generator) -> float:
    return float(np.quantile(density.log_density(density.sample(_DRAWN, generator)), _LEAST))


@dataclass
class Flow:
    """A conditional flow of zuko on whitened rows, stopped where a held-out fold is best.

    Rows are moved by normal noise in training, which keeps flows of few rows from holding on to
    them (J. Rothfuss and others, Noise Regularization for Conditional Density Estimation, 2019).

    Attributes:
        kind: class of `zuko.flows`. settings: its arguments beside the sizes. noise: standard
            deviation in units of the rows'.
        transforms, hidden, epochs, patience, batch, rate, decay: sizes and training, by Adam with
            weight decay.
    """

    kind: str
    settings: dict[str, Any]
    noise: float = 0.2
    transforms: int = 2
    hidden: int = 32
    epochs: int = 400
    patience: int = 40
    batch: int = 128
    rate: float = 2e-3
    decay: float = 1e-3

    def fit(self, rows: FloatArray, groups: NDArray[Any]) -> None:
        """Learn from rows (n, d) of recordings (n,)."""
        import torch

        from recognition.trfe.training.windows import seeded

        flows = _zuko().flows
        self._whitening = Whitening.of(rows)
        white = torch.from_numpy(self._whitening.forward(rows))
        fitted, held = next(folds(groups))
        with seeded(0):
            sizes = {"transforms": self.transforms, "hidden_features": (self.hidden, self.hidden)}
            self._flow = getattr(flows, self.kind)(
                rows.shape[1] - 1, 1, **sizes, **self.settings
            ).double()
            self._train(white[fitted], white[held])

    def _train(self, fitted: Any, held: Any) -> None:
        import torch

        optimiser = torch.optim.AdamW(
            self._flow.parameters(), lr=self.rate, weight_decay=self.decay
        )
        best, weights, since = -np.inf, deepcopy(self._flow.state_dict()), 0
        for _ in range(self.epochs):
            for batch in torch.randperm(len(fitted)).split(self.batch):
                optimiser.zero_grad()
                moved = fitted[batch] + self.noise * torch.randn_like(fitted[batch])
                (-self._given(moved).mean()).backward()
                torch.nn.utils.clip_grad_norm_(self._flow.parameters(), 5.0)
                optimiser.step()
            with torch.no_grad():
                reached = float(self._given(held).mean())
            since += 1
            if reached > best:
                best, weights, since = reached, deepcopy(self._flow.state_dict()), 0
            if since >= self.patience:
                break
        self._flow.load_state_dict(weights)

    def _given(self, white: Any) -> Any:
        return self._flow(white[:, :1]).log_prob(white[:, 1:])

    def log_density(self, rows: FloatArray) -> FloatArray:
        """log p(y | c) of rows (n, d): (n,). Whitening is triangular: the first column stays by
        itself."""
        import torch

        with torch.no_grad():
            found: FloatArray = self._given(torch.from_numpy(self._whitening.forward(rows))).numpy()
        return found - np.log(np.diag(self._whitening.factor)[1:]).sum()

    def least(self, rows: FloatArray, seed: int) -> FloatArray:
        """log p(y | c) that 99 % of draws of y reach, for the c of each row (n, d): (n,)."""
        import torch

        from recognition.trfe.training.windows import seeded

        given = torch.from_numpy(self._whitening.forward(rows))[:, :1]
        with torch.no_grad(), seeded(seed):
            found = self._flow(given)
            likely = found.log_prob(found.sample((_DRAWN,))).numpy()
        least: FloatArray = np.quantile(likely, _LEAST, axis=0)
        return least - np.log(np.diag(self._whitening.factor)[1:]).sum()


def _zuko() -> Any:
    """The package.

    Raises:
        UsageError: it is not installed.
    """
    return package("zuko", "conditional flows are those")


MODELS: dict[str, Callable[[], Conditional]] = {
    "mixture of Student's t, conditioned": Closed,
    "conditional neural spline flow": lambda: Flow("NSF", {"bins": 4}),
    "conditional masked autoregressive flow": lambda: Flow("MAF", {}),
}
"""Compared models, the present judge first."""


class _Held(NamedTuple):
    """Of rows that were not fitted: their log-densities (n,), and which are less likely than 99 %
    of draws (n,)."""

    likelihood: FloatArray
    beyond: NDArray[np.bool_]


def _held(new: Callable[[], Conditional], rows: FloatArray, groups: NDArray[Any]) -> _Held:
    likelihood, beyond = np.empty(len(rows)), np.zeros(len(rows), bool)
    for number, (fitted, tested) in enumerate(folds(groups)):
        model = new()
        model.fit(rows[fitted], groups[fitted])
        likelihood[tested] = model.log_density(rows[tested])
        beyond[tested] = likelihood[tested] < model.least(rows[tested], number)
    return _Held(likelihood, beyond)


def comparison(rows: FloatArray, recordings: NDArray[np.str_]) -> Table:
    """Table of conditional densities of rows (n, d), the condition first, in a cross-validation by
    recording.

    Raises:
        UsageError: zuko is not installed.
    """
    _zuko()
    found = {title: _held(new, rows, recordings) for title, new in MODELS.items()}
    parts = [tested for _, tested in folds(recordings)]
    judge = next(iter(found.values())).likelihood
    lines: list[tuple[str, ...]] = [
        (title, spread(each.likelihood[part].mean() for part in parts),
            _worse(each.likelihood - judge, recordings),
         f"{each.beyond.mean():.1%}")
        for title, each in found.items()
    ]  # fmt: skip
    note = (
        f"{len(rows)} recorded pairs, {rows.shape[1] - 1} values given the ego's speed, in "
        "logarithms. Likelihood: mean ± "
        "standard deviation over folds, of rows from recordings that were not fitted. Against the "
        "first: mean ± standard "
        "error over recordings of the differences. Beyond: rows less likely than 99 % of the "
        "density's draws "
        "for their speed of the ego."
    )
    header = "density", "log-likelihood", "against the first", "beyond"
    return Table("conditional", "Conditional densities of pairs", note, header, lines)


def _worse(difference: FloatArray, recordings: NDArray[np.str_]) -> str:
    """Mean difference a row with its standard error, where rows of a recording go together."""
    numbers: IntArray = np.unique(recordings, return_inverse=True)[1]
    sums = np.bincount(numbers, difference - difference.mean())
    return f"{difference.mean():+.3f} ± {np.sqrt(np.square(sums).sum()) / len(difference):.3f}"
