"""`python -m studies.generation planted`: what searches find of failures that were planted."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from generation.report.options import Kind
from runner.batch.options import Timestep
from runner.judging.settings import RunSettings
from schemas.common.terminal.command_line import Jobs, Verbose, Version, interruptible

NAME = "python -m studies.generation planted"


def command(
    scenario: Annotated[
        Path, typer.Argument(metavar="SCENARIO", help="A logical scenario, or a variation file.")
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="DIR", help="Folder for the results; what is there is not made again."
        ),
    ],
    generator: Annotated[
        str, typer.Option(help="Generator of planted systems: development, reported.")
    ] = "development",
    methods: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Only these methods (repeatable), as cover, or cover:explored=0.25,spread=0 with "
            "other settings.",
        ),
    ] = None,
    budget: Annotated[
        int,
        typer.Option(min=1, metavar="N", help="Runs of each search; judged after 100, 300 and N."),
    ] = 1000,
    seeds: Annotated[
        int, typer.Option(min=1, metavar="N", help="Number of seeds: each plants another system.")
    ] = 10,
    first: Annotated[
        int | None, typer.Option(metavar="N", help="First seed.  [default: that of the generator]")
    ] = None,
    base: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="Driver outside the regions.  [default: that of each plan]"
        ),
    ] = None,
    times: Annotated[
        float,
        typer.Option(metavar="F", help="Factor of the plans' probabilities, for small pools."),
    ] = 1.0,
    plans: Annotated[
        list[int] | None,
        typer.Option("--plan", metavar="N", help="Only this plan (repeatable, from 0)."),
    ] = None,
    kind: Kind = None,
    free: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=LOW..HIGH", help="Search this too (repeatable)."),
    ] = None,
    timestep: Timestep = RunSettings.timestep,
    jobs: Jobs = 2,
    pool: Annotated[
        int,
        typer.Option(
            min=1000, metavar="N", help="Draws of the density that recall is measured by."
        ),
    ] = 40_000,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Search for planted failures without a screen: every trial is a run.

    Systems that play in arrays are played there, all others on SUMO.
    """
    from dataclasses import replace

    from schemas.common.errors import UsageError
    from schemas.common.storage import Records
    from studies.generation.planted.study import (
        FIRST_SEED,
        PLANS,
        PLAYED,
        ROWS,
        Benchmark,
        row,
        statements,
        summary,
        table,
    )
    from studies.generation.planted.systems import UNDRIVEN, Pool
    from studies.generation.problem import posed

    if generator not in PLANS:
        raise UsageError(f"there is no generator {generator!r}; generators: {', '.join(PLANS)}")
    for name in methods or ():
        row(name)  # refuse an unknown one before systems are played
    if plans and max(plans) >= len(PLANS[generator]):
        raise UsageError(
            f"the generator {generator} has {len(PLANS[generator])} plans, counted from 0"
        )
    chosen = [PLANS[generator][number] for number in plans or range(len(PLANS[generator]))]
    chosen = [
        replace(plan, base=base or plan.base, probability=times * plan.probability)
        for plan in chosen
    ]
    with (
        interruptible(NAME, "the same command continues"),
        posed(scenario, UNDRIVEN, jobs, None, kind, timestep, free or ()) as posing,
    ):
        problem = posing.problem
        assert problem.prior is not None
        if problem.plays is None and PLAYED in (methods or ()):
            raise UsageError(f"{PLAYED} needs a scenario that plays in arrays", path=scenario)
        rows = methods or [name for name in ROWS if name != PLAYED or problem.plays is not None]
        of = "_".join([scenario.stem, *([kind] if kind else []), f"{timestep:g}"])
        drawn = Pool.of(problem.prior, posing.plays, pool, out / f"{of}_pool_{pool}.npz")
        start = FIRST_SEED[generator] if first is None else first
        benchmark = Benchmark(problem, posing.plays, drawn, chosen, start, rows, budget)
        found = []
        for each in benchmark.results(seeds, Records(out / f"{of}_{generator}_{budget}.jsonl")):
            found.append(each)
            if each.runs == budget:
                print(
                    each.plan,
                    each.method,
                    each.seed,
                    *(f"{value:.3g}" for value in each.found),
                    f"{each.seconds:.1f} s",
                    flush=True,
                )
        print(summary(found), table(found), statements(found), sep="\n\n")
