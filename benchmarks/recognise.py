"""Windows that a model recognises in a second, and what they are spent on.

    python benchmarks/recognise.py RECORDINGS [--model DIR] [--windows 4096] [--cache DIR]

Windows of the recordings are rasterised first (kept in the cache). Beside the model: a convolution of the same windows by the
first layer of ResNet (7 × 7, stride 2, 64 channels), in the same arithmetic.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from recognition.catalogue.pipeline import SHIPPED
from recognition.encoder.training import deterministic, mixed
from recognition.grids import Grid
from recognition.training.data import windows_at
from recognition.trfe.storage import load

_REPEATS = 3


def main() -> None:
    """Print speeds."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("recordings", type=Path, help="folder of recordings or of windows")
    arguments.add_argument("--model", type=Path, default=SHIPPED)
    arguments.add_argument("--windows", type=int, default=4096)
    arguments.add_argument("--cache", type=Path, default=Path("windows"), help="folder for the windows that are made")
    options = arguments.parse_args()
    start = time.perf_counter()
    model = load(options.model)
    print(f"model read in {time.perf_counter() - start:.1f} s")
    grids = windows_at(options.recordings, options.cache, Grid(), 2600).grids
    chosen = np.ascontiguousarray(grids[np.linspace(0, len(grids) - 1, options.windows).astype(int)])

    whole, encoding = _speed(model.recognise, chosen), _speed(model.encode, chosen)
    plain = _speed(_resnet_stem, chosen)
    print(f"recognised: {whole:.0f} windows/s, {plain / whole:.1f} times as long as the convolution ({plain:.0f}/s)")
    print(f"encoded by {len(model.encoders)} encoders: {encoding:.0f}/s, {whole / encoding:.0%} of the time of recognition")


def _speed(function: Callable[[np.ndarray], object], grids: np.ndarray) -> float:
    """Windows in a second, the fastest of three times."""
    times = []
    for _ in range(_REPEATS):
        start = time.perf_counter()
        function(grids)
        times.append(time.perf_counter() - start)
    return len(grids) / min(times)


def _resnet_stem(grids: np.ndarray) -> None:
    layer = torch.nn.Conv2d(int(np.prod(grids.shape[1:3])), 64, 7, stride=2, padding=3)
    with deterministic(0), torch.inference_mode(), mixed(torch.device("cpu")):
        for start in range(0, len(grids), 64):
            layer(torch.from_numpy(grids[start : start + 64]).flatten(1, 2).float())


if __name__ == "__main__":
    main()
