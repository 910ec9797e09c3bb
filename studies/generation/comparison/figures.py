"""Figures of a study: where generated parameters lie, what was learnt, what the parts of MCSG
bring, and the motions."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from statistics import fmean, stdev

import matplotlib as mpl

from schemas.common.array_types import FloatArray

mpl.use("Agg")

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from generation.search.outcomes import Episodes
from recognition.labels.maneuvers.estimation import reconstruct
from recognition.labels.maneuvers.parameters import PARAMETERS
from studies.generation.comparison.measures import curves, last_third
from studies.generation.comparison.report import FIGURES, results
from studies.generation.comparison.study import Key, Study
from studies.generation.methods import ABLATIONS, METHODS

REAL, GENERATED, HARMLESS = "#2e7d32", "#c62828", "#f4a6a0"
_COLOURS = mpl.colormaps["tab20"]
_SHOWN = 600
"""Points of each kind in a projection, at most."""
_MOTIONS = 40


def write_figures(study: Study, folder: Path) -> list[Path]:
    """Write a PNG for everything there are results of; their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    keys = study.searches()
    drawn: dict[str, Figure] = {}
    if keys:
        drawn["learning"] = _learning(study, keys)
        drawn["methods"] = _methods(study, keys)
    if any(key.method in ABLATIONS for key in keys):
        drawn["ablations"] = _ablations(study)
    own = next((key for key in keys if key.method == "mcsg"), None)
    if own is not None:
        generated = last_third(study.history(own))
        drawn["projections"] = _projections(study, generated)
        if _is_manoeuvre(study):
            drawn["trajectories"] = _trajectories(study, generated)
    paths = [folder / f"{name}.png" for name in drawn]
    for path, figure in zip(paths, drawn.values(), strict=True):
        figure.savefig(path, dpi=120, metadata={"Software": None})
    return paths


def _learning(study: Study, keys: list[Key]) -> Figure:
    """R_risk, collisions and reward over the calls, a line for each method, means over seeds."""
    canvas = Figure(figsize=(13, 4.6), layout="constrained")
    panels = dict(zip(("r_risk", "collisions", "reward"), canvas.subplots(1, 3), strict=True))
    names = [name for name in METHODS if any(key.method == name for key in keys)]
    for name in names:
        found = [curves(study.history(key)) for key in keys if key.method == name]
        place = list(METHODS).index(name)
        for figure, axes in panels.items():
            # A saturated search ends before its budget: the line has the calls of all seeds.
            calls = min(len(one[figure]) for one in found)
            mean = np.mean([one[figure][:calls] for one in found], axis=0)
            style = (
                {"linewidth": 3.0, "color": GENERATED, "zorder": 5}
                if name == "mcsg"
                else {"color": _COLOURS(place)}
            )
            axes.plot(
                np.arange(1, len(mean) + 1), mean, label=METHODS[name].title.strip("*"), **style
            )
    for figure, axes in panels.items():
        axes.set_xlabel("simulator calls")
        axes.set_ylabel(f"{FIGURES[figure]}, mean of the last 150 calls")
        axes.grid(alpha=0.3)
    handles, labels = panels["reward"].get_legend_handles_labels()
    canvas.legend(handles, labels, loc="outside right upper", fontsize=8, frameon=False)
    return canvas


def _ablations(study: Study) -> Figure:
    """Bars of MCSG and its ablations; lines are standard deviations over seeds."""
    found = {name: seeds for name, seeds in results(study).items() if name in ("mcsg", *ABLATIONS)}
    shown = ("r_risk", "collisions", "edge_cases", "log_likelihood")
    canvas = Figure(figsize=(12, 3.8), layout="constrained")
    for axes, figure in zip(canvas.subplots(1, len(shown)), shown, strict=True):
        values = [[getattr(one, figure) for one in seeds.values()] for seeds in found.values()]
        means, spreads = (
            [fmean(each) for each in values],
            [stdev(each) if len(each) > 1 else 0.0 for each in values],
        )
        colours = [GENERATED if name == "mcsg" else "#90a4ae" for name in found]
        axes.bar(range(len(found)), means, yerr=spreads, color=colours, capsize=3)
        axes.set_xticks(
            range(len(found)),
            [METHODS[name].title.strip("*") for name in found],
            rotation=40,
            ha="right",
            fontsize=8,
        )
        axes.set_title(FIGURES[figure], fontsize=10)
        axes.grid(alpha=0.3, axis="y")
    return canvas


def _projections(study: Study, generated: Episodes) -> Figure:
    """Pairs of parameters: recorded ones and what MCSG generates."""
    space = study.space
    pairs = list(combinations(range(len(space.names)), 2))
    canvas, panels = _panels(len(pairs), 6, (2.6, 2.4))
    for axes, (one, other) in zip(panels, pairs, strict=True):
        _scatter(
            axes,
            study.recorded.theta[:, (one, other)],
            generated.theta[:, (one, other)],
            generated.outcomes.collision,
        )
        axes.set_xlabel(_short(space.names[one]), fontsize=7)
        axes.set_ylabel(_short(space.names[other]), fontsize=7)
    canvas.legend(
        *panels[0].get_legend_handles_labels(),
        loc="outside upper center",
        ncols=3,
        fontsize=9,
        frameon=False,
    )
    return canvas


def _methods(study: Study, keys: list[Key]) -> Figure:
    """For each method the first two principal components of recorded parameters, with those that it
    generates."""
    real = study.space.unit(study.recorded.theta)
    centre, spread = real.mean(axis=0), real.std(axis=0)
    axes_of = np.linalg.svd((real - centre) / spread, full_matrices=False)[2][:2].T

    def flat(theta: FloatArray) -> FloatArray:
        return ((study.space.unit(theta) - centre) / spread) @ axes_of

    names = [name for name in METHODS if any(key.method == name for key in keys)]
    canvas, panels = _panels(len(names), 5, (2.8, 2.6), shared=True)
    for axes, name in zip(panels, names, strict=True):
        generated = last_third(study.history(next(key for key in keys if key.method == name)))
        _scatter(
            axes, flat(study.recorded.theta), flat(generated.theta), generated.outcomes.collision
        )
        axes.set_title(METHODS[name].title.strip("*"), fontsize=9)
    canvas.legend(
        *panels[0].get_legend_handles_labels(),
        loc="outside upper center",
        ncols=3,
        fontsize=9,
        frameon=False,
    )
    return canvas


def _panels(
    number: int, abreast: int, size: tuple[float, float], shared: bool = False
) -> tuple[Figure, list[Axes]]:
    """A figure of small panels of a size (inches), so many abreast at the most."""
    columns = min(abreast, number)
    rows = -(-number // columns)
    canvas = Figure(figsize=(size[0] * columns, size[1] * rows + 0.5), layout="constrained")
    panels = list(
        canvas.subplots(rows, columns, squeeze=False, sharex=shared, sharey=shared).ravel()
    )
    for axes in panels:
        axes.tick_params(labelsize=6)
    for axes in panels[number:]:
        axes.set_axis_off()
    return canvas, panels[:number]


def _scatter(axes: Axes, real: FloatArray, generated: FloatArray, collision: np.ndarray) -> None:
    generator = np.random.default_rng(0)
    for points, colour, label in (
        (real, REAL, "recorded"),
        (generated[~collision], HARMLESS, "generated, no collision"),
        (generated[collision], GENERATED, "generated, collision"),
    ):
        shown = points[generator.permutation(len(points))[:_SHOWN]]
        axes.scatter(
            shown[:, 0], shown[:, 1], s=5, color=colour, alpha=0.5, linewidths=0, label=label
        )


def _trajectories(study: Study, generated: Episodes) -> Figure:
    """Motions of the actor that parameters stand for: recorded ones and generated collisions."""
    canvas = Figure(figsize=(12, 4.2), layout="constrained")
    ahead, speed = canvas.subplots(1, 2)
    collisions = generated.theta[generated.outcomes.collision]
    for theta, colour, label in (
        (study.recorded.theta, REAL, "recorded"),
        (collisions, GENERATED, "generated, collision"),
    ):
        chosen = theta[np.random.default_rng(0).permutation(len(theta))[:_MOTIONS]]
        for number, row in enumerate(chosen):
            time = np.linspace(-row[2], row[4] + row[6], 120)
            way, aside = reconstruct(row, 1.0, time)
            style = {
                "color": colour,
                "alpha": 0.5,
                "linewidth": 1.0,
                "label": label if not number else None,
            }
            ahead.plot(way, aside, **style)
            speed.plot(time, np.gradient(way, time), **style)
    ahead.set_xlabel("way since the manoeuvre began [m]")
    ahead.set_ylabel("share of the lateral way")
    speed.set_xlabel("time since the manoeuvre began [s]")
    speed.set_ylabel("speed [m/s]")
    for axes in (ahead, speed):
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8, frameon=False)
    return canvas


def _is_manoeuvre(study: Study) -> bool:
    """Whether the space is that of the seven parameters, in their order."""
    return [name.partition("_")[2] for name in study.space.names] == [
        each.name for each in PARAMETERS.values()
    ]


def _short(name: str) -> str:
    """A parameter's name without its participant's."""
    return name.partition("_")[2] or name
