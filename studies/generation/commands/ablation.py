"""`python -m studies.generation ablation`: what each emitter is worth, and the bounds of the coarse-to-fine stages."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from generation.options import Kind, Recorded
from runner.run_options import Sut
from runner.settings import DEFAULT_SYSTEM
from schemas.common.command_line import Verbose, Version, interruptible

NAME = "python -m studies.generation ablation"


def command(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO", help="A logical scenario with a twin.")],
    seeds: Annotated[int, typer.Option(min=1, metavar="N", help="Number of development seeds.")] = 2,
    proposals: Annotated[int, typer.Option(min=1, metavar="N", help="Proposals of each search.")] = 24576,
    emitters: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME[+NAME...]", help="Only these sets of emitters, and no bounds of stages (repeatable)."),
    ] = None,
    sut: Sut = DEFAULT_SYSTEM,
    recorded: Recorded = None,
    kind: Kind = None,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Search on the twin with each emitter alone, with all but one, with all; and with MCSG by other bounds of its stages."""
    from generation.search.emitters import EMITTERS
    from schemas.common.errors import UsageError
    from studies.generation.failures.problem import posed
    from studies.generation.failures.study import bounds, by_emitters, sets

    chosen = [tuple(each.split("+")) for each in emitters or ()]
    for name in (name for each in chosen for name in each):
        if name not in EMITTERS:
            raise UsageError(f"there is no emitter {name!r}; emitters: {', '.join(EMITTERS)}")

    with interruptible(NAME), posed(scenario, sut, 1, recorded, kind) as problem:
        posing = problem.on_twin()
        print(by_emitters(posing, proposals, range(seeds), chosen or sets()).markdown(), flush=True)
        if not chosen:
            print(bounds(posing, proposals, range(seeds)).markdown(), flush=True)
