"""`python -m studies.generation foreseen`: what the limit of what is foreseeable lets pass where
there are two adversaries."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from generation.report.options import Recorded
from runner.batch.options import Sut
from runner.judging.settings import DEFAULT_SYSTEM, RunSettings
from schemas.common.terminal.command_line import Verbose, Version, interruptible

NAME = "python -m studies.generation foreseen"


def command(
    scenarios: Annotated[
        list[Path],
        typer.Argument(metavar="SCENARIO...", help="Scenarios of two adversaries, of the library."),
    ],
    sut: Sut = DEFAULT_SYSTEM,
    draws: Annotated[
        int, typer.Option(min=1, metavar="N", help="Draws of the density, played in arrays.")
    ] = 4000,
    recorded: Recorded = None,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Compare limits of what is foreseeable by what they let pass: recorded pairs, draws, draws
    that collide, those of them that neither adversary brings about alone, the whole space."""
    from tempfile import TemporaryDirectory

    from generation.search.plays import ArrayPlays
    from generation.space.recorded import kind_of, of_recordings, of_samples
    from generation.space.space import Space
    from studies.generation.foreseen import limits
    from studies.generation.pairs import Coordinated, acting_alone

    with interruptible(NAME):
        for scenario in scenarios:
            space = Space.of(scenario)
            units = of_samples(of_recordings(recorded, kind_of(scenario)), space)
            with TemporaryDirectory() as scratch:
                paths = {"": scenario, **acting_alone(scenario, Path(scratch))}
                singly = {
                    name: ArrayPlays(path, space, RunSettings(sut=sut))
                    for name, path in paths.items()
                }
            plays = singly.pop("")
            found = limits(space, units, plays, Coordinated(plays, singly), draws)
            print(f"{scenario.stem}\n\n{found.markdown()}", flush=True)
