"""`python -m studies.generation estimate`: count intervals of estimates that cover the truth of many draws on the twin."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from generation.report.options import Kind, Recorded
from runner.batch.options import Sut
from runner.judging.settings import DEFAULT_SYSTEM
from schemas.common.errors import Unsupported
from schemas.common.terminal.command_line import Jobs, Verbose, Version, interruptible

NAME = "python -m studies.generation estimate"


def command(
    scenario: Annotated[
        Path, typer.Argument(metavar="SCENARIO", help="A logical scenario that the twin plays.")
    ],
    repeats: Annotated[
        int, typer.Option(min=1, metavar="N", help="Estimates, each with a seed of its own.")
    ] = 20,
    truth: Annotated[
        int, typer.Option(min=1, metavar="N", help="Draws of the prior that say what is true.")
    ] = 100_000,
    runs: Annotated[
        int, typer.Option(min=30, metavar="N", help="Runs of each estimate, played on the twin.")
    ] = 600,
    without_twin: Annotated[
        bool,
        typer.Option(
            "--without-twin",
            help="Estimate after a search of as many runs, as where a scenario has no twin.",
        ),
    ] = False,
    sut: Sut = DEFAULT_SYSTEM,
    recorded: Recorded = None,
    kind: Kind = None,
    jobs: Jobs = 1,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Repeat the estimate with the twin in the place of SUMO, without control, and compare it with crude Monte Carlo there."""
    from generation.estimation.estimate import FAILURE, EstimateSettings, Known, estimate
    from studies.generation.problem import posed
    from studies.generation.truth import crude, searched

    with interruptible(NAME), posed(scenario, sut, jobs, recorded, kind) as posing:
        prior, twin = posing.problem.prior, posing.problem.twin
        if twin is None or prior is None:
            raise Unsupported("this scenario has no twin", path=scenario)
        true = crude(prior, twin, truth)
        print(f"crude Monte Carlo on the twin: {true}", flush=True)
        share, covered, variations = true.collisions / true.runs, 0, []
        for seed in range(repeats):
            known = searched(posing.problem, runs, seed) if without_twin else Known.nothing(prior)
            plays, settings = None if without_twin else twin, EstimateSettings(runs, seed, False, 0)
            found = estimate(prior, twin, twin, known, plays, settings).probabilities[FAILURE]
            low, high = found.interval
            covered += low <= share <= high
            variations.append(found.variation)
            print(
                f"seed {seed}: {found}, coefficient of variation {found.variation:.3f}", flush=True
            )
        print(
            f"{covered} of {repeats} intervals cover it; coefficient of variation {np.mean(variations):.3f} on average"
        )
