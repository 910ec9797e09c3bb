"""The command `xosc-run`: run scenarios and variation files, say how they ended."""

from __future__ import annotations

import sys
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from runner.batch.options import FailIf, Only, Param, Sample, selection_of
from runner.judging.measures.measure import NEW_FAILURE
from runner.judging.settings import RunSettings
from schemas.common.errors import ExitCode, UsageError, exit_codes, gravest
from schemas.common.policy import current
from schemas.common.storage import check_writable
from schemas.common.terminal.command_line import (
    AllowInconclusive,
    Jobs,
    Overwrite,
    Verbose,
    Version,
    epilog,
    guarded,
    interruptible,
    new_app,
    out_folder,
    protected,
)
from schemas.common.terminal.options import READ, WRITTEN, explain, parameters_of, with_settings

if TYPE_CHECKING:
    from runner.batch.batch import Also, BatchComparison
    from runner.batch.jobs import Job, Outcome
    from runner.batch.outputs.terminal import OutcomeTable
    from runner.batch.outputs.work import WorkDone

_EXAMPLES = (
    "xosc-run xosc/library/simple_cut_in.xosc",
    "xosc-run --sut adas xosc/library --jobs 4 --out results --replay",
    'xosc-run -p CutIn_Gap_m=8 --fail-if "min_ttc<1" xosc/library/simple_cut_in.xosc',
    "xosc-run --sut adas --assess euro-ncap-2026 OSC-NCAP-scenarios/OpenSCENARIO --out assessed",
)
_EPILOG = exit_codes(
    "passed",
    "a verdict is a failure (collision of the ego)",
    "a run did not test what its file describes",
)

app = new_app()


Files = Annotated[
    list[str],
    READ,
    typer.Argument(
        metavar="PATH...",
        help="Scenarios, and distributions: every parameter set is run; folders, globs.",
    ),
]
Repeat = Annotated[
    int | None,
    typer.Option(
        min=1, metavar="N", help="Run everything N times, with seeds that count up from --seed."
    ),
]
Osi = Annotated[
    Path | None,
    WRITTEN,
    typer.Option(
        metavar="FILE", help="Write one run's ground truth as an OSI trace: FILE.osi or FILE.mcap."
    ),
]
Replay = Annotated[
    bool,
    typer.Option(
        "--replay",
        help="Write an HTML page that plays each run, to --out with a report, else to this folder.",
    ),
]
Against = Annotated[
    Path | None,
    typer.Option(
        metavar="BATCH",
        help="Folder of an earlier batch to compare with; --fail-if new-failure needs it.",
    ),
]
Assess = Annotated[
    str | None,
    typer.Option(
        metavar="PROTOCOL",
        help="Write the runs as the table of a test protocol to --out: assessment.html and .csv.",
    ),
]
Ray = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Run on this Ray cluster; 'local' starts one of --jobs processes on this machine.",
    ),
]


@app.command(epilog=epilog(_EPILOG, *_EXAMPLES))
@protected()
@with_settings
def xosc_run(
    files: Files,
    settings: RunSettings,
    param: Param = None,
    only: Only = None,
    sample: Sample = None,
    repeat: Repeat = None,
    fail_if: FailIf = None,
    out: Annotated[
        Path | None, out_folder("Folder for trajectories, event log and result of each run.")
    ] = None,
    osi: Osi = None,
    plot: Annotated[
        bool, typer.Option("--plot", help="Add a picture of each run to --out.")
    ] = False,
    replay: Replay = False,
    against: Against = None,
    assess: Assess = None,
    gui: Annotated[bool, typer.Option("--gui", help="Play each run in SUMO's own window.")] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the batch that --out holds.")
    ] = False,
    overwrite: Overwrite = False,
    junit: Annotated[
        Path | None, WRITTEN, typer.Option(metavar="FILE", help="Write a JUnit report.")
    ] = None,
    junit_inconclusive: Annotated[
        Literal["skipped", "error"],
        typer.Option(help="What an inconclusive run is in the JUnit report."),
    ] = "skipped",
    allow_inconclusive: AllowInconclusive = False,
    jobs: Jobs = 1,
    ray: Ray = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Load, compile and begin everything, run nothing.")
    ] = False,
    verbose: Verbose = False,
    quiet: Annotated[
        bool,
        typer.Option("--quiet", "-q", help="Print failures, inconclusive runs and errors only."),
    ] = False,
    _version: Version = False,
) -> None:
    """Run OpenSCENARIO files on SUMO, by default against an ego with a collision avoidance system."""
    from runner.batch.batch import BatchComparison, run_batch, runnable
    from runner.batch.jobs import jobs_of
    from runner.batch.journal import SEAL_KEY, seal_key
    from runner.batch.outputs.terminal import OutcomeTable
    from runner.batch.outputs.work import WorkDone, work_text
    from runner.view.rehearsal import rehearse_batch

    if out is None and (resume or plot):
        raise UsageError("--resume and --plot need the --out folder of the results")
    if assess is not None:
        _check_assessment(assess, out, dry_run)
    if resume and (osi is not None or gui):
        option, instead = (
            ("--gui", "xosc-replay shows them")
            if gui
            else ("--osi", "xosc-export --to osi writes their traces")
        )
        raise UsageError(
            f"{option} is of runs that are played, and --resume leaves out finished ones: {instead}"
        )
    if overwrite and (out is None or resume or dry_run):
        raise UsageError(
            "--overwrite replaces the batch of --out by one that is run: without --resume and --dry-run"
        )
    if against is not None:
        _need_runs(dry_run)
        if overwrite and out is not None and against.resolve() == out.resolve():
            raise UsageError("--against names the folder that --overwrite replaces", path=against)
    limits = [limit.strip() for limit in fail_if or []]
    by_new = NEW_FAILURE in limits
    if by_new and against is None:
        raise UsageError(f"--fail-if {NEW_FAILURE} needs the earlier batch: --against BATCH")
    if by_new and current().untrusted and seal_key() is None:
        reason = f"--untrusted does not believe a stored batch, which may hide new failures, without {SEAL_KEY}"
        raise UsageError(reason, path=against)
    settings = replace(settings, fail_if=tuple(limit for limit in limits if limit != NEW_FAILURE))
    paths, times = runnable(files), None if dry_run else repeat
    earlier = BatchComparison.with_batch(against, paths, settings) if against is not None else None
    selection = selection_of(only, sample, settings.seed, paths)
    source = jobs_of(
        paths, parameters_of(param or []), settings.enforce_constraints, selection, times
    )
    table = OutcomeTable(
        verbose=verbose,
        quiet=quiet,
        total=source.total if sys.stderr.isatty() and not (quiet or dry_run) else 0,
    )
    chosen: Iterable[Job | Outcome] = source
    if osi is not None:
        from runner.exchange.exports.osi import alone

        chosen = alone(source, osi)
    also = list(_also(osi, replay, gui, out))
    if overwrite and out is not None:
        from runner.batch.journal import discard

        discard(out)
    with _reporting(junit, junit_inconclusive) as kept:
        if dry_run:
            outcomes = rehearse_batch(chosen, settings, jobs)
        else:
            how: dict[str, Any] = {
                "plot": plot,
                "processes": jobs,
                "resume": resume,
                "also": also,
                "ray": ray,
            }
            outcomes = run_batch(chosen, settings, out=out, needs=_needed(replay), **how)
        work = WorkDone(source)
        counted = _counted(outcomes, work)
        code = _follow(counted, table, kept, allow_inconclusive, source.left_out, earlier, by_new)
        if work.total > 1 and not dry_run:
            table.tell(f"planned and done: {work_text(work.rows())}")
        if not dry_run and table.shown != source.made:
            print(
                f"xosc-run: internal error: {table.shown} outcomes of {source.made} runs",
                file=sys.stderr,
            )
            code = ExitCode.INTERNAL
    report = None
    if replay and out is not None and not dry_run:
        from runner.view.report import write_report

        report = write_report(out, against)
    if earlier is not None:
        table.compare(earlier, out if replay else None)
    if replay and not dry_run:
        from runner.view.replay.player import kept_replay

        if table.only is not None:
            table.tell(f"replay: {kept_replay(table.only, out)}")
        elif out is None:
            table.tell(f"replays: NAME.html in {Path.cwd()}")
    if out is not None and not dry_run:
        table.tell(f"results: {out}" if report is None else f"report: {report}")
    for what, path in (("JUnit report", junit), ("OSI trace", osi)):
        if path is not None and path.exists():
            table.tell(f"{what}: {path}")
    if assess is not None and out is not None:
        from runner.view.assessment import write_assessment

        for path in write_assessment(out, assess, settings):
            table.tell(f"assessment: {path}")
    raise typer.Exit(code)


def _assessments() -> tuple[str, list[tuple[str, str]]]:
    from runner.judging.assessment.profiles import profiles

    return "Protocols of --assess", list(profiles().items())


explain("assess", _assessments)


def _check_assessment(name: str, out: Path | None, dry_run: bool) -> None:
    """Refuse an unknown protocol, and an assessment of runs that are not kept, before anything runs."""
    from runner.judging.assessment.profiles import profile

    profile(name)
    if out is None or dry_run:
        raise UsageError(
            "--assess reads the results of runs: it needs --out DIR" + " and no --dry-run" * dry_run
        )


def _need_runs(dry_run: bool) -> None:
    """Refuse to compare a batch that is not run."""
    if dry_run:
        raise UsageError("--against compares runs, and --dry-run has none")


@contextmanager
def _reporting(junit: Path | None, inconclusive: str) -> Iterator[list[Outcome] | None]:
    """Collects outcomes for a JUnit report, which is written in the end, also when the runs are interrupted."""
    if junit is None:
        yield None
        return
    from runner.batch.outputs.report import write_junit

    check_writable(junit, "the report")
    outcomes: list[Outcome] = []
    try:
        yield outcomes
    finally:
        write_junit(outcomes, junit, inconclusive)


def _also(osi: Path | None, replay: bool, gui: bool, out: Path | None) -> Iterator[Also]:
    """Yield the further uses of each result besides writing it; options as in `xosc_run`."""
    if osi is not None:
        from runner.exchange.exports.osi import write_trace

        check_writable(osi, "the trace")

        yield partial(write_trace, path=osi)
    if replay:
        from runner.view.replay.player import keep_replay

        yield partial(keep_replay, out=out)
    if gui:
        from runner.view.replay.sumo_gui import need_display, show

        need_display()
        yield show


def _needed(replay: bool) -> list[str]:
    """Names of files, besides results, that a finished run in an output folder has."""
    if not replay:
        return []
    from runner.view.replay.player import REPLAY

    return [REPLAY]


def _counted(outcomes: Generator[Outcome], work: WorkDone) -> Generator[Outcome]:
    with closing(outcomes):
        for outcome in outcomes:
            work.add(outcome)
            yield outcome


def _follow(
    outcomes: Generator[Outcome],
    table: OutcomeTable,
    kept: list[Outcome] | None,
    allow_inconclusive: bool,
    left_out: Mapping[Path, int],
    earlier: BatchComparison | None,
    only_new: bool,
) -> int:
    """Show outcomes as they come, keep and compare them if asked to; the exit code, by new failures only if asked to."""
    codes = {ExitCode.PASSED}
    allowed = {ExitCode.INCONCLUSIVE} if allow_inconclusive else set()
    with interruptible("xosc-run", "with --out and --resume a batch goes on where it was"):
        with closing(outcomes):
            for outcome in outcomes:
                if kept is not None:
                    kept.append(outcome)
                if earlier is not None:
                    earlier.add(outcome)
                code = ExitCode(outcome.exit_code)
                if not (
                    only_new
                    and code == ExitCode.FINDING
                    and earlier is not None
                    and earlier.known(outcome)
                ):
                    codes.add(code)
                table.show(outcome)
        table.close(left_out)
    return gravest(codes - allowed)


def main() -> None:
    """Entry point."""
    guarded("xosc-run", app)


if __name__ == "__main__":
    main()
