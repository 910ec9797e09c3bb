"""`python -m studies.generation conditional`: compare a conditional flow with the density that
judges pairs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from generation.report.options import Recorded
from schemas.common.terminal.command_line import Verbose, Version, interruptible

NAME = "python -m studies.generation conditional"


def command(
    scenarios: Annotated[
        list[Path],
        typer.Argument(metavar="SCENARIO...", help="Scenarios of two adversaries, of the library."),
    ],
    recorded: Recorded = None,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Compare conditional flows with the density that judges pairs, on recordings that were not
    fitted; needs zuko."""
    import numpy as np

    from generation.space.logical.maneuvers import EGO
    from generation.space.recorded import kind_of, of_recordings, of_samples
    from generation.space.space import Space
    from studies.generation.conditional import comparison

    speed = f"{EGO}_Speed_mps"
    with interruptible(NAME):
        for scenario in scenarios:
            space = Space.of(scenario)
            found = of_samples(of_recordings(recorded, kind_of(scenario)), space).within(space)
            held = [
                speed,
                *(
                    name
                    for name in found.recorded_prior(space, "student").searched
                    if name != speed
                ),
            ]
            rows = np.stack([found.values[name] for name in held], axis=1)
            usable = (rows > 0.0).all(axis=1)
            print(
                scenario.stem,
                comparison(np.log(rows[usable]), found.recordings[usable]).markdown(),
                sep="\n\n",
                flush=True,
            )
