"""Many runs: every parameter set of every file, in one process or several, interrupted and resumed with nothing lost."""

from __future__ import annotations

import errno
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runner.batch import journal
from runner.batch.jobs import Job, Outcome, assumed, failure
from runner.outputs import report
from runner.outputs.folder import write_run
from runner.outputs.runs import write_runs
from runner.settings import RunSettings
from runner.sut.parameters import SENSOR_RANGE, split
from schemas.errors import UsageError, one_line
from schemas.storage import alone

if TYPE_CHECKING:
    from runner.interpreter.result import RunResult

Also = Callable[["RunResult"], None]


def execute(job: Job, settings: RunSettings, out: Path | None = None, plot: bool = False, also: Sequence[Also] = ()) -> Outcome:
    """Do one run, write its results and enter it in the journal; errors of the run become outcomes.

    Raises:
        OSError: there is no space, or no right to write: the run is not entered, and to be repeated.
    """
    outcome = _run(job, settings, out, plot, also)
    if out is not None:
        journal.enter(out, outcome)
    return outcome


def _run(job: Job, settings: RunSettings, out: Path | None, plot: bool, also: Sequence[Also]) -> Outcome:
    from runner.interpreter.execution import run

    try:
        own = settings if job.seed is None else replace(settings, seed=job.seed)
        remarks = assumed(job, own.strict)
        result = run(job.scenario, own, parameters=job.parameters)
        result.name = job.name
        result.remarks = (*remarks, *result.remarks)
        measures = write_run(result, out / job.name, plot) if out is not None else {}
        for act in also:
            act(result)
    except OSError:
        raise
    except Exception as error:  # a defect of ours is an outcome too, the other runs go on
        return failure(job, error)
    state, code = ("passed", 0) if result.verdict.passed else ("failed", 1)
    message, criteria = one_line("; ".join(_reasons(result))), report.criteria(result.verdict)
    remarks = [one_line(remark) for remark in result.remarks if not any(remark in reason for reason in result.verdict.reasons)]
    return Outcome(job, state, code, message, result.status, result.end_time, measures, criteria=criteria, remarks=remarks)


def _reasons(result: RunResult) -> Iterator[str]:
    """Why the verdict is a failure, and how far the system could see."""
    yield from result.verdict.reasons
    if result.verdict.reasons and SENSOR_RANGE in result.sut_parameters:
        yield f"{split(result.sut)[0]} sees {result.sut_parameters[SENSOR_RANGE]:g} m"


def run_batch(
    jobs: Iterable[Job | Outcome],
    settings: RunSettings,
    *,
    out: Path | None = None,
    plot: bool = False,
    processes: int = 1,
    resume: bool = False,
    also: Sequence[Also] = (),
    ray: str | None = None,
    max_memory: float | None = None,
) -> Generator[Outcome]:
    """Do the runs and yield their outcomes in the order of the jobs.

    With an output folder every finished run is entered in a journal at once; `resume` takes finished runs from there
    instead of repeating them. `plot` adds a picture to the results of each. Each of `also` gets the result of every run that
    is done, in the process that has done it.

    At the end, or when it is interrupted, the folder gets a table of all runs (see `runner.outputs.runs`). `ray` is the address
    of a Ray cluster that does the runs, or `local`; see `runner.batch.ray_pool`. With `max_memory` (GiB) runs are done in other
    processes, and one that needs more is an error of that run; on a cluster Ray itself sees to that.

    Raises:
        UsageError: the folder holds results already (and `resume` is not set), or those of another batch; another process writes
            into it, or it can't be written into; there is no such cluster.
    """
    how: dict[str, Any] = {"settings": settings, "out": out, "plot": plot, "also": also}
    if out is None:
        with closing(_outcomes(iter(jobs), how, processes, ray, max_memory)) as outcomes:
            yield from outcomes
        return
    with alone(out, "a batch"):
        done = journal.begin(out, settings.as_json(), resume)
        known = (job if isinstance(job, Outcome) else _finished(job, done) or job for job in jobs)
        errors: dict[str, Outcome] = {}
        with _concluded(out, errors), closing(_outcomes(known, how, processes, ray, max_memory)) as outcomes:
            for outcome in outcomes:
                if outcome.state == "error":
                    errors[outcome.job.name] = outcome
                yield outcome


@contextmanager
def _concluded(out: Path, errors: dict[str, Outcome]) -> Iterator[None]:
    """Around the runs of a batch: then, also where they are interrupted, drafts go and the table of all runs is written.

    Raises:
        UsageError: the folder can no longer be written into.
    """
    try:
        try:
            yield
        finally:
            journal.clear_drafts(out)
            if not out.is_dir():
                raise FileNotFoundError(errno.ENOENT, "the folder is gone")
            write_runs((errors | journal.finished(out)).values(), out / "runs.parquet")
    except OSError as error:
        reason = f"results can't be written: {error.strerror or error}; --resume goes on after the runs that are finished"
        raise UsageError(reason, path=out) from None


def _outcomes(
    jobs: Iterator[Job | Outcome], how: dict[str, Any], processes: int, ray: str | None, max_memory: float | None
) -> Generator[Outcome]:
    """Do the runs in this process, in several or on a cluster; `how` has the arguments of `execute` but the job."""
    out: Path | None = how["out"]
    if ray is not None:
        from runner.batch.ray_pool import RayPool

        enter = partial(journal.enter, out) if out is not None else None
        with RayPool(ray, processes, partial(_run, **how), lost, enter) as cluster:
            yield from cluster.execute(jobs)
    else:
        yield from each(jobs, partial(execute, **how), partial(_died, out=out), processes, max_memory)


def each(
    jobs: Iterator[Job | Outcome],
    work: Callable[[Job], Outcome],
    died: Callable[[Job], Outcome],
    processes: int,
    max_memory: float | None = None,
) -> Generator[Outcome]:
    """Do some work for each job, in this process or in others; arguments as in `Pool`."""
    if processes > 1 or max_memory is not None:
        from runner.batch.pool import Pool

        with Pool(processes, work, died, max_memory) as pool:
            yield from pool.execute(jobs)
    else:
        for job in jobs:
            yield job if isinstance(job, Outcome) else work(job)


def _finished(job: Job, done: dict[str, Outcome]) -> Outcome | None:
    outcome = done.get(job.name)
    if outcome is not None and outcome.job != job:
        raise UsageError(f"{job.name} was run from another file or with other parameters; resume with the same")
    return outcome


def lost(job: Job) -> Outcome:
    """The outcome of a job whose process died."""
    return Outcome(job, "error", 5, "the process that ran it died, of too little memory or a defect of a library")


def _died(job: Job, out: Path | None) -> Outcome:
    outcome = lost(job)
    if out is not None:
        journal.enter(out, outcome)
    return outcome
