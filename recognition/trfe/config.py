"""All that can be chosen of TRFE; the defaults are the method's."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from recognition.trfe.discovery.buffer import Preprocessing
from recognition.trfe.discovery.clustering import Clustering
from recognition.trfe.discovery.promotion import Promotion
from recognition.trfe.forest.votes import TREES
from recognition.trfe.prototypes import Metric


@dataclass(frozen=True)
class Config:
    """Choices for TRFE.

    Args:
        trees: T of the forest.
        background: whether trees may vote for none of the classes, see `recognition.trfe.forest.voters.grow`.
        neighbours: whether trees see distances to the samples of each class, see there too.
        screening: reading A of votes and distances (`joint`), of votes for all classes together (`pooled`) or for each class
            (`deficit`), reading B (`weibull`), the plain `threshold` on votes, or `none`: what is beyond the margin of every
            known class is unknown. `joint` needs `neighbours`.
        delta: δ of the screening, or the share that the plain threshold rejects; None has that of reading A chosen by leaving
            one known class out, where there are three, and is 0.05 otherwise.
        window: accepted samples of each class by which reading A follows a shift of the known classes; 0 leaves it as calibrated.
        metric: of the distance to known classes, which decides how features are standardised too.
        sifted: whether NVP sifts the buffer before clustering.
        preprocessing: how.
        clusterer: online clustering, or average `linkage` on 1 − S, cut where clusters would be less cohesive than is promoted.
        pretrained: how many of the features are of the encoder before fine-tuning: the first ones. They weigh more in clustering:
            fine-tuning lays new classes onto known ones.
        components: principal directions of the buffered samples in which they are clustered.
        counted: whether the number of new classes is estimated before clustering, or all candidates are offered.
        forest: S is of the supervised forest, or of completely random trees grown on those directions without labels.
        clustering, promotion: of these steps.
        seed: of everything that is drawn.
    """

    trees: int = TREES
    background: bool = True
    neighbours: bool = True
    screening: Literal["joint", "pooled", "deficit", "weibull", "threshold", "none"] = "joint"
    delta: float | None = None
    window: int = 0
    metric: Metric = "whitened"
    sifted: bool = True
    preprocessing: Preprocessing = field(default_factory=Preprocessing)
    clusterer: Literal["online", "linkage"] = "online"
    pretrained: int = 0
    components: int = 8
    counted: bool = True
    forest: Literal["supervised", "unsupervised"] = "unsupervised"
    clustering: Clustering = field(default_factory=Clustering)
    promotion: Promotion = field(default_factory=Promotion)
    seed: int = 0
