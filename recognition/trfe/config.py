"""What a user can choose of TRFE; the defaults are the method's."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from recognition.trfe.discovery.buffer import Preprocessing
from recognition.trfe.discovery.clustering import Clustering
from recognition.trfe.discovery.promotion import Promotion
from recognition.trfe.forest.votes import TREES
from recognition.trfe.samples import Features


@dataclass(frozen=True)
class Config:
    """Settings of TRFE.

    Args:
        trees: T of the forest.
        delta: δ of the screening; None chooses it by leaving one known class out, where there are three, and is 0.05 otherwise.
        changes: how many of the features, the first ones, are of `recognition.tokens.changes`. Where there are any, samples are
            clustered by them alone.
        recognise_by_changes: whether samples are recognised by them too, beside the others.
        pretrained: how many of the others, again the first ones, are of the encoder before fine-tuning. Without changes samples
            are clustered by these more than by those after it, which lays new classes onto known ones.
        components: principal axes of the buffered samples in which they are clustered.
        preprocessing, clustering, promotion: of these steps.
        seed: of everything that is drawn.
    """

    trees: int = TREES
    delta: float | None = None
    changes: int = 0
    recognise_by_changes: bool = True
    pretrained: int = 0
    components: int = 8
    preprocessing: Preprocessing = field(default_factory=Preprocessing)
    clustering: Clustering = field(default_factory=Clustering)
    promotion: Promotion = field(default_factory=Promotion)
    seed: int = 0

    def recognising(self, features: Features) -> Features:
        """Those of the features (n, d) by which samples are recognised."""
        return features if self.recognise_by_changes else features[:, self.changes :]

    def clustering_parts(self, features: Features) -> list[Features]:
        """Those of the features (n, d) by which samples are clustered, in the parts that are standardised each for itself."""
        if self.changes:
            return [features[:, : self.changes]]
        return np.split(features, [self.pretrained], axis=1) if self.pretrained else [features]
