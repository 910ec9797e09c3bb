"""Figures 4 to 8 of the publication as pictures, drawn from the result files alone."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from schemas.common.array_types import FloatArray
from schemas.common.storage import keep
from studies.publication.results import read_table
from studies.publication.stages import GEOMETRIES, LIBRARY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from PIL import Image

FOLDER = "pictures/publication"
"""Beside the page"""
_MEAN = re.compile(r"^-?[\d.]+(?: ± ([\d.]+))?")
_PUBLISHED, _SHIPPED = "#1565c0", "#c62828"
_RECORDED, _COLLISION, _HARMLESS = "#2e7d32", "#c62828", "#f4a6a0"
_CURVES = (("delta", "δ"), ("trees", "T"), ("w", "W"))
_ABLATED = ("R_risk", "CR", "plausible collisions", "log-likelihood")
_WHOLE = "MCSG"
_COLOURS = 64
"""Colours of a picture of runs: few, so that its file is small"""
Find = Callable[[str, str], Path | None]
"""The table of a stage and a name; None where there is none."""


class Picture(NamedTuple):
    """A picture of the page.

    Attributes:
        file, caption: its name, and the sentence below it.
        stages, tables: what it is drawn from.
        draw: gives the file's content.
    """

    file: str
    caption: str
    stages: tuple[str, ...]
    tables: tuple[str, ...]
    draw: Callable[[Find], bytes]

    def possible(self, find: Find) -> bool:
        """Whether any of its tables is there."""
        return any(find(stage, table) for stage in self.stages for table in self.tables)


def write(find: Find, folder: Path) -> list[Path]:
    """Draw all pictures that there are tables of; their paths."""
    paths = []
    for picture in PICTURES.values():
        if picture.possible(find):
            path = folder / picture.file
            path.parent.mkdir(parents=True, exist_ok=True)
            keep(picture.draw(find), path)
            paths.append(path)
    return paths


def _sensitivity(find: Find) -> bytes:
    """Macro-F1 over δ, T and W, as published and as shipped."""
    curves = [
        (name, symbol)
        for name, symbol in _CURVES
        if any(find(stage, f"sensitivity-{name}") for stage in ("published", "shipped"))
    ]
    figure, panels = _canvas(1, len(curves), (3.0 * len(curves), 2.8))
    for axes, (name, symbol) in zip(panels, curves, strict=True):
        for stage, colour in (("published", _PUBLISHED), ("shipped", _SHIPPED)):
            path = find(stage, f"sensitivity-{name}")
            if path is None:
                continue
            header, *rows = read_table(path)
            column = next(number for number, one in enumerate(header) if "macro-F1" in one)
            points = [(float(row[0]), *_mean(row[column])) for row in rows]
            x, y, spread = np.array(points).T
            bars = spread if spread.any() else None
            scale = path.parts[-3]
            label = f"as {stage}" + (f" ({scale})" if scale != "full" else "")
            axes.errorbar(x, y, bars, color=colour, marker=".", linewidth=1, label=label)
        axes.set_xscale("log")
        ticks = np.unique(np.concatenate([line.get_xdata() for line in axes.lines]))
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks], rotation=60, fontsize=7)
        axes.minorticks_off()
        axes.set_xlabel(symbol)
        axes.set_ylim(0.0, 1.0)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=7, frameon=False)
    panels[0].set_ylabel("macro-F1")
    return _svg(figure)


def _ablations(find: Find) -> bytes:
    """Bars of MCSG and of its ablations; lines are standard deviations over seeds."""
    from studies.generation.methods import ABLATIONS

    path = find("cut_in_highway", "generated")
    assert path is not None
    header, *rows = read_table(path)
    titles = (_WHOLE, *(method.title for method in ABLATIONS.values()))
    shown = [row for row in rows if row[0].rstrip(" †").strip("*") in titles]
    figure, panels = _canvas(1, len(_ABLATED), (10.0, 3.4))
    for axes, name in zip(panels, _ABLATED, strict=True):
        means, spreads = np.array([_mean(row[header.index(name)]) for row in shown]).T
        names = [row[0].rstrip(" †").strip("*") for row in shown]
        colours = [_SHIPPED if one == _WHOLE else "#90a4ae" for one in names]
        bars = spreads if spreads.any() else None
        axes.bar(range(len(names)), means, yerr=bars, color=colours, capsize=2)
        axes.set_xticks(range(len(names)), names, rotation=60, ha="right", fontsize=7)
        axes.set_title(name, fontsize=9)
        axes.grid(alpha=0.3, axis="y")
    return _svg(figure)


def _trajectories(find: Find) -> bytes:
    """Motions that recorded parameters, and those of generated collisions, stand for."""
    from recognition.labels.maneuvers.estimation import reconstruct

    kinds, theta, _ = _points(find)
    figure, (ahead, speed) = _canvas(1, 2, (9.0, 3.2))
    for axes in (ahead, speed):
        axes.set_prop_cycle(linewidth=[0.8])
    for kind, colour, label in (
        ("recorded", _RECORDED, "recorded"),
        ("collision", _COLLISION, "generated, collision"),
    ):
        for number, row in enumerate(theta[kinds == kind][:40]):
            time = np.linspace(-row[2], row[4] + row[6], 60)
            way, aside = reconstruct(row, 1.0, time)
            ahead.plot(way, aside, color=colour, alpha=0.6, label="" if number else label)
            speed.plot(time, np.gradient(way, time), color=colour, alpha=0.6)
    ahead.set_xlabel("way since the manoeuvre began [m]")
    ahead.set_ylabel("share of the lateral way")
    speed.set_xlabel("time since the manoeuvre began [s]")
    speed.set_ylabel("speed [m/s]")
    ahead.legend(fontsize=8, frameon=False)
    return _png(figure)


def _projections(find: Find) -> bytes:
    """All pairs of parameters: recorded points and those that MCSG generates."""
    kinds, theta, names = _points(find)
    pairs = list(combinations(range(len(names)), 2))
    figure, panels = _canvas(-(-len(pairs) // 7), 7, (11.0, 5.2))
    for axes, (one, other) in zip(panels, pairs, strict=False):
        for kind, colour, label in (
            ("recorded", _RECORDED, "recorded"),
            ("generated", _HARMLESS, "generated, no collision"),
            ("collision", _COLLISION, "generated, collision"),
        ):
            some = theta[kinds == kind]
            axes.scatter(some[:, one], some[:, other], s=5, color=colour, label=label, linewidths=0)
        axes.set_xlabel(_short(names[one]), fontsize=6)
        axes.set_ylabel(_short(names[other]), fontsize=6)
        axes.tick_params(labelsize=5)
    figure.legend(
        *panels[0].get_legend_handles_labels(),
        loc="outside upper center", ncols=3, fontsize=8, markerscale=2, frameon=False,
    )  # fmt: skip
    return _png(figure)


def _cases(stages: Sequence[str]) -> Callable[[Find], bytes]:
    """The cases of scenarios below each other, each at its contact or its least clearance."""

    def draw(find: Find) -> bytes:
        from PIL import Image

        pictures: list[Image.Image] = [
            _case(stage, path) for stage in stages if (path := find(stage, "points"))
        ]
        width, height = pictures[0].size
        whole = Image.new("RGB", (width, height * len(pictures)))
        for number, picture in enumerate(pictures):
            whole.paste(picture, (0, number * height))
        content = io.BytesIO()
        whole.quantize(_COLOURS).save(content, "PNG", optimize=True)
        return content.getvalue()

    return draw


def _case(stage: str, path: Path) -> Image.Image:
    """A run with the values of the case, when ego and the other are nearest to each other."""
    from generation.search.outcomes import measures
    from runner.judging.execution import run
    from runner.judging.settings import RunSettings
    from runner.view.replay.frames import frames

    header, *rows = read_table(path)
    values = dict(zip(header[2:], rows[-1][2:], strict=True))
    result = run(LIBRARY / f"{stage}.xosc", RunSettings(world="kinematic"), parameters=values)
    moment = measures(result, "ad-rss").get("conflict", result.end_time)
    return next(frames([result], [moment]))


def _points(find: Find) -> tuple[np.ndarray, FloatArray, list[str]]:
    """Kinds (n,), parameters (n, d) and their names of cut ins."""
    path = find("cut_in_highway", "points")
    assert path is not None
    header, *rows = read_table(path)
    kinds = np.array([row[0] for row in rows])
    return kinds, np.array([[float(value) for value in row[2:]] for row in rows]), header[2:]


def _mean(cell: str) -> tuple[float, float]:
    """Mean and standard deviation of a cell; 0 for none."""
    found = _MEAN.match(cell)
    if found is None:
        return float("nan"), 0.0
    return float(cell.split(" ")[0]), float(found[1] or 0.0)


def _short(name: str) -> str:
    """Name of a parameter without that of its participant."""
    return name.partition("_")[2] or name


def _canvas(rows: int, columns: int, size: tuple[float, float]) -> tuple[Figure, list[Axes]]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    panels = list(np.ravel(figure.subplots(rows, columns, squeeze=False)))
    return figure, panels


def _svg(figure: Figure) -> bytes:
    """The same bytes each time: no date, identifiers by a constant, and text as text."""
    import matplotlib as mpl

    content = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "publication", "svg.fonttype": "none"}):
        figure.savefig(content, format="svg", metadata={"Date": None, "Creator": None})
    return content.getvalue()


def _png(figure: Figure) -> bytes:
    from PIL import Image

    content, small = io.BytesIO(), io.BytesIO()
    rare_too = Image.Quantize.MAXCOVERAGE  # few red points keep their colour
    figure.savefig(content, format="png", dpi=100, metadata={"Software": None})
    Image.open(content).convert("RGB").quantize(_COLOURS, rare_too).save(
        small, "PNG", optimize=True
    )
    return small.getvalue()


_HIGHWAYS = GEOMETRIES[4:]
PICTURES: Mapping[str, Picture] = {
    "4": Picture(
        "figure-4.svg",
        "Figure 4: macro-F1 over δ, the number of trees T, and the windows W of a "
        "discovery (after it).",
        ("published", "shipped"),
        tuple(f"sensitivity-{name}" for name, _ in _CURVES),
        _sensitivity,
    ),
    "5": Picture(
        "figure-5.png",
        "Figure 5: motions that recorded parameters stand for, and those of collisions "
        "that MCSG generates.",
        ("cut_in_highway",),
        ("points",),
        _trajectories,
    ),
    "6": Picture(
        "figure-6.png",
        "Figure 6: pairs of the seven parameters, recorded and generated by MCSG.",
        ("cut_in_highway",),
        ("points",),
        _projections,
    ),
    "7": Picture(
        "figure-7.svg",
        "Figure 7: MCSG and its ablations; lines are standard deviations over seeds.",
        ("cut_in_highway",),
        ("generated",),
        _ablations,
    ),
    "8": Picture(
        "figure-8.png",
        "Figure 8: for each geometry the likeliest collision with `cas` that a search found; "
        "where none found one, the least clearance.",
        GEOMETRIES[:4],
        ("points",),
        _cases(GEOMETRIES[:4]),
    ),
    "8 highways": Picture(
        "figure-8-highways.png",
        "Figure 8: diverging, merging and congested motorways, the same way.",
        _HIGHWAYS,
        ("points",),
        _cases(_HIGHWAYS),
    ),
}
"""Pictures by figure, in the order of the page"""
