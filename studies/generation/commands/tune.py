"""`python -m studies.generation tune`: settings of all methods for the comparison of failures, chosen on development seeds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from generation.options import Kind, Recorded
from runner.run_options import Sut
from runner.settings import DEFAULT_SYSTEM
from schemas.common.command_line import Verbose, Version, interruptible

NAME = "python -m studies.generation tune"


def command(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO", help="A logical scenario with a twin.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="File of the chosen settings; others in it are kept.")],
    methods: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Only these methods (repeatable).")] = None,
    seeds: Annotated[int, typer.Option(min=1, metavar="N", help="Number of development seeds.")] = 2,
    proposals: Annotated[int, typer.Option(min=1, metavar="N", help="Proposals of each trial and seed.")] = 8192,
    sut: Sut = DEFAULT_SYSTEM,
    recorded: Recorded = None,
    kind: Kind = None,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Try four settings of each method on the twin, and keep those with which it finds most distinct failures."""
    from schemas.common.errors import UsageError
    from schemas.common.storage import write_object
    from studies.generation.failures.problem import posed
    from studies.generation.failures.study import TRIALS, read, trials

    for name in methods or ():
        if name not in TRIALS:
            raise UsageError(f"the method {name!r} has nothing to tune; methods: {', '.join(TRIALS)}")
    with interruptible(NAME), posed(scenario, sut, 1, recorded, kind) as problem:
        for name in methods or list(TRIALS):
            chosen = read(out) if out.exists() else {}
            if name in chosen:
                continue
            tried = trials(problem.on_twin(), name, proposals, range(seeds))
            for trial in tried:
                print(f"{name}, {dict(trial.settings)}: {', '.join(map(str, trial.found))} distinct failures", flush=True)
            write_object({**chosen, name: dict(max(tried, key=lambda trial: sum(trial.found)).settings)}, out)
