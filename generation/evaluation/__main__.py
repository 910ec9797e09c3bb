"""`python -m generation.evaluation`: the comparison of all methods as one command that goes on where it was interrupted."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runner.command_line import guarded, interruptible, parameters_of
from schemas.errors import UsageError

if TYPE_CHECKING:
    from generation.evaluation.study import Key, Study

NAME = "python -m generation.evaluation"
app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)


@app.command()
def evaluate(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO", help="A logical scenario.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for searches, tables and figures.")],
    seeds: Annotated[int, typer.Option(min=1, metavar="N", help="Number of seeds.")] = 5,
    budget: Annotated[int, typer.Option(min=3, metavar="N", help="Simulator calls of each search.")] = 3000,
    methods: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Only these methods (repeatable).")] = None,
    recorded: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Recordings, or a table of their units.  [default: our own]")
    ] = None,
    kind: Annotated[str | None, typer.Option(help="Kind of recorded units.  [default: by the scenario's name]")] = None,
    sut: Annotated[str, typer.Option(help="System under test.")] = "cas",
    density: Annotated[str, typer.Option(help="Density of recorded parameters.")] = "kde",
    pin: Annotated[list[str] | None, typer.Option(metavar="NAME=VALUE", help="Keep a parameter at a value (repeatable).")] = None,
    timestep: Annotated[float, typer.Option(metavar="SECONDS", help="Time step of runs.")] = 0.05,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, metavar="N", help="Number of processes.")] = 2,
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw figures.")] = True,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no table.")] = False,
) -> None:
    """Compare MCSG with every method beside it: same problem, same simulator, same number of its calls.

    An interrupted comparison goes on with the same command; more seeds and methods can be added later.
    """
    from generation.evaluation.study import Settings, Study
    from generation.recorded import kind_of, of_recordings, of_samples

    names = _methods(methods)
    samples = of_recordings(recorded, kind or kind_of(scenario))
    settings = Settings(sut, budget, density, timestep=timestep, pinned=parameters_of(pin or []))
    with (
        interruptible(NAME, "the same command goes on where it was"),
        Study(scenario, lambda space: of_samples(samples, space), out, settings, jobs) as study,
    ):
        _run(study, study.pending(seeds, names), quiet)
        _write(study, figures, quiet)


def _methods(chosen: list[str] | None) -> list[str] | None:
    from generation.methods import METHODS

    for name in chosen or ():
        if name not in METHODS:
            raise UsageError(f"there is no search method {name!r}; methods: {', '.join(METHODS)}")
    return chosen


def _run(study: Study, pending: list[Key], quiet: bool) -> None:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    with Progress(*columns, console=console, disable=quiet or not console.is_terminal, transient=True) as progress:
        task = progress.add_task("simulator calls", total=len(pending) * study.settings.budget)
        for key in study.run(pending, lambda calls: progress.advance(task, calls)):
            progress.update(task, description=f"after {key.method}, seed {key.seed}")


def _write(study: Study, figures: bool, quiet: bool) -> None:
    from generation.evaluation.report import write_report

    tables = write_report(study)
    if figures:
        from generation.evaluation.figures import write_figures

        write_figures(study, study.out / "figures")
    if not quiet:
        print("\n".join(table.markdown() for table in tables))
        print(f"all tables: {study.out / 'report.md'}")


if __name__ == "__main__":
    guarded(NAME, app)
