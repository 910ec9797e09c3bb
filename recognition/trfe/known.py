"""The known classes: their labelled samples, and the forest, screening and prototypes learnt from these."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from recognition.trfe.config import Config
from recognition.trfe.forest.voting import VotingForest
from recognition.trfe.prototypes import Prototypes
from recognition.trfe.samples import Features, class_labels, matrix
from recognition.trfe.screening import Screening
from recognition.trfe.screening.selection import FEWEST_CLASSES, choose_delta
from recognition.trfe.steps import Steps
from schemas.errors import UsageError
from xodr.array_types import IntArray

DELTA = 0.05
"""δ where none is given and there are too few classes to choose one."""


class Labelled(NamedTuple):
    """Samples of known classes: features (n, d), classes (n,)."""

    features: Features
    labels: IntArray

    def recognised_by(self, config: Config) -> Labelled:
        """The same with the features alone by which samples are recognised."""
        return self._replace(features=config.recognising(self.features))

    def joined(self, other: Labelled) -> Labelled:
        """These samples and others."""
        return Labelled(np.concatenate([self.features, other.features]), np.concatenate([self.labels, other.labels]))


class Known(NamedTuple):
    """What is known.

    Args:
        fitted: samples that the forest was fitted on, with all features.
        calibrating: other samples of the same classes, which calibrated the screening.
        forest: votes for classes, by `Config.recognising` features.
        screening: judges the votes.
        prototypes: centres and radii of the classes, in the same features.
    """

    fitted: Labelled
    calibrating: Labelled
    forest: VotingForest
    screening: Screening
    prototypes: Prototypes

    @property
    def classes(self) -> IntArray:
        """Labels of the classes, ascending."""
        return self.forest.classes


def labelled(features: ArrayLike, labels: ArrayLike) -> Labelled:
    """Samples of two classes or more.

    Raises:
        UsageError: features that are not finite, labels that are none, or fewer classes.
    """
    table = matrix(features)
    return Labelled(table, class_labels(labels, len(table), least_classes=2))


def learn(fitted: Labelled, calibrating: Labelled, config: Config, steps: Steps) -> Known:
    """Fit the forest on one set of samples and calibrate the screening on another.

    Raises:
        UsageError: the sets are not of the same classes.
    """
    if set(fitted.labels.tolist()) != set(calibrating.labels.tolist()):
        raise UsageError("the samples to fit and to calibrate must be of the same classes")
    trained, held = fitted.recognised_by(config), calibrating.recognised_by(config)
    forest = steps.grow(*trained, trees=config.trees, seed=config.seed)
    prototypes = steps.prototypes(*trained.joined(held))
    screening, votes = steps.screening(_delta(trained, held, config, steps), config.seed), forest.vote(held.features)
    screening.fit(votes.counts, held.labels, config.trees, votes.distances)
    return Known(fitted, calibrating, forest, screening, prototypes)


def _delta(fitted: Labelled, calibrating: Labelled, config: Config, steps: Steps) -> float:
    if config.delta is not None:
        return config.delta
    if len(np.unique(fitted.labels)) < FEWEST_CLASSES:
        return DELTA
    return choose_delta(*fitted, *calibrating, grow=steps.grow, screening=steps.screening, seed=config.seed)
