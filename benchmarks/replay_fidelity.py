"""How closely catalogues of vehicles' scenes repeat recordings when they are run: largest distance from the recorded positions.

    python benchmarks/replay_fidelity.py PATH... [--world sumo|kinematic] [--limit 0.3]

Every usable vehicle's scene becomes a scenario, is checked and is run with `--sut none`; every participant is compared with the
recording at every recorded row.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

from recognition import datasets
from recognition.catalogue import pipeline
from recognition.labels import Rules
from recognition.study import fidelity
from schemas import check_many
from schemas.commands.files import expand


def main() -> None:
    """Print what was made, what the checks say, and how far the runs are from the recording."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("paths", nargs="+", type=Path, help="recordings")
    arguments.add_argument("--world", default="sumo", help="sumo, or kinematic: without a simulator")
    arguments.add_argument("--limit", type=float, default=0.3, help="distance (m) that counts as faithful")
    options = arguments.parse_args()
    settings = pipeline.CatalogueSettings(scenes=pipeline.VEHICLES, rules=Rules(signalised=True))
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        made = pipeline.build(options.paths, out, settings, pipeline.ByRules(), lambda sources, _: sources)
        print(f"{sum(made.classes.values())} scenes of vehicles, {len(made.exclusions)} vehicles without: {dict(made.passages)}")
        for name, error in made.failures.items():
            print(f"{name} was not read: {error}")
        problems = Counter(problem.level for _, found in check_many(expand([str(out)])) for problem in found)
        print(f"problems in the files: {dict(problems) or 'none'}")
        sources = [source for path in options.paths for source in datasets.open(path).sources]
        report(dict(fidelity.of_catalogue(out, sources, settings.config.scope, options.world)), options.limit)


def report(runs: dict[str, list[fidelity.Deviation]], limit: float) -> None:
    """Print how far the participants of all runs are from where they were recorded."""
    everyone = [(each.greatest, name, each) for name, found in runs.items() for each in found]
    greatest = np.array([far for far, _, _ in everyone])
    missing = [each.missing for *_, each in everyone]
    print(
        f"{len(runs)} runs, {len(everyone)} participants, {sum(missing)} rows missing, at most {max(missing)} of one participant"
    )
    quantiles = ", ".join(f"{share:.0%}: {np.quantile(greatest, share):.4f} m" for share in (0.5, 0.9, 0.99, 1.0))
    print(f"greatest distance of a participant from its recorded positions: {quantiles}")
    far = sorted((each for each in everyone if not each[0] <= limit), reverse=True)
    print(f"{len(far)} participants beyond {limit} m, in {len({name for _, name, _ in far})} runs")
    for distance, name, each in far[:20]:
        print(f"  {distance:8.3f} m  {name}  {each.participant}")


if __name__ == "__main__":
    main()
