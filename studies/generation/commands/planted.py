"""`python -m studies.generation planted`: what searches find of failures that were planted."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from schemas.common.command_line import Verbose, Version, interruptible

NAME = "python -m studies.generation planted"


def command(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO", help="A logical scenario with a twin.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results; what is there is not made again.")],
    generator: Annotated[str, typer.Option(help="Generator of planted systems: development, reported.")] = "development",
    methods: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Only these methods (repeatable).")] = None,
    budget: Annotated[int, typer.Option(min=1, metavar="N", help="Runs of each search.")] = 300,
    seeds: Annotated[int, typer.Option(min=1, metavar="N", help="Number of seeds: each plants another system.")] = 10,
    pool: Annotated[int, typer.Option(min=1000, metavar="N", help="Draws of the density that recall is measured by.")] = 40_000,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Search for planted failures on the kinematic twin, without a screen: every trial is a run."""
    from schemas.common.errors import UsageError
    from studies.generation.failures.problem import posed
    from studies.generation.planted.study import PLANS, ROWS, searches, table
    from studies.generation.planted.systems import Pool

    if generator not in PLANS:
        raise UsageError(f"there is no generator {generator!r}; generators: {', '.join(PLANS)}")
    if unknown := [name for name in methods or () if name not in ROWS]:
        raise UsageError(f"there is no row {unknown[0]!r}; rows: {', '.join(ROWS)}")
    with interruptible(NAME, "the same command continues"), posed(scenario, "none", 1) as problem:
        twin, prior = problem.problem.twin, problem.problem.prior
        if twin is None or prior is None:
            raise UsageError("this scenario has no twin to plant failures on", path=scenario)
        drawn = Pool.of(prior, twin, pool, out / f"{scenario.stem}_pool_{pool}.npz")
        found = []
        for each in searches(problem.problem, drawn, generator, methods or list(ROWS), budget, seeds, out):
            found.append(each)
            print(*each, flush=True)
        print(table(found))
