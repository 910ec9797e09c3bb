"""A run as one picture: the road from above with everyone's way on it, speeds, and how critical it was for the ego."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl

mpl.use("Agg")

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from runner.participants.boxes import box_corners
from xodr.lookup.sampling import lane_borders

if TYPE_CHECKING:
    from runner.interpreter.result import RunResult
    from runner.recording import Recording, Track

_EGO, _OTHERS = "#c62828", ("#1565c0", "#2e7d32", "#ef6c00", "#6a1b9a", "#00838f", "#5d4037")
_MARGIN = 12.0
"""Room around the ways shown, m."""
_FLATTEST = 7.0
"""Greatest ratio of width to height of the view from above; longer ways are not to scale across."""
_FADING = 6
"""Boxes drawn along each way, evenly spaced in time, from pale to full colour."""


def write_picture(result: RunResult, path: Path) -> None:
    """Write a PNG: view from above, speeds over time, distance and time to collision of the ego over time."""
    tracks = list(result.recording.tracks.values())
    others = iter(_OTHERS * (len(tracks) // len(_OTHERS) + 1))
    colours = {track.name: _EGO if track.name == result.ego else next(others) for track in tracks}
    figure = Figure(figsize=(11, 7), layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=(1.2, 1.0))
    _from_above(figure.add_subplot(grid[0, :]), result.recording, colours)
    _speeds(figure.add_subplot(grid[1, 0]), tracks, colours)
    _criticality(figure.add_subplot(grid[1, 1]), result)
    outcome = "passed" if result.verdict.passed else "failed: " + "; ".join(result.verdict.reasons)
    figure.suptitle(f"{result.scenario.stem}, {result.end_time:.2f} s, system under test {result.sut}, {outcome}", fontsize=11)
    figure.savefig(path, dpi=110, metadata={"Software": None})


def _from_above(axes: Axes, recording: Recording, colours: dict[str, str]) -> None:
    tracks = [track for track in recording.tracks.values() if len(track.columns["time"])]
    x = np.concatenate([track.columns["x"] for track in tracks]) if tracks else np.zeros(1)
    y = np.concatenate([track.columns["y"] for track in tracks]) if tracks else np.zeros(1)
    axes.set_xlim(x.min() - _MARGIN, x.max() + _MARGIN)
    axes.set_ylim(y.min() - _MARGIN, y.max() + _MARGIN)
    if recording.network is not None:
        borders = [line[:, :2] for road in recording.network.roads.values() for _, *both in lane_borders(road) for line in both]
        axes.add_collection(LineCollection(borders, colors="#9e9e9e", linewidths=0.7))
    for track in tracks:
        _way(axes, track, colours[track.name])
    width, height = np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
    to_scale = width / height < _FLATTEST
    axes.set_aspect("equal" if to_scale else "auto")
    axes.set_xlabel("x / m")
    axes.set_ylabel("y / m" if to_scale else "y / m (stretched)")
    if tracks:
        axes.legend(fontsize=8, loc="upper right", ncols=min(len(tracks), 6))


def _way(axes: Axes, track: Track, colour: str) -> None:
    columns = track.columns
    axes.plot(columns["x"], columns["y"], color=colour, linewidth=1.2, label=track.name)
    shown = sorted(set(np.linspace(0, len(columns["time"]) - 1, _FADING).astype(int).tolist()))
    for number, i in enumerate(shown, 1):
        corners = box_corners(float(columns["x"][i]), float(columns["y"][i]), float(columns["h"][i]), track.box)
        axes.add_patch(Polygon(corners, facecolor=colour, edgecolor=colour, linewidth=0.6, alpha=number / len(shown)))


def _speeds(axes: Axes, tracks: list[Track], colours: dict[str, str]) -> None:
    for track in tracks:
        axes.plot(track.columns["time"], track.columns["speed"], color=colours[track.name], label=track.name)
    axes.set_xlabel("time / s")
    axes.set_ylabel("speed / (m/s)")
    axes.grid(alpha=0.3)


def _criticality(axes: Axes, result: RunResult) -> None:
    measures = result.criticality
    if measures is None:
        axes.text(0.5, 0.5, "no ego, or nobody else", ha="center", va="center", transform=axes.transAxes)
        axes.set_axis_off()
        return
    table = measures.table()
    time = table["time"]
    for name, label, colour in (("distance", "distance / m", "#455a64"), ("ttc", "time to collision / s", "#ad1457")):
        axes.plot(time, np.where(table[f"{name}_valid"], table[name], math.nan), color=colour, label=label)
    axes.fill_between(
        time, 0, 1, where=table["rss_violation_ad_rss"], transform=axes.get_xaxis_transform(), color=_EGO, alpha=0.12,
        linewidth=0, label="RSS distance violated (ad-rss)",
    )  # fmt: skip
    axes.set_ylim(0.0, 50.0)
    axes.set_xlabel("time / s")
    axes.set_title("ego and whoever is nearest or ahead", fontsize=9)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="upper right")
