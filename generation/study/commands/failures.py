"""`python -m generation.study failures`: distinct foreseeable and preventable failures by method."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from generation.options import Jobs, Kind, Recorded
from runner.settings import DEFAULT_SYSTEM
from schemas.commands.options import Verbose, Version, interruptible, out_folder
from schemas.errors import UsageError

NAME = "python -m generation.study failures"
REPORTED = 100
"""The first of the seeds that are reported; those below are for development"""


def command(
    scenarios: Annotated[list[Path], typer.Argument(metavar="SCENARIO...", help="Logical scenarios.")],
    out: Annotated[Path, out_folder("Folder for counts and the table.")],
    methods: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Only these methods (repeatable).")] = None,
    sut: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Systems under test (repeatable).  [default: cas]")
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, metavar="N", help="Number of reported seeds.")] = 5,
    budget: Annotated[int, typer.Option(min=1, metavar="N", help="Runs on SUMO of each search.")] = 1000,
    recorded: Recorded = None,
    kind: Kind = None,
    jobs: Jobs = 2,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Count what each method finds with the same number of runs on SUMO; what is there already is not made again."""
    from generation.search.method import method
    from generation.study.failures.counts import counted, path_of, save, table
    from generation.study.failures.problem import posed
    from generation.study.methods import METHODS, TRAJECTORIES

    names = methods or [name for name in METHODS if name not in TRAJECTORIES]
    for name in names:
        if name not in METHODS or name in TRAJECTORIES:
            raise UsageError(f"there is no search method {name!r} of manoeuvres; methods: {', '.join(METHODS)}")
    with interruptible(NAME, "the same command continues"):
        for scenario in scenarios:
            for system in sut or [DEFAULT_SYSTEM]:
                with posed(scenario, system, jobs, recorded, kind) as problem:
                    for seed in range(REPORTED, REPORTED + seeds):
                        for name in names:
                            path = path_of(out, scenario, system, name, seed)
                            if not path.exists():
                                counts = counted(method(name, METHODS)(problem.problem, budget, seed), problem)
                                save(counts, path, budget)
                                print(f"{scenario.stem}, {system}, {name}, seed {seed}: {counts}", flush=True)
        print(table(out, budget).markdown())
