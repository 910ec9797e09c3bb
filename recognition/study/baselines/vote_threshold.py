"""The plain threshold on votes."""

from __future__ import annotations

from recognition.study.baselines.voting import VotingMethod
from recognition.trfe.screening import Screening, VoteThreshold


class PlainThreshold(VotingMethod):
    """The same forest as TRFE's, without extreme values: score 1 − max_k v_k / T (`recognition.trfe.screening.threshold`)."""

    def _screening(self) -> Screening:
        return VoteThreshold()
