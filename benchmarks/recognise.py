"""Windows that a model recognises in a second of one processor, and what it is spent on.

    python benchmarks/recognise.py RECORDINGS [--model DIR] [--windows 4096] [--cache DIR]

Windows of the recordings are drawn first, as the model reads them (kept in the cache). Times are of
the processor, all threads together: others' work does not count.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from recognition.catalogue.pipeline import SHIPPED
from recognition.trfe.storage import load
from recognition.trfe.training.windows import windows_at

_REPEATS = 3


def main() -> None:
    """Print speeds."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("recordings", type=Path, help="folder of recordings or of windows")
    arguments.add_argument("--model", type=Path, default=SHIPPED)
    arguments.add_argument("--windows", type=int, default=4096)
    arguments.add_argument(
        "--cache", type=Path, default=Path("windows"), help="folder for the windows that are made"
    )
    options = arguments.parse_args()
    start = time.process_time()
    model = load(options.model)
    print(f"model read in {time.process_time() - start:.1f} s")
    inputs = windows_at(options.recordings, options.cache, model.encoders[0].view, 2600).inputs
    chosen = np.ascontiguousarray(
        inputs[np.linspace(0, len(inputs) - 1, options.windows).astype(int)]
    )

    whole, encoding = _speed(model.recognise, chosen), _speed(model.encode, chosen)
    print(f"recognised: {whole:.0f} windows/s")
    print(
        f"encoded by {len(model.encoders)} encoders: {encoding:.0f}/s, {whole / encoding:.0%} of "
        "the time of recognition"
    )


def _speed(function: Callable[[np.ndarray], object], inputs: np.ndarray) -> float:
    """Windows in a second of processor time, the fastest of three times."""
    times = []
    for _ in range(_REPEATS):
        start = time.process_time()
        function(inputs)
        times.append(time.process_time() - start)
    return len(inputs) / min(times)


if __name__ == "__main__":
    main()
