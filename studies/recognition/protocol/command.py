"""`python -m studies.recognition protocol`: the protocol as one command that
goes on where it was interrupted.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from recognition.trfe.training import Unit
from schemas.common.errors import UsageError
from schemas.common.terminal.command_line import Verbose, Version, interruptible, out_folder

if TYPE_CHECKING:
    from studies.recognition.protocol.evaluation import Evaluation

SCALES = {"quick": 100, "standard": 400, "paper": 2600}
"""Events of each class, by name of the scale."""
_PRINTED = ("open-set", "clustering", "open-world", "chain")
"""Tables that are shown at the end."""


def protocol(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="WINDOWS_OR_RECORDINGS", help="Folder of windows, or of recordings."
        ),
    ],
    out: Annotated[Path, out_folder("Folder for results, caches, tables and figures.")],
    seeds: Annotated[
        int, typer.Option(min=1, metavar="N", help="Number of seeds; each has its own split.")
    ] = 5,
    first_seed: Annotated[
        int,
        typer.Option(
            min=0,
            metavar="N",
            help="The first of them: figures are reported of others than settings are chosen by.",
        ),
    ] = 0,
    methods: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Only these methods and variants (repeatable)."),
    ] = None,
    experiments: Annotated[
        list[str] | None,
        typer.Option(metavar="KIND", help="Only these kinds of experiments (repeatable)."),
    ] = None,
    scale: Annotated[
        str, typer.Option(help="quick (100), standard (400) or paper (2600) events of each class.")
    ] = "standard",
    events_per_class: Annotated[
        int | None,
        typer.Option(min=20, metavar="N", help="Events of each class, in place of --scale."),
    ] = None,
    preset: Annotated[
        str,
        typer.Option(
            help="Encoder: tokens, or of grids cpu, cpu-cells (no convolutions), cpu-rows (grids "
            "flattened row by row besides), "
            "full, full-rows (both), or pca (principal components of the grids instead)."
        ),
    ] = "cpu",
    channels: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Only these channels of the grids (repeatable)."),
    ] = None,
    split_by: Annotated[
        Unit,
        typer.Option(help="What is never divided between training and test: recording or vehicle."),
    ] = "recording",
    jobs: Annotated[
        int,
        typer.Option(
            "--jobs", "-j", min=1, metavar="N", help="Seeds at a time, each in a process."
        ),
    ] = 2,
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw figures.")] = True,
    _verbose: Verbose = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="No progress bar and no table.")
    ] = False,
    _version: Version = False,
) -> None:
    """Evaluate TRFE and every method beside it by the incremental open-world protocol.

    An interrupted evaluation goes on with the same command; more seeds, methods and experiments can
    be added later.
    """
    from recognition.trfe.inputs.grids import CHANNELS, Grid
    from recognition.trfe.inputs.tokens import Tokens
    from studies.recognition.protocol import pixels
    from studies.recognition.protocol.evaluation import EXPERIMENTS, Evaluation, ProtocolSettings
    from studies.recognition.protocol.presets import PRESETS, TOKENS
    from studies.recognition.protocol.processes import run_beside

    _require("scale", [scale], SCALES)
    _require("preset", [preset], (*PRESETS, pixels.PRESET))
    _require("experiment", experiments or (), EXPERIMENTS)
    _require(
        "method", methods or (), sorted({name for names in EXPERIMENTS.values() for name in names})
    )
    _require("channel", channels or (), CHANNELS)
    kinds = [name for name in EXPERIMENTS if not experiments or name in experiments]
    with interruptible("studies.recognition protocol", "the same command goes on where it was"):
        grid = (
            Grid(channels=tuple(one for one in CHANNELS if one in channels)) if channels else Grid()
        )
        view = Tokens() if preset == TOKENS else grid
        settings = ProtocolSettings(events_per_class or SCALES[scale], preset, split_by, view)
        evaluation = Evaluation(path, out, settings)
        pending = evaluation.pending(seeds, kinds, methods or None, first_seed)
        _show(run_beside(path, out, settings, pending, jobs), len(pending), quiet)
        _write(evaluation, out, figures, quiet)


def _write(evaluation: Evaluation, out: Path, figures: bool, quiet: bool) -> None:
    from studies.recognition.report.report import write_report

    tables = write_report(evaluation, out)
    if figures:
        from studies.recognition.report.figures import write_figures

        write_figures(evaluation, out / "figures")
    if not quiet:
        for table in tables:
            if table.name in _PRINTED:
                print(table.markdown())
        print(f"all tables: {out / 'report.md'}")


def _require(what: str, names: Iterable[str], known: Collection[str]) -> None:
    """Refuse a name that is none of those known."""
    for name in names:
        if name not in known:
            raise UsageError(f"there is no {what} {name!r}; {what}s: {', '.join(known)}")


def _show(counts: Iterable[int], total: int, quiet: bool) -> None:
    """Follow how many results are there."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    columns = TextColumn("results"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    with Progress(
        *columns, console=console, disable=quiet or not console.is_terminal, transient=True
    ) as progress:
        task = progress.add_task("results", total=total)
        for count in counts:
            progress.update(task, completed=count)
