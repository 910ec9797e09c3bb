"""`python -m studies.recognition agreement`: how labels agree with what else is known of real
recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from schemas.common.terminal.command_line import Verbose, Version, interruptible, out_folder


@interruptible("studies.recognition agreement")
def agreement(
    data: Annotated[
        Path, typer.Argument(metavar="RECORDINGS", help="Folder or file with recordings.")
    ],
    out: Annotated[Path, out_folder("Folder for agreement.md and its plots.")],
    signalised: Annotated[
        bool, typer.Option("--signalised", help="Count junctions with traffic lights as well.")
    ] = False,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Label all recordings of a folder, and report how the labels agree with their bare positions
    and own lanes."""
    from recognition.labels import Rules
    from schemas.common.storage import keep, writing
    from studies.recognition.agreement.plots import plots
    from studies.recognition.agreement.report import report
    from studies.recognition.agreement.survey import survey

    with writing("the report", out):
        out.mkdir(parents=True, exist_ok=True)
        places = survey(data, out / "roads", Rules(signalised=signalised))
        drawn = {place.name: plots(place, out) for place in places}
        print(keep(report(places, drawn).encode(), out / "agreement.md"))
