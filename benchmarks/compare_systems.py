"""Collisions of the systems under test on the same cases, each marked avoidable or not by a careful and competent driver.

    python benchmarks/compare_systems.py PATH... [--systems NAME...] [--method NAME] [--most N] [--scenarios DIR]
        [--recorded PATH] [--draw N] [--processes N] [--timestep S] [--out DIR]

Paths are what `xosc-generate` wrote into a folder, the folder of a study (`python -m generation.study.comparison`), scenarios, or
variation files; every parameter set is a case. Of a study, the cases are the best ones of `--method`, at most `--most`, of all
its seeds, no two of them much alike; its scenario is looked for in `--scenarios`, and `--recorded` is what it was made with where
not with our own recordings. With `--draw`, so many uniform points of each logical scenario's parameter space are cases instead.
The table is printed; with `--out` it is written to systems.md, and every case with every system to cases.parquet.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from generation.logical.library import SCENARIOS
from generation.outcomes.cases import Choice
from generation.parameters import Space
from generation.study.comparison.edge_cases import CONFIGURATION, edge_cases, opened
from generation.study.systems import SYSTEMS, compare
from runner.batch.jobs import Job, Outcome, jobs_of
from schemas.errors import ToolchainError, UsageError


def drawn(path: Path, count: int) -> Iterator[Job]:
    """Uniform points of a logical scenario."""
    space = Space.of(path)
    for number, row in enumerate(space.draw(count, np.random.default_rng(0))):
        yield Job(f"{path.stem}~{number:06d}", path, path, {**space.pinned, **space.values(row)})


def cases_of(path: Path, options: argparse.Namespace) -> list[Job | Outcome]:
    """The cases that a path stands for."""
    if options.draw:
        return list(drawn(path, options.draw))
    if (path / CONFIGURATION).exists():
        with opened(path, options.scenarios, options.recorded) as study:
            return list(edge_cases(study, options.method, Choice(options.most)))
    files = sorted(path.rglob("*_edge_cases.xosc")) if path.is_dir() else [path]
    if not files:
        raise UsageError("neither a study nor edge cases of xosc-generate are in this folder", path=path)
    return list(jobs_of(files, {}, True))


def main() -> None:
    """Print the table."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("paths", type=Path, nargs="+")
    arguments.add_argument("--systems", nargs="+", default=SYSTEMS)
    arguments.add_argument("--method", default="mcsg")
    arguments.add_argument("--most", type=int, default=Choice().most, metavar="N")
    arguments.add_argument("--scenarios", type=Path, default=SCENARIOS, metavar="DIR")
    arguments.add_argument("--recorded", type=Path, metavar="PATH")
    arguments.add_argument("--draw", type=int, metavar="N")
    arguments.add_argument("--processes", type=int, default=2)
    arguments.add_argument("--timestep", type=float, default=0.05, help="s")
    arguments.add_argument("--out", type=Path)
    options = arguments.parse_args()
    try:
        cases = [case for path in options.paths for case in cases_of(path, options)]
    except ToolchainError as error:
        sys.exit(str(error))
    found = compare(
        cases,
        options.systems,
        timestep=options.timestep,
        processes=options.processes,
        progress=lambda system: print(f"{system}: {len(cases)} cases", file=sys.stderr, flush=True),
    )
    for system, outcomes in found.outcomes.items():
        failed = outcomes.error[~outcomes.executed]
        if len(failed):
            print(f"{system}: {len(failed)} cases failed, the first with: {failed[0]}", file=sys.stderr)
    print(found.markdown(), end="")
    if options.out is not None:
        import pyarrow.parquet as pq

        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "systems.md").write_text(found.markdown(), encoding="utf-8")
        pq.write_table(found.table(), options.out / "cases.parquet", compression="zstd")


if __name__ == "__main__":
    main()
