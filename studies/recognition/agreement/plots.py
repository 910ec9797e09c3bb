"""Plots of labelled places: where the events are, how lane changes run, and how the gap to the lead
jumps at cuts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from recognition.labels import Label
from studies.recognition.agreement.survey import Place
from xodr.lookup.arrays import lane_borders

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FAINT = "0.8"
_GREYS = (14, 15)
"""Colours of the palette that look like the ways without events."""
_MARGIN = 3.0
"""Room about the ways on a map, m."""


def plots(place: Place, folder: Path) -> list[str]:
    """Write a place's plots; their file names."""
    from matplotlib import pyplot

    pyplot.switch_backend("Agg")
    drawn = []
    for kind, draw, present in (
        ("map", _map, bool(place.lines)),
        ("changes", _changes, bool(place.sides)),
        ("cuts", _cuts, bool(place.gaps)),
    ):
        if present:
            figure, axes = pyplot.subplots(figsize=(10, 6), layout="constrained")
            draw(place, axes)
            axes.set_title(f"{place.name}: {axes.get_title()}")
            drawn.append(f"{place.name}-{kind}.png")
            figure.savefig(folder / drawn[-1], dpi=110, metadata={"Software": None})
            pyplot.close(figure)
    return drawn


def _map(place: Place, axes: Axes) -> None:
    from matplotlib import colormaps

    for road in place.site.network.roads.values() if place.site else ():
        for _, inner, outer in lane_borders(road):
            for border in (inner, outer):
                axes.plot(border[:, 0], border[:, 1], color="0.6", linewidth=0.4)
    for x, y in place.ways:
        axes.plot(x, y, color=_FAINT, linewidth=0.6, zorder=0)
    colours = [colormaps["tab20"](index) for index in range(20) if index not in _GREYS]
    for label, lines in sorted(place.lines.items()):
        for number, (x, y) in enumerate(lines):
            title = f"{label.title} ({len(lines)})" if number == 0 else None
            axes.plot(x, y, color=colours[label - 1], linewidth=1.6, label=title)
    x, y = (np.concatenate(values) for values in zip(*place.ways, strict=True))
    axes.set(title="windows of the events", xlabel="x / m", ylabel="y / m")
    axes.set(
        xlim=(x.min() - _MARGIN, x.max() + _MARGIN), ylim=(y.min() - _MARGIN, y.max() + _MARGIN)
    )
    axes.set_aspect("auto" if np.ptp(x) > 8.0 * np.ptp(y) else "equal")
    axes.legend(fontsize="small", loc="best")


def _changes(place: Place, axes: Axes) -> None:
    for number, (label, lines) in enumerate(sorted(place.sides.items())):
        for index, (time, side) in enumerate(lines):
            title = f"{label.title} ({len(lines)})" if index == 0 else None
            axes.plot(time, side, color=f"C{number}", linewidth=0.7, alpha=0.6, label=title)
    axes.set(
        title="lateral position about t*",
        xlabel="time from t* / s",
        ylabel="to the left of the place at t* / m",
    )
    axes.axvline(0.0, color=_FAINT, zorder=0)
    axes.legend(fontsize="small")


def _cuts(place: Place, axes: Axes) -> None:
    for label, time, gap in place.gaps:
        colour = "C0" if label in (Label.CUT_IN, Label.URBAN_CUT_IN) else "C1"
        axes.plot(time, gap, color=colour, linewidth=0.7, alpha=0.6)
    axes.set(
        title="gap to the lead about cut in (blue) and cut out (orange)",
        xlabel="time from t* / s",
        ylabel="gap / m",
    )
    axes.axvline(0.0, color=_FAINT, zorder=0)
