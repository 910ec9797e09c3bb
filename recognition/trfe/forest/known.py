"""Known classes: learning from labelled samples, the choice of δ; and a round of discovery of new
ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recognition.labels.classes import Label
from recognition.trfe.config import Config, Steps, Task
from recognition.trfe.discovery.candidates import (
    Buffer,
    Candidate,
    Sifted,
    judge,
    known_cohesion,
    sift,
)
from recognition.trfe.forest import VotingForest
from recognition.trfe.forest import grow as grow_forest
from recognition.trfe.forest.screening import EvtJoint, Screening
from recognition.trfe.inputs.samples import (
    BACKGROUND,
    UNKNOWN,
    Features,
    PrincipalAxes,
    Prototypes,
    class_labels,
    drawn_of_each,
    matrix,
)
from schemas.common.array_types import IntArray
from schemas.common.errors import UsageError

DELTAS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2)
FEWEST_CLASSES = 3
"""Without one of two classes, the trees have nothing to choose between."""
_MOST = 60
"""Samples of each class that forests are fitted on here: there is one forest for each class."""


def choose_delta(
    features: ArrayLike,
    labels: ArrayLike,
    calibration: ArrayLike,
    calibration_labels: ArrayLike,
    *,
    grow: Callable[..., VotingForest] = grow_forest,
    screening: Callable[[float, int], Screening] = EvtJoint,
    trees: int = 100,
    deltas: Sequence[float] = DELTAS,
    seed: int = 0,
) -> float:
    """The δ with the greatest macro-F1 over the known classes and unknown, the mean over the
    classes left out one by one.

    Macro-F1 is what open-set recognition is judged by; with balanced accuracy in its place δ grows
    too large for many classes, where a sample rejected by mistake costs more than one accepted by
    mistake. Each time, half of the calibration samples calibrate and the other half are judged;
    classes of which that half has no sample calibrate with all they have.

    Args:
        features, labels: samples (n, d) to fit forests on, their classes (n,).
        calibration, calibration_labels: other samples (m, d) of the same classes.
        grow, screening: forest and screening, see `recognition.trfe.config.Steps`; a sample is
            unknown where the score exceeds 1 − δ.
        trees: of each forest.
        deltas: candidates; of equally good ones the first is taken.
        seed: of forests, halves and jitter.

    Raises:
        UsageError: fewer than three known classes, or features that are not finite.
    """
    table, held = matrix(features), matrix(calibration)
    known = class_labels(labels, len(table), FEWEST_CLASSES)
    truth = class_labels(calibration_labels, len(held), FEWEST_CLASSES)
    random = np.random.default_rng(seed)
    half = random.permutation(len(held)) % 2 == 0
    half |= ~np.isin(truth, truth[half])
    rows = np.sort(drawn_of_each(known, _MOST, random))
    gains = []
    for out in np.unique(known):
        kept = rows[known[rows] != out]
        forest = grow(table[kept], known[kept], trees=trees, seed=seed)
        votes, left_out = forest.vote(held), truth == out
        calibrating, judged = half & ~left_out, ~half | left_out
        usual, tried = votes.only(calibrating), votes.only(judged)
        # Scores do not depend on δ: one fit serves all candidates.
        fitted = screening(deltas[0], seed).fit(
            usual.counts, truth[calibrating], trees, usual.distances
        )
        score, best = fitted.score(*tried), forest.classes[tried.counts.argmax(axis=1)]
        expected = np.where(left_out, UNKNOWN, truth)[judged]
        gains.append(
            [macro_f1(expected, np.where(score > 1.0 - delta, UNKNOWN, best)) for delta in deltas]
        )
    return float(deltas[int(np.mean(gains, axis=0).argmax())])


def macro_f1(truth: ArrayLike, predicted: ArrayLike) -> float:
    """Mean F1 over all labels that occur in `truth`, unknown among them."""
    from sklearn.metrics import f1_score

    return float(
        f1_score(truth, predicted, labels=np.unique(truth), average="macro", zero_division=0.0)
    )


DELTA = 0.05
"""δ where none is given and there are too few classes to choose one."""


class Labelled(NamedTuple):
    """Samples of known classes: features (n, d), classes (n,)."""

    features: Features
    labels: IntArray

    def recognised_by(self, config: Config) -> Labelled:
        """Return the samples with the features for recognition only."""
        return self._replace(features=config.recognising(self.features))

    def joined(self, other: Labelled) -> Labelled:
        """Samples of this set and of others."""
        return Labelled(
            np.concatenate([self.features, other.features]),
            np.concatenate([self.labels, other.labels]),
        )


class KnownClasses(NamedTuple):
    """Known classes.

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


def learn(fitted: Labelled, calibrating: Labelled, config: Config, steps: Steps) -> KnownClasses:
    """Fit the forest on one set of samples and calibrate the screening on another.

    Raises:
        UsageError: the sets are not of the same classes.
    """
    if set(fitted.labels.tolist()) != set(calibrating.labels.tolist()):
        raise UsageError("the samples to fit and to calibrate must be of the same classes")
    trained, held = fitted.recognised_by(config), calibrating.recognised_by(config)
    forest = steps.grow(*trained, trees=config.trees, seed=config.seed)
    # Prototypes have no threshold to calibrate: both sets may make them.
    prototypes = steps.prototypes(*trained.joined(held))
    screening, votes = (
        steps.screening(_delta(trained, held, config, steps), config.seed),
        forest.vote(held.features),
    )
    screening.fit(votes.counts, held.labels, config.trees, votes.distances)
    return KnownClasses(fitted, calibrating, forest, screening, prototypes)


def _delta(fitted: Labelled, calibrating: Labelled, config: Config, steps: Steps) -> float:
    if config.delta is not None:
        return config.delta
    if len(np.unique(fitted.labels)) < FEWEST_CLASSES:
        return DELTA
    return choose_delta(
        *fitted, *calibrating, grow=steps.grow, screening=steps.screening, seed=config.seed
    )


FIRST_DISCOVERED = 101
"""Label of the first class that is discovered; the given ones have smaller ones."""
_REFERENCE = 50
"""Samples of each known class from which its cohesion is measured."""
SET_ASIDE = -1
"""Cluster of samples that were not clustered."""


class Discovery(NamedTuple):
    """Discovery in the m samples of a buffer.

    Args:
        keys: numbers (m,) by which the caller knows the samples.
        features: of the samples (m, d).
        sifted: what NVP set aside.
        clusters: cluster (m,) of each sample; −1 where it was set aside.
        candidates: each cluster judged; its members are rows of the buffer.
        labels: new class (m,) of each sample of a promoted cluster, else 0.
        reference: cohesion of the known classes, with which that of the clusters is compared.
    """

    keys: IntArray
    features: Features
    sifted: Sifted
    clusters: IntArray
    candidates: list[Candidate]
    labels: IntArray
    reference: float


def discover(known: KnownClasses, buffer: Buffer, config: Config, steps: Steps) -> Discovery:
    """Screen the buffer, cluster the kept samples and judge the clusters; the buffer is not
    changed.

    Raises:
        UsageError: the buffer is empty, or holds no more samples than a sample must have
            neighbours.
    """
    if buffer.inputs is None or not len(buffer):
        raise UsageError("the buffer is empty: there is nothing to discover classes in")
    features = matrix(buffer.inputs)
    seen = config.recognising(features)
    sifted = sift(seen, known.prototypes, config.preprocessing)
    rows = np.flatnonzero(sifted.kept)
    clusters, labels = np.full(len(features), SET_ASIDE), np.full(len(features), UNKNOWN)
    # No cluster could be promoted.
    if len(rows) < config.promotion.least_samples:
        return Discovery(buffer.keys, features, sifted, clusters, [], labels, 0.0)
    axes = clustering_axes(known.fitted.joined(known.calibrating), features[rows], config, steps)
    similar, reference = _similarity(features[rows], axes, known, config, steps)
    known_samples = axes.project(config.clustering_parts(known.fitted.features))
    least = config.promotion.relative_cohesion * reference
    task = Task(
        axes.project(config.clustering_parts(features[rows])),
        similar,
        known_samples,
        known.fitted.labels,
        least,
    )
    clusters[rows] = steps.cluster(task, config)
    judged = judge(
        clusters[rows], seen[rows], similar, known.prototypes, reference, config.promotion
    )
    candidates = [one._replace(members=rows[one.members]) for one in judged]
    # Above all labels in use: those of earlier rounds keep their meaning.
    first = max(int(known.classes[-1]) + 1, FIRST_DISCOVERED)
    for label, one in enumerate((one for one in candidates if one.promoted), first):
        labels[one.members] = label
    return Discovery(buffer.keys, features, sifted, clusters, candidates, labels, reference)


def clustering_axes(
    own: Labelled, unknown: Features, config: Config, steps: Steps
) -> PrincipalAxes:
    """The axes along which unknown samples with these features (n, d) are clustered, beside samples
    of the known classes."""
    parts, beside = config.clustering_parts(own.features), config.clustering_parts(unknown)
    if config.changes:
        around = [steps.prototypes(parts[0], own.labels, beside[0])]
    else:
        around = [steps.prototypes(part, own.labels) for part in parts]
    return PrincipalAxes.fit(around, beside, config.components)


def _similarity(
    features: Features, axes: PrincipalAxes, known: KnownClasses, config: Config, steps: Steps
) -> tuple[NDArray[np.float32], float]:
    """S of the unknown samples, and the cohesion of the known classes under the same forest."""
    own, labels = known.calibrating
    chosen = drawn_of_each(labels, _REFERENCE, np.random.default_rng(config.seed))
    both = np.concatenate([features, own[chosen]])
    coordinates = axes.project(config.clustering_parts(both))
    # Both under one forest: similarities of different forests can't be compared.
    similar = steps.similarity(config.recognising(both), coordinates, known.forest, config)
    split = len(features)
    return similar[:split, :split], known_cohesion(similar[split:, split:], labels[chosen])


def title_of(label: int) -> str:
    """Name of a class of a model."""
    if label == BACKGROUND:
        return "nothing"
    return (
        f"discovered {label - FIRST_DISCOVERED + 1:02d}"
        if label >= FIRST_DISCOVERED
        else Label(label).title
    )
