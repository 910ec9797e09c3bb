"""A run as one picture: the road from above with all ways, speeds, and criticality for the ego."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl

mpl.use("Agg")

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

from runner.engine.participants.boxes import box_corners
from xodr.lookup.arrays import lane_borders

if TYPE_CHECKING:
    from runner.judging.measures.contacts import Impact
    from runner.judging.result import RunResult
    from runner.recording import Recording, Track

_EGO, _OTHERS = "#c62828", ("#1565c0", "#2e7d32", "#ef6c00", "#6a1b9a", "#00838f", "#5d4037")
_MARGIN = 12.0
"""Room around the ways shown, m."""
_FLATTEST = 7.0
"""Greatest ratio of width to height of the view from above; longer ways are not to scale across."""
_NARROWEST = 3.4
"""Least ratio, that of the room which the picture has for it: a narrow view would leave names none
"""
_FADING = 6
"""Boxes drawn along each way, evenly spaced in time, from pale to full colour."""
_NEAR = 50.0
"""Distances (m) and times to collision (s) that are shown at least"""
_NAMED = 8
"""Participants that are named in the view and in the legend; of more, those nearest to the ego come
first"""
_SAID = 3
"""Participants that are named in a view of more"""


def write_picture(result: RunResult, path: Path) -> None:
    """Write a PNG: view from above, speeds over time, distance and time to collision of the ego
    over time."""
    tracks = [track for track in result.recording.tracks.values() if len(track.columns["time"])]
    others = iter(_OTHERS * (len(tracks) // len(_OTHERS) + 1))
    # The ego keeps its colour in all pictures, whichever place it has in the file.
    colours = {track.name: _EGO if track.name == result.ego else next(others) for track in tracks}
    impact = result.criticality.impact if result.criticality is not None else None
    named = _named(result, tracks)
    with mpl.rc_context(), warnings.catch_warnings():
        # Matplotlib reads a file of the working folder, which may ask for any program
        mpl.rcdefaults()
        warnings.filterwarnings(
            "ignore", "Glyph .* missing"
        )  # names may be in any script, and are boxes then
        # Without pyplot, which keeps figures of a process until they are closed.
        figure = Figure(figsize=(11, 7.4), layout="constrained")
        grid = figure.add_gridspec(2, 2, height_ratios=(1.2, 1.0))
        above = figure.add_subplot(grid[0, :])
        _from_above(above, result.recording, tracks, colours)
        said = named if len(tracks) <= _NAMED else named[:_SAID]
        _say(above, [track for track in tracks if track.name in said], impact)
        _speeds(figure.add_subplot(grid[1, 0]), tracks, colours, impact)
        _criticality(figure.add_subplot(grid[1, 1]), result, impact)
        if named:
            rest = len(tracks) - len(named)
            lines = [Line2D([], [], color=colours[name], label=_plain(name)) for name in named]
            more = [Line2D([], [], linestyle="", label=f"and {rest} more")] if rest else []
            figure.legend(
                handles=[*lines, *more], fontsize=8, loc="outside lower center", ncols=_NAMED + 1
            )
        title = (
            f"{result.scenario.stem}, {result.end_time:.2f} s, system under test {result.sut}, "
            f"{result.verdict}"
        )
        figure.suptitle(_plain(title), fontsize=11, wrap=True)
        # Without the version of the library: same run, same bytes.
        figure.savefig(path, dpi=110, metadata={"Software": None})


def _named(result: RunResult, tracks: list[Track]) -> list[str]:
    """Names of the relevant entities: the ego, its nearest partner, then all others."""
    measures = result.criticality
    nearest = (
        []
        if measures is None
        else [
            # Partners of extremes are those that a reader asks for.
            extreme["other"]
            for extreme in measures.summary.values()
            if isinstance(extreme, dict)
        ]
    )
    there = {track.name for track in tracks}
    names = dict.fromkeys(
        [*([result.ego] if result.ego else []), *nearest, *(track.name for track in tracks)]
    )
    return [name for name in names if name in there][:_NAMED]


def _plain(text: str) -> str:
    """Text that matplotlib takes for no formula."""
    return text.replace("$", r"\$")


def _from_above(
    axes: Axes, recording: Recording, tracks: list[Track], colours: dict[str, str]
) -> None:
    x = np.concatenate([track.columns["x"] for track in tracks]) if tracks else np.zeros(1)
    y = np.concatenate([track.columns["y"] for track in tracks]) if tracks else np.zeros(1)
    height = np.ptp(y) + 2.0 * _MARGIN
    # Never narrower than its room: names at the ends would be cut.
    width = max(np.ptp(x) + 2.0 * _MARGIN, _NARROWEST * height)
    middle = (x.min() + x.max()) / 2.0
    axes.set_xlim(middle - width / 2.0, middle + width / 2.0)
    axes.set_ylim(y.min() - _MARGIN, y.max() + _MARGIN)
    if recording.network is not None:
        borders = [
            line[:, :2]
            for road in recording.network.roads.values()
            for _, *both in lane_borders(road)
            for line in both
        ]
        axes.add_collection(LineCollection(borders, colors="#9e9e9e", linewidths=0.7))
    for track in tracks:
        _way(axes, track, colours[track.name])
    to_scale = width / height < _FLATTEST
    axes.set_aspect("equal" if to_scale else "auto")
    axes.set_xlabel("x / m")
    axes.set_ylabel("y / m" if to_scale else "y / m (stretched)")
    length = max(
        metres
        for metres in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
        if metres == 1 or metres < width / 4
    )
    told = f"{length} m" if to_scale else f"{length} m along x"
    bar = AnchoredSizeBar(
        axes.transData, length, told, "lower right", pad=0.1, sep=3, frameon=False,
        bbox_to_anchor=(1.0, 1.0), bbox_transform=axes.transAxes,
        fontproperties=FontProperties(size=8), label_top=True,
    )  # fmt: skip
    axes.add_artist(bar)


def _say(axes: Axes, tracks: list[Track], impact: Impact | None) -> None:
    """Names and speeds where participants are at the contact, else at their end;
    and the contact.
    """
    for number, track in enumerate(tracks):
        columns = track.columns
        row = (
            min(int(np.searchsorted(columns["time"], impact.time - 1e-6)), len(columns["time"]) - 1)
            if impact
            else -1
        )
        text = f"{track.name} {columns['speed'][row]:.1f} m/s"
        place = float(columns["x"][row]), float(columns["y"][row])
        # Alternately above and below: names of neighbours would cover each other.
        above = 16 if number % 2 == 0 else -22
        axes.annotate(
            _plain(text), place, (0, above), textcoords="offset points", ha="center", fontsize=8,
            annotation_clip=False,
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none",
                "alpha": 0.8},
            arrowprops={"arrowstyle": "-", "color": "#616161", "linewidth": 0.6},
        )  # fmt: skip
    if impact is not None:
        title = (
            f"speeds at the contact with {impact.other}, {impact.time:.2f} s, {impact.speed:.1f} "
            "m/s relative"
        )
        axes.set_title(_plain(title), fontsize=9, loc="left", color=_EGO)
    elif tracks:
        axes.set_title("speeds at the end", fontsize=9, loc="left")


def _way(axes: Axes, track: Track, colour: str) -> None:
    columns = track.columns
    axes.plot(columns["x"], columns["y"], color=colour, linewidth=1.2)
    shown = sorted(set(np.linspace(0, len(columns["time"]) - 1, _FADING).astype(int).tolist()))
    for number, i in enumerate(shown, 1):
        corners = box_corners(
            float(columns["x"][i]), float(columns["y"][i]), float(columns["h"][i]), track.box
        )
        axes.add_patch(
            Polygon(
                corners,
                facecolor=colour,
                edgecolor=colour,
                linewidth=0.6,
                alpha=number / len(shown),
            )
        )


def _speeds(
    axes: Axes, tracks: list[Track], colours: dict[str, str], impact: Impact | None
) -> None:
    for track in tracks:
        axes.plot(track.columns["time"], track.columns["speed"], color=colours[track.name])
    if impact is not None:
        axes.axvline(impact.time, color=_EGO, linestyle=":", linewidth=1.0)
    axes.set_xlabel("time / s")
    axes.set_ylabel("speed / (m/s)")
    axes.grid(alpha=0.3)


def _criticality(axes: Axes, result: RunResult, impact: Impact | None) -> None:
    measures = result.criticality
    if measures is None:
        axes.text(
            0.5,
            0.5,
            "no ego, or no other participant",
            ha="center",
            va="center",
            transform=axes.transAxes,
        )
        axes.set_axis_off()
        return
    table = measures.table()
    time = table["time"]
    for name, label, colour in (
        ("distance", "distance / m", "#455a64"),
        ("ttc", "time to collision / s", "#ad1457"),
    ):
        axes.plot(
            # NaN breaks the line where a measure has no value.
            time,
            np.where(table[f"{name}_valid"], table[name], math.nan),
            color=colour,
            label=label,
        )
    axes.fill_between(
        time, 0, 1, where=table["rss_violation_ad_rss"], transform=axes.get_xaxis_transform(),
        color=_EGO, alpha=0.12,
        linewidth=0, label="RSS distance violated (ad-rss)",
    )  # fmt: skip
    if impact is not None:
        axes.axvline(impact.time, color=_EGO, linestyle=":", linewidth=1.0, label="contact")
    nearest = float(np.min(table["distance"][table["distance_valid"]], initial=math.inf))
    axes.set_ylim(0.0, _NEAR if nearest < _NEAR or not math.isfinite(nearest) else 1.5 * nearest)
    axes.set_xlabel("time / s")
    axes.set_title("ego and the nearest entity or the one ahead", fontsize=9)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="best")
