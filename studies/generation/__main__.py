"""`python -m studies.generation`: the experiments on generation, a subcommand each."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Annotated

import typer

from schemas.common.packages import load
from schemas.common.terminal.command_line import guarded, new_app
from studies.generation.tables import Printed

NAME = "python -m studies.generation"
app = new_app()
for module in load("studies.generation.commands"):
    app.command(module.__name__.rpartition(".")[2])(module.command)


def _kept(_code: object, results: Path | None) -> None:
    """Write the result files of an experiment that has ended well."""
    if results is not None and isinstance(sys.stdout, Printed):
        given = sys.argv[1:]
        sys.stdout.keep(results, given[given.index("--results") + 2 :])


@app.callback(result_callback=_kept)
def study(
    context: typer.Context,
    results: Annotated[
        Path | None,
        typer.Option(
            "--results",
            metavar="DIR",
            help="Folder that gets the printed tables as CSV, and the command.",
        ),
    ] = None,
) -> None:
    """Experiments on generation: methods, densities and systems under test compared on the same
    problem."""
    if results is not None:
        context.with_resource(redirect_stdout(Printed(sys.stdout)))


def main() -> None:
    """Entry point of the command."""
    guarded(NAME, app, extra="study")


if __name__ == "__main__":
    main()
