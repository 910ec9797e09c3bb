"""Reading A of RF-EVT (UCS): a generalised Pareto tail of the votes that the true class lacks."""

from __future__ import annotations

import numpy as np
from scipy.stats import genpareto

from recognition.trfe.screening.base import Screening
from xodr.array_types import BoolArray, FloatArray, IntArray

TAIL = 0.05
"""Share of a class's calibration samples beyond its 95th percentile, which the tail describes."""
_MEAN_JITTER = 0.5
_FEWEST_EXCEEDANCES = 10
_FEWEST_RECENT = 30
"""Accepted samples of a class without which its shift is not judged."""
_COMPARED = 0.9
"""Quantile of deficits by which a shift is judged: lower ones hardly move where most samples have all votes."""
_STRETCH = 4.0
"""Greatest factor by which recalibration stretches a class's deficits."""


class EvtDeficit(Screening):
    """score = 1 − max_k s_k, unknown where max_k s_k < δ, else argmax_k v_k.

    d = T − v_k + U(0, 1) is the deficit of votes of a calibration sample of class k, u_k its 95th percentile.
    s_k(d) = empirical P(D ≥ d) for d ≤ u_k, else 0.05 · (1 + ξ_k (d − u_k) / σ_k)^(−1/ξ_k): the survival of a generalised Pareto
    distribution fitted to d − u_k > 0, with ξ = 0 and σ = mean excess where fewer than 10 samples exceed u_k.
    Scoring uses the mean jitter, 0.5, so that a sample's score does not depend on what it is scored with.
    Reference: Pickands, "Statistical Inference Using Extreme Order Statistics" (Annals of Statistics 3, 1975); Scheirer et al.,
    "Meta-Recognition" (PAMI 33, 2011) for extreme values of recognition scores.

    Args:
        delta: similarity below which a sample is unknown; `selection.choose_delta` finds one.
        seed: of the jitter.
        window: accepted samples of each class that `recalibrate` looks back on; 0 leaves the calibration as fitted.
    """

    def __init__(self, delta: float = 0.05, seed: int = 0, window: int = 0) -> None:
        super().__init__(threshold=1.0 - delta)
        self.seed = seed
        self.window = window
        self.deficits: FloatArray = np.zeros(0)
        self.starts: IntArray = np.zeros(1, dtype=np.int64)
        self.limits: FloatArray = np.zeros(0)
        self.shapes: FloatArray = np.zeros(0)
        self.scales: FloatArray = np.zeros(0)
        self.stretches: FloatArray = np.zeros(0)
        self.recent: FloatArray = np.zeros((0, window))
        self.seen: IntArray = np.zeros(0, dtype=np.int64)

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
        self.stretches = np.ones(len(of_group))
        self.recent = np.zeros((len(of_group), self.window))
        self.seen = np.zeros(len(of_group), dtype=np.int64)

    def _lacking(self, votes: IntArray, distances: FloatArray | None, jitter: FloatArray | float) -> FloatArray:
        """What samples lack (n, G), in each group of calibration samples that has a distribution; here each class is a group."""
        return self.trees - votes + np.reshape(jitter, (-1, 1))

    def _belongs(self, columns: IntArray) -> BoolArray:
        """Whether samples (n,) of the classes in these columns belong to each group (n, G)."""
        return columns[:, None] == np.arange(len(self.classes))

    def recalibrate(self, votes: IntArray, distances: FloatArray | None = None) -> None:
        """Follow a shift of the known classes, seen in votes (n, K) and distances (n,) of which nobody knows the classes.

        The 90th percentile of the deficits of a group's latest accepted samples, over what it was at calibration, stretches
        the group's distribution of deficits, never below what was calibrated. The share that screening cuts off is left out
        of the calibration's percentile too, or it would be taken for a shift.
        """
        accepted = self.score(votes, distances) <= self.threshold
        belongs, lacking = self._belongs(votes.argmax(axis=1)), self._lacking(votes, distances, _MEAN_JITTER)
        for group in range(len(self.stretches)):
            new = lacking[accepted & belongs[:, group], group][-self.window :]
            self.recent[group, (self.seen[group] + np.arange(len(new))) % self.window] = new
            self.seen[group] += len(new)
            latest = self.recent[group, : self.seen[group]]
            if len(latest) >= _FEWEST_RECENT:
                usual = np.quantile(self._of_group(group), _COMPARED * self.threshold)
                self.stretches[group] = np.clip(np.quantile(latest, _COMPARED) / usual, 1.0, _STRETCH)

    def similarities(self, votes: IntArray, distances: FloatArray | None = None) -> FloatArray:
        """s_k (n, G) in [0, 1]: share of the samples of class k, or of another group, that lack at least as much."""
        deficits = self._lacking(votes, distances, _MEAN_JITTER) / self.stretches
        tails = zip(self.limits, self.shapes, self.scales, strict=True)
        return np.stack([survival(deficits[:, k], self._of_group(k), *one) for k, one in enumerate(tails)], axis=1)

    def _score(self, votes: IntArray, distances: FloatArray | None) -> FloatArray:
        return 1.0 - self.similarities(votes, distances).max(axis=1)

    def _of_group(self, group: int) -> FloatArray:
        """Deficits of a group's calibration samples, ascending."""
        return self.deficits[self.starts[group] : self.starts[group + 1]]


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
