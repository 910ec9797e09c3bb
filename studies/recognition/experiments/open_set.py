"""Open-set recognition in one round: every method on the same features, judged on the same test
windows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from recognition.trfe.encoder.config import TrainingSchedule
from recognition.trfe.inputs.samples import UNKNOWN, Features
from schemas.common.array_types import FloatArray, IntArray
from studies.recognition import kinds, metrics
from studies.recognition.baselines.end_to_end import EndToEnd
from studies.recognition.baselines.open_set.heads import HeadMethod
from studies.recognition.baselines.open_set.method import OpenSetMethod
from studies.recognition.baselines.open_set.voting import VotingMethod
from studies.recognition.protocol.trials import Trial, long_enough

COMMON = "trfe"
"""TRFE's forest and screening under the common rejection rule, as all others are."""
OWN_RULE = "trfe-own-rule"
"""Method with a rejection rule of its own: δ chosen by leaving one known class out."""
ONLY_ENCODED = "encoded"
"""TRFE on the encoders' features alone."""
ONLY_TUNED = "trfe-tuned"
"""TRFE on features of the fine-tuned encoder alone."""
ONLY_CHANGES = "only-changes"
"""TRFE on what changes in windows alone, without an encoder: tokens only."""
WITHOUT_ROLES = "without-roles"
"""The same without the roles of lanes, by which classes are defined: tokens only."""
MAP_ONLY = "map-only"
"""TRFE on what the map alone tells of one frame, without traffic: tokens only."""
ON_ALL, ENCODED_ON_ALL = "pretrained-on-all", "encoded-pretrained-on-all"
"""TRFE on all and on the encoders' features alone, by encoders whose pretraining saw windows of all
classes: tokens only."""


class Together(NamedTuple):
    """A method whose head and encoder learn together, see `EndToEnd`.

    Attributes:
        frozen: name of the method with the same head on frozen features.
        rate, steps: greatest learning rate and number of steps, chosen on development seeds 0
            and 1.
    """

    frozen: str
    rate: float
    steps: int


PLAIN = {"logistic-changes": "logistic", "logistic-without-roles": "logistic", "knn-changes": "knn"}
"""Methods on what changes in windows alone, or on that without the roles of lanes, by name, with
those of their kinds: tokens only."""
END_TO_END = {
    "mls-end-to-end": Together("mls", 5e-4, 100),
    "cac-end-to-end": Together("cac", 1.5e-3, 300),
}
"""Methods whose heads train the encoder too, by name: tokens only."""
_BATCH = 96
"""Windows in a step of these."""
_FEATURES: dict[str, Callable[[Trial], Trial]] = {
    ONLY_ENCODED: lambda trial: trial.only_encoded,
    ONLY_TUNED: lambda trial: trial.only_tuned,
    ONLY_CHANGES: lambda trial: trial.only_changes,
    WITHOUT_ROLES: lambda trial: trial.without_roles,
    "logistic-changes": lambda trial: trial.only_changes,
    "logistic-without-roles": lambda trial: trial.without_roles,
    "knn-changes": lambda trial: trial.only_changes,
    MAP_ONLY: lambda trial: trial.map_only,
    ON_ALL: lambda trial: trial.pretrained_on_all,
    ENCODED_ON_ALL: lambda trial: trial.pretrained_on_all.only_encoded,
}
"""Other features than all, by name of the method that looks at them."""
TITLES = {
    COMMON: "**TRFE**",
    OWN_RULE: "TRFE, its own δ",
    ONLY_ENCODED: "TRFE, encoders' features alone",
    ONLY_TUNED: "TRFE, features after fine-tuning alone",
    ONLY_CHANGES: "TRFE, what changes alone",
    WITHOUT_ROLES: "TRFE, what changes without roles",
    "logistic-changes": "logistic regression, fifth neighbour: what changes alone",
    "logistic-without-roles": "logistic regression, fifth neighbour: what changes without roles",
    "knn-changes": "nearest neighbours: what changes alone",
    MAP_ONLY: "map only, one frame",
    ON_ALL: "TRFE, pretrained on all classes",
    ENCODED_ON_ALL: "TRFE, encoders' features alone, pretrained on all classes",
    **kinds.titles(kinds.SCREENINGS),
    **kinds.titles(kinds.OPEN_SET),
    **{
        name: f"{kinds.titles(kinds.OPEN_SET)[learnt.frozen]}, end to end"
        for name, learnt in END_TO_END.items()
    },
}
"""Methods by name, with the titles of their rows in the report."""


class Judged(NamedTuple):
    """Test samples as a method sees them: best known class, outlyingness and label (n,), and the
    threshold behind the labels."""

    closed: IntArray
    scores: FloatArray
    predicted: IntArray
    threshold: float


def measure_open_set(name: str, trial: Trial) -> dict[str, Any]:
    """Fit a method on the known classes of a trial and measure it on known and new ones.

    Returns:
        The fields of `metrics.OpenSet`, the threshold, and the confusion matrix: `[truth,
        prediction, windows]` for each pair
        that occurs, with 0 for unknown.
    """
    found = _own_rule(trial) if name == OWN_RULE else _common_rule(name, trial)
    pairs, counts = np.unique(np.stack([trial.truth, found.predicted]), axis=1, return_counts=True)
    return {
        **metrics.open_set(trial.truth, found.closed, found.scores, found.predicted)._asdict(),
        "threshold": found.threshold,
        "confusion": [
            [*map(int, pair), int(count)] for pair, count in zip(pairs.T, counts, strict=True)
        ],
    }


def _own_rule(trial: Trial) -> Judged:
    found = trial.model.recognise(trial.test.features)
    return Judged(found.closed, found.score, found.labels, trial.model.known.screening.threshold)


def _common_rule(name: str, trial: Trial) -> Judged:
    trial = seen_by(name, trial)
    fitted, held, tested = trial.labelled, trial.validation, trial.test.features
    model = _unfitted(name, trial).fit(fitted.features, fitted.labels, held.features, held.labels)
    return judged(model, tested)


def seen_by(name: str, trial: Trial) -> Trial:
    """The trial with the features that a method looks at."""
    if name in END_TO_END:
        return trial.beside_inputs
    return _FEATURES[name](trial) if name in _FEATURES else trial


def judged(model: OpenSetMethod, features: Features) -> Judged:
    """Return a fitted method's results for samples in one pass; `predict` would classify and score
    them again."""
    closed, scores = model.classify(features), model.score(features)
    return Judged(
        closed, scores, np.where(scores > model.threshold, UNKNOWN, closed), model.threshold
    )


def _unfitted(name: str, trial: Trial) -> OpenSetMethod:
    """A method by name; those that vote share the forests of the trial."""
    if name == COMMON or (name in _FEATURES and name not in PLAIN):
        return VotingMethod(trial.seed, forest=trial.forest)
    if name in kinds.titles(kinds.SCREENINGS):
        module = kinds.kind(kinds.SCREENINGS, name)
        forest = trial.plain_forest if module.PLAIN_VOTES else trial.forest
        return VotingMethod(trial.seed, module.SCREENING, forest=forest)
    if name in END_TO_END:
        return _end_to_end(END_TO_END[name], trial)
    method: OpenSetMethod = kinds.kind(kinds.OPEN_SET, PLAIN.get(name, name)).METHOD(trial.seed)
    return method


def _end_to_end(learnt: Together, trial: Trial) -> EndToEnd:
    head: HeadMethod = kinds.kind(kinds.OPEN_SET, learnt.frozen).METHOD(trial.seed)
    schedule = long_enough(
        TrainingSchedule(1, _BATCH, learnt.rate), len(trial.labelled.rows), learnt.steps
    )
    return EndToEnd(head, trial.pretrained, trial.changes + trial.tuned, schedule)
