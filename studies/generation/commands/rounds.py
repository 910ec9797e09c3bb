"""`python -m studies.generation rounds`: what the failures of a first search are worth to a second
one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from generation.report.options import Kind, Recorded
from runner.batch.options import Sut
from runner.judging.settings import DEFAULT_SYSTEM
from schemas.common.terminal.command_line import Jobs, Verbose, Version, interruptible

NAME = "python -m studies.generation rounds"


def command(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO", help="A logical scenario.")],
    budget: Annotated[
        int, typer.Option(min=1, metavar="N", help="Simulator calls of each search.")
    ] = 200,
    seeds: Annotated[int, typer.Option(min=1, metavar="N", help="Number of seeds.")] = 3,
    sut: Sut = DEFAULT_SYSTEM,
    recorded: Recorded = None,
    kind: Kind = None,
    jobs: Jobs = 2,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Count the distinct collisions of a second search with the failures of the first and without,
    at equal budgets.

    The second search has another seed than the first; with and without failures it has the same
    one.
    """
    from studies.generation.rounds import compared

    print("seed  first  second with failures (new)  second without (new)", flush=True)
    with interruptible(NAME):
        for seed, (first, fed, alone) in enumerate(
            compared(scenario, recorded, kind, sut, budget, seeds, jobs)
        ):
            cells = [f"{each.collisions:10} ({each.new})" for each in (fed, alone)]
            print(f"{seed:4}  {first.collisions:5}  {cells[0]:>27}  {cells[1]:>20}", flush=True)
