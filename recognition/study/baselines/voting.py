"""Open-set methods that judge the votes of a random forest."""

from __future__ import annotations

from abc import abstractmethod

from recognition.study.baselines.method import OpenSetMethod
from recognition.trfe.forest.voters import Voters, grow
from recognition.trfe.forest.votes import TREES
from recognition.trfe.samples import Features
from recognition.trfe.screening import Screening
from xodr.array_types import FloatArray, IntArray


class VotingMethod(OpenSetMethod):
    """A forest of the training samples and a screening of its votes, which is calibrated on the validation samples.

    Args:
        seed: of the forest and the screening.
        trees: number of trees.
        voters: grown from the training samples already; None grows them in `fit`.

    Attributes:
        background, neighbours: of the forest, see `recognition.trfe.forest.voters.grow`.
    """

    background = False
    neighbours = False

    def __init__(self, seed: int = 0, trees: int = TREES, voters: Voters | None = None) -> None:
        super().__init__(seed)
        self.trees, self._grown = trees, voters

    @abstractmethod
    def _screening(self) -> Screening:
        """The screening, not calibrated yet."""

    def _learn(self, features: Features, indices: IntArray) -> None:
        self._voters = self._grown or grow(
            features,
            self.classes[indices],
            trees=self.trees,
            seed=self.seed,
            background=self.background,
            neighbours=self.neighbours,
        )

    def _calibrate(self, features: Features, labels: IntArray) -> None:
        cast = self._voters.cast(features)
        self.screening = self._screening().fit(cast.votes, labels, self.trees, cast.distances)

    def _classify(self, features: Features) -> IntArray:
        return self._voters.cast(features).votes.argmax(axis=1)

    def score(self, features: Features) -> FloatArray:
        """Outlyingness of each sample (n,); higher is less like the known classes."""
        return self.screening.score(*self._voters.cast(features))
