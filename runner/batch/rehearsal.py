"""Dry runs: what is to be run is loaded, compiled and brought to time 0, without a step of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Iterable, Iterator
from contextlib import closing
from dataclasses import replace
from functools import partial
from itertools import combinations_with_replacement, groupby
from pathlib import Path

from runner.batch.batch import each, lost
from runner.batch.jobs import Job, Outcome, assumed, failure
from runner.interpreter.result import INCONCLUSIVE
from runner.settings import RunSettings
from schemas.common.errors import ExitCode, gravest
from schemas.common.policy import limited
from schemas.common.text import one_line, shown

ALL = 1000
"""So many parameter sets of a file are rehearsed whatever their values are."""


def rehearse_batch(jobs: Iterable[Job | Outcome], settings: RunSettings, processes: int = 1) -> Generator[Outcome]:
    """Load, resolve, compile and begin what is to be run; one outcome a file, the gravest of its sets.

    What a set can break is decided by one of its values or by two that meet, as a rule. Of a file with more than `ALL` sets those
    that follow are rehearsed where two of their values meet for the first time (pairwise testing: Kuhn, Wallace, Gallo, Software
    Fault Interactions and Implications for Software Testing, IEEE Transactions on Software Engineering 30, 2004).
    """
    chosen = Pairwise(jobs)
    with closing(each(iter(chosen), partial(_compiled, settings=settings), lost, processes)) as outcomes:
        for _, group in groupby(outcomes, key=lambda outcome: outcome.job.source):
            yield _rehearsed(group, chosen.sets)


class Pairwise:
    """Jobs without those parameter sets in which no two values meet for the first time; the first `ALL` of a file are kept.

    Attributes:
        sets: how many sets of each file there have been, those left out among them.
    """

    def __init__(self, jobs: Iterable[Job | Outcome]) -> None:
        self._jobs = jobs
        self.sets: Counter[Path] = Counter()

    def __iter__(self) -> Iterator[Job | Outcome]:
        met: set[tuple[tuple[str, str], tuple[str, str]]] = set()
        source: Path | None = None
        for job in self._jobs:
            if isinstance(job, Outcome):
                self.sets[job.job.source] += 1
                yield job
                continue
            if job.source != source:
                source = job.source
                met.clear()
            self.sets[source] += 1
            pairs = set(combinations_with_replacement(job.parameters.items(), 2))
            if self.sets[source] <= ALL or not pairs <= met:
                met |= pairs
                yield job


def _rehearsed(outcomes: Iterable[Outcome], sets: Counter[Path]) -> Outcome:
    """Combine the outcomes of a file's parameter sets."""
    first, count, failures, remarks = None, 0, list[Outcome](), dict[str, None]()
    for outcome in outcomes:
        count += 1
        first = first or outcome.job
        if outcome.exit_code:
            failures.append(replace(outcome, trace="" if failures else outcome.trace))
        remarks |= dict.fromkeys(outcome.remarks)
    assert first is not None
    varied = first.source != first.scenario
    name = first.name.rpartition("~")[0] or first.name if varied else first.name
    job = Job(name, first.source, first.scenario)
    every = sets[first.source]
    pairwise = f", {count} of them rehearsed: every two values that meet" if count < every else ""
    if not failures:
        said = f"{every} parameter sets{pairwise}" * varied
        return Outcome(job, "loaded", 0, said, status="compiled", remarks=[*remarks])
    worst = gravest(outcome.exit_code for outcome in failures)
    first_worst = next(outcome for outcome in failures if outcome.exit_code == worst)
    share = f"{len(failures)} of {count} parameter sets: " if count > 1 else ""
    remarks = {remark: None for remark in remarks if remark not in first_worst.message}
    return replace(first_worst, job=job, message=share + first_worst.message, remarks=[*remarks])


def _compiled(job: Job, settings: RunSettings) -> Outcome:
    from runner.interpreter.execution import prepare
    from runner.interpreter.untested import of_remarks

    try:
        assumptions = assumed(job, settings.strict)
        with limited():
            prepared = prepare(job.scenario, job.parameters, settings)
            begun = prepared.rehearse(settings)
    except Exception as error:  # a defect of ours is an outcome too, the other files go on
        return failure(job, error)
    causes = tuple(dict.fromkeys((*of_remarks(assumptions), *begun.causes)))
    told = [cause.text for cause in causes]
    remarks = [one_line(remark) for remark in (*map(str, assumptions), *begun.remarks) if remark not in told]
    if not causes:
        return Outcome(job, "loaded", ExitCode.PASSED, status="compiled", remarks=remarks)
    message, names = one_line("; ".join(shown(told))), [*dict.fromkeys(cause.name for cause in causes)]
    return Outcome(job, INCONCLUSIVE, ExitCode.INCONCLUSIVE, message, "compiled", remarks=remarks, causes=names)
