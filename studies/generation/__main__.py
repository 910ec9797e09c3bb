"""`python -m studies.generation`: the experiments on generation, a subcommand each."""

from __future__ import annotations

from schemas.common.packages import load
from schemas.common.terminal.command_line import guarded, new_app

NAME = "python -m studies.generation"
app = new_app()
for module in load("studies.generation.commands"):
    app.command(module.__name__.rpartition(".")[2])(module.command)


@app.callback()
def study() -> None:
    """Experiments on generation: methods, densities and systems under test compared on the same
    problem."""


def main() -> None:
    """Entry point of the command."""
    guarded(NAME, app, extra="study")


if __name__ == "__main__":
    main()
