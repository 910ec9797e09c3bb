"""The command `xosc-recognize`: catalogues of recordings, labels of runs, recordings of SUMO's traffic, training of models."""

from __future__ import annotations

from functools import partial
from inspect import cleandoc
from pathlib import Path
from typing import Annotated

import typer
from typer.core import TyperGroup

from recognition.catalogue.command import NAME, catalogue, label, replay
from recognition.training.command import train
from schemas.common import packages
from schemas.common.command_line import Jobs, Verbose, Version, guarded, interruptible, new_app, protected, say, writable_folder
from schemas.common.errors import exit_codes


@protected("max_runs")
@interruptible("xosc-recognize record")
def record(
    out: Annotated[
        Path,
        typer.Argument(
            metavar="OUT", callback=writable_folder, help="Folder for the recordings, one folder in it for each site."
        ),
    ],
    scale: Annotated[float, typer.Option(metavar="FACTOR", help="How much: 1 gives about 2,600 events of each class.")] = 1.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything random.")] = 0,
    site: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Only this site (repeatable).")] = None,
    families: Annotated[
        int, typer.Option(min=0, metavar="N", help="So many sites drawn from the seed instead, with a minute of traffic each.")
    ] = 0,
    jobs: Jobs = 1,
    _verbose: Verbose = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no summary.")] = False,
    _version: Version = False,
) -> None:
    """Record SUMO's traffic on maps of our own, in the formats of highD (motorways) and INTERACTION (all else)."""
    import sys

    from rich.console import Console
    from rich.progress import Progress

    from recognition.recorder import record as record_traffic

    with Progress(console=Console(stderr=True), disable=quiet or not sys.stderr.isatty(), transient=True) as bar:
        task = bar.add_task("Recording", total=None)
        found = record_traffic(
            out, scale=scale, seed=seed, sites=site, jobs=jobs, families=families,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )  # fmt: skip
    if not quiet:
        say(f"{len(found)} recordings in {out}")


_DEFAULT = "catalogue"
_EPILOG = (
    f"{NAME} PATH... --out DIR is short for {NAME} {_DEFAULT} PATH... --out DIR; a folder with the name of a command is given as "
    f"./NAME, or after {_DEFAULT}. Experiments: python -m studies.recognition. "
) + exit_codes("all recordings are in the catalogue", "")
_FORMATS = ", ".join(packages.described("recognition.datasets.formats", "TITLE").values())
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
    """Make catalogues or replays of recordings, label runs, record traffic, train models; each command has --help."""


app.command(_DEFAULT, help=_CATALOGUE)(catalogue)
app.command("label")(label)
app.command("record")(record)
app.command("replay")(replay)
app.command("train")(train)


def main() -> None:
    """Entry point."""
    guarded(NAME, partial(app, prog_name=NAME))


if __name__ == "__main__":
    main()
