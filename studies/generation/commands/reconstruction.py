"""`python -m studies.generation reconstruction`: how far the seven parameters lead from recorded
manoeuvres."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from schemas.common.terminal.command_line import Verbose, Version, interruptible

NAME = "python -m studies.generation reconstruction"


def command(
    paths: Annotated[
        list[Path], typer.Argument(metavar="RECORDINGS...", help="Files or folders of recordings.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Keep the units and their parameters in this table."),
    ] = None,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Measure the distance of recorded manoeuvres from their seven parameters: RMSE_t across the
    lane, RMSE_s along it."""
    from tempfile import TemporaryDirectory

    from recognition.labels.maneuvers.units import Samples, extract
    from studies.generation.reconstruction import by_kind

    found = []
    with interruptible(NAME), TemporaryDirectory() as roads:
        for path in paths:
            found.append(extract(path, roads))
            print(
                f"{path}: {len(set(found[-1].recordings))} recordings", file=sys.stderr, flush=True
            )
            print(by_kind(found[-1], path.name).markdown())
        every = Samples.joined(found)
        if len(found) > 1:
            print(by_kind(every, "all").markdown())
        if out is not None:
            every.write(out)
