"""`python -m studies.publication`: results of all stages, and the page made of them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from schemas.common.errors import UsageError
from schemas.common.storage import keep
from schemas.common.terminal.command_line import (
    Verbose,
    Version,
    guarded,
    interruptible,
    new_app,
    out_folder,
)
from studies.publication import pictures
from studies.publication.page import PAGE, finding, text
from studies.publication.results import (
    RESULTS,
    entry,
    publish,
    read_journal,
    write_journal,
    written,
)
from studies.publication.stages import SCALES, FailedStage, run, stages

NAME = "python -m studies.publication"
app = new_app()


@app.command()
def publication(
    out: Annotated[
        Path, out_folder("Folder of all that the stages make; they go on where they were.")
    ] = Path("publication"),
    smallest: Annotated[
        bool,
        typer.Option("--smallest", help="Smallest settings: all of it runs in minutes."),
    ] = False,
    middle: Annotated[
        bool,
        typer.Option("--middle", help="Fewer windows and a small encoder: runs in hours."),
    ] = False,
    recordings: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Recordings in the formats of highD and INTERACTION.  [default: SUMO's "
            "traffic is recorded]",
        ),
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(metavar="STAGE", help="Only these stages (repeatable).")
    ] = None,
    results: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder of the result files.")
    ] = RESULTS,
    page: Annotated[Path, typer.Option(metavar="FILE", help="The page.")] = PAGE,
    page_only: Annotated[
        bool, typer.Option("--page-only", help="Run nothing: make the page of the result files.")
    ] = False,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Make the publication's tables, and a page that has them beside the published rows."""
    if smallest and middle:
        raise UsageError("--smallest and --middle are two scales; give one of them")
    scale = "smallest" if smallest else "middle" if middle else "full"
    if recordings is not None and not recordings.exists():
        raise UsageError("there are no recordings", path=recordings)
    found = stages(SCALES[scale], out, recordings)
    names = [stage.name for stage in found]
    for name in only or ():
        if name not in names:
            raise UsageError(f"there is no stage {name!r}; stages: {', '.join(names)}")
    failed: FailedStage | None = None
    if not page_only:
        with interruptible(NAME, "the same command goes on where it was"):
            chosen = [stage for stage in found if not only or stage.name in only]
            journal = read_journal(out)
            left = [
                stage
                for stage in chosen
                if stage.name not in journal or journal[stage.name].command != written(stage, out)
            ]
            try:
                for stage, seconds, processor in run(left):
                    journal[stage.name] = entry(stage, out, seconds, processor)
                    write_journal(journal.values(), out)
                    spent = f"{seconds:.0f} s, processor time {processor:.0f} s"
                    print(f"{stage.name}: {spent}", flush=True)
            except FailedStage as error:
                failed = error  # raised below: what the others made is kept
        publish(found, out, results / scale)
    pictures.write(finding(results), page.parent / pictures.FOLDER)
    keep(text(results).encode(), page)
    print(page)
    if failed is not None:
        raise failed


def main() -> None:
    """Entry point of the command."""
    guarded(NAME, app, extra="study")


if __name__ == "__main__":
    main()
