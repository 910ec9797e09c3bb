"""Effect of smoothing on recordings: distance from the recorded positions, remaining motion, time.

python benchmarks/smoothing.py PATH...
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from pathlib import Path

import numpy as np

from recognition import recordings as datasets
from runner.recording import Track
from schemas.common.array_types import FloatArray


def main() -> None:
    """Print a line for each site."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("paths", nargs="+", type=Path, help="recordings")
    sites: dict[str, list[tuple[FloatArray, ...]]] = {}
    counts: Counter[str] = Counter()
    for source in (
        source for path in arguments.parse_args().paths for source in datasets.open(path).sources
    ):
        start = time.perf_counter()
        recording = source.load()
        counts["ms"] += round(1000.0 * (time.perf_counter() - start))
        assert source.report is not None
        counts.update(
            rows=source.report.rows, cuts=len(source.report.cuts), excluded=source.report.excluded
        )
        sites.setdefault(source.site, []).extend(
            moved(track) for track in recording.tracks.values() if track.kind == "vehicle"
        )
    print(
        f"{counts['rows']} rows read in {counts['ms'] / 1000:.1f} s, {counts['cuts']} cuts, "
        f"{counts['excluded']} rows excluded"
    )
    for site, tracks in sites.items():
        off, speed, acceleration, recorded, smoothed, jerk = (
            np.concatenate(values) for values in zip(*tracks, strict=True)
        )
        print(f"{site}: {len(off)} rows of vehicles")
        print(f"  centre off by {quantiles(off)} m")
        print(
            f"  speed, acceleration off by {rms(speed):.3f} m/s, {rms(acceleration):.3f} m/s² "
            "(root mean square)"
        )
        print(
            f"  |acceleration| recorded {quantiles(recorded)}, smoothed {quantiles(smoothed)} "
            f"m/s²; |jerk| {quantiles(jerk)} m/s³"
        )


def moved(track: Track) -> tuple[FloatArray, ...]:
    """Distances of the box's centre, differences of speed and acceleration; accelerations recorded
    and smoothed; jerks."""
    columns, ahead = track.columns, track.box.x
    places = ((columns[f"{of}x"], columns[f"{of}y"], columns[f"{of}h"]) for of in ("", "raw_"))
    (x, y), (raw_x, raw_y) = ((x + ahead * np.cos(h), y + ahead * np.sin(h)) for x, y, h in places)
    speed, acceleration = (
        columns[name] - columns[f"raw_{name}"] for name in ("speed", "acceleration")
    )
    jerk = np.diff(columns["acceleration"]) / np.diff(columns["time"])
    amounts = (np.abs(columns[name]) for name in ("raw_acceleration", "acceleration"))
    return np.hypot(x - raw_x, y - raw_y), speed, acceleration, *amounts, np.abs(jerk)


def rms(values: FloatArray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def quantiles(values: FloatArray) -> str:
    """Median, 99th percentile and maximum, as text."""
    return "/".join(f"{np.quantile(values, share):.2f}" for share in (0.5, 0.99, 1.0))


if __name__ == "__main__":
    main()
