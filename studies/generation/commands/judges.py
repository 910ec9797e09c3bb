"""`python -m studies.generation judges`: collisions of reference drivers in replays of recorded
units."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from generation.report.options import Kind, Recorded
from schemas.common.terminal.command_line import Verbose, Version, interruptible

NAME = "python -m studies.generation judges"


def command(
    scenario: Annotated[
        Path, typer.Argument(metavar="SCENARIO", help="A logical scenario that plays in arrays.")
    ],
    systems: Annotated[
        list[str] | None,
        typer.Option(
            "--system", metavar="NAME", help="Only these systems, with parameters (repeatable)."
        ),
    ] = None,
    recorded: Recorded = None,
    kind: Kind = None,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Replay all recorded units in arrays with each reference driver, and count collisions by kind
    of site."""
    from generation.space.recorded import kind_of, of_recordings, of_samples
    from generation.space.space import Space
    from schemas.common.errors import UsageError
    from studies.generation.judges import SYSTEMS, Replays

    with interruptible(NAME):
        space = Space.of(scenario)
        units = of_samples(of_recordings(recorded, kind or kind_of(scenario)), space)
        found = Replays.of(scenario, space, units, systems or SYSTEMS)
        if found is None:
            raise UsageError(
                "nothing is recorded of a parameter: there is nothing to replay", path=scenario
            )
        print(found.markdown(scenario.stem))
