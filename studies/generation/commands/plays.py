"""`python -m studies.generation plays`: how often verdicts of plays in arrays are SUMO's, and how
fast it is."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from generation.report.options import Kind, Recorded
from runner.batch.options import Sut
from runner.judging.settings import DEFAULT_SYSTEM
from schemas.common.terminal.command_line import Jobs, Verbose, Version, interruptible

NAME = "python -m studies.generation plays"
_PLAYED = 32_768
"""Points by which its speed is measured"""


def command(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO", help="A logical scenario.")],
    draws: Annotated[
        int, typer.Option(min=4, metavar="N", help="Draws of the prior, and as many uniform ones.")
    ] = 500,
    finds: Annotated[
        int, typer.Option(min=0, metavar="N", help="Failures found in arrays, at most.")
    ] = 250,
    seed: Annotated[int, typer.Option(help="Of everything that is drawn.")] = 0,
    sut: Sut = DEFAULT_SYSTEM,
    recorded: Recorded = None,
    kind: Kind = None,
    jobs: Jobs = 2,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Compare verdicts of plays in arrays with those of SUMO, for the system under test and all
    reference drivers."""
    from studies.generation.agreement import HEADER, measured
    from studies.generation.problem import posed

    with interruptible(NAME), posed(scenario, sut, jobs, recorded, kind) as problem:
        print(HEADER)
        for each in measured(problem, draws, finds, seed):
            print(each, flush=True)
        theta = problem.problem.space.draw(_PLAYED, np.random.default_rng(seed))
        begun = time.process_time()
        assert problem.problem.plays is not None
        problem.problem.plays(theta)
        print(
            f"\n{len(theta) / (time.process_time() - begun):.0f} episodes a second of processor "
            "time, uniform draws"
        )
