"""`python -m studies.generation coverage`: count intervals that hold sampling and density and cover
the truth."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from generation.report.options import Density
from schemas.common.terminal.command_line import Verbose, Version, interruptible

NAME = "python -m studies.generation coverage"
_SYSTEMS = ("cas", "aeb", "idm", "r157-cc")
_PLANTED = "planted"


def command(
    scenario: Annotated[
        Path, typer.Argument(metavar="SCENARIO", help="A logical scenario that plays in arrays.")
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="DIR", help="Folder for the results; what is there is not made again."
        ),
    ],
    systems: Annotated[
        list[str] | None,
        typer.Option(
            "--system", metavar="NAME", help="Only these systems; `planted` sleeps in a region."
        ),
    ] = None,
    repetitions: Annotated[
        int, typer.Option(min=1, metavar="N", help="Drawn sets of recordings.")
    ] = 100,
    runs: Annotated[int, typer.Option(min=30, metavar="N", help="Runs of each estimate.")] = 600,
    density: Density = "gaussian",
    pool: Annotated[
        int,
        typer.Option(
            min=1000, metavar="N", help="Draws of the density that a region is planted by."
        ),
    ] = 40_000,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Draw recordings anew, fit the density on them, and estimate systems in arrays: how often does
    the interval cover?"""
    from dataclasses import replace

    from generation.search.outcomes import Evaluate
    from generation.space.recorded import kind_of, of_recordings, of_samples
    from schemas.common.errors import UsageError
    from schemas.common.storage import Records
    from studies.generation.coverage import coverage, markdown
    from studies.generation.planted.systems import SILENT, Plan, Pool, plant
    from studies.generation.problem import posed

    names = systems or [*_SYSTEMS, _PLANTED]
    with interruptible(NAME, "the same command continues"), posed(scenario, "none", 1) as posing:
        space, plays = posing.problem.space, posing.problem.plays
        if plays is None:
            raise UsageError("this scenario does not play in arrays", path=scenario)
        recorded = of_samples(of_recordings(None, kind_of(scenario)), space)
        prior = recorded.prior(space, density)
        problem = replace(posing.problem, prior=prior)
        evaluated: dict[str, Evaluate] = {
            name: partial(plays, sut=name) for name in names if name != _PLANTED
        }
        if _PLANTED in names:
            drawn = Pool.of(prior, plays, pool, out / f"{scenario.stem}_{density}_pool_{pool}.npz")
            evaluated[_PLANTED] = plant(
                Plan("box", (1,), 4e-3, SILENT), space, prior, plays, drawn, 0
            )
        found = []
        for each in coverage(
            problem,
            recorded,
            evaluated,
            density,
            repetitions,
            runs,
            Records(out / f"{density}.jsonl"),
        ):
            found.append(each)
            print(*each, flush=True)
        print(markdown(found))
