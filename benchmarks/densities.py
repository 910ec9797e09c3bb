"""Cost of a density of recorded manoeuvres, with the folds of its cross-validation, and what it
says of recordings not seen.

    python benchmarks/densities.py [--density NAME]

Rows are logarithms of the eight values of each unit of our own recordings, as a search has them
before anything is pinned. Times are of the processor.
"""

from __future__ import annotations

import argparse
from time import process_time

import numpy as np

from generation.space.density.models import JUDGE
from generation.space.density.prior import fitted, held_out
from generation.space.recorded import of_recordings
from recognition.labels.maneuvers.parameters import KINDS
from recognition.labels.maneuvers.units import Samples


def main() -> None:
    """Print a line for each kind of units."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("--density", default=JUDGE)
    options = arguments.parse_args()
    for kind in KINDS:
        units = of_recordings(None, kind)
        assert isinstance(units, Samples)
        rows = np.column_stack([units.theta, units.ego_speeds])
        usable = (rows > 0.0).all(axis=1)
        known = np.log(rows[usable]), units.recordings[usable]
        start = process_time()
        fitted(options.density, *known)
        whole = process_time() - start
        likely = held_out(options.density, *known)
        seconds = process_time() - start
        print(
            f"{kind:12} {len(likely)} units: {whole:.2f} s, with folds {seconds:.2f} s; "
            f"held-out log-likelihood {likely.mean():.3f}, of the least likely 1 % below "
            f"{np.quantile(likely, 0.01):.2f}"
        )


if __name__ == "__main__":
    main()
