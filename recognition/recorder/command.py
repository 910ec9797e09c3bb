"""`xosc-recognize record`: recordings of our own."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from schemas.commands.options import Verbose, Version, interruptible, writable_folder


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
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, metavar="N", help="Number of processes.")] = 1,
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
        print(f"{len(found)} recordings in {out}")
