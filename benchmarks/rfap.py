"""Cost of the RFAP similarity: how it grows with the samples, against a double loop over pairs, and
how fast votes are counted.

    python benchmarks/rfap.py [--trees 250] [--width 128] [--classes 14]

Features are made up: noisy clouds of as many classes, so that trees are deep. Times are the
processor's, of one thread.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from sklearn.ensemble import RandomForestClassifier

from recognition.trfe.forest import random_trees, similarity
from recognition.trfe.forest.trees import Trees
from recognition.trfe.inputs.samples import Features
from schemas.common.array_types import IntArray

SIZES = (250, 500, 1000, 2000, 4000)
NAIVE = 150
"""Samples for the double loop, which takes time with their square."""
FITTED = 6000


def main() -> None:
    """Print the table."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("--trees", type=int, default=250)
    arguments.add_argument("--width", type=int, default=128, help="dimensions of the features")
    arguments.add_argument("--classes", type=int, default=14)
    options = arguments.parse_args()
    features, labels = _clouds(FITTED + max(SIZES), options.width, options.classes)
    fitted = RandomForestClassifier(options.trees, random_state=0, n_jobs=-1)
    fitted.fit(features[:FITTED], labels[:FITTED])
    grown = Trees.of(fitted)
    held = features[FITTED:]
    nodes = len(grown.feature) / options.trees
    print(f"{options.trees} trees of {nodes:.0f} nodes on average, {options.width} dimensions")
    spent = _time(lambda: grown.votes(held))
    print(f"votes        {len(held):>5} samples  {spent:7.2f} s  {len(held) / spent:.0f} samples/s")
    for name, trees in (
        ("supervised", grown),
        ("unsupervised", random_trees(held[:2000], options.trees)),
    ):
        for size in SIZES:
            spent = _time(lambda trees=trees, size=size: similarity(trees, held[:size]))
            print(
                f"{name:<12} {size:>5} samples  {spent:7.2f} s  "
                f"{1e9 * spent / size**2 / options.trees:.2f} ns a pair and tree"
            )
    spent, loop = (
        _time(lambda: similarity(grown, held[:NAIVE])),
        _time(lambda: _naive(fitted, held[:NAIVE])),
    )
    print(
        f"double loop  {NAIVE:>5} samples  {loop:7.2f} s  {loop / spent:.0f} times the time of ours"
    )


def _clouds(count: int, width: int, classes: int) -> tuple[Features, IntArray]:
    generator = np.random.default_rng(0)
    labels = generator.integers(1, classes + 1, count)
    centres = generator.standard_normal((classes + 1, width))
    return (0.5 * centres[labels] + generator.standard_normal((count, width))).astype(
        np.float32
    ), labels


def _time(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def _naive(grown: RandomForestClassifier, features: Features) -> None:
    total = np.zeros((len(features), len(features)))
    for tree in grown.estimators_:
        paths = [set(row.indices.tolist()) for row in tree.decision_path(features)]
        for i, one in enumerate(paths):
            for j, other in enumerate(paths):
                total[i, j] += len(one & other) / len(one | other)


if __name__ == "__main__":
    main()
