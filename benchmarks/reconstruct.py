"""How well seven parameters tell a recorded manoeuvre: RMSE_t and RMSE_s of METHOD.md §3, by kind of unit.

    python benchmarks/reconstruct.py PATH... [--out samples.parquet]

PATH are folders or files with recordings. RMSE_t is across the lane, RMSE_s along it: root mean squares at 1 Hz through each
unit's scene, recording and reconstruction being at one place when the manoeuvre begins, averaged over units. "inside" counts the
units whose parameters all lie within Table 1.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from recognition.maneuvers.parameters import PARAMETERS
from recognition.maneuvers.units import CUT_IN, CUT_OUT, KINDS, LANE_CHANGE, Samples, extract

LOW, HIGH = (np.array([getattr(each, side) for each in PARAMETERS.values()]) for side in ("low", "high"))
SIDEWAYS = (LANE_CHANGE, CUT_IN, CUT_OUT)


def main() -> None:
    """Print a table for each path and one for all."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("paths", nargs="+", type=Path, help="folders or files with recordings")
    arguments.add_argument("--out", type=Path, help="keep the units and their parameters in this Parquet file")
    options = arguments.parse_args()
    found = []
    with tempfile.TemporaryDirectory() as roads:
        for path in options.paths:
            start = time.perf_counter()
            found.append(extract(path, roads))
            print(f"\n{path.name}: {len(set(found[-1].recordings))} recordings in {time.perf_counter() - start:.0f} s")
            show(found[-1])
    everything = Samples.joined(found)
    if len(found) > 1:
        print(f"\nall: {len(set(everything.recordings))} recordings")
        show(everything)
    if options.out:
        everything.write(options.out)


def show(samples: Samples) -> None:
    """Print a line for each kind and one for all that go sideways."""
    print(f"{'kind':<16}{'units':>7}{'inside':>8}{'RMSE_t':>9}{'95 %':>8}{'RMSE_s':>9}{'95 %':>8}  m")
    for name, kinds in (*((kind, (kind,)) for kind in KINDS), ("all sideways", SIDEWAYS), ("all", KINDS)):
        chosen = samples.of_kind(*kinds)
        if not len(chosen.theta):
            continue
        means, most = chosen.errors.mean(axis=0), np.percentile(chosen.errors, 95, axis=0)
        inside = len(chosen.within(LOW, HIGH).theta)
        print(
            f"{name:<16}{len(chosen.theta):>7}{inside:>8}"
            + "".join(f"{a:>9.3f}{b:>8.3f}" for a, b in zip(means, most, strict=True))
        )


if __name__ == "__main__":
    main()
