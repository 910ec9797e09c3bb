"""`python -m generation.study ablation`: what each emitter is worth, and the bounds of the coarse-to-fine stages."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from generation.options import Kind, Recorded, Sut
from runner.settings import DEFAULT_SYSTEM
from schemas.commands.options import Verbose, Version, interruptible

NAME = "python -m generation.study ablation"


def command(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO", help="A logical scenario with a twin.")],
    seeds: Annotated[int, typer.Option(min=1, metavar="N", help="Number of development seeds.")] = 2,
    proposals: Annotated[int, typer.Option(min=1, metavar="N", help="Proposals of each search.")] = 24576,
    sut: Sut = DEFAULT_SYSTEM,
    recorded: Recorded = None,
    kind: Kind = None,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Search on the twin with each emitter alone, with all but one, with all; and with MCSG by other bounds of its stages."""
    from generation.study.failures.ablation import bounds, emitters
    from generation.study.failures.problem import posed

    with interruptible(NAME), posed(scenario, sut, 1, recorded, kind) as problem:
        for table in (emitters, bounds):
            print(table(problem.on_twin(), proposals, range(seeds)).markdown(), flush=True)
