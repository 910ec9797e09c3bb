"""TRFE: recognise scenarios of known classes, set aside unknown ones, find new
classes among them, and go on with those.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recognition.trfe.config import Config, Steps
from recognition.trfe.discovery.candidates import Buffer
from recognition.trfe.encoder.inference import StoredEncoder
from recognition.trfe.forest import Votes
from recognition.trfe.forest.known import (
    FIRST_DISCOVERED,
    Discovery,
    KnownClasses,
    Labelled,
    discover,
    labelled,
    learn,
)
from recognition.trfe.forest.screening import EvtScreening
from recognition.trfe.inputs.samples import BACKGROUND, UNKNOWN, Features, matrix
from recognition.trfe.inputs.tokens import changes
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import UsageError

if TYPE_CHECKING:
    from recognition.trfe.encoder.model import Encoder

_CALIBRATING = 0.3
"""Share of a promoted class's samples that calibrate the screening; the forest
is fitted on the others.
"""


class Recognition(NamedTuple):
    """Recognition of n samples.

    Args:
        labels: known class (n,), 0 = unknown.
        confidence: share of the votes of the class with most (n,), in [0, 1].
        score: how outlying (n,); higher is more outlying.
        closed: class with most votes (n,), whether the sample is unknown or not.
        features: (n, d).
        share: of the votes for classes, that of the class with most (n,), in [0, 1]; votes for none
            of them do not count.
    """

    labels: IntArray
    confidence: FloatArray
    score: FloatArray
    closed: IntArray
    features: Features
    share: FloatArray


class TRFE:
    """Recognises, sets aside, discovers and expands.

    Args:
        config: settings.
        encoders: make features of windows, trained and from now on frozen; without any, only
            features are taken. Features of the encoder before fine-tuning, beside those after it,
            hold what new classes differ in from each other.
        known: what was learnt before.
        steps: the method's own, or others that a study puts in their place.

    Attributes:
        buffer: unknown samples that wait.
        unseen_sites: at sites that it was not trained on, the share of the rules' events that it
            gives the rules' class, and the share to which it gives another one or none, on the
            worst site that was measured; None where none was.
        least: the least `Recognition.share` that a class needs, as chosen on development data; see
            `least_share`.

    Example:
        >>> import numpy as np
        >>> import xosc_toolchain as xt
        >>> from recognition import Config
        >>> random, labels = np.random.default_rng(0), np.repeat([1, 2, 3], 60)
        >>> centres = 8.0 * np.eye(4)[labels]
        >>> first, second = (random.normal(centres) for _ in range(2))
        >>> model = xt.TRFE(Config(delta=0.05, trees=50)).fit(first, labels, second, labels)
        >>> recognised = model.recognise(8.0 * np.eye(4)[[1, 2, 0]])
        >>> recognised.labels.tolist()
        [1, 2, 0]
    """

    def __init__(
        self,
        config: Config | None = None,
        encoders: Sequence[Encoder | StoredEncoder] = (),
        known: KnownClasses | None = None,
        steps: Steps | None = None,
    ) -> None:
        self.config = config or Config()
        self.encoders = tuple(encoders)
        self.steps = steps or Steps()
        self.buffer = Buffer(self.config.preprocessing.capacity)
        self.unseen_sites: tuple[float, float] | None = None
        self.least: dict[int, float] = {}
        self._known = known

    @property
    def known(self) -> KnownClasses:
        """The known classes and what was learnt of them.

        Raises:
            UsageError: nothing has been learnt yet.
        """
        if self._known is None:
            raise UsageError("this model has not been fitted yet")
        return self._known

    def fit(
        self,
        inputs: ArrayLike,
        labels: ArrayLike,
        calibration: ArrayLike,
        calibration_labels: ArrayLike,
    ) -> Self:
        """Learn the known classes.

        Args:
            inputs, labels: windows or features (n, …) to fit the forest on, and their classes (n,).
            calibration, calibration_labels: other samples of the same classes, best of other
                recordings, to calibrate the screening on.

        Raises:
            UsageError: fewer than two classes, classes that differ between the two sets, or
                features that are not finite.
        """
        fitted, calibrating = (
            labelled(self.encode(inputs), labels),
            labelled(self.encode(calibration), calibration_labels),
        )
        self._known = learn(fitted, calibrating, self.config, self.steps)
        return self

    def encode(self, inputs: ArrayLike) -> Features:
        """Features (n, d) of windows (n, ...): what changes in them, where the model looks at it,
        and what the encoders read.

        Features stay as they are.

        Raises:
            UsageError: neither, or windows without encoders.
        """
        table = np.asarray(inputs)
        if table.ndim == 2:
            return matrix(table)
        if not self.encoders:
            raise UsageError("this model has no encoder: it takes features, not windows")
        encoded = features_of(self.encoders, table)
        return matrix(
            np.concatenate([changes(table), encoded], axis=1) if self.config.changes else encoded
        )

    def recognise(self, inputs: ArrayLike) -> Recognition:
        """The known class of each sample (n, …), windows or features, or that it
        is unknown, or nothing.
        """
        features, known = self.encode(inputs), self.known
        seen = self.config.recognising(features)
        votes = known.forest.vote(seen)
        closed, most = known.classes[votes.counts.argmax(axis=1)], votes.counts.max(axis=1)
        score, threshold = self._score(seen, votes)
        share = most / np.maximum(votes.counts.sum(axis=1), 1)
        labels = np.where(score <= threshold, closed, UNKNOWN)
        # Below its least share a label is no better than chance on sites not seen: background, not
        # unknown, or discovery would be fed with it.
        needed = np.array([self.least_share(label) for label in labels.tolist()])
        chance = (
            most < self.config.trees / len(known.classes)
            if self.least
            else np.zeros(len(most), bool)
        )
        labels = np.where((labels != UNKNOWN) & ((share < needed) | chance), BACKGROUND, labels)
        return Recognition(labels, most / self.config.trees, score, closed, features, share)

    def least_share(self, label: int) -> float:
        """Return the least share of the votes for classes that a class needs; with less, a sample
        is taken for `BACKGROUND`.

        A class that no development data has an optimum for needs the median of the others' shares.
        Discovered classes need none. Besides, a class of a model with least shares needs as many of
        all trees as chance gives: one by the number of classes.
        """
        if (
            label in self.least
            or not self.least
            or label in (BACKGROUND, UNKNOWN)
            or label >= FIRST_DISCOVERED
        ):
            return self.least.get(label, 0.0)
        return float(np.median(list(self.least.values())))

    def _score(self, features: Features, votes: Votes) -> tuple[FloatArray, float]:
        """Outlyingness (n,) of samples, and the threshold above which they are unknown."""
        screening = self.known.screening
        return screening.score(*votes), screening.threshold

    def observe(self, inputs: ArrayLike, keys: ArrayLike) -> Recognition:
        """Recognise samples (n, …) and put the unknown ones into the buffer, under their keys (n,).

        Give a stream in parts smaller than the buffer, and `discover` when it is full: of what is
        more, the oldest are dropped.
        """
        found = self.recognise(inputs)
        unknown = found.labels == UNKNOWN
        self.buffer.add(found.features[unknown], np.asarray(keys)[unknown])
        return found

    def discover(self) -> Discovery:
        """Look for new classes in the buffer; neither the buffer nor what is known changes.

        Raises:
            UsageError: the buffer is empty, or holds no more samples than a sample must have
                neighbours.
        """
        return discover(self.known, self.buffer, self.config, self.steps)

    def expand(self, discovery: Discovery) -> None:
        """Take promoted clusters as known classes: they leave the buffer, and forest, screening and
        prototypes are made anew.

        δ stays what it is: to choose it again would take a forest for each class.
        """
        promoted = discovery.labels != UNKNOWN
        if not promoted.any():
            return
        features, labels = discovery.features[promoted], discovery.labels[promoted]
        # Samples that fit the forest look more certain to it than new ones: others calibrate.
        calibrates = share_of_each(labels, self.config.seed)
        fitted, calibrating = (
            Labelled(features[chosen], labels[chosen]) for chosen in (~calibrates, calibrates)
        )
        known, config = self.known, self.config
        # The threshold was chosen by leaving each class out, which takes a forest for each.
        if isinstance(known.screening, EvtScreening):
            config = replace(config, delta=known.screening.delta)
        self._known = learn(
            known.fitted.joined(fitted), known.calibrating.joined(calibrating), config, self.steps
        )
        self.buffer.remove(np.isin(self.buffer.keys, discovery.keys[promoted]))


def share_of_each(labels: IntArray, seed: int) -> BoolArray:
    """Mask (n,) of the promoted samples that calibrate: a random share of each
    class, at least one.
    """
    chosen = np.zeros(len(labels), dtype=bool)
    random = np.random.default_rng(seed)
    for label in np.unique(labels):
        members = random.permutation(np.flatnonzero(labels == label))
        chosen[members[: int(np.ceil(_CALIBRATING * len(members)))]] = True
    return chosen


def features_of(
    encoders: Sequence[StoredEncoder | Encoder], windows: NDArray[np.floating[Any]]
) -> Features:
    """Features (n, dim) of windows, those of several encoders beside each other; of encoders that
    are being trained by torch.

    Raises:
        UsageError: windows of another shape.
    """
    stored = [one for one in encoders if isinstance(one, StoredEncoder)]
    if len(stored) == len(encoders):
        return np.concatenate([one.features(windows) for one in stored], axis=1)
    from recognition.trfe.encoder.storage import features

    return features([one for one in encoders if not isinstance(one, StoredEncoder)], windows)
