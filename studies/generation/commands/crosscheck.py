"""`python -m studies.generation crosscheck`: P(failure | manoeuvre) by OpenTURNS, crude Monte Carlo
and ours, in arrays."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from generation.report.options import Kind, Recorded
from runner.batch.options import Sut
from runner.judging.settings import DEFAULT_SYSTEM
from schemas.common.errors import Unsupported
from schemas.common.terminal.command_line import Jobs, Verbose, Version, interruptible

NAME = "python -m studies.generation crosscheck"


def command(
    scenario: Annotated[
        Path, typer.Argument(metavar="SCENARIO", help="A logical scenario that plays in arrays.")
    ],
    repeats: Annotated[int, typer.Option(min=1, metavar="N", help="Estimates of each kind.")] = 5,
    truth: Annotated[
        int, typer.Option(min=1, metavar="N", help="Draws of crude Monte Carlo.")
    ] = 100_000,
    sut: Sut = DEFAULT_SYSTEM,
    recorded: Recorded = None,
    kind: Kind = None,
    jobs: Jobs = 1,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Compare estimates with subset simulation by OpenTURNS and with crude Monte Carlo, all in
    arrays; needs openturns."""
    from generation.estimation.estimate import FAILURE, EstimateSettings, Known, estimate
    from generation.space.density.prior import RecordedPrior
    from studies.generation.crosscheck import openturns, subset_simulation
    from studies.generation.problem import posed
    from studies.generation.truth import crude

    openturns()  # before anything is played
    with interruptible(NAME), posed(scenario, sut, jobs, recorded, kind) as posing:
        prior, plays = posing.problem.prior, posing.problem.plays
        if plays is None or not isinstance(prior, RecordedPrior):
            raise Unsupported(
                "this scenario does not play in arrays, or a prior that is not of recordings alone",
                path=scenario,
            )
        for seed in range(repeats):
            print(
                f"OpenTURNS, subset simulation, seed {seed}: "
                f"{subset_simulation(prior, plays, seed)}",
                flush=True,
            )
        for seed in range(repeats):
            found = estimate(
                prior,
                plays,
                plays,
                Known.nothing(prior),
                plays,
                EstimateSettings(seed=seed, controlled=False),
            )
            print(
                f"ours, {found.runs} runs, seed {seed}: {found.probabilities[FAILURE]}", flush=True
            )
        print(f"crude Monte Carlo: {crude(prior, plays, truth)}", flush=True)
