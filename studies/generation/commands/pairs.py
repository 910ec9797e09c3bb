"""`python -m studies.generation pairs`: failures of a system under test that one adversary alone
does not bring about."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from generation.report.options import Recorded
from runner.batch.options import Sut
from runner.judging.settings import DEFAULT_SYSTEM
from schemas.common.terminal.command_line import Jobs, Verbose, Version, interruptible

NAME = "python -m studies.generation pairs"
_FIRST = 100
"""First seed: those below are for development"""


def command(
    scenarios: Annotated[
        list[Path],
        typer.Argument(metavar="SCENARIO...", help="Scenarios of two adversaries, of the library."),
    ],
    sut: Sut = DEFAULT_SYSTEM,
    budget: Annotated[
        int, typer.Option(min=1, metavar="N", help="Runs on SUMO of each search.")
    ] = 1000,
    seeds: Annotated[int, typer.Option(min=1, metavar="N", help="Number of reported seeds.")] = 1,
    both: Annotated[
        bool, typer.Option("--both", help="Search for those alone that need both.")
    ] = False,
    recorded: Recorded = None,
    jobs: Jobs = 2,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Search for failures with two adversaries, and run them again with each alone: what needs
    both, no single one reaches."""
    from tempfile import TemporaryDirectory

    from generation.search.methods.cover import cover
    from studies.generation.pairs import acting_alone, coordinated, needed
    from studies.generation.problem import posed

    with interruptible(NAME):
        for scenario in scenarios:
            with posed(scenario, sut, jobs, recorded) as problem, TemporaryDirectory() as scratch:
                alone = acting_alone(scenario, Path(scratch))
                sought = coordinated(problem, alone, sut) if both else problem
                for seed in range(_FIRST, _FIRST + seeds):
                    found = needed(alone, cover(sought.problem, budget, seed), problem, sut, jobs)
                    print(f"{scenario.stem}, {sut}, seed {seed}: {found}", flush=True)
