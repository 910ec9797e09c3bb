"""Collisions of the systems under test on the same cases, each marked avoidable or not by a careful and competent driver.

    python benchmarks/compare_systems.py FILE... [--systems NAME...] [--draw N] [--processes N] [--timestep S] [--out DIR]

Files are scenarios, or variation files such as `xosc-generate` writes: every parameter set is a case. With `--draw`, so many
uniform points of each logical scenario's parameter space are cases instead. The table is printed; with `--out` it is written to
systems.md, and every case with every system to cases.parquet.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from generation.parameters import Space
from generation.systems import SYSTEMS, compare
from runner.jobs import Job, Outcome, jobs_of


def drawn(scenarios: Iterable[Path], count: int) -> list[Job | Outcome]:
    """Uniform points of logical scenarios."""
    cases: list[Job | Outcome] = []
    for path in scenarios:
        space = Space.of(path)
        points = space.draw(count, np.random.default_rng(0))
        cases += [Job(f"{path.stem}~{n:06d}", path, path, {**space.pinned, **space.values(row)}) for n, row in enumerate(points)]
    return cases


def main() -> None:
    """Print the table."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("files", type=Path, nargs="+")
    arguments.add_argument("--systems", nargs="+", default=SYSTEMS)
    arguments.add_argument("--draw", type=int, metavar="N")
    arguments.add_argument("--processes", type=int, default=2)
    arguments.add_argument("--timestep", type=float, default=0.05, help="s")
    arguments.add_argument("--out", type=Path)
    options = arguments.parse_args()
    cases = drawn(options.files, options.draw) if options.draw else list(jobs_of(options.files, {}, True))
    found = compare(
        cases,
        options.systems,
        timestep=options.timestep,
        processes=options.processes,
        progress=lambda system: print(f"{system}: {len(cases)} cases", file=sys.stderr, flush=True),
    )
    print(found.markdown(), end="")
    if options.out is not None:
        import pyarrow.parquet as pq

        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "systems.md").write_text(found.markdown(), encoding="utf-8")
        pq.write_table(found.table(), options.out / "cases.parquet", compression="zstd")


if __name__ == "__main__":
    main()
