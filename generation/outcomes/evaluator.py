"""What a scenario does at points of its parameter space: one real run of the file on SUMO for each.

Workers last as long as the evaluator does. What does not change from run to run (the parsed scenario, its catalogues, the
road, SUMO's network) each of them reads once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from generation.outcomes.outcomes import NOTHING, RISK_WINDOW, Outcomes
from runner.batch.jobs import Job, Outcome, failure
from runner.batch.pool import Pool
from runner.measures.rss import parameter_set
from runner.settings import RunSettings
from xodr.array_types import FloatArray

if TYPE_CHECKING:
    from generation.search.space import Space
    from runner.batch.ray_pool import RayPool
    from runner.interpreter.result import RunResult


Evaluate = Callable[[FloatArray], Outcomes]
"""Outcomes of the points (n, d), in their order; `Evaluator` is one."""


@dataclass(frozen=True)
class Episode(Job):
    """A run.

    Args:
        sut: name of the system under test that drives the ego; None for that of the settings.
    """

    sut: str | None = None


@dataclass(eq=False)
class Simulator:
    """Runs scenarios in lasting processes. A context manager.

    The outcomes are the same whatever the number of processes; a run that fails, or takes its process down, says so in them.

    Args:
        run: the settings of the runs. Their defaults are those of `xosc-run`, so that a generated file gives the same
            verdict there.
        rss: the RSS parameter set of R_risk.
        processes: how many run at a time.
        ray: address of a Ray cluster that does the runs, or `local` (`runner.batch.ray_pool`); None for processes of one's own.

    Raises:
        UsageError: a setting is wrong, or there is no such cluster.
    """

    _: KW_ONLY
    run: RunSettings = field(default_factory=RunSettings)
    rss: str = "ad-rss"
    processes: int = 2
    ray: str | None = None
    calls: int = field(default=0, init=False)
    """Runs so far: what a budget of simulator calls counts"""

    def __post_init__(self) -> None:
        parameter_set(self.rss)
        work = partial(_episode, settings=self.run, rss=self.rss)
        self._pool: Pool | RayPool = (
            Pool(self.processes, work, _lost) if self.ray is None else _cluster(self.ray, self.processes, work)
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.close()

    def of(self, jobs: Iterable[Job | Outcome]) -> Outcomes:
        """The outcomes of jobs, in their order."""
        found = list(self._pool.execute(iter(jobs)))
        self.calls += len(found)
        rows = [_row(one) for one in found]
        return Outcomes.of(len(rows), **{name: [row[name] for row in rows] for name in NOTHING})


@dataclass(eq=False)
class Evaluator(Simulator):
    """Runs a logical scenario at points of its parameter space; settings as those of `Simulator`.

    Args:
        scenario: the file.
        space: the parameters that are searched, and the values of the others.
    """

    scenario: Path
    space: Space

    def __call__(self, theta: FloatArray, sut: str | None = None) -> Outcomes:
        """The outcomes at points (n, d), in their order.

        Args:
            sut: name of the system under test, where another one than that of the settings is to drive.
        """
        values = ({**self.space.pinned, **self.space.values(row)} for row in theta)
        return self.of(Episode(str(number), self.scenario, self.scenario, each, sut=sut) for number, each in enumerate(values))


def measures(result: RunResult, rss: str) -> dict[str, Any]:
    """The columns of `Outcomes` that a run says something about.

    Args:
        rss: name of the RSS parameter set.
    """
    collision, seen = not result.verdict.passed, result.criticality
    if seen is None or seen.conflict is None:
        return {"collision": collision}
    found = {
        "collision": collision,
        "r_risk": seen.risk(rss) or 0.0,
        "min_ttc": 0.0 if collision else float(seen.ttc.value[seen.ttc.valid].min(initial=math.inf)),  # a side is no lead's rear
        "risk": seen.risk_before(rss, seen.conflict, RISK_WINDOW),
        "max_drac": float(seen.drac.value[seen.drac.valid].max(initial=0.0)),
        "clearance": float(seen.distance.value[seen.distance.valid].min()),
        "conflict": seen.conflict,
    }
    impact = seen.impact
    return found if impact is None else found | {"impact_speed": impact.speed, "side": impact.side, "striking": impact.striking}


def _cluster(address: str, processes: int, work: Callable[[Job], Outcome]) -> RayPool:
    from runner.batch.ray_pool import RayPool

    return RayPool(address, processes, work, _lost)


def _row(found: Outcome) -> dict[str, Any]:
    """The columns of `Outcomes` for one run."""
    error = found.message if found.state == "error" else ""
    ended = {"end_time": found.end_time or 0.0, "status": found.status or "error", "error": error}
    return {**NOTHING, **found.measures, **ended}


def _episode(job: Job, settings: RunSettings, rss: str) -> Outcome:
    from runner.interpreter.execution import run

    try:
        chosen = replace(settings, sut=job.sut) if isinstance(job, Episode) and job.sut is not None else settings
        result = run(job.scenario, chosen, parameters=job.parameters)
        found = measures(result, rss)
    except Exception as error:  # whatever it is, the search goes on
        return failure(job, error)
    state = "passed" if result.verdict.passed else "failed"
    return Outcome(job, state, 0, status=result.status, end_time=result.end_time, measures=found)


def _lost(job: Job) -> Outcome:
    return Outcome(job, "error", 5, "the process that ran it died")
