"""The open world: known and new classes stream by; TRFE and its variants
recognise, set aside, discover and expand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from recognition.trfe.forest.screening import EvtJoint
from recognition.trfe.inputs.samples import UNKNOWN
from recognition.trfe.trfe import TRFE
from schemas.common.array_types import IntArray
from studies.recognition import metrics
from studies.recognition.ablations import VARIANTS, Variant
from studies.recognition.learning import LearningTRFE
from studies.recognition.protocol.rounds import Round
from studies.recognition.protocol.trials import Samples, Trial
from studies.recognition.recalibrated import Recalibrated

_PART = 50
"""Samples that arrive together."""


def measure_open_world(name: str, trial: Trial) -> dict[str, Any]:
    """One round from true labels of the known classes: what the stream's new classes become.

    δ is the trial's, chosen once for all variants of TRFE's own screening.

    Returns:
        See `follow`.
    """
    variant = VARIANTS[name]
    if variant.steps.screening in (EvtJoint, Recalibrated):
        variant = replace(variant, config=replace(variant.config, delta=trial.delta))
    return follow(begin(variant, trial), seen_by(variant, trial), {})


def measure_chain(name: str, first: Trial, rounds: Sequence[Round]) -> list[dict[str, Any]]:
    """All rounds of a seed on the model's own discoveries: only the classes
    known at first ever have true labels.

    The encoder is that of the first round throughout, and what remains in the buffer waits for the
    next round.

    Returns:
        For each round, see `follow`.
    """
    variant, names = VARIANTS[name], dict[int, int]()
    model, seen = begin(variant, first), seen_by(variant, first)
    return [follow(model, replace(seen, round=one), names) for one in rounds]


def seen_by(variant: Variant, trial: Trial) -> Trial:
    """The trial as the model of a variant takes it: numbers of windows where the
    encoder learns on.
    """
    return trial.numbered if variant.learns else trial


def begin(variant: Variant, trial: Trial) -> TRFE:
    """A model that knows the known classes of a trial."""
    config = replace(variant.config, seed=trial.seed, changes=trial.changes, pretrained=trial.tuned)
    model = (
        LearningTRFE(config, variant.steps, trial, variant.learns)
        if variant.learns
        else variant.model(config, steps=variant.steps)
    )
    seen = seen_by(variant, trial)
    held = seen.validation
    return model.fit(*seen.labelled[:2], held.features, held.labels)


def follow(model: TRFE, trial: Trial, names: dict[int, int]) -> dict[str, Any]:
    """Let the stream of a trial pass by a model; say how well its new classes were found, and how
    well it recognises after it.

    Args:
        names: true class of each class discovered so far; those matched in this round are added.

    Returns:
        The fields of `metrics.Clustering` over new samples and those put into classes discovered
        now; `mistaken`, the share of
        the other samples put there; and afterwards, on test windows of all classes so far,
        `macro_f1` over the true classes,
        discovered ones under their names, and `found`, the share of test windows of new classes
        that get a discovered class.
    """
    before = model.known.classes
    labels, truth = walk(model, trial.stream), trial.stream.labels
    is_new, discovered = np.isin(truth, trial.round.new), ~np.isin(labels, [UNKNOWN, *before])
    judged = is_new | discovered
    clusters = np.where(discovered, labels, metrics.DROPPED)
    agreement = metrics.clustering(truth[judged], clusters[judged], among=trial.round.new)
    names.update(agreement.matches)
    tested, of_new = (
        model.recognise(trial.test.features).labels,
        np.isin(trial.test.labels, trial.round.new),
    )
    return {
        **agreement._asdict(),
        "mistaken": float(np.mean(discovered[~is_new])) if (~is_new).any() else 0.0,
        "macro_f1": metrics.macro_f1(
            trial.test.labels, [names.get(label, label) for label in tested.tolist()]
        ),
        "found": float(np.mean(~np.isin(tested[of_new], [UNKNOWN, *before]))),
    }


def walk(model: TRFE, stream: Samples) -> IntArray:
    """Let a stream pass by a model, which discovers when its buffer is full, at most every half
    capacity, and at the end.

    Returns:
        Label (n,) that each sample got: a known class, a discovered one by promotion or later
        recognition, or 0.
    """
    labels = np.full(len(stream.rows), UNKNOWN, dtype=np.int64)
    capacity, fresh = model.buffer.capacity, 0
    for start in range(0, len(labels), _PART):
        part = slice(start, start + _PART)
        if len(model.buffer) + _PART > capacity and fresh >= capacity // 2:
            _discover(model, stream, labels)
            fresh = 0
        labels[part] = model.observe(stream.features[part], stream.rows[part]).labels
        screening = model.known.screening
        if isinstance(screening, Recalibrated):
            screening.recalibrate(*model.known.forest.vote(stream.features[part]))
        fresh += int(np.count_nonzero(labels[part] == UNKNOWN))
    _discover(model, stream, labels)
    return labels


def _discover(model: TRFE, stream: Samples, labels: IntArray) -> None:
    """A discovery, where the buffer holds enough; what is promoted gets its label."""
    if len(model.buffer) <= model.config.preprocessing.neighbours:
        return
    found = model.discover()
    of_key = dict(zip(found.keys.tolist(), found.labels.tolist(), strict=True))
    promoted = np.array([of_key.get(row, UNKNOWN) for row in stream.rows.tolist()])
    labels[promoted != UNKNOWN] = promoted[promoted != UNKNOWN]
    model.expand(found)
