"""Features and classes of many windows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from recognition.encoder.model import Encoder
from recognition.encoder.training import deterministic, mixed
from recognition.training.views import Inputs
from recognition.training.windows import Windows

_BATCH = 64
"""Windows at a time: as many as stay in the processor's cache."""


def features(encoders: Encoder | Sequence[Encoder], windows: Windows | Inputs) -> NDArray[np.float32]:
    """Features (n, dim) of windows or of their inputs; those of several encoders beside each other.

    Raises:
        UsageError: they have another shape than an encoder's.
    """
    chosen = [encoders] if isinstance(encoders, Encoder) else encoders
    return _applied(chosen, chosen, windows, sum(one.architecture.dim for one in chosen))


def logits(encoder: Encoder, windows: Windows | Inputs) -> NDArray[np.float32]:
    """Logits (n, classes) of a fine-tuned encoder; columns in the order of `encoder.classes`.

    Raises:
        UsageError: they have another shape than the encoder's, or it has no class head.
    """
    return _applied([encoder], [encoder.logits], windows, len(encoder.classes))


def _applied(
    encoders: Sequence[Encoder],
    functions: Sequence[Callable[[Tensor], Tensor]],
    windows: Windows | Inputs,
    columns: int,
) -> NDArray[np.float32]:
    """What the functions of encoders give (n, columns), beside each other.

    Threads take a batch each instead of sharing one: batches are too small to be divided well, and no sum depends on how many
    threads there are.
    """
    inputs = windows.inputs if isinstance(windows, Windows) else windows
    where = encoders[0].norm.weight.device
    found = np.empty((len(inputs), columns), np.float32)
    for encoder in encoders:
        encoder.eval()

    def apply(start: int) -> None:
        part = inputs[start : start + _BATCH]
        with torch.inference_mode(), mixed(where):
            batch = torch.from_numpy(part if part.flags.writeable else part.copy()).to(where)
            found[start : start + _BATCH] = torch.cat([function(batch).float() for function in functions], dim=1).cpu().numpy()

    with deterministic(0), ThreadPoolExecutor(torch.get_num_threads(), initializer=torch.set_num_threads, initargs=(1,)) as pool:
        list(pool.map(apply, range(0, len(inputs), _BATCH)))
    return found
