"""Precision of a catalogue: how many of its scenarios, drawn at random, show the class that they are filed under.

    python benchmarks/precision.py draw CATALOGUE RECORDINGS... --out DIR [--number 100] [--seed 0]
    python benchmarks/precision.py report VERDICTS

`draw` writes verdicts.csv, with a row for each scenario drawn and a verdict to be filled in (right, wrong or unclear), and
pictures of what was recorded: lanes, the ego in blue, its partner in red, others in grey, all from 4 s before the event (thin) to
4 s after it (bold), with the ego's speeds. `report` gives the precision with its 95 % interval (Wilson); unclear counts as wrong.
"""

from __future__ import annotations

import argparse
import csv
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from recognition import datasets
from recognition.catalogue.writing.index import rows_of
from recognition.datasets import Source, cache_roads
from recognition.sites import site_of
from xodr.lookup.sampling import sample

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from runner.recording import Recording
    from xodr.network import RoadNetwork

_COLUMNS = ("number", "recording", "vehicle", "time", "class", "partner", "verdict", "reason")
_VERDICTS = ("right", "wrong", "unclear")
_AROUND = 4.0
_SHEET = 20
_Z = 1.959964


def main() -> None:
    """Draw, or report."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    commands = arguments.add_subparsers(dest="command", required=True)
    drawing = commands.add_parser("draw")
    drawing.add_argument("catalogue", type=Path)
    drawing.add_argument("recordings", nargs="+", type=Path)
    drawing.add_argument("--out", type=Path, required=True)
    drawing.add_argument("--number", type=int, default=100)
    drawing.add_argument("--seed", type=int, default=0)
    commands.add_parser("report").add_argument("verdicts", type=Path)
    options = arguments.parse_args()
    if options.command == "report":
        report(options.verdicts)
    else:
        draw(options.catalogue, options.recordings, options.out, options.number, options.seed)


def draw(catalogue: Path, recordings: Sequence[Path], out: Path, number: int, seed: int) -> None:
    """Write the table for verdicts, and the pictures."""
    import matplotlib as mpl

    mpl.use("Agg")
    rows = rows_of(catalogue)
    chosen = np.sort(np.random.default_rng(seed).choice(len(rows), min(number, len(rows)), replace=False))
    drawn = [rows[index] for index in chosen.tolist()]
    out.mkdir(parents=True, exist_ok=True)
    with (out / "verdicts.csv").open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(_COLUMNS)
        table.writerows([[index, *(row[name] for name in _COLUMNS[1:6]), "", ""] for index, row in enumerate(drawn)])
    sources = {source.name: source for path in recordings for source in datasets.open(path).sources}
    for start in range(0, len(drawn), _SHEET):
        _sheet(out / f"sheet{start // _SHEET}.png", start, drawn[start : start + _SHEET], sources)


def _sheet(path: Path, first: int, rows: Sequence[dict[str, Any]], sources: dict[str, Source]) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(25, 20), layout="constrained")
    panels = figure.subplots(4, 5).ravel()
    read = {name: _read(sources[name]) for name in {row["recording"] for row in rows}}
    for index, (axes, row) in enumerate(zip(panels, rows, strict=False), first):
        _panel(axes, row, *read[row["recording"]])
        axes.set_title(f"{index}: {row['class']}\n{row['recording']} {row['vehicle']} {row['tags']}"[:120], fontsize=7, wrap=True)
    figure.savefig(path, dpi=75)


def _read(source: Source) -> tuple[Recording, RoadNetwork]:
    recording = source.load()
    return recording, site_of(source, recording, cache_roads()).network


def _panel(axes: Axes, row: dict[str, Any], recording: Recording, network: RoadNetwork) -> None:
    """What happens about an event, with the speed of the ego before, at and after it."""
    for road in network.roads.values():
        for section, end in zip(road.sections, [*(each.s for each in road.sections[1:]), road.length], strict=True):
            s = np.linspace(section.s, end - 1e-6, max(2, int((end - section.s) / 2.0)))
            for lane in section.lanes.values():
                axes.plot(*sample(road, s, [lane.outer(one) for one in s.tolist()])[:, :2].T, color="0.8", linewidth=0.6)
    for track in recording.tracks.values():
        columns = track.columns
        near = np.abs(columns["time"] - row["time"]) <= _AROUND
        if not near.any():
            continue
        color = {row["vehicle"]: "tab:blue", row["partner"]: "tab:red"}.get(track.name, "0.55")
        after = near & (columns["time"] >= row["time"])
        for rows, width in ((near, 0.8), (after, 2.5)):
            axes.plot(columns["x"][rows], columns["y"][rows], color=color, linewidth=width)
        if track.name == row["vehicle"]:
            _ego(axes, columns, row["time"], near)


def _ego(axes: Axes, columns: dict[str, np.ndarray], time: float, near: np.ndarray) -> None:
    at = int(np.abs(columns["time"] - time).argmin())
    x, y, speed = columns["x"], columns["y"], columns["speed"]
    axes.plot(x[at], y[at], "k.", markersize=9)
    reach = max(25.0, 0.7 * max(np.ptp(x[near]), np.ptp(y[near])))
    axes.set(xlim=(x[at] - reach, x[at] + reach), ylim=(y[at] - reach, y[at] + reach), aspect="equal")
    axes.set_xlabel(f"{speed[near][0]:.1f}, {speed[at]:.1f}, {speed[near][-1]:.1f} m/s", fontsize=7)


def report(path: Path) -> None:
    """Print the precision of all classes and of each."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        if row["verdict"] not in _VERDICTS:
            raise SystemExit(f"{path}: row {row['number']}: the verdict is {row['verdict']!r}, not one of {', '.join(_VERDICTS)}")
    right, all_of = Counter(row["class"] for row in rows if row["verdict"] == "right"), Counter(row["class"] for row in rows)
    low, high = interval(right.total(), len(rows))
    print(f"precision {right.total() / len(rows):.0%} ({right.total()} of {len(rows)}), 95 % interval {low:.0%} to {high:.0%}")
    for name, count in sorted(all_of.items()):
        print(f"  {name}: {right[name]} of {count}")


def interval(right: int, number: int) -> tuple[float, float]:
    """Wilson's interval of a share."""
    share, spread = right / number, _Z**2 / number
    middle, half = share + 0.5 * spread, _Z * np.sqrt(share * (1.0 - share) / number + 0.25 * spread / number)
    return float((middle - half) / (1.0 + spread)), float((middle + half) / (1.0 + spread))


if __name__ == "__main__":
    main()
