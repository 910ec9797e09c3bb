"""Many runs: every parameter set of every file, in one process or several, interrupted and resumed
with nothing lost.

`BatchComparison` holds a batch against an earlier one, run by run: new, fixed and remaining
failures.
"""

from __future__ import annotations

import errno
import os
import signal
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from heapq import merge
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from runner.batch import inputs, journal
from runner.batch.jobs import Job, Jobs, Outcome, assumed, failure
from runner.batch.outputs.folder import PICTURE, digests, write_run
from runner.batch.outputs.outcomes import contradiction, outcome_of
from runner.batch.outputs.tables import write_runs
from runner.batch.outputs.work import WorkDone, write_work
from runner.judging.settings import RunSettings
from schemas.common.errors import ToolchainError, UsageError
from schemas.common.policy import current, limited, poll
from schemas.common.storage import alone

if TYPE_CHECKING:
    from runner.judging.result import RunResult


Also = Callable[["RunResult"], None]


def execute(
    job: Job,
    settings: RunSettings,
    out: Path | None = None,
    plot: bool = False,
    also: Sequence[Also] = (),
    shared: str = "",
    contacts: bool = True,
) -> Outcome:
    """Do one run and write its results into a folder of its own; errors of the run become outcomes.

    Args:
        out: folder for the folder of results.
        plot: add a picture.
        also: called with the result.
        contacts: describe the first contact of a failed run, which takes a third of a short one.
        shared: what `runner.batch.inputs.of_batch` gives, for the digest of all that went in.

    Raises:
        OSError: there is no space, or no right to write.
    """
    # Before the run: a file that changes meanwhile must not pass for what was run.
    given = inputs.of_job(job, settings, shared) if shared else ""
    content = inputs.content_of(job, settings) if shared else ""
    try:
        found = _run(job, settings, out, plot, also, contacts)
        return replace(found, inputs=given, content=content)
    # A full disk is the batch's error, not that of the run.
    except OSError:
        raise
    except Exception as error:  # a defect of ours is an outcome too, the other runs go on
        poll()  # unless an interrupt is behind it
        return replace(failure(job, error), inputs=given, content=content)


def _run(
    job: Job,
    settings: RunSettings,
    out: Path | None,
    plot: bool,
    also: Sequence[Also],
    contacts: bool,
) -> Outcome:
    from runner.judging.execution import run

    # A repeated run has a seed of its own, all others that of the batch.
    own = settings if job.seed is None else replace(settings, seed=job.seed)
    remarks = assumed(job, own.strict)
    with limited():
        result = run(job.scenario, own, parameters=job.parameters)
        result.name = job.name
        result.assume(remarks)
        measures = write_run(result, out / job.name, plot) if out is not None else {}
        for act in also:
            act(result)
    files = digests(out / job.name) if out is not None else {}
    return outcome_of(job, result, measures, files, contacts or out is not None, own.limits)


def print_line(line: str) -> None:
    """Print a line about a batch to standard error."""
    print(line, file=sys.stderr)


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
    needs: Sequence[str] = (),
    contacts: bool = True,
    tell: Callable[[str], None] = print_line,
    known: Callable[[Outcome], object] = lambda outcome: None,
) -> Generator[Outcome]:
    """Do the runs and yield their outcomes in the order of the jobs.

    With an output folder every finished run is entered in a journal; `resume` takes finished runs
    from there instead of repeating them, as long as nothing that went in has changed and their
    results are whole. They are believed if the user's key has sealed them (see
    `runner.batch.journal`), else if their outcomes follow from their trajectories and results, and
    under --untrusted not at all. `plot` adds a picture to the results of each. Finished runs
    without that, or without one of the files that `needs` names, are repeated too. Each of `also`
    gets the result of every run that is done, in the process that has done it. Without `contacts`
    outcomes of a batch without a folder have no `impact`. `tell` is called with a line about
    finished runs that are repeated, `known` with each outcome that is taken from the journal.

    At the end, or when it is interrupted, the folder gets a table of all runs (see
    `runner.batch.outputs.tables`). `ray` is the address of a Ray cluster that does the runs, or
    `local`; see `runner.batch.pool`. Under a policy with limits of memory or time
    (`schemas.common.policy`) runs are done in other processes, and one that needs more is an error
    of that run.

    Raises:
        UsageError: the folder holds results already (and `resume` is not set), or those of another
            batch; another process writes into it, or it can't be written into; there is no such
            cluster.
    """
    how: dict[str, Any] = {
        "settings": settings, "out": out, "plot": plot, "also": also, "contacts": contacts,
    }  # fmt: skip
    # Without a folder nothing is kept that could be resumed.
    if out is None:
        with closing(_outcomes(iter(jobs), partial(execute, **how), processes, ray)) as outcomes:
            yield from outcomes
        return
    shared = inputs.of_batch(settings)
    given = partial(inputs.of_job, run=settings, shared=shared)
    with alone(out, "a batch"), _writable(out):
        needed = (*needs, PICTURE) if plot else tuple(needs)
        named = jobs.is_named if isinstance(jobs, Jobs) else lambda job: True
        kept = journal.begin(
            out, settings.as_json(), resume, given, _sources(jobs), tell, needed, named
        )
        believed = partial(_believed, out=out, settings=settings, sealed=kept.sealed, tell=tell)
        without_job: list[Outcome] = []
        work = partial(execute, **how, shared=shared)
        ended = WorkDone(jobs)

        # Lazily: jobs of a large space are never all in memory.
        def asked() -> Iterator[Job | Outcome]:
            for job in jobs:
                if isinstance(job, Job):
                    finished = _finished(job, kept.done, believed)
                    if finished is not None:
                        known(finished)
                    yield finished or job
                    continue
                if job.state == "error":
                    without_job.append(job)
                yield job

        with (
            _concluded(out, kept, without_job, ended),
            closing(_outcomes(asked(), work, processes, ray, kept.enter)) as outcomes,
        ):
            for outcome in outcomes:
                ended.add(outcome)
                yield outcome


def _sources(jobs: Iterable[Job | Outcome]) -> set[Path] | None:
    """The files that jobs are of, where that is known before they are worked out."""
    if isinstance(jobs, Jobs):
        return jobs.sources
    return (
        {job.source if isinstance(job, Job) else job.job.source for job in jobs}
        if isinstance(jobs, Sequence)
        else None
    )


@contextmanager
def _writable(out: Path) -> Iterator[None]:
    """Context in which results are written.

    Raises:
        UsageError: the folder can no longer be written into.
    """
    try:
        yield
    except OSError as error:
        reason = (
            f"results can't be written: {error.strerror or error}; --resume goes on after the "
            "runs that are finished"
        )
        raise UsageError(reason, path=out) from None


@contextmanager
def _concluded(
    out: Path, kept: journal.Journal, without_job: list[Outcome], ended: WorkDone
) -> Iterator[None]:
    """Context manager around the runs of a batch: at its end, also when they are interrupted,
    drafts are removed and the table of all runs is written.

    Args:
        without_job: errors of files that gave no job: they have rows, but no entries.
    """
    try:
        yield
    finally:
        journal.clear_drafts(out)
        # Writing the table would make a deleted folder anew, with a table of nothing.
        if not out.is_dir():
            raise FileNotFoundError(errno.ENOENT, "the folder is gone")
        without_job.sort(key=_by_name)
        write_runs(merge(without_job, kept.close(), key=_by_name), out / "runs.parquet")
        write_work(ended.rows(), out)


def _by_name(outcome: Outcome) -> str:
    return outcome.job.name


def _outcomes(
    jobs: Iterator[Job | Outcome],
    work: Callable[[Job], Outcome],
    processes: int,
    ray: str | None,
    done: Callable[[Outcome], None] | None = None,
) -> Generator[Outcome]:
    """Do the runs in this process, in several or on a cluster; `done` is called here with each that
    was done."""
    if ray is not None:
        from runner.batch.pool import RayPool

        with RayPool(ray, processes, work, lost, done) as cluster:
            yield from cluster.execute(jobs)
    else:
        yield from each(jobs, work, lost, processes, done)


def each(
    jobs: Iterator[Job | Outcome],
    work: Callable[[Job], Outcome],
    died: Callable[[Job, int | None], Outcome],
    processes: int,
    done: Callable[[Outcome], None] | None = None,
) -> Generator[Outcome]:
    """Do some work for each job, in this process or in others, as where one has limits; arguments
    as in `Pool`."""
    if processes > 1 or current().bounded:
        from runner.batch.pool import Pool

        with Pool(processes, work, died, done) as pool:
            yield from pool.execute(jobs)
    else:
        for job in jobs:
            outcome = job if isinstance(job, Outcome) else work(job)
            # Known outcomes pass through: only work that was done is entered.
            if done is not None and outcome is not job:
                done(outcome)
            yield outcome


def _finished(
    job: Job, done: dict[str, Outcome], believed: Callable[[Outcome], bool]
) -> Outcome | None:
    outcome = done.get(job.name)
    # A name with other values would mix results of two batches.
    if outcome is not None and outcome.job != job:
        raise UsageError(
            f"{job.name} was run from another file or with other parameters; resume with the same"
        )
    return outcome if outcome is not None and believed(outcome) else None


def _believed(
    outcome: Outcome, out: Path, settings: RunSettings, sealed: bool, tell: Callable[[str], None]
) -> bool:
    """Whether a finished run is sealed, or its result follows from its files; `tell` gets the
    reason if not."""
    if sealed:
        return True
    fault = contradiction(outcome, out / outcome.job.name, settings)
    if fault:
        tell(f"1 finished run {fault}: run anew ({outcome.job.name})")
    return not fault


def lost(job: Job, signal_number: int | None = None) -> Outcome:
    """The outcome of a job whose process died, by a signal where that is known."""
    how = ""
    if signal_number is not None:
        with suppress(ValueError):
            how = f" by {signal.Signals(signal_number).name}"
    # SIGKILL comes from the kernel when memory runs out, or from a user.
    killed = signal_number == getattr(signal, "SIGKILL", None)
    why = (
        "as a system does that runs out of memory"
        if killed
        else "of too little memory or a defect of a library"
    )
    over = signal_number is not None and signal_number == getattr(
        signal, "SIGPROF", None
    )  # see `schemas.common.policy.limited`
    why = "for it takes longer than --max-seconds allows" if over else why
    return Outcome(
        job, "error", 4 if over else 5, f"the process that ran it died{how}, {why}", "died"
    )


Identity = tuple[str, tuple[tuple[str, str], ...], int | None]
"""Key that identifies a run in two batches: file, parameters, seed"""
_FAILS = ("failed", "error")


def identity(
    file: str | Path,
    parameters: Mapping[str, object] | Iterable[tuple[str, str]],
    seed: int | None,
    counterparts: Mapping[str, str] = MappingProxyType({}),
) -> Identity:
    """Return the key of a run.

    Args:
        counterparts: files of another batch by those of this one, see `counterparts_of`.
    """
    pairs = parameters.items() if isinstance(parameters, Mapping) else parameters
    own = os.path.abspath(file)
    values = tuple(sorted((name, str(value)) for name, value in pairs))
    return counterparts.get(own, own), values, seed


def counterparts_of(now: Iterable[str | Path], before: Iterable[str | Path]) -> dict[str, str]:
    """Files of an earlier batch by those of this one, as absolute paths.

    A file is that of the same path; else that of the same path below the folder which all files of
    its batch are in; else the only one of its name, where both batches have one only.
    """
    own, earlier = (
        [os.path.abspath(file) for file in dict.fromkeys(files)] for files in (now, before)
    )
    counterparts = {path: path for path in own if path in set(earlier)}
    # First the surer key: a file's place below its batch's folder before its bare name.
    for key in (_below(own) | _below(earlier)).get, lambda path: Path(path).stem:
        taken = set(counterparts.values())
        left = _unique([path for path in earlier if path not in taken], key)
        mine = _unique([path for path in own if path not in counterparts], key)
        counterparts |= {mine[name]: left[name] for name in mine.keys() & left.keys()}
    return counterparts


def _below(paths: Sequence[str]) -> dict[str, str]:
    """Paths below the folder that all are in."""
    root = os.path.commonpath(list(map(os.path.dirname, paths))) if paths else ""
    return {path: os.path.relpath(path, root) for path in paths}


def _unique(paths: Iterable[str], key: Callable[[str], str | None]) -> dict[str | None, str]:
    """Paths by a key that no other has."""
    groups: dict[str | None, list[str]] = {}
    for path in paths:
        groups.setdefault(key(path), []).append(path)
    return {name: group[0] for name, group in groups.items() if len(group) == 1}


class EarlierRun(NamedTuple):
    """State of a run in an earlier batch, digest of its files, and speed of its impact (m/s)."""

    state: str
    content: str
    impact: float | None = None


@dataclass
class BatchComparison:
    """Sorts the runs of a batch by their outcome in an earlier one; a run that the earlier one
    lacks counts as not failed.

    So does a run of which a file (scenario, road network, catalogue) has changed since.

    Attributes:
        title: of the earlier batch.
        before: runs of the earlier batch.
        content: gives the digest of a job's files.
        new, fixed, still: runs that fail now only, that failed before only, and that fail in both.
    """

    title: str
    before: dict[Identity, EarlierRun]
    content: Callable[[Job], str]
    counterparts: Mapping[str, str] = field(default_factory=dict)
    new: list[Outcome] = field(default_factory=list)
    fixed: list[Outcome] = field(default_factory=list)
    still: list[Outcome] = field(default_factory=list)

    @classmethod
    def with_batch(
        cls, folder: Path, files: Iterable[Path], settings: RunSettings
    ) -> BatchComparison:
        """Comparison with the batch of an output folder; with the user's key only runs that it has
        sealed count.

        Args:
            files, settings: of the batch that is compared.

        Raises:
            UsageError: the folder is not that of a batch.
        """
        key = journal.seal_key()
        earlier = [
            outcome
            for outcome in journal.finished(folder).outcomes.values()
            # Without the seal an edited journal could call a new failure a known one.
            if key is None or journal.is_sealed(outcome, key)
        ]
        runs = {
            _key(outcome.job): EarlierRun(outcome.state, outcome.content, _impact(outcome))
            for outcome in earlier
        }
        same = counterparts_of(files, [outcome.job.source for outcome in earlier])
        content = partial(inputs.content_of, run=settings)
        system, now = journal.settings(folder).get("sut"), settings.as_json()["sut"]
        title = folder.resolve().name
        return cls(
            title if system == now else f"{title} ({system}, now {now})", runs, content, same
        )

    def add(self, outcome: Outcome) -> None:
        """Take a run of the batch in."""
        failed, fails = self.failed(outcome), outcome.state in _FAILS
        if failed or fails:
            # A failure after an error is new: the error had hidden the verdict.
            new = fails and not self.known(outcome)
            (self.new if new else self.still if fails else self.fixed).append(outcome)

    def failed(self, outcome: Outcome) -> bool:
        """Whether a run failed in the earlier batch."""
        return self.was(outcome) in _FAILS

    def known(self, outcome: Outcome) -> bool:
        """Whether a run failed likewise in the earlier batch: a failed verdict after an error is
        new, and one of other files."""
        after_error = outcome.state == "failed" and self.was(outcome) == "error"
        return self.failed(outcome) and not after_error and not self.changed(outcome)

    def was(self, outcome: Outcome) -> str | None:
        """State of a run in the earlier batch; None where it was not in it."""
        run = self._earlier(outcome)
        return run.state if run is not None else None

    def changed(self, outcome: Outcome) -> bool:
        """Whether a file of a run of the earlier batch has changed since."""
        run = self._earlier(outcome)
        return run is not None and run.content != (outcome.content or self.content(outcome.job))

    def harder(self, outcome: Outcome) -> tuple[float, float] | None:
        """Speeds of a run's impact (m/s) in the earlier batch and now, where it has become harder
        by 0.1 m/s or more."""
        run, now = self._earlier(outcome), _impact(outcome)
        if run is None or run.impact is None or now is None or now - run.impact < 0.1:
            return None
        return run.impact, now

    def _earlier(self, outcome: Outcome) -> EarlierRun | None:
        return self.before.get(_key(outcome.job, self.counterparts))


def _impact(outcome: Outcome) -> float | None:
    return None if outcome.impact is None else float(outcome.impact["speed"])


def _key(job: Job, counterparts: Mapping[str, str] = MappingProxyType({})) -> Identity:
    return identity(job.source, job.parameters, job.seed, counterparts)


def runnable(arguments: Iterable[str]) -> list[Path]:
    """Expand names of files, folders and globs; folders and globs give runnable files only.

    Raises:
        UsageError: a folder or glob stands for nothing that can be run.
    """
    from schemas.common.terminal.files import expand

    found: dict[Path, None] = {}
    for argument in arguments:
        if command := journal.repeated_by(Path(argument)):
            raise UsageError(f"results of runs are here; repeat them by: {command}", path=argument)
        files = expand([argument])
        alone = files == [Path(argument)]
        meant = (
            files
            if alone
            else [
                file
                for file in files
                if file.is_dir() or (file.suffix.lower() == ".xosc" and not _is_catalog(file))
            ]
        )
        if not meant:
            raise UsageError("this stands for no scenario or variation file", path=argument)
        found |= dict.fromkeys(meant)
    return list(found)


# Folders hold catalogues beside scenarios: by name nothing tells them apart.
def _is_catalog(path: Path) -> bool:
    import xosc

    try:
        return xosc.load(path).kind == "catalog"
    except ToolchainError:
        return False  # reported when it is run
