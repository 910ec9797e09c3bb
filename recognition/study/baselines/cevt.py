"""Votes and extreme values, in the reading of the earlier paper."""

from __future__ import annotations

from recognition.study.baselines.voting import VotingMethod
from recognition.trfe.screening import Screening, WeibullVotes


class CEVT(VotingMethod):
    """A Weibull distribution of the winning class's votes.

    m = max_k v_k, k its class; score 1 − F_k(m), F_k the Weibull distribution of greatest likelihood for class k
    (`recognition.trfe.screening.weibull`).

    Balasubramanian et al., Open-set Recognition based on the Combination of Deep Learning and Ensemble Method for Detecting
    Unknown Traffic Scenarios, IV 2021.
    """

    def _screening(self) -> Screening:
        return WeibullVotes(seed=self.seed)
