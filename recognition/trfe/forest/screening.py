"""Screenings: which samples belong to no known class, by votes and distances; the base class and
EVT models."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import xlogy

from recognition.trfe.inputs.samples import UNKNOWN, class_labels
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import UsageError

State = Mapping[str, NDArray[Any]]


class Screening(ABC):
    """Decides from votes (n, K) of a forest, and perhaps distances (n,), which samples belong to no
    known class.

    All that an instance holds are numbers and arrays, so that it can be stored without pickle.

    Attributes:
        threshold: a sample whose score is greater is unknown.
        classes: labels of the columns of the votes, ascending; set by `fit`.
        trees: number of trees that vote; set by `fit`.
    """

    def __init__(self, threshold: float) -> None:
        self.threshold = threshold
        self.classes: IntArray = np.zeros(0, dtype=np.int64)
        self.trees = 0

    def fit(
        self,
        votes: ArrayLike,
        labels: ArrayLike,
        trees: int | None = None,
        distances: FloatArray | None = None,
    ) -> Self:
        """Calibrate on votes (n, K) of samples that the forest was not fitted on, and their true
        labels (n,).

        Args:
            votes, labels: of the samples.
            trees: that vote; None where all of them vote for known classes.
            distances: of the samples to the known classes (n,), for a screening that looks at them.

        Raises:
            UsageError: the labels are not of as many classes as the votes, or the rows of the votes
                do not add up.
        """
        table = np.asarray(votes)
        if table.ndim != 2 or not len(table):
            raise UsageError(
                f"votes must be a table (samples, classes), not of shape {table.shape}"
            )
        totals = table.sum(axis=1)
        if (totals != totals[0]).any() if trees is None else (totals > trees).any():
            raise UsageError(
                "each row of the votes must add up to the number of trees, or to less where some "
                "may vote for none"
            )
        truth = class_labels(labels, len(table))
        self.classes = np.unique(truth)
        if len(self.classes) != table.shape[1]:
            raise UsageError(
                f"{table.shape[1]} classes are voted for, but calibration samples are of "
                f"{len(self.classes)}"
            )
        self.trees = int(totals[0]) if trees is None else trees
        self._calibrate(table, np.searchsorted(self.classes, truth), distances)
        return self

    def score(self, votes: ArrayLike, distances: FloatArray | None = None) -> FloatArray:
        """Return outlier scores for votes (n, K) and distances (n,); higher is more outlying."""
        table = np.asarray(votes)
        if not self.trees:
            raise UsageError("the screening has to be fitted before it can score")
        if table.ndim != 2 or table.shape[1] != len(self.classes):
            raise UsageError(
                f"votes of shape {table.shape} are not for {len(self.classes)} classes"
            )
        return self._score(table, distances)

    def predict(self, votes: ArrayLike, distances: FloatArray | None = None) -> IntArray:
        """Labels (n,): the class with most votes, or 0 where the score exceeds the threshold."""
        accepted = self.score(votes, distances) <= self.threshold
        return np.where(accepted, self.classes[np.asarray(votes).argmax(axis=1)], UNKNOWN)

    def state(self) -> dict[str, NDArray[Any]]:
        """State of the instance as arrays, for `restore`."""
        return {name: np.asarray(value) for name, value in vars(self).items()}

    def restore(self, state: State) -> Self:
        """Take over what `state` of an instance of the same class gave.

        Raises:
            KeyError: an attribute is missing.
        """
        for name, value in vars(self).items():
            setattr(
                self,
                name,
                state[name] if isinstance(value, np.ndarray) else type(value)(state[name]),
            )
        return self

    @abstractmethod
    def _calibrate(self, votes: IntArray, columns: IntArray, distances: FloatArray | None) -> None:
        """Fit to votes (n, K) and distances (n,), where `columns` (n,) are the columns of the true
        classes."""

    @abstractmethod
    def _score(self, votes: IntArray, distances: FloatArray | None) -> FloatArray: ...


TAIL = 0.05
"""Share of a group's calibration samples beyond its 95th percentile, which the tail describes."""
MEAN_JITTER = 0.5
_FEWEST_EXCEEDANCES = 10


class EvtScreening(Screening):
    """score = 1 − max_k s_k, unknown where max_k s_k < δ.

    d is the deficit of a calibration sample of group k, such as the votes that it lacks, u_k its
    95th percentile. s_k(d) = empirical P(D ≥ d) for d ≤ u_k, else 0.05 · (1 + ξ_k (d − u_k) /
    σ_k)^(−1/ξ_k): the survival of a generalised Pareto distribution fitted to d − u_k > 0, with ξ =
    0 and σ = mean excess where fewer than 10 samples exceed u_k. Votes are whole numbers:
    calibration adds U(0, 1) to them. Scoring adds the mean of that, 0.5, so that a sample's score
    does not depend on what it is scored with. Reference: Pickands, "Statistical Inference Using
    Extreme Order Statistics" (Annals of Statistics 3, 1975); Scheirer et al., "Meta-Recognition"
    (PAMI 33, 2011) for extreme values of recognition scores.

    Args:
        delta: similarity below which a sample is unknown; `selection.choose_delta` finds one.
        seed: of the jitter.
    """

    def __init__(self, delta: float = 0.05, seed: int = 0) -> None:
        super().__init__(threshold=1.0 - delta)
        self.seed = seed
        self.deficits: FloatArray = np.zeros(0)
        self.starts: IntArray = np.zeros(1, dtype=np.int64)
        self.limits: FloatArray = np.zeros(0)
        self.shapes: FloatArray = np.zeros(0)
        self.scales: FloatArray = np.zeros(0)

    @property
    def delta(self) -> float:
        """δ, the similarity below which a sample is unknown."""
        return 1.0 - self.threshold

    def _calibrate(self, votes: IntArray, columns: IntArray, distances: FloatArray | None) -> None:
        jitter = np.random.default_rng(self.seed).random(len(votes))
        deficits, belongs = self._lacking(votes, distances, jitter), self._belongs(columns)
        of_group = [np.sort(deficits[of, group]) for group, of in enumerate(belongs.T)]
        self.deficits = np.concatenate(of_group)
        self.starts = np.cumsum([0, *map(len, of_group)])
        self.limits = np.array([np.quantile(of, 1.0 - TAIL) for of in of_group])
        tails = [
            tail(of[of > limit] - limit) for of, limit in zip(of_group, self.limits, strict=True)
        ]
        self.shapes, self.scales = np.array(tails).T

    @abstractmethod
    def _lacking(
        self, votes: IntArray, distances: FloatArray | None, jitter: FloatArray | float
    ) -> FloatArray:
        """Deficits (n, G) of samples in each group."""

    @abstractmethod
    def _belongs(self, columns: IntArray) -> BoolArray:
        """Whether samples (n,) of the classes in these columns belong to each group (n, G)."""

    def _judged(self, votes: IntArray, distances: FloatArray | None) -> FloatArray:
        """Deficits (n, G) by which samples are scored."""
        return self._lacking(votes, distances, MEAN_JITTER)

    def similarities(self, votes: IntArray, distances: FloatArray | None = None) -> FloatArray:
        """s_k (n, G) in [0, 1]: share of the samples of group k that lack at least as much."""
        deficits, tails = (
            self._judged(votes, distances),
            zip(self.limits, self.shapes, self.scales, strict=True),
        )
        return np.stack(
            [survival(deficits[:, k], self.group(k), *one) for k, one in enumerate(tails)], axis=1
        )

    def _score(self, votes: IntArray, distances: FloatArray | None) -> FloatArray:
        return 1.0 - self.similarities(votes, distances).max(axis=1)

    def group(self, number: int) -> FloatArray:
        """Deficits of a group's calibration samples, ascending."""
        return self.deficits[self.starts[number] : self.starts[number + 1]]


def survival(
    values: FloatArray, calibrated: FloatArray, limit: float, shape: float, scale: float
) -> FloatArray:
    """Share (n,) of calibrated values (m,), ascending, that are at least as great; beyond the limit
    that of the tail."""
    empirical = 1.0 - np.searchsorted(calibrated, values) / len(calibrated)
    excess = values - limit
    return np.where(
        excess <= 0.0, empirical, TAIL * _beyond(np.maximum(excess, 0.0) / scale, shape)
    )


def _beyond(excess: FloatArray, shape: float) -> FloatArray:
    """Survival of the generalised Pareto distribution of scale 1: (1 + ξx)^(−1/ξ), e^(−x) for ξ =
    0, and 0 where the distribution ends."""
    if shape == 0.0:
        return np.exp(-excess)
    with np.errstate(divide="ignore"):
        return np.exp(-np.log1p(np.maximum(shape * excess, -1.0)) / shape)


def tail(excesses: FloatArray) -> tuple[float, float]:
    """Shape ξ and scale σ of the generalised Pareto distribution of positive excesses; of the
    exponential one if few."""
    if len(excesses) < _FEWEST_EXCEEDANCES:
        return 0.0, float(excesses.mean()) if len(excesses) else 1.0
    from scipy.stats import genpareto  # half a second, for fitting alone

    shape, _, scale = genpareto.fit(excesses, floc=0.0)
    return float(shape), float(scale)


class EvtJoint(EvtScreening):
    """score = 1 − p, with p = q (1 − ln q), q = s(d) · s(r): Fisher's combined significance of both
    survivals.

    s(d) is that of d = T − max_k v_k + U(0, 1), the votes that the best class lacks, for all known
    classes together: with a distribution for each class, the class that trees are most torn about
    would accept nearly everything. s(r) is that of the distance r to the nearest known samples, in
    the same form. Trees split at one feature at a time and see little of what lies between the
    classes; distances weigh all features alike and see little of what matters for a class. Source:
    Fisher, "Statistical Methods for Research Workers" (1932), § 21.1; for the distance Sun et al.,
    "Out-of-Distribution Detection with Deep Nearest Neighbors" (ICML 2022).
    """

    def _lacking(
        self, votes: IntArray, distances: FloatArray | None, jitter: FloatArray | float
    ) -> FloatArray:
        if distances is None:
            raise UsageError("the joint screening looks at distances: it needs trees that see them")
        return np.column_stack(
            [self.trees - votes.max(axis=1, keepdims=True) + np.reshape(jitter, (-1, 1)), distances]
        )

    def _belongs(self, columns: IntArray) -> BoolArray:
        return np.ones((len(columns), 2), dtype=bool)

    def _score(self, votes: IntArray, distances: FloatArray | None) -> FloatArray:
        both = self.similarities(votes, distances).prod(axis=1)
        return 1.0 - both + xlogy(both, both)
