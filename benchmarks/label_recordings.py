"""Time to read and label recordings, step by step.

    python benchmarks/label_recordings.py PATH... [--repeat N]
    python benchmarks/label_recordings.py --traffic VEHICLES

PATH are folders or files with recordings; each recording is read, gets its site and its labels.
With --traffic a synthetic recording of so many vehicles of 17 s at 25 Hz on a motorway of six lanes
stands in, whose places are looked up as well.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from recognition.labels import label
from recognition.recordings import open as open_data
from recognition.recordings.source import participant
from recognition.scenes import Site, place, site_at, site_of
from runner.recording import Recording, Track
from xodr.builders import straight_highway

RATE, SECONDS = 25.0, 17.0


class Times(NamedTuple):
    """Rows of a recording, events found, and seconds for each step."""

    rows: int
    events: int
    read: float
    site: float
    place: float
    label: float


def main() -> None:
    """Print a line for each recording."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("paths", nargs="*", type=Path, help="folders or files with recordings")
    arguments.add_argument(
        "--traffic", type=int, metavar="VEHICLES", help="measure a synthetic recording"
    )
    arguments.add_argument(
        "--repeat", type=int, default=3, help="passes, of which the median counts"
    )
    options = arguments.parse_args()
    print(
        f"{'recording':<32}{'rows':>9}{'events':>8}{'read':>8}{'site':>8}{'place':>8}"
        f"{'label':>8}  s"
    )
    with tempfile.TemporaryDirectory() as folder:
        for path in options.paths:
            for index, source in enumerate(open_data(path, folder).sources):
                show(
                    source.name,
                    [_recorded(path, index, Path(folder)) for _ in range(options.repeat)],
                )
        if options.traffic:
            show(
                f"{options.traffic} synthetic vehicles",
                [_synthetic(options.traffic, Path(folder)) for _ in range(options.repeat)],
            )


def show(name: str, passes: list[Times]) -> None:
    """Print the medians of some passes."""
    first = passes[0]
    medians = [
        statistics.median(values) for values in zip(*(one[2:] for one in passes), strict=True)
    ]
    print(
        f"{name:<32}{first.rows:>9}{first.events:>8}"
        + "".join(f"{value:>8.2f}" for value in medians)
    )


def _recorded(path: Path, index: int, folder: Path) -> Times:
    start = time.perf_counter()
    source = open_data(path, folder).sources[index]
    recording = source.load()
    rows = _rows(recording)
    read = time.perf_counter() - start
    start = time.perf_counter()
    site = site_of(source, recording, folder)
    return _labelled(recording, site, rows, read, time.perf_counter() - start)


def _labelled(recording: Recording, site: Site, rows: int, read: float, sited: float) -> Times:
    start = time.perf_counter()
    place(recording, site.network)
    placed = time.perf_counter()
    events = label(recording, site, "benchmark")
    return Times(rows, len(events), read, sited, placed - start, time.perf_counter() - placed)


def _rows(recording: Recording) -> int:
    return sum(len(track.columns["time"]) for track in recording.tracks.values())


def _synthetic(vehicles: int, folder: Path) -> Times:
    start = time.perf_counter()
    site = site_at(straight_highway(opposite_lanes=3, length=1000.0).write(folder / "traffic.xodr"))
    sited = time.perf_counter() - start
    rng = np.random.default_rng(1)
    recording = Recording(
        [_vehicle(str(number), rng) for number in range(vehicles)], 1.0 / RATE, None
    )
    return _labelled(recording, site, _rows(recording), 0.0, sited)


def _vehicle(name: str, rng: np.random.Generator) -> Track:
    """A vehicle that crosses the view at its own speed, one in five with a change of lane."""
    frame, time_of = np.arange(round(RATE * SECONDS)), rng.integers(0, round(1000.0 * RATE)) / RATE
    lanes, side = rng.permutation(3)[:2], rng.choice([-1.0, 1.0])
    centres = side * (1.875 + 3.75 * lanes) + (3.5 if side > 0.0 else 0.0)
    share = np.clip((frame / RATE - rng.uniform(5.0, 12.0)) / 4.0 + 0.5, 0.0, 1.0) * (
        rng.random() < 0.2
    )
    speed, y = (
        rng.uniform(22.0, 36.0),
        centres[0] + (centres[1] - centres[0]) * share**2 * (3.0 - 2.0 * share),
    )
    who = participant(name, "car")
    zero = np.zeros(len(frame))
    columns = {
        "time": time_of + frame / RATE, "x": 500.0 - side * speed * (frame / RATE - 0.5 * SECONDS),
        "y": y, "z": zero,
        "h": np.full(len(frame), np.pi if side > 0.0 else 0.0), "pitch": zero, "roll": zero,
        "speed": zero + speed,
        "acceleration": zero, "road_id": np.full(len(frame), None, object),
        "lane_id": np.zeros(len(frame), np.int64),
        "s": zero, "t": zero, "lane_offset": zero,
    }  # fmt: skip
    return Track(
        name,
        who.kind,
        who.category,
        who.box,
        lambda: {key: values.copy() for key, values in columns.items()},
    )


if __name__ == "__main__":
    main()
