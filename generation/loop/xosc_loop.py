"""The command `xosc-loop`: a folder of recordings or scenarios passes the whole loop,
and a page shows the results."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from generation.report.options import Failing, fates
from generation.search.settings import (
    LoopSettings,
    budget_within_limits,
    limits_and_fates,
)
from schemas.common.errors import ExitCode, UsageError, exit_codes
from schemas.common.terminal.command_line import (
    AllowInconclusive,
    Quiet,
    Verbose,
    Version,
    epilog,
    guarded,
    interruptible,
    new_app,
    out_folder,
    progress_bar,
    protected,
    say,
)
from schemas.common.terminal.options import with_settings
from schemas.common.terminal.text import many

if TYPE_CHECKING:
    from generation.loop.findings import LoopStage, StageFinding

NAME = "xosc-loop"
_EXAMPLES = ("xosc-loop results --out loop --budget 20 --rounds 1",)
_EPILOG = exit_codes(
    "the page is written",
    "it is, but a file in the folder or a file made is not valid, a run ended with an error, or "
    "no run of a search succeeded "
    "(with --against, also: a failure is new)",
    "a run did not test what its file describes",
)

app = new_app()


@app.command(epilog=epilog(_EPILOG, *_EXAMPLES))
@protected()
@with_settings
def xosc_loop(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER",
            help="Folder of recordings and .xosc scenarios.",
        ),
    ],
    out: Annotated[Path, out_folder("Folder for all files, with the page index.html.")],
    settings: LoopSettings,
    labels: Annotated[
        Literal["model", "rules"], typer.Option(help="Who labels: a model, or the rules alone.")
    ] = "model",
    model: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Model to label by.  [default: the one shipped]"),
    ] = None,
    fail_if: Failing = None,
    allow_inconclusive: AllowInconclusive = False,
    _verbose: Verbose = False,
    quiet: Quiet = False,
    _version: Version = False,
) -> None:
    """Recognise scenarios in recordings, vary them into edge cases for a system under test, check,
    run and show them.

    Edge cases of one round are what the next one starts from. What is done stays: after an
    interruption the same command goes on. index.html in the output folder shows everything, with
    replays, scenario and road files and tags to open.

    --against compares with a loop of another version of the system: the failures of its edge cases
    are replayed, and are fixed or still there; those found now that are unlike them are new where
    the former system survives them.

    --fail-if searches failures by limits of measures, criteria and formulas too, and judges all
    runs by them.

    Recordings that can't be read, and scenarios that can't be read, run or searched are listed with
    the reason; the others go on.

    --recorded, --kind, --pin, --free, --map, --road-path and --catalog-path are about the scenarios
    in the folder, as in xosc-generate.
    """
    from generation.loop.findings import closing
    from generation.loop.loop import run_loop
    from generation.loop.page import write

    settings = replace(
        settings, model=_model(labels, model), budget=budget_within_limits(settings.budget, 0, NAME)
    )
    _refuse_wrong(settings)
    limits, others = limits_and_fates(fail_if)
    settings = replace(settings, run=replace(settings.run, fail_if=limits))
    wanted = fates(others, settings.against)
    with interruptible(NAME, "the same command goes on where it was"):
        found = run_loop(
            folder, out, settings, partial(progress_bar, quiet=quiet), partial(_told, quiet)
        )
        page = write(found, out)
        if not quiet:
            say(*closing(found), f"{page} shows all of it")
    for first in found.inconclusive[:1]:
        several = f"{many(len(found.inconclusive), 'run')} inconclusive, the first"
        say(f"{NAME}: {several}: {first.name}: {first.message}", to=sys.stderr)
    failing = found.against is not None and found.against.fails(*wanted)
    if found.crashed:
        raise typer.Exit(ExitCode.INTERNAL)
    if found.unsound or failing:
        reasons = found.unsound[:1]
        if len(found.unsound) > 1:
            reasons.append(f"{len(found.unsound) - 1} more, see above")
        if failing:
            reasons.append("failures as --fail-if says, or nothing is known of them")
        say(f"{NAME}: exit code 1: {'; '.join(reasons)}", to=sys.stderr)
        raise typer.Exit(ExitCode.FINDING)
    raise typer.Exit(
        ExitCode.INCONCLUSIVE if found.inconclusive and not allow_inconclusive else ExitCode.PASSED
    )


def _model(labels: str, model: Path | None) -> Path | None:
    from recognition.catalogue.pipeline import SHIPPED

    if labels == "rules":
        if model is not None:
            raise UsageError("--model and --labels rules exclude each other")
        return None
    if model is not None and not model.is_dir():
        raise UsageError("there is no model in this folder; --labels rules needs none", path=model)
    return model or SHIPPED


def _refuse_wrong(settings: LoopSettings) -> None:
    """Refuse impossible settings before the recognition starts."""
    from generation.search.problem import method
    from generation.search.variations import freed, mapped

    method(settings.method)
    freed(settings.ask.free)
    mapped(settings.ask.maps)


def _told(quiet: bool, stage: LoopStage, found: StageFinding, seconds: float | None) -> None:
    """A line for each finished stage, and what it could not do."""
    from generation.loop.findings import summary

    if not quiet:
        when = "done before" if seconds is None else f"{seconds:.1f} s"
        say(f"{when:>11}  {summary(stage, found)}")
    for name, error in found.failures.items():
        say(f"{NAME}: {name}: {error}", to=sys.stderr)


def main() -> None:
    """Entry point of the command."""
    guarded(NAME, app)


if __name__ == "__main__":
    main()
