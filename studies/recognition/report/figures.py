"""Figures of an evaluation: confusion, F1 by round, sensitivity, and where the classes lie among
the features."""

from __future__ import annotations

from pathlib import Path
from statistics import fmean, stdev
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from recognition.labels import Label
from studies.recognition.protocol.evaluation import EXPERIMENTS, Evaluation
from studies.recognition.protocol.trials import Trial
from studies.recognition.report.report import TITLES
from studies.recognition.report.tables import Results, results_of

_COLOURS = (
    "#c62828",
    "#ef6c00",
    "#1565c0",
    "#2e7d32",
    "#6a1b9a",
    "#00838f",
    "#5d4037",
    "#ad1457",
    "#827717",
    "#9e9e9e",
)
_PROJECTED = 1500
"""Windows in the projection, at most."""
_WORDS = {
    "macro_f1": "macro-F1",
    "auroc": "AUROC",
    "false_rejection": "false rejection",
    "accuracy": "ACC_cluster",
}


def write_figures(evaluation: Evaluation, folder: Path) -> list[Path]:
    """Write a PNG for everything there are results of; their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    store = evaluation.store
    open_set = results_of(store, "open-set", EXPERIMENTS["open-set"])
    clustering = results_of(store, "clustering", EXPERIMENTS["clustering"])
    sensitivity = results_of(store, "sensitivity", EXPERIMENTS["sensitivity"])
    drawn: dict[str, Figure] = {}
    if open_set:
        drawn["open-set-f1"] = _lines(
            open_set, TITLES["open-set"], "macro_f1", "macro-F1 (known classes and unknown)"
        )
    if clustering:
        drawn["clustering-accuracy"] = _lines(
            clustering, TITLES["clustering"], "accuracy", "Hungarian clustering accuracy"
        )
    if "trfe" in open_set:
        drawn["confusion"] = _confusions(open_set["trfe"])
    if sensitivity:
        drawn["sensitivity"] = _sensitivity(sensitivity)
    if open_set or clustering:
        seed = min(seed for seeds in (*open_set.values(), *clustering.values()) for seed in seeds)
        drawn["projection"] = _projection(evaluation.trial(seed, len(evaluation.rounds(seed))))
    paths = [folder / f"{name}.png" for name in drawn]
    for path, figure in zip(paths, drawn.values(), strict=True):
        figure.savefig(path, dpi=120, metadata={"Software": None})
    return paths


def _lines(results: Results, titles: dict[str, str], figure: str, label: str) -> Figure:
    """A line for each method over the rounds; bars are standard deviations over seeds."""
    canvas = Figure(figsize=(8, 5), layout="constrained")
    axes = canvas.add_subplot()
    numbers = sorted(
        {number for seeds in results.values() for rounds in seeds.values() for number in rounds}
    )
    for place, (name, seeds) in enumerate(results.items()):
        values = [
            [rounds[number][figure] for rounds in seeds.values() if number in rounds]
            for number in numbers
        ]
        aside = (place - len(results) / 2) * 0.02
        axes.errorbar(
            [number + aside for number in numbers],
            [fmean(of) if of else np.nan for of in values],
            [stdev(of) if len(of) > 1 else 0.0 for of in values],
            color=_COLOURS[place % len(_COLOURS)],
            linewidth=2.6 if name == "trfe" else 1.2,
            linestyle="--" if name in ("random", "vote-threshold", "mls", "kmeans") else "-",
            marker="o",
            markersize=4,
            capsize=2,
            label=titles[name].strip("*"),
        )
    axes.set_xticks(numbers)
    axes.set_xlabel("round")
    axes.set_ylabel(label)
    axes.set_ylim(0, 1)
    axes.grid(alpha=0.3)
    canvas.legend(loc="outside right upper", fontsize=8, frameon=False)
    return canvas


def _confusions(seeds: dict[int, dict[int, dict[str, Any]]]) -> Figure:
    """TRFE's confusion matrices of the first and the last round, rows normalised, summed over
    seeds."""
    last = max(number for rounds in seeds.values() for number in rounds)
    canvas = Figure(figsize=(14, 7), layout="constrained")
    for place, number in enumerate((1, last)):
        entries = [
            entry
            for rounds in seeds.values()
            for entry in rounds.get(number, {}).get("confusion", [])
        ]
        _matrix(canvas.add_subplot(1, 2, place + 1), entries, f"TRFE, round {number}")
    return canvas


def _matrix(axes: Axes, entries: list[list[int]], title: str) -> None:
    labels = sorted(
        {label for truth, predicted, _ in entries for label in (truth, predicted)},
        key=lambda label: label or 99,
    )
    place = {label: index for index, label in enumerate(labels)}
    counts = np.zeros((len(labels), len(labels)))
    for truth, predicted, count in entries:
        counts[place[truth], place[predicted]] += count
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    axes.imshow(shares, cmap="Blues", vmin=0, vmax=1)
    names = [Label(label).title if label else "unknown (new)" for label in labels]
    axes.set_xticks(range(len(labels)), names, rotation=90, fontsize=8)
    axes.set_yticks(range(len(labels)), names, fontsize=8)
    for row, column in np.argwhere(shares >= 0.005):
        dark = shares[row, column] > 0.5
        axes.text(
            column,
            row,
            f"{shares[row, column]:.2f}",
            ha="center",
            va="center",
            fontsize=7,
            color="w" if dark else "k",
        )
    axes.set_xlabel("recognised as")
    axes.set_ylabel("true class")
    axes.set_title(title)


def _sensitivity(results: Results) -> Figure:
    """Open-set figures over δ and over T, means over rounds and seeds."""
    canvas = Figure(figsize=(11, 4.2), layout="constrained")
    for place, (name, seeds) in enumerate(results.items()):
        axes = canvas.add_subplot(1, len(results), place + 1)
        points = [
            point for rounds in seeds.values() for one in rounds.values() for point in one["points"]
        ]
        values = sorted({point["value"] for point in points})
        for figure, colour in (
            ("macro_f1", _COLOURS[0]),
            ("auroc", _COLOURS[2]),
            ("false_rejection", _COLOURS[-1]),
        ):
            means = [
                fmean(point[figure] for point in points if point["value"] == value)
                for value in values
            ]
            axes.plot(values, means, color=colour, marker="o", markersize=4, label=_WORDS[figure])
        axes.set_xlabel({"delta": "δ", "trees": "number of trees T"}[name])
        axes.set_xscale("log" if name == "delta" else "linear")
        axes.set_ylim(0, 1)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8, frameon=False)
    return canvas


def _projection(trial: Trial) -> Figure:
    """Test windows of a round in two dimensions by t-SNE; new classes as crosses."""
    from sklearn.manifold import TSNE

    tested = trial.test.only(
        np.random.default_rng(0).permutation(len(trial.test.rows))[:_PROJECTED]
    )
    standard = (tested.features - tested.features.mean(axis=0)) / (
        tested.features.std(axis=0) + 1e-6
    )
    flat = TSNE(
        2, init="pca", perplexity=min(30.0, len(standard) / 4), random_state=0
    ).fit_transform(standard)
    canvas = Figure(figsize=(9, 6), layout="constrained")
    axes = canvas.add_subplot()
    colours = mpl.colormaps["tab20"]
    for place, label in enumerate(np.unique(tested.labels).tolist()):
        own = flat[tested.labels == label]
        marker = "x" if label in trial.round.new else "o"
        name = Label(label).title + (" (new)" if label in trial.round.new else "")
        axes.scatter(
            own[:, 0],
            own[:, 1],
            s=14,
            marker=marker,
            color=colours(place % 20),
            label=name,
            linewidths=1.0,
        )
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_title(
        f"Features of test windows, round {trial.round.number} of seed {trial.seed} (t-SNE)",
        fontsize=10,
    )
    canvas.legend(loc="outside right upper", fontsize=8, frameon=False)
    return canvas
