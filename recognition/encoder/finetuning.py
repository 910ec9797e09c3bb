"""Supervised fine-tuning of an encoder, with a class head."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import torch
import torch.nn.functional as F

from recognition.encoder.config import Schedule
from recognition.encoder.model import Encoder
from recognition.encoder.training import Progress, deterministic, device, train
from recognition.training.windows import Windows
from schemas.errors import UsageError

_SMOOTHING = 0.05


def finetune(encoder: Encoder, windows: Windows, schedule: Schedule, seed: int, progress: Progress | None = None) -> Encoder:
    """A copy of the encoder, trained with a new head to tell the classes of the windows apart.

    Cross-entropy with label smoothing, over augmented windows; those of rare classes weigh more, by the root of how rare they
    are.

    Raises:
        UsageError: a window has no label, or there are too few.
    """
    if not len(windows) or (windows.labels <= 0).any():
        raise UsageError("fine-tuning needs windows that all have labels")
    classes, counts = np.unique(windows.labels, return_counts=True)
    truth = torch.from_numpy(np.searchsorted(classes, windows.labels))
    weights = torch.from_numpy(np.sqrt(counts.mean() / counts).astype(np.float32))
    with deterministic(seed):
        tuned = deepcopy(encoder)
        tuned.set_classes(classes.tolist())
        where = device()
        tuned.to(where)
        truth, weights = truth.to(where), weights.to(where)

        def loss(inputs: torch.Tensor, chosen: torch.Tensor) -> torch.Tensor:
            logits = tuned.logits(tuned.augmented(inputs)).float()
            return F.cross_entropy(logits, truth[chosen.to(where)], weights, label_smoothing=_SMOOTHING)

        train(tuned, windows.inputs, schedule, loss, progress)
    return tuned
