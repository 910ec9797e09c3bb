"""Precision of a catalogue: how many of its scenarios, drawn at random, show the class that they are filed under.

    python benchmarks/precision.py draw CATALOGUE RECORDINGS... --out DIR [--number 100] [--seed 0]
    python benchmarks/precision.py report VERDICTS... [--second VERDICTS ...]

`draw` writes verdicts.csv, with a row for each scenario drawn and a verdict to be filled in (right, wrong or unclear), and two
views of what was recorded, which owe nothing to the rules. Pictures: lanes, the ego in blue, its partner in red, others in grey,
all from 4 s before the event (thin) to 4 s after it (bold), with the ego's speeds. numbers.txt: roads, lanes, places, speeds and
distances of the ego, its partner and who is nearest, from 5 s before to 5 s after. `report` gives the precision with its 95 %
interval (Wilson); unclear counts as wrong. Several tables are reported together; --second holds another reviewer's beside them.
"""

from __future__ import annotations

import argparse
import csv
from collections import Counter
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from recognition import datasets
from recognition.catalogue.index import rows_of
from recognition.datasets import Source, cache_roads
from recognition.sites import site_of
from schemas.common.text import csv_text
from xodr.lookup.arrays import sample

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from runner.recording import Recording, Track
    from xodr.network import RoadNetwork

    Seen = tuple[Recording, RoadNetwork]

_COLUMNS = ("number", "recording", "vehicle", "time", "class", "partner", "verdict", "reason")
_VERDICTS = ("right", "wrong", "unclear")
_AROUND = 4.0
_SECONDS, _NEAR, _OTHERS = 5, 0.1, 3
"""Numbers are told from so many seconds before to so many after, of rows that are as near in time (s), with so many others"""
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
    reporting = commands.add_parser("report")
    reporting.add_argument("verdicts", nargs="+", type=Path)
    reporting.add_argument("--second", nargs="+", type=Path, default=[], help="of another reviewer, in the same order")
    options = arguments.parse_args()
    if options.command == "report":
        report(options.verdicts, options.second)
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
    lines = ([index, *(row[name] for name in _COLUMNS[1:6]), "", ""] for index, row in enumerate(drawn))
    (out / "verdicts.csv").write_text(csv_text([_COLUMNS, *lines]), encoding="utf-8", newline="\n")
    sources = {source.name: source for path in recordings for source in datasets.open(path).sources}
    read = cache(lambda name: _read(sources[name]))
    (out / "numbers.txt").write_text("\n".join(_numbers(index, row, *read(row["recording"])) for index, row in enumerate(drawn)))
    for start in range(0, len(drawn), _SHEET):
        _sheet(out / f"sheet{start // _SHEET}.png", start, drawn[start : start + _SHEET], read)


def _sheet(path: Path, first: int, rows: Sequence[dict[str, Any]], read: Callable[[str], Seen]) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(25, 20), layout="constrained")
    panels = figure.subplots(4, 5).ravel()
    for index, (axes, row) in enumerate(zip(panels, rows, strict=False), first):
        _panel(axes, row, *read(row["recording"]))
        axes.set_title(f"{index}: {row['class']}\n{row['recording']} {row['vehicle']} {row['tags']}"[:120], fontsize=7, wrap=True)
    figure.savefig(path, dpi=75)


def _read(source: Source) -> Seen:
    recording = source.load()
    network = site_of(source, recording, cache_roads()).network
    return recording, network


def _numbers(number: int, row: dict[str, Any], recording: Recording, network: RoadNetwork) -> str:
    """Describe an event second by second: places on the map, motion, and positions of others relative to the ego."""
    ego = recording.tracks[row["vehicle"]]
    partner = recording.tracks.get(row["partner"])
    head = f"{number}: {row['class']}, ego {ego.name} ({ego.category}, {ego.box.length:.1f} m long)"
    lines = [f"{head}, partner {row['partner']}, {row['recording']}"]
    for second in np.arange(-_SECONDS, _SECONDS + 1.0):
        time = row["time"] + second
        at = _at(ego, time)
        if at is None:
            continue
        told = [f"ego {_place(network, at)} {at['speed']:.1f} m/s {at['acceleration']:+.1f} m/s²"]
        if partner is not None:
            told.append(f"partner {_seen(network, at, partner, time)}")
        others = [each for each in recording.tracks.values() if each not in (ego, partner)]
        told += [_seen(network, at, each, time) for each in _nearest(at, others, time)]
        lines.append(f"{second:+.0f} s  {' | '.join(told)}")
    return "\n".join(lines) + "\n"


def _at(track: Track, time: float) -> dict[str, float] | None:
    """Values of a track at the row nearest to a time; None where it has none within 0.1 s."""
    columns = track.columns
    row = int(np.abs(columns["time"] - time).argmin())
    if abs(columns["time"][row] - time) > _NEAR:
        return None
    return {name: float(columns[name][row]) for name in ("x", "y", "h", "speed", "acceleration")}


def _place(network: RoadNetwork, at: dict[str, float]) -> str:
    """Road, lane, place and heading, with what the map says of the road there."""
    point = network.locate(at["x"], at["y"], None, at["h"])
    road = network.roads[point.road_id]
    left = road.direction(point.lane_id, point.s) * point.offset if point.lane_id else point.offset
    limit = road.speed_limit(point.s, point.lane_id)
    of_map = ("junction", road.junction_id), ("", road.road_type(point.s)), ("limit", limit and f"{limit:.0f}")
    said = " ".join(f"{name} {value}".strip() for name, value in of_map if value not in (None, "unknown"))
    width, heading = road.lane_width(point.s, point.lane_id), np.degrees(at["h"]) % 360.0
    lane = f"road {road.id} lane {point.lane_id} ({said}) s {point.s:.0f} of {road.length:.0f}"
    return f"{lane} left {left:+.1f} of width {width:.1f} heading {heading:.0f}°"


def _seen(network: RoadNetwork, at: dict[str, float], other: Track, time: float) -> str:
    """Describe a vehicle: offset ahead and to the left of the ego, speed, place."""
    there = _at(other, time)
    if there is None:
        return f"{other.name} not there"
    ahead, left = _from(at, there)
    point = network.locate(there["x"], there["y"], None, there["h"])
    turned = np.degrees(there["h"] - at["h"] + np.pi) % 360.0 - 180.0
    lane = f"{point.road_id}/{point.lane_id}"
    return f"{other.name} {ahead:+.0f} ahead {left:+.1f} left {turned:+.0f}° {there['speed']:.1f} m/s on {lane}"


def _nearest(at: dict[str, float], others: Sequence[Track], time: float) -> list[Track]:
    """The three nearest of the others at a time."""
    there = [(each, place) for each in others if (place := _at(each, time)) is not None]
    return [each for each, place in sorted(there, key=lambda one: float(np.hypot(*_from(at, one[1]))))[:_OTHERS]]


def _from(at: dict[str, float], there: dict[str, float]) -> tuple[float, float]:
    """Return the offset of one vehicle ahead and to the left of another, m."""
    x, y, sin, cos = there["x"] - at["x"], there["y"] - at["y"], np.sin(at["h"]), np.cos(at["h"])
    return float(cos * x + sin * y), float(cos * y - sin * x)


def _panel(axes: Axes, row: dict[str, Any], recording: Recording, network: RoadNetwork) -> None:
    """Draw an event, with the speed of the ego before, at and after it."""
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


def report(paths: Sequence[Path], second: Sequence[Path] = ()) -> None:
    """Print the precision of all classes and of each, and how far another reviewer agrees."""
    rows = [row for path in paths for row in _judged(path)]
    right, all_of = Counter(row["class"] for row in rows if row["verdict"] == "right"), Counter(row["class"] for row in rows)
    low, high = interval(right.total(), len(rows))
    print(f"precision {right.total() / len(rows):.0%} ({right.total()} of {len(rows)}), 95 % interval {low:.0%} to {high:.0%}")
    for name, count in sorted(all_of.items()):
        print(f"  {name}: {right[name]} of {count}")
    if second:
        others = [row for path in second for row in _judged(path)]
        if [_drawn(row) for row in others] != [_drawn(row) for row in rows]:
            raise SystemExit("the second reviewer's tables are of other scenarios: name them in the same order")
        print("another reviewer, of the same scenarios:")
        report(second)
        pairs = np.array([[row["verdict"] == "right" for row in each] for each in (rows, others)])
        print(f"they agree on {np.mean(pairs[0] == pairs[1]):.0%}; right for both: {np.mean(pairs.all(axis=0)):.0%}")


def _judged(path: Path) -> list[dict[str, str]]:
    """Rows of a table of verdicts, each with one that is known."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        if row["verdict"] not in _VERDICTS:
            raise SystemExit(f"{path}: row {row['number']}: the verdict is {row['verdict']!r}, not one of {', '.join(_VERDICTS)}")
    return rows


def _drawn(row: dict[str, str]) -> list[str]:
    return [row[name] for name in _COLUMNS[1:5]]


def interval(right: int, number: int) -> tuple[float, float]:
    """Wilson's interval of a share."""
    share, spread = right / number, _Z**2 / number
    middle, half = share + 0.5 * spread, _Z * np.sqrt(share * (1.0 - share) / number + 0.25 * spread / number)
    return float((middle - half) / (1.0 + spread)), float((middle + half) / (1.0 + spread))


if __name__ == "__main__":
    main()
