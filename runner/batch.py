"""Many runs: every parameter set of every file, in one process or several, interrupted and resumed with nothing lost."""

from __future__ import annotations

import itertools
import json
import os
import shutil
import tempfile
import traceback
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from runner.outputs import report
from schemas.errors import InvalidFile, ToolchainError, UsageError

_JOURNAL, _MANIFEST = "runs.jsonl", "batch.json"
_WAITING = 8
"""Runs handed out for each process ahead of need: few, so that a space of any size is never enumerated."""
_DEATHS = 2
"""Deaths of a worker after which the run it had is given up."""


@dataclass(frozen=True)
class Job:
    """One run to be done.

    Args:
        name: unique in the batch; names the folder of its results.
        source: the file that the user named (a scenario, or a parameter value distribution).
        scenario: the scenario file.
        parameters: values of its parameters.
    """

    name: str
    source: Path
    scenario: Path
    parameters: dict[str, str] = field(default_factory=dict)


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


@dataclass(frozen=True)
class Outcome:
    """How one run of a batch ended.

    Args:
        state: `passed`, `failed` (its verdict) or `error` (a defect of the file or the run).
        exit_code: what the command line would answer for this run alone.
        message: reasons of a failed verdict, or the error.
        status, end_time, measures: of the run, where there was one (measures only with an output folder).
    """

    job: Job
    state: str
    exit_code: int
    message: str = ""
    status: str = ""
    end_time: float | None = None
    measures: dict[str, Any] = field(default_factory=dict)
    trace: str = ""


def jobs_of(paths: Iterable[Path], parameters: dict[str, str], enforce_constraints: bool) -> Iterator[Job | Outcome]:
    """The runs that files stand for, lazily: one for a scenario, one for each parameter set of a distribution.

    Args:
        paths: scenarios and distributions; one that can't be read gives an outcome in its place.
        parameters: values given by the user, before those of a distribution.
        enforce_constraints: leave out parameter sets that violate the scenario's constraint groups.
    """
    stems: dict[str, int] = {}
    for path in paths:
        number = stems[path.stem] = stems.get(path.stem, 0) + 1
        stem = path.stem if number == 1 else f"{path.stem}~{number}"
        try:
            yield from _jobs_of(path, stem, parameters, enforce_constraints)
        except ToolchainError as error:
            yield _error(Job(stem, path, path, dict(parameters)), error)


def _jobs_of(path: Path, stem: str, parameters: dict[str, str], enforce_constraints: bool) -> Iterator[Job]:
    import xosc

    kind = xosc.load(path).kind
    if kind == "scenario":
        yield Job(stem, path, path, dict(parameters))
    elif kind == "distribution":
        for index, (scenario, values) in enumerate(xosc.variations(path, enforce_constraints=enforce_constraints)):
            yield Job(f"{stem}-{index:06d}", path, Path(scenario), {**parameters, **values})
    else:
        raise InvalidFile(f"this is a {kind}, nothing in it can be run", path=path)


def _error(job: Job, error: Exception) -> Outcome:
    """The outcome of a run that an error ended (to be called while it is handled)."""
    if isinstance(error, ToolchainError):
        return Outcome(job, "error", error.exit_code, str(error), trace=traceback.format_exc())
    return Outcome(job, "error", 5, f"internal error: {type(error).__name__}: {error}", trace=traceback.format_exc())


def rehearse(job: Job, options: Options) -> Outcome:
    """Load, resolve and compile a scenario without running it."""
    from runner.execution import prepare

    try:
        prepare(job.scenario, job.parameters, options.ego, options.enforce_constraints)
        return Outcome(job, "passed", 0, status="compiled")
    except Exception as error:  # a defect of ours is an outcome too, the other files go on
        return _error(job, error)


def execute(job: Job, options: Options, out: Path | None = None) -> Outcome:
    """Do one run and write its results; errors become outcomes."""
    from runner.execution import run

    try:
        result = run(job.scenario, parameters=job.parameters, **asdict(options))
        measures = _write(result, out / job.name) if out is not None else {}
        state, code = ("passed", 0) if result.verdict.passed else ("failed", 1)
        return Outcome(job, state, code, "; ".join(result.verdict.reasons), result.status, result.end_time, measures)
    except Exception as error:  # a defect of ours is an outcome too, the other runs go on
        return _error(job, error)


def _write(result: Any, folder: Path) -> dict[str, Any]:
    """Write a run's files into its folder, which appears only when it is complete."""
    from runner.outputs import trajectories

    folder.parent.mkdir(parents=True, exist_ok=True)
    draft = Path(tempfile.mkdtemp(prefix=".", dir=folder.parent))
    try:
        values = report.summary(result)
        trajectories.write_parquet(result, draft / "trajectories.parquet")
        trajectories.write_csv(result, draft / "trajectories.csv")
        report.write_events(result.events, draft / "events.jsonl")
        report.write_json(values, draft / "result.json")
        draft.chmod(0o755)
        if folder.exists():
            shutil.rmtree(folder)
        draft.rename(folder)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return values["criticality"] or {}


def run_batch(
    jobs: Iterable[Job | Outcome], options: Options, *, out: Path | None = None, processes: int = 1, resume: bool = False
) -> Iterator[Outcome]:
    """Do the runs and yield their outcomes in the order of the jobs.

    With an output folder every finished run is entered in a journal at once; `resume` takes finished runs from there
    instead of repeating them.

    Raises:
        UsageError: the folder holds results already (and `resume` is not set), or those of another batch.
    """
    journal = _Journal(out, options, resume) if out is not None else None
    outcomes = _execute_all(jobs, options, out, processes, journal.done if journal else {})
    for outcome, fresh in outcomes:
        if journal is not None and fresh:
            journal.enter(outcome)
        yield outcome


def _execute_all(
    jobs: Iterable[Job | Outcome], options: Options, out: Path | None, processes: int, done: dict[str, Outcome]
) -> Iterator[tuple[Outcome, bool]]:
    """Outcomes in the order of the jobs, with whether they are new."""
    known = (job if isinstance(job, Outcome) else done.get(job.name, job) for job in jobs)
    if processes > 1:
        yield from _Pool(options, out, processes).execute(known)
        return
    for job in known:
        yield (job, False) if isinstance(job, Outcome) else (execute(job, options, out), True)


_Pending = tuple[Job, "Future[Outcome]"] | Outcome


class _Pool:
    """Worker processes that are replaced when they die, with their runs repeated."""

    def __init__(self, options: Options, out: Path | None, processes: int) -> None:
        self.options, self.out, self.processes = options, out, processes
        self._pool = ProcessPoolExecutor(processes)
        self._deaths: dict[str, int] = {}

    def execute(self, jobs: Iterator[Job | Outcome]) -> Iterator[tuple[Outcome, bool]]:
        """Outcomes in the order of the jobs, with whether they are new."""
        queue: deque[_Pending] = deque()
        try:
            while True:
                for job in itertools.islice(jobs, self.processes * _WAITING - len(queue)):
                    queue.append(job if isinstance(job, Outcome) else self._submit(job))
                if not queue:
                    return
                pending = queue.popleft()
                if isinstance(pending, Outcome):
                    yield pending, False
                    continue
                try:
                    yield pending[1].result(), True
                except BrokenProcessPool:
                    queue = self._replace([pending, *queue])
        finally:
            self._pool.shutdown(wait=True, cancel_futures=True)

    def _submit(self, job: Job) -> tuple[Job, Future[Outcome]]:
        return job, self._pool.submit(execute, job, self.options, self.out)

    def _replace(self, waiting: list[_Pending]) -> deque[_Pending]:
        """New workers after one has died; unfinished runs are handed out again.

        Which run killed it is not known. The first that is unfinished is suspected; suspected twice, it is given up.
        """
        self._pool.shutdown(wait=True, cancel_futures=True)
        self._pool = ProcessPoolExecutor(self.processes)
        queue: deque[_Pending] = deque()
        suspected = False
        for pending in waiting:
            if isinstance(pending, Outcome) or (pending[1].done() and not pending[1].cancelled() and not pending[1].exception()):
                queue.append(pending)
                continue
            job = pending[0]
            if not suspected:
                suspected = True
                self._deaths[job.name] = self._deaths.get(job.name, 0) + 1
            if self._deaths.get(job.name, 0) >= _DEATHS:
                queue.append(Outcome(job, "error", 5, f"internal error: the process running it died, {_DEATHS} times"))
            else:
                queue.append(self._submit(job))
        return queue


class _Journal:
    """What a batch has done so far, in its output folder."""

    def __init__(self, out: Path, options: Options, resume: bool) -> None:
        self.done: dict[str, Outcome] = {}
        self._path = out / _JOURNAL
        settings = asdict(options)
        manifest = out / _MANIFEST
        if self._path.exists() and not resume:
            raise UsageError(f"{out} holds the results of an earlier batch; use --resume to go on with it, or another folder")
        if resume and manifest.exists():
            before = json.loads(manifest.read_text(encoding="utf-8"))
            if before != settings:
                changed = ", ".join(key for key in settings if settings[key] != before.get(key))
                raise UsageError(f"{out} was begun with other settings ({changed}); resume with the same ones")
            self._read()
        out.mkdir(parents=True, exist_ok=True)
        report.write_json(settings, manifest)
        self._path.touch()

    def _read(self) -> None:
        for line in self._path.read_text(encoding="utf-8").splitlines() if self._path.exists() else []:
            try:
                entry = json.loads(line)
            except json.JSONDecodeError:
                continue  # the line that an interruption cut short; its run is repeated
            job = entry.pop("job")
            restored = Job(job["name"], Path(job["source"]), Path(job["scenario"]), job["parameters"])
            self.done[restored.name] = Outcome(restored, **entry)

    def enter(self, outcome: Outcome) -> None:
        """Write down a finished run, safely on disk before the next."""
        job = outcome.job
        entry = {
            "job": {"name": job.name, "source": str(job.source), "scenario": str(job.scenario), "parameters": job.parameters},
            **{key: value for key, value in asdict(outcome).items() if key != "job"},
        }
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(report.finite(entry), ensure_ascii=False) + "\n")
            file.flush()
            os.fsync(file.fileno())
