"""Open-set recognition in one round: every method on the same features, judged on the same test windows."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from recognition.study import metrics
from recognition.study.baselines.arpl import ARPL
from recognition.study.baselines.cac import CAC
from recognition.study.baselines.cevt import CEVT
from recognition.study.baselines.chance import Chance
from recognition.study.baselines.cpn import CPN
from recognition.study.baselines.knn import KNN
from recognition.study.baselines.mdenet import MDENet
from recognition.study.baselines.method import OpenSetMethod
from recognition.study.baselines.mls import MLS
from recognition.study.baselines.vote_threshold import PlainThreshold
from recognition.study.baselines.voting import VotingMethod
from recognition.study.protocol.stage import Stage
from recognition.trfe.samples import UNKNOWN, Features
from recognition.trfe.screening import EvtDeficit, EvtJoint, EvtPooled, Screening
from xodr.array_types import FloatArray, IntArray

OWN_RULE = "trfe"
"""The one method with a rejection rule of its own: δ chosen by leaving one known class out."""
ONLY_TUNED = "trfe-tuned"
"""TRFE's screening under the common rule, on features of the fine-tuned encoder alone."""


class ReadingA(VotingMethod):
    """Reading A of the plain votes (`recognition.trfe.screening.evt_deficit`) under the common rejection rule."""

    def _screening(self) -> Screening:
        return EvtDeficit(seed=self.seed)


class PooledScreening(VotingMethod):
    """TRFE's own voters, and votes alone (`recognition.trfe.screening.evt_pooled`), under the common rejection rule."""

    background = neighbours = True

    def _screening(self) -> Screening:
        return EvtPooled(seed=self.seed)


class JointScreening(PooledScreening):
    """TRFE's own voters and screening (`recognition.trfe.screening.evt_joint`) under the common rejection rule."""

    def _screening(self) -> Screening:
        return EvtJoint(seed=self.seed)


COMMON_RULE: dict[str, type[OpenSetMethod]] = {
    "trfe-common": JointScreening,
    ONLY_TUNED: JointScreening,
    "pooled": PooledScreening,
    "reading-a": ReadingA,
    "cac": CAC,
    "arpl": ARPL,
    "cpn": CPN,
    "cevt": CEVT,
    "mdenet": MDENet,
    "mls": MLS,
    "threshold": PlainThreshold,
    "knn": KNN,
    "random": Chance,
}
"""Methods that reject by the common rule, by name."""


class Judged(NamedTuple):
    """Test samples as a method sees them: best known class, outlyingness and label (n,), and the threshold behind the labels."""

    closed: IntArray
    scores: FloatArray
    predicted: IntArray
    threshold: float


def measure_open_set(name: str, stage: Stage) -> dict[str, Any]:
    """Fit a method on the known classes of a stage and measure it on known and new ones.

    Returns:
        The fields of `metrics.OpenSet`, the threshold, and the confusion matrix: `[truth, prediction, windows]` for each pair
        that occurs, with 0 for unknown.
    """
    found = _own_rule(stage) if name == OWN_RULE else _common_rule(name, stage)
    pairs, counts = np.unique(np.stack([stage.truth, found.predicted]), axis=1, return_counts=True)
    return {
        **metrics.open_set(stage.truth, found.closed, found.scores, found.predicted)._asdict(),
        "threshold": found.threshold,
        "confusion": [[*map(int, pair), int(count)] for pair, count in zip(pairs.T, counts, strict=True)],
    }


def _own_rule(stage: Stage) -> Judged:
    found = stage.model.recognise(stage.test.features)
    screening = stage.model.known.screening
    return Judged(found.closed, found.score, found.labels, screening.threshold if screening else 1.0)


def _common_rule(name: str, stage: Stage) -> Judged:
    if name == ONLY_TUNED:
        stage = stage.only_tuned
    fitted, held, tested = stage.labelled, stage.validation, stage.test.features
    model = _unfitted(COMMON_RULE[name], stage).fit(fitted.features, fitted.labels, held.features, held.labels)
    return judged(model, tested)


def judged(model: OpenSetMethod, features: Features) -> Judged:
    """What a fitted method makes of samples; `predict` would classify and score them once more."""
    closed, scores = model.classify(features), model.score(features)
    return Judged(closed, scores, np.where(scores > model.threshold, UNKNOWN, closed), model.threshold)


def _unfitted(kind: type[OpenSetMethod], stage: Stage) -> OpenSetMethod:
    """A method of that kind; those that vote share the forests of the stage."""
    if issubclass(kind, VotingMethod):
        return kind(stage.seed, voters=stage.model.known.voters if kind.background else stage.plain_voters)
    return kind(stage.seed)
