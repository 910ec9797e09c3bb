"""Distance by which runs of the library come back from their OSI traces, in m and s.

    python benchmarks/osi_round_trip.py [FILE...]

Each scenario runs on its exact roads without SUMO, is written as `.osi` and as `.mcap`, and read
again. Vehicles and pedestrians are compared by their reference points, things by the centres of
their boxes: OSI has no other point of them.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

import runner
from runner.exchange.exports import osi
from runner.exchange.exports.moments import box_centre
from runner.exchange.traces.reading import read
from runner.recording import Track
from schemas.common.errors import ToolchainError
from xosc.listing import LIBRARY

PLACE, TIME = 0.01, 0.001
"""m and s that a run may be off"""


def main() -> None:
    """Print a line for each scenario that is off or can't run, and the greatest distances; 1 where
    one is off."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument(
        "files", nargs="*", type=Path, help="scenarios; by default the library's"
    )
    files = arguments.parse_args().files or sorted(
        each for each in LIBRARY.glob("*.xosc") if "_variation" not in each.name
    )
    worst, off, compared = (0.0, 0.0), 0, 0
    for path in files:
        try:
            result = runner.run(path, world="kinematic", sut="none")
        except ToolchainError as error:
            print(f"not run: {error}")
            continue
        place, time = _off(result)
        worst, compared = (max(worst[0], place), max(worst[1], time)), compared + 1
        if place > PLACE or time > TIME:
            off += 1
            print(f"{path.name}: {place:.4f} m, {time:.6f} s")
    print(
        f"{compared} scenarios, two formats: at most {worst[0]:.2e} m and "
        f"{worst[1]:.2e} s, {off} off"
    )
    sys.exit(bool(off))


def _off(result: runner.RunResult) -> tuple[float, float]:
    """Greatest distance and time between a run and what is read from its traces; infinite where a
    track or row is missing."""
    found = (0.0, 0.0)
    with tempfile.TemporaryDirectory() as folder:
        for suffix in osi.FORMATS:
            path = Path(folder) / f"trace{suffix}"
            osi.write_trace(result, path)
            back = read(path).recording.tracks
            for track in result.recording.tracks.values():
                found = tuple(
                    max(pair)
                    for pair in zip(found, _apart(track, back.get(track.name)), strict=True)
                )  # type: ignore[assignment]
    return found


def _apart(one: Track, other: Track | None) -> tuple[float, float]:
    if other is None or len(one.columns["time"]) != len(other.columns["time"]):
        return float("inf"), float("inf")
    points = [
        box_centre(each)
        if one.kind == "miscellaneous"
        else np.column_stack([each.columns[axis] for axis in "xyz"])
        for each in (one, other)
    ]
    times = np.abs(one.columns["time"] - other.columns["time"])
    return float(np.linalg.norm(points[0] - points[1], axis=1).max()), float(times.max())


if __name__ == "__main__":
    main()
