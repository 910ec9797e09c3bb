"""The votes of a random forest and a screening of them, as an open-set method."""

from __future__ import annotations

from collections.abc import Callable

from recognition.trfe.forest import TREES, VotingForest, grow
from recognition.trfe.forest.screening import EvtJoint, Screening
from recognition.trfe.inputs.samples import Features
from schemas.common.array_types import FloatArray, IntArray
from studies.recognition.baselines.open_set.method import OpenSetMethod

_DELTA = 0.05
"""Of screenings; the common rule of `OpenSetMethod` takes the place of its threshold."""


class VotingMethod(OpenSetMethod):
    """A forest of the training samples and a screening of its votes, which is calibrated on the
    validation samples.

    Args:
        seed: of the forest and the screening.
        screening: makes the screening of a δ and a seed.
        trees: number of trees.
        forest: grown from the training samples already; None grows TRFE's in `fit`.
    """

    def __init__(
        self,
        seed: int = 0,
        screening: Callable[[float, int], Screening] = EvtJoint,
        trees: int = TREES,
        forest: VotingForest | None = None,
    ) -> None:
        super().__init__(seed)
        self.screening, self.trees, self._grown = screening(_DELTA, seed), trees, forest

    def _learn(self, features: Features, indices: IntArray) -> None:
        self._forest = self._grown or grow(
            features, self.classes[indices], trees=self.trees, seed=self.seed
        )

    def _calibrate(self, features: Features, labels: IntArray) -> None:
        votes = self._forest.vote(features)
        self.screening.fit(votes.counts, labels, self.trees, votes.distances)

    def _classify(self, features: Features) -> IntArray:
        return self._forest.vote(features).counts.argmax(axis=1)

    def score(self, features: Features) -> FloatArray:
        """Outlyingness of each sample (n,); higher is less like the known classes."""
        return self.screening.score(*self._forest.vote(features))
