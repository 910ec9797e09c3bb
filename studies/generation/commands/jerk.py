"""`python -m studies.generation jerk`: what a limited jerk of a braking leader is worth to a
search."""

from __future__ import annotations

from typing import Annotated

import typer

from generation.report.options import Recorded
from runner.batch.options import Sut
from runner.judging.settings import DEFAULT_SYSTEM
from schemas.common.terminal.command_line import Verbose, Version, interruptible

NAME = "python -m studies.generation jerk"


def command(
    recorded: Recorded = None,
    sut: Sut = DEFAULT_SYSTEM,
    draws: Annotated[
        int, typer.Option(min=1, metavar="N", help="Draws of the density, played in arrays.")
    ] = 100_000,
    seed: Annotated[int, typer.Option(help="Seed of the draws.")] = 0,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Count the draws of recorded braking that fail with their jerk and with accelerations that
    jump."""
    import numpy as np

    from studies.generation.jerk import compare

    with interruptible(NAME):
        found = compare(recorded, sut, draws, seed)
        both = int((found.with_it & found.without_it).sum())
        print(
            f"{draws} draws: {found.with_it.sum()} fail with their jerk, {found.without_it.sum()} "
            f"without one, {both} both ways"
        )
        for name, rows in (("all", slice(None)), ("those that fail with it", found.with_it)):
            jerk = found.jerk[rows]
            shares = (
                "; ".join(f"{each:.2f}" for each in np.quantile(jerk, [0.1, 0.5, 0.9]))
                if len(jerk)
                else "none"
            )
            print(f"  jerk of {name}, 10, 50 and 90 %: {shares} m/s³")
