"""TRFE whose encoder learns on: together with the heads of a discovery, and again from its
checkpoint with promoted classes.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike
from torch import Tensor, nn

from recognition.trfe.config import Config, Steps, Task, fixed_pairs, likely_clusters
from recognition.trfe.discovery.candidates import sift
from recognition.trfe.discovery.clustering import NovelHead, cluster, k_means_head, random_head
from recognition.trfe.encoder.training import device, mixed
from recognition.trfe.forest.known import Discovery, Labelled, discover, learn
from recognition.trfe.forest.screening import EvtScreening
from recognition.trfe.inputs.samples import UNKNOWN, Features, matrix
from recognition.trfe.trfe import TRFE, share_of_each
from schemas.common.array_types import IntArray

if TYPE_CHECKING:
    from recognition.trfe.encoder.model import Encoder
    from studies.recognition.protocol.trials import Trial

_EPOCHS, _RAMP, _RATE = 30, 15, 3e-4
"""Of training with the encoder: a fifth of those of heads on frozen features, as
each moves far more weights.
"""


class Learns(NamedTuple):
    """Learning of the encoder after its supervised training.

    Attributes:
        jointly: the losses of a discovery train it too.
        again: it is fine-tuned from its checkpoint to the labelled and the promoted classes, and
            the forest, the screening and the prototypes are fitted to its new features.
        all_candidates: the novel head has all candidates, untrained; else one for each likely
            cluster, as TRFE's.
    """

    jointly: bool = False
    again: bool = False
    all_candidates: bool = False


class LearningTRFE(TRFE):
    """TRFE that takes numbers of windows (n, 1) for samples and looks their
    features up, as these change.

    Args:
        config, steps: of TRFE.
        trial: has the windows, their first features, and the encoder of its round.
        learns: what trains the encoder.
    """

    def __init__(self, config: Config, steps: Steps, trial: Trial, learns: Learns) -> None:
        super().__init__(config, steps=steps)
        self.trial, self.learns = trial, learns
        self.features = trial.features
        self.encoder: Encoder = trial.encoder
        self._fitted: IntArray = np.zeros(0, np.int64)
        self._calibrating: IntArray = np.zeros(0, np.int64)

    def fit(
        self,
        inputs: ArrayLike,
        labels: ArrayLike,
        calibration: ArrayLike,
        calibration_labels: ArrayLike,
    ) -> Self:
        """Learn the known classes, see `TRFE.fit`."""
        self._fitted, self._calibrating = _rows(inputs), _rows(calibration)
        return super().fit(inputs, labels, calibration, calibration_labels)

    def encode(self, inputs: ArrayLike) -> Features:
        """Features (n, d) of the windows with these numbers (n, 1), by the encoder as it is now."""
        return matrix(self.features[_rows(inputs)])

    def discover(self) -> Discovery:
        """Look for new classes in the buffer, see `TRFE.discover`; the encoder
        learns with a copy of itself.
        """
        if not self.learns.jointly or self.buffer.inputs is None:
            return super().discover()
        seen = self.config.recognising(matrix(self.buffer.inputs))
        kept = sift(seen, self.known.prototypes, self.config.preprocessing).kept
        rows = self.buffer.keys[kept]
        steps = replace(self.steps, cluster=lambda task, config: self._cluster(rows, task, config))
        return discover(self.known, self.buffer, self.config, steps)

    def _cluster(self, rows: IntArray, task: Task, config: Config) -> IntArray:
        """Cluster (n,) of the windows with these numbers, by heads that train
        the encoder beneath them too.
        """
        inputs = self.trial.windows.inputs
        backbone = _Elsewhere(deepcopy(self.encoder))
        settings = replace(config.clustering, epochs=_EPOCHS, ramp=_RAMP, rate=_RATE)
        return cluster(
            backbone,
            inputs[rows],
            inputs[self._fitted],
            task.labels,
            fixed_pairs(task, config),
            self._novel_head(task, config),
            settings,
            config.seed,
            backbone.augmented,
        ).assignment

    def _novel_head(self, task: Task, config: Config) -> NovelHead:
        if self.learns.all_candidates:
            return lambda features, _: random_head(features, config.clustering.candidates)
        count = likely_clusters(task, config)
        return lambda features, seed: k_means_head(features, count, seed)

    def expand(self, discovery: Discovery) -> None:
        """Take promoted clusters as known classes, see `TRFE.expand`."""
        promoted = discovery.labels != UNKNOWN
        if not promoted.any():
            return
        super().expand(discovery)
        rows, labels = discovery.keys[promoted], discovery.labels[promoted]
        calibrates = share_of_each(labels, self.config.seed)
        self._fitted = np.concatenate([self._fitted, rows[~calibrates]])
        self._calibrating = np.concatenate([self._calibrating, rows[calibrates]])
        if self.learns.again:
            self._tune_again()

    def _tune_again(self) -> None:
        """Fine-tune the encoder from its checkpoint, and fit all that reads its features anew."""
        known, config = self.known, self.config
        self.encoder, encoded = self.trial.tuned_again(
            self.encoder, self._fitted, known.fitted.labels
        )
        self.features = self.features.copy()
        self.features[:, self.trial.changes + self.trial.tuned :] = encoded
        if isinstance(known.screening, EvtScreening):
            config = replace(config, delta=known.screening.delta)
        fitted, calibrating = (
            Labelled(matrix(self.features[rows]), of.labels)
            for rows, of in (
                (self._fitted, known.fitted),
                (self._calibrating, known.calibrating),
            )
        )
        self._known = learn(fitted, calibrating, config, self.steps)
        self.buffer.inputs = matrix(self.features[self.buffer.keys])


class _Elsewhere(nn.Module):
    """An encoder on its device, for heads and windows on the processor."""

    def __init__(self, encoder: Encoder) -> None:
        super().__init__()
        self.where = device()
        self.encoder = encoder.to(self.where)

    def forward(self, windows: Tensor) -> Tensor:
        """Features (n, dim) of windows, on the processor."""
        with mixed(self.where):
            encoded: Tensor = self.encoder(windows.to(self.where))
        return encoded.float().cpu()

    def augmented(self, windows: Tensor) -> Tensor:
        """See `Encoder.augmented`; on the encoder's device."""
        return self.encoder.augmented(windows.to(self.where))


def _rows(inputs: ArrayLike) -> IntArray:
    return np.asarray(inputs)[:, 0].astype(np.int64)
