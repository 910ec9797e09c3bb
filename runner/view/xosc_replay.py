"""The command `xosc-replay`: results of runs as pages that play them, pictures and animations;
batches as reports."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from urllib.parse import quote

import typer

from schemas.common.errors import InvalidFile, UsageError, exit_codes
from schemas.common.policy import limited
from schemas.common.terminal.command_line import (
    Quiet,
    Verbose,
    Version,
    epilog,
    guarded,
    new_app,
    protected,
    say,
)
from schemas.common.terminal.options import WRITTEN
from schemas.common.terminal.text import many

if TYPE_CHECKING:
    from runner.judging.result import RunResult

NAME = "xosc-replay"
_EXAMPLES = (
    "xosc-replay results/simple_cut_in",
    "xosc-replay results --against results_before",
    "xosc-replay results_v1 results_v2 results_v3",
    "xosc-replay results/simple_cut_in --out cut_in.gif",
)
_EPILOG = exit_codes("written", "")
_SUFFIXES = (".html", ".png", ".gif", ".mp4")
_MOST = 2
"""Runs that a replay shows side by side"""

app = new_app()


@app.command(epilog=epilog(_EPILOG, *_EXAMPLES))
@protected("max_runs")
def xosc_replay(
    folders: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUN [RUN2] | BATCH...",
            help="Folders of runs that xosc-run --out has written, or OSI traces; a batch; or "
            "several batches, the oldest first.",
        ),
    ],
    out: Annotated[
        Path | None,
        WRITTEN,
        typer.Option(
            metavar="FILE",
            help="File to write: .html, .png, .gif, or .mp4 by ffmpeg."
            "  [default: replay.html in RUN; report.html in a batch; history.html in the last of "
            "several; the trace's name]",
        ),
    ] = None,
    road: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The OpenDRIVE file, where it has moved.")
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option(
            metavar="BATCH", help="Folder of an earlier batch that the report compares with."
        ),
    ] = None,
    gui: Annotated[bool, typer.Option("--gui", help="Play in SUMO's own window instead.")] = False,
    _verbose: Verbose = False,
    quiet: Quiet = False,
    _version: Version = False,
) -> None:
    """Make a page that plays a run, or two side by side; a picture or an animation; of a batch a
    report, of several a history."""
    from runner.batch import journal
    from runner.batch.outputs.folder import load_run
    from runner.exchange.traces.maps import is_trace, load_trace

    if len(folders) == 1 and journal.is_batch(folders[0]):
        # Options of single runs would have no effect, and pass in silence.
        if out is not None or road is not None or gui:
            first = min(journal.finished(folders[0]).outcomes, default="RUN")
            told = (
                "this is a whole batch: --out, --road and --gui are for its runs, as "
                f"{folders[0] / first}"
            )
            raise UsageError(told, path=folders[0])
        made = [_report(folders[0], against)]
    elif len(folders) > 1 and all(map(journal.is_batch, folders)):
        made = [_history(folders, out, road is not None or gui or against is not None)]
    else:
        if against is not None:
            raise UsageError(
                "--against compares whole batches; give two runs to see them side by side",
                path=folders[0],
            )
        if len(folders) > _MOST:
            raise UsageError(f"a replay shows one run or two, not {len(folders)}")
        if out is not None and out.suffix.lower() not in _SUFFIXES:
            raise UsageError(f"a replay ends in {', '.join(_SUFFIXES)}", path=out)
        for folder in folders:
            if folder.is_file() and not is_trace(folder):
                raise InvalidFile(
                    "a folder of results is expected, as xosc-run --out writes it, or an OSI trace",
                    path=folder,
                )
        with limited():
            results = [
                load_trace(folder, road) if is_trace(folder) else load_run(folder, road)
                for folder in folders
            ]
            made = _show(results) if gui else [_write(results, out or _usual(folders), folders)]
    for path in made if not quiet else ():
        say(str(path))


def _history(batches: list[Path], out: Path | None, odd: bool) -> Path:
    """The page of several batches."""
    from runner.view.report import write_history

    if odd:
        raise UsageError(
            "these are whole batches: --road, --gui and --against are not for their history",
            path=batches[0],
        )
    if out is not None and out.suffix.lower() != ".html":
        raise UsageError("the history of batches ends in .html", path=out)
    return write_history(batches, out)


def _usual(folders: list[Path]) -> Path:
    from runner.view.replay.player import REPLAY

    if len(folders) > 1:
        raise UsageError("name the --out file of the comparison")
    (only,) = folders
    return only.with_suffix(".html") if only.is_file() else only / REPLAY


def _write(results: list[RunResult], path: Path, folders: list[Path]) -> Path:
    if path.suffix.lower() == ".png":
        from runner.view.replay.frames import write_pictures

        write_pictures(results, path)
    elif path.suffix.lower() == ".gif":
        from runner.view.replay.frames import write_animation

        write_animation(results, path)
    elif path.suffix.lower() == ".mp4":
        from runner.view.replay.frames import write_film

        write_film(results, path)
    else:
        from runner.view.replay.player import write_replay

        write_replay(results, path, _report_of(folders, path))
    return path


def _report_of(folders: list[Path], page: Path) -> str | None:
    """The report of the batch that runs are of, as an address from a page; None where there is
    none."""
    from runner.view.replay.player import REPORT

    (batch, *others) = {folder.resolve().parent for folder in folders}
    if others or not (batch / REPORT).is_file():
        return None
    return quote(Path(os.path.relpath(batch / REPORT, page.resolve().parent)).as_posix())


def _show(results: list[RunResult]) -> list[Path]:
    """Show runs in sequence in SUMO's window, which leaves no file."""
    from runner.view.replay.sumo_gui import show

    for result in results:
        show(result)
    return []


def _report(batch: Path, against: Path | None) -> Path:
    """Replays of all runs of a batch that have none yet, and the report that links them."""
    from runner.batch import journal
    from runner.batch.outputs.folder import RESULT, load_run
    from runner.view.replay.player import REPLAY, TO_REPORT, write_replay
    from runner.view.report import write_report

    finished, faults = journal.finished(batch), list[InvalidFile]()
    for name in sorted(finished.outcomes):
        folder = batch / name
        if folder.is_symlink():  # it leads to another folder, of which nobody has spoken
            print(f"{NAME}: no replay of {name}: its folder is a symbolic link", file=sys.stderr)
            continue
        if (folder / RESULT).is_file() and not (folder / REPLAY).exists():
            try:
                with limited():
                    write_replay([load_run(folder)], folder / REPLAY, TO_REPORT)
            except InvalidFile as error:
                print(f"{NAME}: no replay of {name}", file=sys.stderr)
                faults.append(error)
    if finished.damaged:
        lines = many(len(finished.damaged), "line")
        print(
            f"{NAME}: {lines} of the journal damaged, the first is "
            f"{finished.damaged[0]}: without those runs",
            file=sys.stderr,
        )
    report = write_report(batch, against)
    # After the report: one damaged run must not cost it.
    if faults:
        raise faults[0]
    return report


def main() -> None:
    """Entry point."""
    guarded(NAME, app)


if __name__ == "__main__":
    main()
