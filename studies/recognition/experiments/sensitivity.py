"""Sensitivity of the open-set figures to δ and to the number of trees T, and the content of the
features."""

from __future__ import annotations

from typing import Any

import numpy as np

from recognition.trfe.inputs.grids import Grid
from recognition.trfe.inputs.samples import UNKNOWN
from recognition.trfe.training.windows import View
from studies.recognition import metrics
from studies.recognition.baselines.open_set.voting import VotingMethod
from studies.recognition.experiments.open_set import judged
from studies.recognition.experiments.probe import probe, speed_code
from studies.recognition.protocol.trials import Trial

DELTAS = (0.001, 0.003, 0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3)
TREES = (25, 50, 100, 150, 200, 250, 400)


def measure_delta(trial: Trial) -> dict[str, Any]:
    """Open-set figures of TRFE's screening for each of `DELTAS`: `points`, each
    with its `value`.
    """
    found, truth = trial.model.recognise(trial.test.features), trial.truth
    labels = [np.where(found.score > 1.0 - delta, UNKNOWN, found.closed) for delta in DELTAS]
    return {
        "points": [
            {
                "value": delta,
                **metrics.open_set(truth, found.closed, found.score, predicted)._asdict(),
            }
            for delta, predicted in zip(DELTAS, labels, strict=True)
        ]
    }


def measure_trees(trial: Trial) -> dict[str, Any]:
    """The same under the common rejection rule for each of `TREES`."""
    fitted, held, tested = trial.labelled, trial.validation, trial.test.features
    points = []
    for trees in TREES:
        model = VotingMethod(trial.seed, trees=trees).fit(
            fitted.features, fitted.labels, held.features, held.labels
        )
        found = judged(model, tested)
        figures = metrics.open_set(trial.truth, found.closed, found.scores, found.predicted)
        points.append({"value": trees, **figures._asdict()})
    return {"points": points}


def measure_probe(trial: Trial, view: View) -> dict[str, Any]:
    """Mean accuracy over the known and new classes of a linear probe: of the encoder's features,
    and of the ego's speed alone.

    The speed is left out where the windows are no grids with a channel for it.
    """
    trial = trial.only_encoded
    training = np.concatenate([trial.labelled.rows, trial.stream.rows])
    labels, tested = trial.windows.labels[training], trial.test
    found = {"features": probe(trial.features[training], labels, tested.features, tested.labels)}
    if isinstance(view, Grid) and "speed" in view.channels:
        fitted, judged = (
            speed_code(trial.windows.inputs[rows], view) for rows in (training, tested.rows)
        )
        found["speed"] = probe(fitted, labels, judged, tested.labels)
    return found
