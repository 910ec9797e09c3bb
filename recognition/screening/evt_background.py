"""Reading A with the known classes taken together: a generalised Pareto tail of the votes that none of them gets."""

from __future__ import annotations

import numpy as np

from recognition.samples import Whole
from recognition.screening.evt_deficit import EvtDeficit
from schemas.errors import UsageError


class EvtBackground(EvtDeficit):
    """score = 1 − s, with s(d) as in `EvtDeficit` but one distribution for all known classes, d = T − Σ_k v_k + U(0, 1).

    d counts the trees of a forest with a background class that vote for it. Trees that are torn between known classes do not
    make a sample unknown here, whereas they widen the distribution of d = T − v_k, and with it what each such class accepts.
    """

    def _calibrate(self, votes: Whole, columns: Whole) -> None:
        if (votes.sum(axis=1) == self.trees).all():
            raise UsageError("no tree votes for the background: this reading needs a forest that was fitted with one")
        super()._calibrate(votes, columns)

    def _lacking(self, votes: Whole) -> Whole:
        return self.trees - votes.sum(axis=1, keepdims=True)

    def _groups(self, columns: Whole) -> Whole:
        return np.zeros_like(columns)
