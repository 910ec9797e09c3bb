"""The known classes: their labelled samples, and the voters, screening and prototypes learnt from these."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from recognition.trfe.config import Config
from recognition.trfe.forest.voters import Voters, grow
from recognition.trfe.prototypes import Prototypes
from recognition.trfe.samples import Features, class_labels, matrix
from recognition.trfe.screening import EvtDeficit, EvtJoint, EvtPooled, Screening, VoteThreshold, WeibullVotes
from recognition.trfe.screening.selection import FEWEST_CLASSES, choose_delta
from schemas.errors import UsageError
from xodr.array_types import IntArray

_DELTA = 0.05
"""δ where none is given and there are too few classes to choose one."""
READINGS: dict[str, type[EvtDeficit]] = {"deficit": EvtDeficit, "pooled": EvtPooled, "joint": EvtJoint}
"""Screenings whose δ is chosen by leaving one known class out."""


class Labelled(NamedTuple):
    """Samples of known classes: features (n, d), classes (n,)."""

    features: Features
    labels: IntArray

    def joined(self, other: Labelled) -> Labelled:
        """These samples and others."""
        return Labelled(np.concatenate([self.features, other.features]), np.concatenate([self.labels, other.labels]))


class Known(NamedTuple):
    """What is known.

    Args:
        fitted: samples that the forest was fitted on.
        calibrating: other samples of the same classes, which calibrated the screening.
        voters: a forest that votes for classes.
        screening: judges the votes; None where the margin of the prototypes does instead.
        prototypes: centres and radii of the classes.
    """

    fitted: Labelled
    calibrating: Labelled
    voters: Voters
    screening: Screening | None
    prototypes: Prototypes

    @property
    def classes(self) -> IntArray:
        """Labels of the classes, ascending."""
        return self.voters.classes


def labelled(features: ArrayLike, labels: ArrayLike) -> Labelled:
    """Samples of two classes or more.

    Raises:
        UsageError: features that are not finite, labels that are none, or fewer classes.
    """
    table = matrix(features)
    return Labelled(table, class_labels(labels, len(table), least_classes=2))


def learn(fitted: Labelled, calibrating: Labelled, config: Config) -> Known:
    """Fit the forest on one set of samples and calibrate the screening on another.

    Raises:
        UsageError: the sets are not of the same classes.
    """
    if set(fitted.labels.tolist()) != set(calibrating.labels.tolist()):
        raise UsageError("the samples to fit and to calibrate must be of the same classes")
    grown = grow(*fitted, trees=config.trees, seed=config.seed, background=config.background, neighbours=config.neighbours)
    prototypes = Prototypes.fit(*fitted.joined(calibrating), config.metric)
    screening = bare_screening(config, _delta(fitted, calibrating, config))
    if screening:
        cast = grown.cast(calibrating.features)
        screening.fit(cast.votes, calibrating.labels, config.trees, cast.distances)
    return Known(fitted, calibrating, grown, screening, prototypes)


def bare_screening(config: Config, delta: float = _DELTA) -> Screening | None:
    """The screening that is configured, not calibrated yet."""
    match config.screening:
        case "deficit" | "pooled" | "joint":
            return READINGS[config.screening](delta, config.seed, config.window)
        case "weibull":
            return WeibullVotes(delta, config.seed)
        case "threshold":
            return VoteThreshold(delta)
        case "none":
            return None


def _delta(fitted: Labelled, calibrating: Labelled, config: Config) -> float:
    if config.delta is not None:
        return config.delta
    if config.screening not in READINGS or len(np.unique(fitted.labels)) < FEWEST_CLASSES:
        return _DELTA
    reading = READINGS[config.screening]
    return choose_delta(
        *fitted,
        *calibrating,
        reading=reading,
        background=config.background,
        neighbours=config.neighbours,
        seed=config.seed,
    )
