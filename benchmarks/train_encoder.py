"""Training of the encoder: time for as many windows as the paper has, accuracy, and what is
confused with what.

    python benchmarks/train_encoder.py RECORDINGS [--preset cpu] [--events 2600] [--cache DIR]
    [--objectives order barlow]

Recordings are labelled and rasterised first (kept in the cache), and split by recording; figures
are those of the test part.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from recognition.labels import Label
from recognition.trfe.encoder.config import PRESETS
from recognition.trfe.encoder.storage import features, logits
from recognition.trfe.encoder.training import GRID_OBJECTIVES, finetune, pretrain
from recognition.trfe.inputs.grids import Grid
from recognition.trfe.training.windows import split, windows_at
from schemas.common.array_types import IntArray
from studies.recognition.experiments.probe import probe, speed_code

PAPER = 43_800


def main() -> None:
    """Print times, accuracies, probes and confusions."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("recordings", type=Path, help="folder of recordings or of windows")
    arguments.add_argument("--preset", choices=PRESETS, default="cpu")
    arguments.add_argument("--events", type=int, default=2600, help="of each class, at most")
    arguments.add_argument(
        "--cache", type=Path, default=Path("windows"), help="folder for the windows that are made"
    )
    arguments.add_argument(
        "--objectives", nargs="*", default=list(GRID_OBJECTIVES), help="of the pretraining"
    )
    arguments.add_argument("--seed", type=int, default=0)
    options = arguments.parse_args()
    preset, grid = PRESETS[options.preset], Grid()
    windows = windows_at(options.recordings, options.cache, grid, options.events)
    parts = split(windows, options.seed, events_per_class=options.events)
    known, test = (
        windows.select(np.sort(np.append(parts.labelled, parts.stream))),
        windows.select(parts.test),
    )

    start = time.perf_counter()
    bare = pretrain(known, preset, grid, options.seed, options.objectives, _said("pretraining"))
    pretrained = time.perf_counter()
    encoder = finetune(bare, known, preset.finetuning, options.seed, _said("fine-tuning"))
    tuned = time.perf_counter()
    codes = features(encoder, test)
    speed = len(test) / (time.perf_counter() - tuned)
    scale = PAPER / len(known)
    print(f"{len(known)} windows to train with; times are for {PAPER}")
    print(
        f"pretraining {scale * (pretrained - start):.0f} s, fine-tuning "
        f"{scale * (tuned - pretrained):.0f} s"
    )
    print(f"features of {speed:.0f} windows/s")

    found = np.array(encoder.classes)[logits(encoder, test).argmax(axis=1)]
    _confusion(test.labels, found)
    for name, one, other in (
        ("speed", speed_code(known.inputs, grid), speed_code(test.inputs, grid)),
        ("pretrained features", features(bare, known), features(bare, test)),
        ("fine-tuned features", features(encoder, known), codes),
    ):
        print(f"linear probe on {name:<20}{probe(one, known.labels, other, test.labels):>7.3f}")


def _said(what: str):
    return lambda epoch, loss: print(f"{what}: epoch {epoch}, loss {loss:.3f}", flush=True)


def _confusion(truth: IntArray, found: IntArray) -> None:
    print(f"accuracy {(truth == found).mean():.3f}")
    for label in np.unique(truth):
        mine = found[truth == label]
        wrong, counts = np.unique(mine[mine != label], return_counts=True)
        most = [f"{Label(wrong[k]).title} {counts[k]}" for k in counts.argsort()[::-1][:3]]
        print(
            f"{label:>4} {Label(label).title:<28}{len(mine):>6}{(mine == label).mean():>7.3f}  "
            f"{', '.join(most)}"
        )


if __name__ == "__main__":
    main()
