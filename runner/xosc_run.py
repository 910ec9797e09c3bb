"""The command `xosc-run`: run scenarios and variation files, say how they ended."""

from __future__ import annotations

import sys
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runner.batch.options import BatchOptions, selection_of
from runner.judging.measures.measure import NEW_FAILURE
from runner.judging.settings import RunSettings
from schemas.common.errors import ExitCode, exit_codes, gravest
from schemas.common.storage import check_writable
from schemas.common.terminal.command_line import (
    Version,
    epilog,
    guarded,
    interruptible,
    new_app,
    protected,
)
from schemas.common.terminal.files import complete_name
from schemas.common.terminal.options import READ, with_settings
from schemas.common.terminal.text import many

if TYPE_CHECKING:
    from runner.batch.arrays import Together
    from runner.batch.batch import Also, BatchComparison
    from runner.batch.jobs import Job, Jobs, Outcome
    from runner.batch.outputs.terminal import OutcomeTable
    from runner.batch.outputs.work import WorkDone

_EXAMPLES = (
    "xosc-run simple_cut_in",
    "xosc-run --sut adas 'cut_in_*' --jobs 4 --out results --replay",
    'xosc-run -p CutIn_Gap_m=8 --fail-if "min_ttc<1" simple_cut_in',
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
        autocompletion=complete_name,
        help="Scenarios, and distributions: every parameter set is run; folders, globs, names of "
        "shipped ones.",
    ),
]


@app.command(epilog=epilog(_EPILOG, *_EXAMPLES))
@protected()
@with_settings
def xosc_run(
    files: Files, settings: RunSettings, batch: BatchOptions, _version: Version = False
) -> None:
    """Run OpenSCENARIO files on SUMO, by default against an ego with a collision
    avoidance system.
    """
    from runner.batch.batch import BatchComparison, runnable
    from runner.batch.jobs import jobs_of
    from runner.batch.outputs.terminal import OutcomeTable
    from runner.batch.outputs.work import WorkDone, work_text

    limits = tuple(limit for limit in batch.limits if limit != NEW_FAILURE)
    settings = replace(settings, fail_if=limits)
    paths = runnable(files)
    earlier = (
        BatchComparison.with_batch(batch.against, paths, settings)
        if batch.against is not None
        else None
    )
    selection = selection_of(batch.only, batch.sample, settings.seed, paths)
    times = None if batch.dry_run else batch.repeat
    source = jobs_of(paths, dict(batch.param), settings.enforce_constraints, selection, times)
    shows_progress = sys.stderr.isatty() and not (batch.quiet or batch.dry_run)
    table = OutcomeTable(
        verbose=batch.verbose, quiet=batch.quiet, total=source.total if shows_progress else 0
    )
    chosen, also = _chosen(source, batch), list(_also(batch))
    if batch.overwrite and batch.out is not None:
        from runner.batch.journal import discard

        discard(batch.out)
    with _reporting(batch.junit, batch.junit_inconclusive) as kept:
        work = WorkDone(source)
        in_arrays = batch.plays_in_arrays(settings.world, lambda: source.total)
        if in_arrays and batch.in_arrays is None and not batch.dry_run:
            table.tell(
                f"{source.total} sets: played in arrays, failures and nearest misses are recorded; "
                "--no-batch runs and records each"
            )
        if in_arrays and settings.world != "kinematic" and not batch.dry_run:
            table.tell(
                "sets are played in arrays, kinematically: passed means so there; "
                "failures and nearest misses are run on SUMO"
            )
        limit = _FailureLimit(batch.maxfail, source)
        outcomes, together = _outcomes(chosen, settings, batch, also, table, in_arrays, limit)
        outcomes = _counted(outcomes, work)
        code = _follow(outcomes, table, kept, batch, source.left_out, earlier, limit)
        if together is not None and together.fault:
            code = gravest([code, ExitCode.INTERNAL])
            if batch.quiet:  # what the table would say
                print(f"xosc-run: {together.fault}", file=sys.stderr)
        if limit.stopped and (left := source.planned - table.shown):
            goes_on = "" if batch.out is None else "; --resume goes on"
            told = f"stopped by --maxfail: {left} of {many(source.planned, 'run')} left{goes_on}"
            print(f"xosc-run: {told}", file=sys.stderr)
        if work.total > 1 and not batch.dry_run:
            table.tell(f"planned and done: {work_text(work.rows())}")
        if batch.dry_run and table.shown > 1:
            several = source.made > table.shown
            hint = "; to learn how long they take, time one set of each file: --sample 1"
            table.tell(f"without --dry-run: {many(source.made, 'run')}{hint if several else ''}")
        if not batch.dry_run and not limit.stopped and table.shown != source.made:
            told = f"{table.shown} outcomes of {source.made} runs"
            print(f"xosc-run: internal error: {told}", file=sys.stderr)
            code = ExitCode.INTERNAL
    _tell_results(batch, settings, table, earlier)
    raise typer.Exit(code)


class _FailureLimit:
    """Stops a batch after so many failures and errors of its own; those of runs that an earlier
    call has done are known.

    Args:
        most: how many; None for no limit. jobs: of the batch.
    """

    def __init__(self, most: int | None, jobs: Jobs) -> None:
        self._most, self._jobs = most, jobs
        self._failures, self._known, self.stopped = 0, set[str](), False

    def know(self, outcome: Outcome) -> None:
        """Leave out the outcome of a run that was done before."""
        if self._most is not None and outcome.state in ("failed", "error"):
            self._known.add(outcome.job.name)

    def reached(self, outcome: Outcome) -> bool:
        """Count an outcome; whether it is the last one."""
        if outcome.state in ("failed", "error") and outcome.job.name not in self._known:
            self._failures += 1
        self.stopped = self._jobs.stopped = self._failures == self._most
        return self.stopped


def _chosen(source: Jobs, batch: BatchOptions) -> Iterable[Job | Outcome]:
    """Return the jobs, which are refused from the second on where there is one trace to write."""
    if batch.osi is None:
        return source
    from runner.exchange.exports.osi import alone

    return alone(source, batch.osi)


def _outcomes(
    chosen: Iterable[Job | Outcome],
    settings: RunSettings,
    batch: BatchOptions,
    also: Sequence[Also],
    table: OutcomeTable,
    in_arrays: bool,
    limit: _FailureLimit,
) -> tuple[Generator[Outcome], Together | None]:
    """Return the outcomes of jobs, which are run, or only rehearsed, and what plays them in arrays,
    which tells what it leaves out."""
    from runner.batch.batch import run_batch

    if batch.dry_run:
        from runner.view.rehearsal import rehearse_batch

        return rehearse_batch(chosen, settings, batch.jobs, table.working), None
    together = None
    if in_arrays:
        from runner.batch.arrays import Together

        together = Together(chosen, settings, batch.out, table.tell, batch.jobs)
    outcomes = run_batch(
        chosen if together is None else iter(together),
        settings,
        out=batch.out,
        needs=_needed(batch.replay),
        plot=batch.plot,
        processes=batch.jobs,
        resume=batch.resume,
        also=also,
        contacts=not batch.quiet,  # a quiet table does not name the worst ones
        ray=batch.ray,
        known=limit.know,
    )
    return (outcomes if together is None else together.checked(outcomes)), together


def _tell_results(
    batch: BatchOptions,
    settings: RunSettings,
    table: OutcomeTable,
    earlier: BatchComparison | None,
) -> None:
    """Write pages about the whole batch, and name the written files."""
    report = _pages(batch, table, earlier)
    if batch.out is not None and not batch.dry_run:
        table.tell(f"results: {batch.out}" if report is None else f"report: {report}")
    for what, path in (("JUnit report", batch.junit), ("OSI trace", batch.osi)):
        if path is not None and path.exists():
            table.tell(f"{what}: {path}")
    if batch.assess is not None and batch.out is not None:
        from runner.view.assessment import write_assessment

        for path in write_assessment(batch.out, batch.assess, settings):
            table.tell(f"assessment: {path}")


def _pages(
    batch: BatchOptions, table: OutcomeTable, earlier: BatchComparison | None
) -> Path | None:
    """Write the report of a batch with replays, and name its replays; the report's path."""
    replayed, report = batch.replay and not batch.dry_run, None
    if replayed and batch.out is not None:
        from runner.view.report import write_report

        report = write_report(batch.out, batch.against)
    if earlier is not None:
        table.compare(earlier, batch.out if batch.replay else None)
    if replayed:
        from runner.view.replay.player import kept_replay

        if table.only is not None:
            table.tell(f"replay: {kept_replay(table.only, batch.out)}")
        elif batch.out is None:
            table.tell(f"replays: NAME.html in {Path.cwd()}")
    return report


@contextmanager
def _reporting(junit: Path | None, inconclusive: str) -> Iterator[list[Outcome] | None]:
    """Collects outcomes for a JUnit report, which is written in the end, also when the runs are
    interrupted."""
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


def _also(batch: BatchOptions) -> Iterator[Also]:
    """Yield the further uses of each result besides writing it."""
    if batch.osi is not None:
        from runner.exchange.exports.osi import write_trace

        check_writable(batch.osi, "the trace")
        yield partial(write_trace, path=batch.osi)
    if batch.replay:
        from runner.view.replay.player import keep_replay

        yield partial(keep_replay, out=batch.out)
    if batch.gui:
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
    """Yield outcomes after they are counted as work."""
    with closing(outcomes):
        for outcome in outcomes:
            work.add(outcome)
            yield outcome


def _follow(
    outcomes: Generator[Outcome],
    table: OutcomeTable,
    kept: list[Outcome] | None,
    batch: BatchOptions,
    left_out: Mapping[Path, int],
    earlier: BatchComparison | None,
    limit: _FailureLimit,
) -> int:
    """Show outcomes as they come, up to the limit, keep and compare them if asked to; the exit
    code, by new failures only if asked to."""
    codes = {ExitCode.PASSED}
    allowed = {ExitCode.INCONCLUSIVE} if batch.allow_inconclusive else set()
    only_new = NEW_FAILURE in batch.limits
    with interruptible("xosc-run", "with --out and --resume a batch goes on where it was"):
        with closing(outcomes):
            for outcome in outcomes:
                if kept is not None:
                    kept.append(outcome)
                if earlier is not None:
                    earlier.add(outcome)
                code = ExitCode(outcome.exit_code)
                counts = not (
                    only_new
                    and code == ExitCode.FINDING
                    and earlier is not None
                    and earlier.known(outcome)
                )
                if counts:
                    codes.add(code)
                table.show(outcome)
                if counts and limit.reached(outcome):
                    break
        table.close(left_out)
    return gravest(codes - allowed)


def main() -> None:
    """Entry point."""
    guarded("xosc-run", app)


if __name__ == "__main__":
    main()
