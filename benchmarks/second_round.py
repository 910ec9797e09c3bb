"""What the failures of a first search are worth to a second one: distinct collisions, with them and without, at equal budgets.

    python benchmarks/second_round.py [--scenario xosc/library/cut_in_highway.xosc] [--budget 200] [--seeds 3] [--sut cas]

The second search has another seed than the first, with and without its failures the same one.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from generation.loop.tasks.failures import Failures, failures
from generation.pipeline import Settings, generate
from generation.recorded import kind_of, of_recordings, of_samples
from xodr.array_types import FloatArray


def main() -> None:
    """Print, for each seed, what both rounds found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", type=Path, default=Path("xosc/library/cut_in_highway.xosc"))
    parser.add_argument("--budget", type=int, default=200)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--sut", default="cas")
    given = parser.parse_args()
    samples = of_recordings(None, kind_of(given.scenario))

    def search(seed: int, found: FloatArray | None = None, before: FloatArray | None = None) -> Failures:
        settings = Settings(sut=given.sut, budget=given.budget, seed=seed)
        with TemporaryDirectory() as out:
            made = generate(given.scenario, partial(of_samples, samples), Path(out), settings, found=found)
        return failures(made.space, made.history, before)

    print("seed  first  second with failures (new)  second without (new)", flush=True)
    for seed in range(given.seeds):
        first = search(seed)
        fed = search(seed + 1000, first.theta, first.theta)
        alone = search(seed + 1000, None, first.theta)
        told = (f"{each.collisions:10} ({each.new})" for each in (fed, alone))
        print(f"{seed:4}  {first.collisions:5}  {next(told):>27}  {next(told):>20}", flush=True)


if __name__ == "__main__":
    main()
