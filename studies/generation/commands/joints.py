"""`python -m studies.generation joints`: how comfortable the motion of scripted actors is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from generation.report.options import Recorded
from schemas.common.terminal.command_line import Verbose, Version, interruptible

NAME = "python -m studies.generation joints"
_QUANTILES = (0.5, 0.9, 0.99, 1.0)


def command(
    scenarios: Annotated[
        list[Path], typer.Argument(metavar="SCENARIO...", help="Logical scenarios of one actor.")
    ],
    recorded: Recorded = None,
    draws: Annotated[int, typer.Option(min=1, metavar="N", help="Draws of the density.")] = 500,
    seed: Annotated[int, typer.Option(help="Seed of the draws.")] = 0,
    timestep: Annotated[float, typer.Option(min=1e-3, metavar="S", help="Of the runs.")] = 0.05,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Measure the greatest acceleration and jerk of the actor in runs of draws of the density,
    without a system under test: those that so many of the runs do not exceed."""
    import numpy as np

    from studies.generation.joints import measure

    with interruptible(NAME):
        print(
            f"| scenario, greatest | {' | '.join(f'{each:.0%}' for each in _QUANTILES)} |",
            f"|---|{'---|' * len(_QUANTILES)}",
            sep="\n",
        )
        for scenario in scenarios:
            found = measure(scenario, recorded, draws, seed, timestep)
            for name, unit, values in (
                ("acceleration", "m/s²", found.acceleration),
                ("jerk", "m/s³", found.jerk),
            ):
                shares = " | ".join(f"{each:.2f}" for each in np.quantile(values, _QUANTILES))
                print(f"| {scenario.stem}, {name}, {unit} | {shares} |", flush=True)
