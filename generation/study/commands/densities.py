"""`python -m generation.study densities`: which density says most of recordings that it has not seen."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from generation.density.model import models
from generation.options import Kind, Pin, Recorded
from schemas.commands.options import Verbose, Version, interruptible, parameters_of
from schemas.errors import UsageError

NAME = "python -m generation.study densities"


def command(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO", help="A logical scenario.")],
    only: Annotated[
        list[str] | None,
        typer.Option("--density", metavar="NAME", help=f"Only these of {', '.join(models())} (repeatable)."),
    ] = None,
    recorded: Recorded = None,
    kind: Kind = None,
    pin: Pin = None,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Compare densities of recorded parameters by held-out log-likelihood, in a cross-validation by recording."""
    from generation.density.model import model
    from generation.recorded import kind_of, of_recordings, of_samples
    from generation.search.space import Space
    from generation.study.densities import comparison

    for name in only or ():
        model(name)
    with interruptible(NAME):
        samples = of_recordings(recorded, kind or kind_of(scenario))
        space = Space.of(scenario, parameters_of(pin or [], "--pin"))
        found = of_samples(samples, space).within(space)
        if not len(found.theta):
            raise UsageError("no recorded manoeuvre is inside the limits of its parameters", path=scenario)
        print(comparison(found.theta, found.recordings, only).markdown(), end="")
