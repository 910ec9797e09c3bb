"""The command `xosc-run`: run scenarios and variation files, say how they ended."""

from __future__ import annotations

import os
import sys
from collections.abc import Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from runner.run_options import Only, Param, Sample, selection_of, with_run_settings
from runner.settings import RunSettings
from schemas.commands.options import Verbose, Version, guarded, interruptible, new_app, out_folder, parameters_of
from schemas.errors import UsageError
from schemas.storage import writing

if TYPE_CHECKING:
    from runner.batch.batch import Also
    from runner.batch.jobs import Job, Outcome
    from runner.outputs.terminal import Table

_EPILOG = (
    "Exit codes: 0 passed, 1 a verdict is a failure (collision of the ego), 2 wrong usage, 3 invalid file, "
    "4 valid file that asks for something this runner does not do, 5 internal error. With several runs, the gravest of theirs."
)
_GRAVEST_FIRST = (5, 3, 4, 2, 1, 0)

app = new_app()


Files = Annotated[
    list[str],
    typer.Argument(metavar="PATH...", help="Scenarios, and distributions: every parameter set is run; folders, globs."),
]
Repeat = Annotated[
    int | None, typer.Option(min=1, metavar="N", help="Run everything N times, with seeds that count up from --seed.")
]
Osi = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Write one run's ground truth as an OSI trace: FILE.osi or FILE.mcap.")
]
Replay = Annotated[
    bool,
    typer.Option("--replay", help="Write an HTML page that plays each run, to --out with a report, else to this folder."),
]
Against = Annotated[
    Path | None, typer.Option(metavar="BATCH", help="Folder of an earlier batch that the report of --replay compares with.")
]
MaxMemory = Annotated[
    float | None, typer.Option(min=0.1, metavar="GIB", help="Memory that a process may take; a run that needs more is an error.")
]
Ray = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Run on this Ray cluster; 'local' starts one of --jobs processes on this machine."),
]


@app.command(epilog=_EPILOG)
@with_run_settings()
def xosc_run(
    files: Files,
    settings: RunSettings,
    param: Param = None,
    only: Only = None,
    sample: Sample = None,
    repeat: Repeat = None,
    out: Annotated[Path | None, out_folder("Folder for trajectories, event log and result of each run.")] = None,
    osi: Osi = None,
    plot: Annotated[bool, typer.Option("--plot", help="Add a picture of each run to --out.")] = False,
    replay: Replay = False,
    against: Against = None,
    gui: Annotated[bool, typer.Option("--gui", help="Play each run in SUMO's own window.")] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the batch that --out holds.")] = False,
    junit: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a JUnit report.")] = None,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, metavar="N", help="Number of processes.")] = 1,
    ray: Ray = None,
    max_memory: MaxMemory = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Load, compile and begin everything, run nothing.")] = False,
    verbose: Verbose = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print failures and errors only.")] = False,
    _version: Version = False,
) -> None:
    """Run OpenSCENARIO files on SUMO, by default against an ego with a collision avoidance system."""
    from runner.batch.batch import run_batch
    from runner.batch.jobs import jobs_of
    from runner.batch.rehearsal import rehearse_batch
    from runner.batch.selection import runnable
    from runner.outputs.terminal import Table

    if out is None and (resume or plot):
        raise UsageError("--resume and --plot need the --out folder of the results")
    if against is not None:
        _need_report(against, replay and not dry_run, out)
    if max_memory is not None and (ray is not None or dry_run):
        raise UsageError("--max-memory is for runs on this machine: leave --ray and --dry-run out")
    selection, times = selection_of(only, sample, settings.seed), None if dry_run else repeat
    source = jobs_of(runnable(files), parameters_of(param or []), settings.enforce_constraints, selection, times)
    table = Table(verbose=verbose, quiet=quiet, total=source.total if sys.stderr.isatty() and not (quiet or dry_run) else 0)
    chosen: Iterable[Job | Outcome] = source
    if osi is not None:
        from runner.exports.osi import alone

        chosen = alone(source, osi)
    also = list(_also(osi, replay, gui, out))
    with _reporting(junit) as kept:
        if dry_run:
            outcomes = rehearse_batch(chosen, settings, jobs)
        else:
            how: dict[str, Any] = {"processes": jobs, "ray": ray, "max_memory": max_memory}
            outcomes = run_batch(chosen, settings, out=out, plot=plot, resume=resume, also=also, **how)
        code = _follow(outcomes, table, kept)
    if replay and out is not None and not dry_run:
        from runner.replay.report import write_report

        write_report(out, against)
    raise typer.Exit(code)


def _need_report(against: Path, replay: bool, out: Path | None) -> None:
    """Find out before the runs whether their report can be compared with an earlier batch."""
    from runner.batch.journal import settings as settings_of

    if not replay or out is None:
        raise UsageError("--against is for the report, which --replay writes into the --out folder")
    settings_of(against)


@contextmanager
def _reporting(junit: Path | None) -> Iterator[list[Outcome] | None]:
    """Collects outcomes for a JUnit report, which is written in the end, also when the runs are interrupted."""
    if junit is None:
        yield None
        return
    from runner.outputs.report import write_junit

    with writing("the report", junit):
        junit.parent.mkdir(parents=True, exist_ok=True)
        junit.open("a").close()  # what can't be written is better known before the runs than after them
    outcomes: list[Outcome] = []
    try:
        yield outcomes
    finally:
        write_junit(outcomes, junit)


def _also(osi: Path | None, replay: bool, gui: bool, out: Path | None) -> Iterator[Also]:
    """What is to be done with each result besides writing it; options as in `xosc_run`."""
    if osi is not None:
        from runner.exports.osi import write_trace

        yield partial(write_trace, path=osi)
    if replay:
        from runner.replay.player import keep_replay

        yield partial(keep_replay, out=out)
    if gui:
        from runner.replay.sumo_gui import need_display, show

        need_display()
        yield show


def _follow(outcomes: Generator[Outcome], table: Table, kept: list[Outcome] | None) -> int:
    """Show outcomes as they come, keep them if asked to; the exit code."""
    code = 0
    with interruptible("xosc-run", "with --out and --resume a batch goes on where it was"):
        with closing(outcomes):
            for outcome in outcomes:
                if kept is not None:
                    kept.append(outcome)
                code = min(code, outcome.exit_code, key=_GRAVEST_FIRST.index)
                table.show(outcome)
        table.close()
    return code


def main() -> None:
    """Entry point."""
    sys.path.append(os.getcwd())  # for systems under test named as module:Class
    guarded("xosc-run", app)


if __name__ == "__main__":
    main()
