"""RF-EVT: a generalised Pareto tail of what samples lack, such as votes, for each group of calibration samples."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from scipy.stats import genpareto

from recognition.trfe.screening.base import Screening
from xodr.array_types import BoolArray, FloatArray, IntArray

TAIL = 0.05
"""Share of a group's calibration samples beyond its 95th percentile, which the tail describes."""
MEAN_JITTER = 0.5
_FEWEST_EXCEEDANCES = 10


class EvtScreening(Screening):
    """score = 1 − max_k s_k, unknown where max_k s_k < δ.

    d is the deficit of a calibration sample of group k, such as the votes that it lacks, u_k its 95th percentile.
    s_k(d) = empirical P(D ≥ d) for d ≤ u_k, else 0.05 · (1 + ξ_k (d − u_k) / σ_k)^(−1/ξ_k): the survival of a generalised Pareto
    distribution fitted to d − u_k > 0, with ξ = 0 and σ = mean excess where fewer than 10 samples exceed u_k.
    Votes are whole numbers: calibration adds U(0, 1) to them. Scoring adds the mean of that, 0.5, so that a sample's score does
    not depend on what it is scored with.
    Reference: Pickands, "Statistical Inference Using Extreme Order Statistics" (Annals of Statistics 3, 1975); Scheirer et al.,
    "Meta-Recognition" (PAMI 33, 2011) for extreme values of recognition scores.

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
        tails = [tail(of[of > limit] - limit) for of, limit in zip(of_group, self.limits, strict=True)]
        self.shapes, self.scales = np.array(tails).T

    @abstractmethod
    def _lacking(self, votes: IntArray, distances: FloatArray | None, jitter: FloatArray | float) -> FloatArray:
        """Deficits (n, G) of samples in each group."""

    @abstractmethod
    def _belongs(self, columns: IntArray) -> BoolArray:
        """Whether samples (n,) of the classes in these columns belong to each group (n, G)."""

    def _judged(self, votes: IntArray, distances: FloatArray | None) -> FloatArray:
        """Deficits (n, G) by which samples are scored."""
        return self._lacking(votes, distances, MEAN_JITTER)

    def similarities(self, votes: IntArray, distances: FloatArray | None = None) -> FloatArray:
        """s_k (n, G) in [0, 1]: share of the samples of group k that lack at least as much."""
        deficits, tails = self._judged(votes, distances), zip(self.limits, self.shapes, self.scales, strict=True)
        return np.stack([survival(deficits[:, k], self.group(k), *one) for k, one in enumerate(tails)], axis=1)

    def _score(self, votes: IntArray, distances: FloatArray | None) -> FloatArray:
        return 1.0 - self.similarities(votes, distances).max(axis=1)

    def group(self, number: int) -> FloatArray:
        """Deficits of a group's calibration samples, ascending."""
        return self.deficits[self.starts[number] : self.starts[number + 1]]


def survival(values: FloatArray, calibrated: FloatArray, limit: float, shape: float, scale: float) -> FloatArray:
    """Share (n,) of calibrated values (m,), ascending, that are at least as great; beyond the limit that of the tail."""
    empirical = 1.0 - np.searchsorted(calibrated, values) / len(calibrated)
    excess = values - limit
    return np.where(excess <= 0.0, empirical, TAIL * genpareto.sf(excess, shape, scale=scale))


def tail(excesses: FloatArray) -> tuple[float, float]:
    """Shape ξ and scale σ of the generalised Pareto distribution of positive excesses; of the exponential one if few."""
    if len(excesses) < _FEWEST_EXCEEDANCES:
        return 0.0, float(excesses.mean()) if len(excesses) else 1.0
    shape, _, scale = genpareto.fit(excesses, floc=0.0)
    return float(shape), float(scale)
