"""What a user can choose of TRFE; the defaults are the method's."""

from __future__ import annotations

from dataclasses import dataclass, field

from recognition.trfe.discovery.buffer import Preprocessing
from recognition.trfe.discovery.clustering import Clustering
from recognition.trfe.discovery.promotion import Promotion
from recognition.trfe.forest.votes import TREES


@dataclass(frozen=True)
class Config:
    """Settings of TRFE.

    Args:
        trees: T of the forest.
        delta: δ of the screening; None chooses it by leaving one known class out, where there are three, and is 0.05 otherwise.
        pretrained: how many of the features are of the encoder before fine-tuning: the first ones. They weigh more in clustering:
            fine-tuning lays new classes onto known ones.
        components: principal axes of the buffered samples in which they are clustered.
        preprocessing, clustering, promotion: of these steps.
        seed: of everything that is drawn.
    """

    trees: int = TREES
    delta: float | None = None
    pretrained: int = 0
    components: int = 8
    preprocessing: Preprocessing = field(default_factory=Preprocessing)
    clustering: Clustering = field(default_factory=Clustering)
    promotion: Promotion = field(default_factory=Promotion)
    seed: int = 0
