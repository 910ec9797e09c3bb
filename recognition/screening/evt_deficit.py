"""Reading A of RF-EVT (UCS): a generalised Pareto tail of the votes that the true class lacks."""

from __future__ import annotations

import numpy as np
from scipy.stats import genpareto

from recognition.samples import Floats, Whole
from recognition.screening.base import Screening

TAIL = 0.05
"""Share of a class's calibration samples beyond its 95th percentile, which the tail describes."""
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
        self.deficits: Floats = np.zeros(0)
        self.starts: Whole = np.zeros(1, dtype=np.int64)
        self.limits: Floats = np.zeros(0)
        self.shapes: Floats = np.zeros(0)
        self.scales: Floats = np.zeros(0)
        self.stretches: Floats = np.zeros(0)
        self.recent: Floats = np.zeros((0, window))
        self.seen: Whole = np.zeros(0, dtype=np.int64)

    @property
    def delta(self) -> float:
        """δ, the similarity below which a sample is unknown."""
        return 1.0 - self.threshold

    def _calibrate(self, votes: Whole, columns: Whole) -> None:
        jitter = np.random.default_rng(self.seed).random(len(votes))
        groups = self._groups(columns)
        deficits = self._lacking(votes)[np.arange(len(votes)), groups] + jitter
        of_group = [np.sort(deficits[groups == group]) for group in range(groups.max() + 1)]
        self.deficits = np.concatenate(of_group)
        self.starts = np.cumsum([0, *map(len, of_group)])
        self.limits = np.array([np.quantile(of, 1.0 - TAIL) for of in of_group])
        tails = [tail(of[of > limit] - limit) for of, limit in zip(of_group, self.limits, strict=True)]
        self.shapes, self.scales = np.array(tails).T
        self.stretches = np.ones(len(of_group))
        self.recent = np.zeros((len(of_group), self.window))
        self.seen = np.zeros(len(of_group), dtype=np.int64)

    def _lacking(self, votes: Whole) -> Whole:
        """Votes that are lacking (n, G), for each group of classes that has a distribution; here each class is a group."""
        return self.trees - votes

    def _groups(self, columns: Whole) -> Whole:
        """Group (n,) of the classes in these columns."""
        return columns

    def recalibrate(self, votes: Whole) -> None:
        """Follow a shift of the known classes, seen in votes (n, K) of which nobody knows the classes.

        The 90th percentile of the deficits of a group's latest accepted samples, over what it was at calibration, stretches
        the group's distribution of deficits, never below what was calibrated. The share that screening cuts off is left out
        of the calibration's percentile too, or it would be taken for a shift.
        """
        accepted = self.score(votes) <= self.threshold
        groups, lacking = self._groups(votes.argmax(axis=1)), self._lacking(votes) + 0.5
        for group in range(len(self.stretches)):
            new = lacking[accepted & (groups == group), group][-self.window :]
            self.recent[group, (self.seen[group] + np.arange(len(new))) % self.window] = new
            self.seen[group] += len(new)
            latest = self.recent[group, : self.seen[group]]
            if len(latest) >= _FEWEST_RECENT:
                usual = np.quantile(self._of_group(group), _COMPARED * self.threshold)
                self.stretches[group] = np.clip(np.quantile(latest, _COMPARED) / usual, 1.0, _STRETCH)

    def similarities(self, votes: Whole) -> Floats:
        """s_k (n, G) in [0, 1]: share of the samples of class k, or of a group of classes, that lack at least as many votes."""
        deficits = (self._lacking(votes) + 0.5) / self.stretches
        return np.stack([self._survival(deficits[:, group], group) for group in range(len(self.stretches))], axis=1)

    def _score(self, votes: Whole) -> Floats:
        return 1.0 - self.similarities(votes).max(axis=1)

    def _survival(self, deficit: Floats, group: int) -> Floats:
        of_group = self._of_group(group)
        empirical = 1.0 - np.searchsorted(of_group, deficit) / len(of_group)
        excess = deficit - self.limits[group]
        beyond = TAIL * genpareto.sf(excess, self.shapes[group], scale=self.scales[group])
        return np.where(excess <= 0.0, empirical, beyond)

    def _of_group(self, group: int) -> Floats:
        """Deficits of a group's calibration samples, ascending."""
        return self.deficits[self.starts[group] : self.starts[group + 1]]


def tail(excesses: Floats) -> tuple[float, float]:
    """Shape ξ and scale σ of the generalised Pareto distribution of positive excesses; of the exponential one if few."""
    if len(excesses) < _FEWEST_EXCEEDANCES:
        return 0.0, float(excesses.mean()) if len(excesses) else 1.0
    shape, _, scale = genpareto.fit(excesses, floc=0.0)
    return float(shape), float(scale)
