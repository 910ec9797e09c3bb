"""`python -m studies.generation estimate`: count intervals of estimates that cover the truth of
many draws in arrays."""

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
        Path, typer.Argument(metavar="SCENARIO", help="A logical scenario that plays in arrays.")
    ],
    repeats: Annotated[
        int, typer.Option(min=1, metavar="N", help="Estimates, each with a seed of its own.")
    ] = 20,
    truth: Annotated[
        int, typer.Option(min=1, metavar="N", help="Draws of the prior that say what is true.")
    ] = 100_000,
    runs: Annotated[
        int, typer.Option(min=30, metavar="N", help="Runs of each estimate, played in arrays.")
    ] = 600,
    without_plays: Annotated[
        bool,
        typer.Option(
            "--without-plays",
            help="Estimate after a search of as many runs, as where a scenario "
            "does not play in arrays.",
        ),
    ] = False,
    sut: Sut = DEFAULT_SYSTEM,
    recorded: Recorded = None,
    kind: Kind = None,
    jobs: Jobs = 1,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Repeat the estimate in arrays in the place of SUMO, without control, and compare it with
    crude Monte Carlo there."""
    from generation.estimation.estimate import FAILURE, EstimateSettings, Known, estimate
    from studies.generation.problem import posed
    from studies.generation.truth import crude, searched

    with interruptible(NAME), posed(scenario, sut, jobs, recorded, kind) as posing:
        prior, plays = posing.problem.prior, posing.problem.plays
        if plays is None or prior is None:
            raise Unsupported("this scenario does not play in arrays", path=scenario)
        true = crude(prior, plays, truth)
        print(f"crude Monte Carlo in arrays: {true}", flush=True)
        share, covered, variations = true.collisions / true.runs, 0, []
        for seed in range(repeats):
            known = searched(posing.problem, runs, seed) if without_plays else Known.nothing(prior)
            given, settings = (
                None if without_plays else plays,
                EstimateSettings(runs, seed, False, 0),
            )
            found = estimate(prior, plays, plays, known, given, settings).probabilities[FAILURE]
            low, high = found.interval
            covered += low <= share <= high
            variations.append(found.variation)
            print(
                f"seed {seed}: {found}, coefficient of variation {found.variation:.3f}", flush=True
            )
        print(
            f"\n| estimates | truth, {truth} draws | intervals that cover it | variation |",
            "|---|---|---|---|",
            f"| {'without' if without_plays else 'with'} plays, {runs} runs | {share:.2e} "
            f"| {covered} of {repeats} | {np.mean(variations):.3f} |",
            sep="\n",
        )
