"""`python -m studies.generation densities`: which density says most of recordings that it has not
seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from generation.report.options import Kind, Pin, Recorded
from generation.space import SpaceChoice
from generation.space.density.models import models
from runner.batch.options import Sut
from runner.judging.settings import DEFAULT_SYSTEM, RunSettings
from schemas.common.errors import UsageError
from schemas.common.storage import keep
from schemas.common.terminal.command_line import Jobs, Verbose, Version, interruptible
from schemas.common.terminal.options import parameters_of

if TYPE_CHECKING:
    from generation.space.recorded import Recorded as Units
    from generation.space.space import Space
    from studies.recognition.report.tables import Table

NAME = "python -m studies.generation densities"


def command(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO", help="A logical scenario.")],
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--density", metavar="NAME", help=f"Only these of {', '.join(models())} (repeatable)."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for the tables as CSV.")
    ] = None,
    recorded: Recorded = None,
    kind: Kind = None,
    pin: Pin = None,
    runs: Annotated[
        int,
        typer.Option(
            min=0,
            metavar="N",
            help="Runs of replays, and of each density's draws: the gate; 0 for none.",
        ),
    ] = 0,
    plays: Annotated[
        bool, typer.Option("--plays", help="Play runs in arrays, in the place of SUMO.")
    ] = False,
    sut: Sut = DEFAULT_SYSTEM,
    jobs: Jobs = 2,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Compare densities of recorded parameters by held-out log-likelihood, in a cross-validation by
    recording.

    With --runs they are simulated too: recorded units with their own values, and draws of the
    densities.
    """
    from generation.search.outcomes import Evaluator
    from generation.search.plays import ArrayPlays
    from generation.space.density.models import model
    from generation.space.recorded import kind_of, of_recordings, of_samples
    from generation.space.space import Space
    from studies.generation.densities import comparison

    for name in only or ():
        model(name)
    with interruptible(NAME):
        samples = of_recordings(recorded, kind or kind_of(scenario))
        space = Space.of(scenario, SpaceChoice(pinned=parameters_of(pin or [], "--pin")))
        found = of_samples(samples, space).within(space)
        if not len(found.theta):
            raise UsageError(
                "no recorded manoeuvre is inside the limits of its parameters", path=scenario
            )
        _show(comparison(found.theta, found.recordings, only), out)
        if runs:
            names = only or list(models())
            play = ArrayPlays if plays else partial(Evaluator, processes=jobs)
            simulate = partial(play, scenario, run=RunSettings(sut=sut))
            print()
            _show(_gated(space, of_samples(samples, space), names, runs, simulate), out)


def _show(table: Table, out: Path | None) -> None:
    """Print a table, and write it into the folder."""
    print(table.markdown(), end="")
    if out is not None:
        folder = out / "tables"
        folder.mkdir(parents=True, exist_ok=True)
        keep(table.csv().encode(), folder / f"{table.name}.csv")


def _gated(
    space: Space, recorded: Units, names: Sequence[str], runs: int, simulate: Callable[..., Any]
) -> Table:
    from generation.search.gate import Share
    from studies.generation.densities import gated

    replays = recorded.replays(space)
    if replays is None:
        raise UsageError("nothing is recorded that could be replayed")
    own, units = replays
    replayed = Share.of(
        simulate(space=own)(units[np.random.default_rng(0).permutation(len(units))[:runs]])
    )
    priors = {name: recorded.recorded_prior(space, name) for name in names}
    return gated(priors, simulate(space=space), replayed, 2 * runs)
