"""`python -m studies.generation failures`: distinct foreseeable and preventable failures by method."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from generation.options import Kind, Recorded
from runner.settings import DEFAULT_SYSTEM
from schemas.common.command_line import Jobs, Verbose, Version, interruptible, out_folder
from schemas.common.errors import UsageError

NAME = "python -m studies.generation failures"
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
    on_twin: Annotated[bool, typer.Option("--on-twin", help="Search on the twin; SUMO judges what is found.")] = False,
    without_twin: Annotated[
        bool, typer.Option("--without-twin", help="Search on SUMO alone: no twin screens what is run.")
    ] = False,
    extras: Annotated[
        int | None,
        typer.Option(
            min=1, metavar="N", help="Screen proposals of all methods as quality-diversity does, at most N of each search."
        ),
    ] = None,
    tuned: Annotated[Path | None, typer.Option(metavar="FILE", help="Settings that `tune` has written.")] = None,
    recorded: Recorded = None,
    kind: Kind = None,
    jobs: Jobs = 2,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Count what each method finds with the same number of runs on SUMO; what is there already is not made again."""
    from studies.generation.failures.counts import table
    from studies.generation.failures.problem import posed
    from studies.generation.failures.study import Comparison, read
    from studies.generation.methods import METHODS, TRAJECTORIES

    if on_twin and without_twin:
        raise UsageError("--on-twin and --without-twin exclude each other")
    names = methods or [name for name in METHODS if name not in TRAJECTORIES]
    for name in names:
        if name not in METHODS or name in TRAJECTORIES:
            raise UsageError(f"there is no search method {name!r} of manoeuvres; methods: {', '.join(METHODS)}")
    comparison = Comparison(out, budget, extras, read(tuned) if tuned is not None else {})
    with interruptible(NAME, "the same command continues"):
        for scenario in scenarios:
            for system in sut or [DEFAULT_SYSTEM]:
                with posed(scenario, system, jobs, recorded, kind) as problem:
                    chosen = problem.on_twin() if on_twin else problem.without_twin() if without_twin else problem
                    for seed in range(REPORTED, REPORTED + seeds):
                        for name in names:
                            counts = comparison.search(chosen, scenario, system, name, seed)
                            if counts is not None:
                                print(f"{scenario.stem}, {system}, {name}, seed {seed}: {counts}", flush=True)
        print(table(out, budget).markdown())
