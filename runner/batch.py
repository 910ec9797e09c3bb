"""Many runs: every parameter set of every file, in one process or several, interrupted and resumed with nothing lost."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runner import journal
from runner.jobs import Job, Outcome, failure, one_line
from runner.outputs import report
from runner.pool import Pool
from schemas.errors import UsageError

if TYPE_CHECKING:
    from runner.result import RunResult

Also = Callable[["RunResult"], None]


@dataclass(frozen=True)
class Options:
    """Settings shared by all runs of a batch; see `runner.run`."""

    timestep: float = 0.05
    sut: str | None = "cas"
    ego: str | None = None
    seed: int = 0
    max_time: float | None = None
    world: str = "sumo"
    enforce_constraints: bool = True

    def verify(self) -> None:
        """Refuse settings that no run can have.

        Raises:
            UsageError: one of them is wrong.
        """
        from runner.execution import check_settings
        from runner.sut import find_system

        check_settings(self.timestep, self.max_time, self.world)
        find_system(self.sut)


def rehearse_batch(jobs: Iterable[Job | Outcome], options: Options) -> Generator[Outcome]:
    """Load, resolve and compile what is to be run, without running it."""
    from runner.execution import prepare

    for job in jobs:
        if isinstance(job, Outcome):
            yield job
            continue
        try:
            prepare(job.scenario, job.parameters, options.ego, options.enforce_constraints)
            outcome = Outcome(job, "passed", 0, status="compiled")
        except Exception as error:  # a defect of ours is an outcome too, the other files go on
            outcome = failure(job, error)
        yield outcome


def execute(job: Job, options: Options, out: Path | None = None, plot: bool = False, also: Sequence[Also] = ()) -> Outcome:
    """Do one run, write its results and enter it in the journal; errors become outcomes."""
    try:
        outcome = _run(job, options, out, plot, also)
        if out is not None:
            journal.enter(out, outcome)
        return outcome
    except OSError as error:  # no space, no right to write: not entered, to be repeated
        return failure(job, error)


def _run(job: Job, options: Options, out: Path | None, plot: bool, also: Sequence[Also]) -> Outcome:
    from runner.execution import run

    try:
        result = run(job.scenario, parameters=job.parameters, **asdict(options))
        result.name = job.name
        measures = _write(result, out / job.name, plot) if out is not None else {}
        for act in also:
            act(result)
    except OSError:
        raise
    except Exception as error:  # a defect of ours is an outcome too, the other runs go on
        return failure(job, error)
    state, code = ("passed", 0) if result.verdict.passed else ("failed", 1)
    message = one_line("; ".join((*result.verdict.reasons, *result.remarks)))
    return Outcome(job, state, code, message, result.status, result.end_time, measures)


def _write(result: RunResult, folder: Path, plot: bool) -> dict[str, Any]:
    """Write a run's files into its folder, which appears only when it is complete; its criticality measures."""
    from runner.outputs import trajectories

    draft = Path(tempfile.mkdtemp(prefix=journal.DRAFT, dir=folder.parent))
    try:
        values = report.summary(result)
        trajectories.write_parquet(result, draft / "trajectories.parquet")
        trajectories.write_csv(result, draft / "trajectories.csv")
        trajectories.write_criticality(result, draft / "criticality.parquet")
        report.write_events(result.events, draft / "events.jsonl")
        report.write_json(values, draft / "result.json")
        if plot:
            from runner.outputs.picture import write_picture

            write_picture(result, draft / "picture.png")
        draft.chmod(0o755)
        _replace(folder, draft)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return values["criticality"] or {}


def _replace(folder: Path, draft: Path) -> None:
    """Put a folder in the place of one that an interrupted batch left, and of nothing else."""
    if folder.exists():
        if not (folder / "result.json").is_file():
            raise UsageError("this is in the way of a run's results, and is not of a run", path=folder)
        shutil.rmtree(folder)
    draft.rename(folder)


def run_batch(
    jobs: Iterable[Job | Outcome],
    options: Options,
    *,
    out: Path | None = None,
    plot: bool = False,
    processes: int = 1,
    resume: bool = False,
    also: Sequence[Also] = (),
) -> Generator[Outcome]:
    """Do the runs and yield their outcomes in the order of the jobs.

    With an output folder every finished run is entered in a journal at once; `resume` takes finished runs from there
    instead of repeating them. `plot` adds a picture to the results of each. Each of `also` gets the result of every run that
    is done, in the process that has done it.

    Raises:
        UsageError: the folder holds results already (and `resume` is not set), or those of another batch.
    """
    done = journal.begin(out, asdict(options), resume) if out is not None else {}
    known = (job if isinstance(job, Outcome) else _finished(job, done) or job for job in jobs)
    try:
        if processes > 1:
            with Pool(
                processes, partial(execute, options=options, out=out, plot=plot, also=also), partial(_died, out=out)
            ) as pool:
                yield from pool.execute(known)
        else:
            for job in known:
                yield job if isinstance(job, Outcome) else execute(job, options, out, plot, also)
    finally:
        if out is not None:
            journal.clear_drafts(out)


def _finished(job: Job, done: dict[str, Outcome]) -> Outcome | None:
    outcome = done.get(job.name)
    if outcome is not None and outcome.job != job:
        raise UsageError(f"{job.name} was run from another file or with other parameters; resume with the same")
    return outcome


def _died(job: Job, out: Path | None) -> Outcome:
    outcome = Outcome(job, "error", 5, "the process that ran it died, which is not the scenario's fault")
    if out is not None:
        journal.enter(out, outcome)
    return outcome
