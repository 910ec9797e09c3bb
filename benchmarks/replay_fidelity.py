"""Fidelity of played catalogues of vehicles' scenes to data sets: places, speeds, accelerations,
criticality.

    python benchmarks/replay_fidelity.py PATH... [--world sumo|kinematic] [--limit 0.3]

Every usable vehicle's scene becomes a scenario, is checked and is run with `--sut none`; every
participant is compared with the smoothed recording at every recorded row. Each path is a data set,
with figures of its own.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from recognition import recordings as datasets
from recognition.catalogue import pipeline, recordings
from recognition.labels import Rules
from schemas import check_many
from schemas.common.array_types import FloatArray
from schemas.common.terminal.command_line import progress_bar
from schemas.common.terminal.files import expand
from studies.recognition import fidelity

_PHYSICS = 9.5
"""More than tyres hold on a dry road, m/s²"""


def main() -> None:
    """Print what was made, what the checks say, and how far the runs are from the recording."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("paths", nargs="+", type=Path, help="recordings")
    arguments.add_argument(
        "--world", default="sumo", help="sumo, or kinematic: without a simulator"
    )
    arguments.add_argument(
        "--limit", type=float, default=0.3, help="distance (m) that counts as faithful"
    )
    options = arguments.parse_args()
    for path in options.paths:
        print(f"== {path}")
        measure(path, options.world, options.limit)


def measure(path: Path, world: str, limit: float) -> None:
    """Make the scenes of all vehicles of a data set, check and run them, and print how far they are
    from the recordings."""
    settings = recordings.CatalogueSettings(
        scenes=recordings.VEHICLES, rules=Rules(signalised=True)
    )
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        made = pipeline.build(
            [path], out, settings, pipeline.ByRules, partial(progress_bar, quiet=True)
        )
        print(
            f"{sum(made.classes.values())} scenes of vehicles, {len(made.exclusions)} vehicles "
            f"without: {dict(made.passages)}"
        )
        for name, error in made.failures.items():
            print(f"{name} was not read: {error}")
        problems = Counter(
            problem.level for _, found in check_many(expand([str(out)])) for problem in found
        )
        print(f"problems in the files: {dict(problems) or 'none'}")
        sources = datasets.open(path).sources
        report(dict(fidelity.of_catalogue(out, sources, settings.config.scope, world)), limit)


def report(runs: dict[str, fidelity.Replay], limit: float) -> None:
    """Print how far the participants of all runs are from their recorded motion."""
    everyone = [
        (each.greatest, name, each) for name, run in runs.items() for each in run.deviations
    ]
    each = [deviation for *_, deviation in everyone]
    missing = [one.missing for one in each]
    print(
        f"{len(runs)} runs, {len(each)} participants, {sum(missing)} rows missing, at most "
        f"{max(missing)} of one participant"
    )
    print(
        "greatest distance of a participant from its recorded positions: "
        f"{quantiles([one.greatest for one in each], 'm')}"
    )
    rows = np.array([one.rows for one in each])
    for what, unit, values in (
        ("speed", "m/s", np.array([one.speed for one in each])),
        ("acceleration", "m/s²", np.array([one.acceleration for one in each])),
    ):
        overall = float(np.sqrt((rows * values**2)[rows > 0].sum() / rows.sum()))
        print(
            f"{what}, root mean square of the difference: {overall:.3f} {unit}; of a participant "
            f"{quantiles(values, unit)}"
        )
    print(f"greatest speed {max(one.fastest for one in each):.1f} m/s")
    for category in sorted({one.category for one in each}):
        hardest = [one.hardest for one in each if one.category == category]
        print(f"greatest acceleration of a {category}: {quantiles(hardest, 'm/s²')}")
    print(f"greatest turn from step to step: {quantiles([one.turn for one in each], 'rad')}")
    hard = sorted((one.hardest, name, one) for _, name, one in everyone if one.hardest > _PHYSICS)
    print(f"{len(hard)} participants accelerate or brake with more than {_PHYSICS} m/s²")
    for amount, name, one in hard[:-21:-1]:
        print(f"  {amount:6.2f} m/s²  {name}  {one.participant} at {one.hardest_at:.2f} s")
    encounters(runs)
    far = sorted(
        (one for one in everyone if not one[0] <= limit), key=lambda one: one[:2], reverse=True
    )
    print(f"{len(far)} participants beyond {limit} m, in {len({name for _, name, _ in far})} runs")
    for distance, name, one in far[:20]:
        print(f"  {distance:8.3f} m  {name}  {one.participant}")


def encounters(runs: dict[str, fidelity.Replay]) -> None:
    """Print how the least times to collision of runs compare with those of the recording."""
    pairs = [run.encounter for run in runs.values()]
    both = [
        (one.recorded, one.driven)
        for one in pairs
        if one.recorded is not None and one.driven is not None
    ]
    once = sum((one.recorded is None) != (one.driven is None) for one in pairs)
    critical = [abs(driven - recorded) for recorded, driven in both if min(recorded, driven) < 5.0]
    print(f"least time to collision in both: {len(both)} runs, in one only: {once}")
    if critical:
        print(f"  below 5 s: {len(critical)} runs, off by {quantiles(critical, 's')}")


def quantiles(values: Sequence[float] | FloatArray, unit: str) -> str:
    """Median and upper quantiles of values, as text."""
    return ", ".join(
        f"{share:.0%}: {np.quantile(values, share):.4f} {unit}" for share in (0.5, 0.9, 0.99, 1.0)
    )


if __name__ == "__main__":
    main()
