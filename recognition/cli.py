"""The command `xosc-recognize`: catalogues of recordings, labels of runs, recordings of SUMO's traffic, training of models."""

from __future__ import annotations

from functools import partial
from inspect import cleandoc

import typer
from typer.core import TyperGroup

from recognition.catalogue.command import NAME, catalogue, label
from recognition.recorder.command import record
from recognition.training.command import train
from schemas import discovery
from schemas.commands.options import Version, guarded, new_app

_DEFAULT = "catalogue"
_EPILOG = (
    f"{NAME} PATH... --out DIR is short for {NAME} {_DEFAULT} PATH... --out DIR; a folder with the name of a command is given as "
    f"./NAME, or after {_DEFAULT}. Experiments: python -m recognition.study. Exit codes: 0 all recordings are in the catalogue, "
    "2 wrong usage, 3 a recording is invalid, 4 one asks for what is not done here, 5 internal error."
)
_FORMATS = ", ".join(discovery.described("recognition.datasets.formats", "TITLE").values())
_CATALOGUE = f"{cleandoc(catalogue.__doc__ or '')}\n\nFormats of recordings: {_FORMATS}."


class _CatalogueByDefault(TyperGroup):
    """Takes arguments that name no command for those of `catalogue`."""

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:  # type: ignore[override]
        """The arguments of the group; what is left are those of the command."""
        own = (*self.commands, *ctx.help_option_names, "--version")
        return super().parse_args(ctx, args if args and args[0] in own else [_DEFAULT, *args])


app = new_app(NAME, _CatalogueByDefault)


@app.callback(epilog=_EPILOG)
def xosc_recognize(_version: Version = False) -> None:
    """Make catalogues of scenarios from recordings, label runs, record traffic, train models; each command has --help."""


app.command(_DEFAULT, help=_CATALOGUE)(catalogue)
app.command("label")(label)
app.command("record")(record)
app.command("train")(train)


def main() -> None:
    """Entry point."""
    guarded(NAME, partial(app, prog_name=NAME))


if __name__ == "__main__":
    main()
