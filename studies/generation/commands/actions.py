"""`python -m studies.generation actions`: how far recorded drivers who cut in go, and how well
their density foretells others."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from schemas.common.terminal.command_line import Verbose, Version, interruptible

NAME = "python -m studies.generation actions"


def command(
    paths: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="RECORDINGS...", help="Folders of recordings.  [default: our own actions]"
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Keep the actions in this table.")
    ] = None,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Extract what drivers did who cut in, and say how likely they find what others do."""
    from tempfile import TemporaryDirectory

    from studies.generation.adversary.actions import DECISIONS, OWN, Actions, extract
    from studies.generation.adversary.driving import Driving

    found: list[Actions] = []
    with interruptible(NAME), TemporaryDirectory() as roads:
        for path in paths or ():
            found.append(extract(path, Path(roads) / str(len(found))))
            print(f"{path}: {len(found[-1])} decisions", file=sys.stderr, flush=True)
        actions = Actions.joined(found) if found else Actions.read(OWN)
        if out is not None:
            actions.write(out)
        driving, episodes = Driving(actions), len(np.unique(actions.episodes))
        print(
            f"{len(actions)} decisions in {episodes} episodes of "
            f"{len(set(actions.recordings))} recordings"
        )
        print(f"log p(action | state), held out: {driving.held_out.mean():.3f} on average")
        print(
            f"least mean of foreseeable episodes: {driving.least[0]:.2f} at first, "
            f"{driving.least[DECISIONS - 1]:.2f} at the end"
        )
        limits = driving.limits
        for number, name in enumerate(("along", "across")):
            span = f"{limits.low[number]:.2f} to {limits.high[number]:.2f} m/s²"
            print(f"{name}: {span}, jerk at most {limits.jerk[number]:.2f} m/s³")
