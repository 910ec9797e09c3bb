"""`python -m studies.generation adversary`: search for failures by an adversary that acts within
the episode."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from generation.report.options import Pin, Ray
from runner.batch.options import Sut, Timestep
from runner.judging.settings import DEFAULT_SYSTEM, RunSettings
from schemas.common.terminal.command_line import (
    CatalogPath,
    Jobs,
    Quiet,
    RoadPath,
    Verbose,
    Version,
    interruptible,
    out_folder,
    progress_bar,
)
from schemas.common.terminal.options import parameters_of
from studies.generation.adversary import OBJECTIVES

if TYPE_CHECKING:
    from studies.generation.adversary.pipeline import Written

NAME = "python -m studies.generation adversary"
_LISTED = 3


def command(
    scenario: Annotated[
        Path, typer.Argument(metavar="SCENARIO", help="A scenario with an actor beside the ego.")
    ],
    out: Annotated[Path, out_folder("Folder for the files; nothing in it is overwritten.")],
    sut: Sut = DEFAULT_SYSTEM,
    recorded: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Table of recorded actions.  [default: our own recordings']"
        ),
    ] = None,
    objective: Annotated[
        str, typer.Option(metavar="NAME", help=f"What shapes the reward: {', '.join(OBJECTIVES)}.")
    ] = OBJECTIVES[0],
    budget: Annotated[
        int,
        typer.Option(
            min=1, metavar="N", help="Most runs, those of the reference drivers among them."
        ),
    ] = 3000,
    seed: Annotated[int, typer.Option(help="Seed of the search.")] = 0,
    pin: Pin = None,
    most: Annotated[int, typer.Option(min=1, metavar="N", help="Most failures to write.")] = 100,
    apart: Annotated[
        float,
        typer.Option(min=0.0, help="Least distance of two failures, as a share of the ranges."),
    ] = 0.05,
    timestep: Timestep = RunSettings.timestep,
    road_path: RoadPath = None,
    catalog_path: CatalogPath = None,
    jobs: Jobs = 2,
    ray: Ray = None,
    _verbose: Verbose = False,
    quiet: Quiet = False,
    _version: Version = False,
) -> None:
    """Train an adversary in arrays, and write each failure that the simulator confirms to the step
    as a scenario.

    Exit codes: 0 failures are written, 1 there is none.
    """
    from studies.generation.adversary.pipeline import Settings, generate
    from studies.generation.adversary.search import AdversarySettings
    from studies.generation.adversary.shape import shape

    run = RunSettings(
        sut=sut,
        timestep=timestep,
        road_path=tuple(road_path or ()),
        catalog_path=tuple(catalog_path or ()),
    )
    chosen = AdversarySettings(objective=objective, apart=apart)
    settings = Settings(
        run, budget, most, seed, recorded, jobs, ray, parameters_of(pin or [], "--pin"), chosen
    )
    shape(objective)  # reject a wrong name before recordings are read
    with interruptible(NAME):
        with progress_bar(scenario.stem, chosen.rounds * chosen.episodes, quiet) as progress:
            written = generate(scenario, out, settings, progress)
        if not quiet:
            print("\n".join(_report(scenario, written, sut)))
    raise typer.Exit(0 if written.files else 1)


def _report(scenario: Path, written: Written, sut: str) -> Iterator[str]:
    rounds = written.rounds
    episodes, foreseeable = (
        sum(each.episodes for each in rounds),
        sum(each.foreseeable for each in rounds),
    )
    failures = sum(each.failures for each in rounds)
    yield f"{scenario.name}: adversary against {sut}"
    yield (
        f"  {episodes} episodes in arrays, {foreseeable} of them as likely as recorded driving; "
        f"{failures} failures"
    )
    survived = ", ".join(f"{name} {count}" for name, count in written.survived.items())
    confirmed = f"{written.world} confirms {len(written.files)} of {written.tried} to the step"
    yield f"  {written.found} of the failures are distinct; {confirmed}"
    if written.files:
        yield f"  of these, reference drivers survive: {survived}"
    yield from (f"  {path}" for path in written.files[:_LISTED])
    if len(written.files) > _LISTED:
        yield f"  and {len(written.files) - _LISTED} more files in {written.files[0].parent}"
