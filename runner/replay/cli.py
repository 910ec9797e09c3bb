"""The command `xosc-replay`: results of runs as pages that play them, pictures and animations; batches as reports."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from urllib.parse import quote

import typer

from schemas.commands.options import Verbose, Version, guarded, interruptible, new_app
from schemas.errors import UsageError

if TYPE_CHECKING:
    from runner.interpreter.result import RunResult

NAME = "xosc-replay"
_EPILOG = "Exit codes: 0 written, 2 wrong usage, 3 results that are damaged or lack a file, 5 internal error."
_SUFFIXES = (".html", ".png", ".gif", ".mp4")
_MOST = 2
"""Runs that a replay shows side by side"""

app = new_app()


@app.command(epilog=_EPILOG)
def xosc_replay(
    folders: Annotated[
        list[Path],
        typer.Argument(metavar="RUN [RUN2]", help="Folders of runs that xosc-run --out has written, or one of a batch."),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="File to write: .html, .png, .gif, or .mp4 by ffmpeg.  [default: replay.html in RUN; report.html in a batch]",
        ),
    ] = None,
    road: Annotated[Path | None, typer.Option(metavar="FILE", help="The OpenDRIVE file, where it has moved.")] = None,
    against: Annotated[
        Path | None, typer.Option(metavar="BATCH", help="Folder of an earlier batch that the report compares with.")
    ] = None,
    gui: Annotated[bool, typer.Option("--gui", help="Play in SUMO's own window instead.")] = False,
    _verbose: Verbose = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")] = False,
    _version: Version = False,
) -> None:
    """Make a page that plays a run, or two side by side; a picture or an animation; of a whole batch a report with replays."""
    from runner.batch import journal
    from runner.outputs.stored import load_run

    with interruptible(NAME):
        if len(folders) == 1 and journal.is_batch(folders[0]):
            if out is not None or road is not None or gui:
                raise UsageError("this is a whole batch: --out, --road and --gui are for its runs", path=folders[0])
            made = [_report(folders[0], against)]
        else:
            if against is not None:
                raise UsageError("--against compares whole batches; give two runs to see them side by side", path=folders[0])
            if len(folders) > _MOST:
                raise UsageError(f"a replay shows one run or two, not {len(folders)}")
            if out is not None and out.suffix.lower() not in _SUFFIXES:
                raise UsageError(f"a replay ends in {', '.join(_SUFFIXES)}", path=out)
            results = [load_run(folder, road) for folder in folders]
            made = _show(results) if gui else [_write(results, out or _usual(folders), folders)]
    for path in made if not quiet else ():
        print(path)


def _usual(folders: list[Path]) -> Path:
    from runner.replay.names import REPLAY

    if len(folders) > 1:
        raise UsageError("name the --out file of the comparison")
    return folders[0] / REPLAY


def _write(results: list[RunResult], path: Path, folders: list[Path]) -> Path:
    if path.suffix.lower() == ".png":
        from runner.replay.pictures import write_pictures

        write_pictures(results, path)
    elif path.suffix.lower() == ".gif":
        from runner.replay.animation import write_animation

        write_animation(results, path)
    elif path.suffix.lower() == ".mp4":
        from runner.replay.animation import write_film

        write_film(results, path)
    else:
        from runner.replay.player import write_replay

        write_replay(results, path, _report_of(folders, path))
    return path


def _report_of(folders: list[Path], page: Path) -> str | None:
    """The report of the batch that runs are of, as an address from a page; None where there is none."""
    from runner.replay.names import REPORT

    (batch, *others) = {folder.resolve().parent for folder in folders}
    if others or not (batch / REPORT).is_file():
        return None
    return quote(Path(os.path.relpath(batch / REPORT, page.resolve().parent)).as_posix())


def _show(results: list[RunResult]) -> list[Path]:
    """One after the other in SUMO's window, which leaves no file."""
    from runner.replay.sumo_gui import show

    for result in results:
        show(result)
    return []


def _report(batch: Path, against: Path | None) -> Path:
    """Replays of all runs of a batch that have none yet, and the report that links them."""
    from runner.batch import journal
    from runner.outputs.stored import RESULT, load_run
    from runner.replay.names import REPLAY, TO_REPORT
    from runner.replay.player import write_replay
    from runner.replay.report import write_report

    for name in sorted(journal.finished(batch)):
        folder = batch / name
        if (folder / RESULT).is_file() and not (folder / REPLAY).exists():
            write_replay([load_run(folder)], folder / REPLAY, TO_REPORT)
    return write_report(batch, against)


def main() -> None:
    """Entry point."""
    guarded(NAME, app)


if __name__ == "__main__":
    main()
