"""`python -m studies.generation systems`: collisions of systems under test on the same cases,
avoidable or not."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runner.batch.options import Timestep
from runner.judging.settings import RunSettings
from schemas.common.errors import UsageError
from schemas.common.terminal.command_line import (
    Jobs,
    Quiet,
    Verbose,
    Version,
    interruptible,
    out_folder,
)

if TYPE_CHECKING:
    from runner.batch.jobs import Job, Outcome
    from studies.generation.systems import Comparison

NAME = "python -m studies.generation systems"
LIBRARY = Path("xosc/library")


def command(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="PATH...",
            help="Folders of xosc-generate or of a comparison of methods, or files.",
        ),
    ],
    systems: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Only these systems (repeatable).")
    ] = None,
    method: Annotated[
        str, typer.Option(help="Of a comparison: the method whose cases are run.")
    ] = "mcsg",
    most: Annotated[
        int, typer.Option(min=1, metavar="N", help="Of a comparison: most cases.")
    ] = 100,
    scenarios: Annotated[
        Path, typer.Option(metavar="DIR", help="Of a comparison: folder of its scenario.")
    ] = LIBRARY,
    recorded: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH", help="Of a comparison: its recordings.  [default: our own recordings]"
        ),
    ] = None,
    draw: Annotated[
        int,
        typer.Option(
            min=0, metavar="N", help="Run N uniform points of each logical scenario instead."
        ),
    ] = 0,
    timestep: Timestep = RunSettings.timestep,
    jobs: Jobs = 2,
    out: Annotated[Path | None, out_folder("Folder for systems.md and cases.parquet.")] = None,
    quiet: Quiet = False,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Run every case with every system under test, and with the careful and competent driver of UN
    R157.

    Every parameter set of a variation file is a case. Of a comparison of methods, the cases are the
    best ones of one method over all its seeds, no two of them much alike.
    """
    from studies.generation.systems import SYSTEMS, compare

    with interruptible(NAME):
        if draw:
            cases: list[Job | Outcome] = [case for path in paths for case in _drawn(path, draw)]
        else:
            cases = [
                case
                for path in paths
                for case in _cases_of(path, method, most, scenarios, recorded)
            ]
        progress = (
            _ignore
            if quiet
            else lambda system: print(f"{system}: {len(cases)} cases", file=sys.stderr, flush=True)
        )
        found = compare(
            cases, systems or SYSTEMS, timestep=timestep, processes=jobs, progress=progress
        )
        for line in _failures(found):
            print(line, file=sys.stderr)
        print(found.markdown(), end="")
        if out is not None:
            found.write(out)


def _cases_of(
    path: Path, method: str, most: int, scenarios: Path, recorded: Path | None
) -> Sequence[Job | Outcome]:
    """The cases that a path stands for."""
    from generation.search.settings import Choice
    from runner.batch.jobs import jobs_of
    from studies.generation.comparison.edge_cases import CONFIGURATION, edge_cases, opened

    if (path / CONFIGURATION).exists():
        with opened(path, scenarios, recorded) as study:
            return edge_cases(study, method, Choice(most))
    files = sorted(path.rglob("*_edge_cases.xosc")) if path.is_dir() else [path]
    if not files:
        raise UsageError(
            "neither a comparison of methods nor edge cases of xosc-generate are in this folder",
            path=path,
        )
    return list(jobs_of(files, {}, True))


def _drawn(path: Path, count: int) -> Iterator[Job]:
    """Uniform points of a logical scenario."""
    import numpy as np

    from generation.space.space import Space
    from runner.batch.jobs import Job

    space = Space.of(path)
    for number, row in enumerate(space.draw(count, np.random.default_rng(0))):
        yield Job(f"{path.stem}~{number:06d}", path, path, {**space.pinned, **space.values(row)})


def _failures(found: Comparison) -> Iterator[str]:
    for system, outcomes in found.outcomes.items():
        failed = outcomes.error[~outcomes.executed]
        if len(failed):
            yield f"{system}: {len(failed)} cases failed, the first with: {failed[0]}"


def _ignore(system: str) -> None:
    """Show no progress."""
