"""The plain threshold on votes."""

from __future__ import annotations

from recognition.baselines.voting import VotingMethod
from recognition.screening import Screening, VoteThreshold


class PlainThreshold(VotingMethod):
    """The same forest as TRFE's, without extreme values: score 1 − max_k v_k / T (`recognition.screening.threshold`)."""

    def _screening(self) -> Screening:
        return VoteThreshold()
