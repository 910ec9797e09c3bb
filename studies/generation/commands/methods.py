"""`python -m studies.generation methods`: all methods on one problem; an interrupted comparison
continues."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from generation.report.options import Density, Kind, Pin, Recorded
from runner.batch.options import Sut, Timestep
from schemas.common.errors import UsageError
from schemas.common.terminal.command_line import (
    Jobs,
    Quiet,
    Verbose,
    Version,
    interruptible,
    out_folder,
    progress_bar,
)
from schemas.common.terminal.options import parameters_of

if TYPE_CHECKING:
    from studies.generation.comparison.study import Study

NAME = "python -m studies.generation methods"


def command(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO", help="A logical scenario.")],
    out: Annotated[Path, out_folder("Folder for searches, tables and figures.")],
    seeds: Annotated[int, typer.Option(min=1, metavar="N", help="Number of seeds.")] = 5,
    budget: Annotated[
        int, typer.Option(min=3, metavar="N", help="Simulator calls of each search.")
    ] = 3000,
    methods: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Only these methods (repeatable).")
    ] = None,
    recorded: Recorded = None,
    kind: Kind = None,
    sut: Sut = "cas",
    density: Density = "kde",
    pin: Pin = None,
    timestep: Timestep = 0.05,
    arrays: Annotated[
        bool,
        typer.Option(
            "--arrays/--no-arrays",
            help="Play in arrays, kinematically, if the scenario plays so; "
            "else each run is SUMO's.",
        ),
    ] = True,
    jobs: Jobs = 2,
    likelihoods: Annotated[
        bool,
        typer.Option(
            "--likelihoods/--no-likelihoods",
            help="Table of the densities' held-out likelihoods: the flow takes minutes.",
        ),
    ] = True,
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw figures.")] = True,
    quiet: Quiet = False,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Compare MCSG with every method beside it: same problem, same simulator, same number of its
    calls.

    After an interruption the same command continues; more seeds and methods can be added later.
    """
    from generation.space.recorded import kind_of, of_recordings, of_samples
    from studies.generation.comparison.study import Study, StudySettings

    names = _methods(methods)
    samples = of_recordings(recorded, kind or kind_of(scenario))
    settings = StudySettings(
        sut, budget, density, timestep=timestep, pinned=parameters_of(pin or []), arrays=arrays
    )
    with (
        interruptible(NAME, "the same command continues"),
        Study(scenario, lambda space: of_samples(samples, space), out, settings, jobs) as study,
    ):
        pending = study.pending(seeds, names)
        with progress_bar("simulator calls", len(pending) * budget, quiet) as progress:
            for _ in study.run(pending, progress):
                pass
        _write(study, likelihoods, figures, quiet)


def _methods(chosen: list[str] | None) -> list[str] | None:
    from studies.generation.methods import METHODS

    for name in chosen or ():
        if name not in METHODS:
            raise UsageError(f"there is no search method {name!r}; methods: {', '.join(METHODS)}")
    return chosen


def _write(study: Study, likelihoods: bool, figures: bool, quiet: bool) -> None:
    from studies.generation.comparison.report import write_report

    tables = write_report(study, likelihoods)
    if figures:
        from studies.generation.comparison.figures import write_figures

        write_figures(study, study.out / "figures")
    if not quiet:
        print("\n".join(table.markdown() for table in tables))
        print(f"all tables: {study.out / 'report.md'}")
