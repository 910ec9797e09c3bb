"""Speed of rasterising: seconds for 43,800 windows of four grids, from recordings.

    python benchmarks/rasterise.py RECORDINGS [--windows N]

Windows are drawn at random from all vehicles and times, with everything that the default grid
shows: vehicles and road. Reading the recordings is measured apart. Times are of the CPU, of which
rasterising uses one core: others' work does not count.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from recognition import recordings as datasets
from recognition.scenes import site_of
from recognition.trfe.inputs.grids import Grid, Moments, covered, rasterise
from runner.recording import Recording

PAPER = 43_800


def main() -> None:
    """Print the time that rasterising takes, by recording and for as many
    windows as the paper has.
    """
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("recordings", type=Path, help="file or folder")
    arguments.add_argument("--windows", type=int, default=200, help="from each recording")
    options = arguments.parse_args()
    grid, rng = Grid(), np.random.default_rng(0)
    reading = drawing = windows = 0.0
    with tempfile.TemporaryDirectory() as roads:
        for source in datasets.open(options.recordings, roads=Path(roads)).sources:
            start = time.process_time()
            recording = source.load()
            site = site_of(source, recording, Path(roads))
            chosen = moments(recording, grid, options.windows, rng)
            read = time.process_time()
            grids = rasterise(recording, chosen, grid, site)
            end = time.process_time()
            print(
                f"{source.name:<40}{len(recording.tracks):>5} tracks  {len(grids):>6} windows  "
                f"{end - read:.2f} s"
            )
            reading, drawing, windows = (
                reading + read - start,
                drawing + end - read,
                windows + len(grids),
            )
    print(f"reading {reading:.1f} s, rasterising {drawing:.1f} s")
    print(f"{drawing / windows * PAPER:.0f} s for {PAPER} windows of {grid.frames} grids")


def moments(recording: Recording, grid: Grid, count: int, rng: np.random.Generator) -> Moments:
    """Random vehicles and times whose windows their tracks cover."""
    vehicles = sorted(name for name, track in recording.tracks.items() if track.kind == "vehicle")
    spans = {name: recording.tracks[name].columns["time"][[0, -1]] for name in vehicles}
    names = rng.choice(vehicles, count).tolist()
    drawn = [(name, float(rng.uniform(*spans[name]))) for name in names]
    return [
        moment
        for moment, usable in zip(drawn, covered(recording, drawn, grid.offsets), strict=True)
        if usable
    ]


if __name__ == "__main__":
    main()
