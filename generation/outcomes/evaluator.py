"""What a scenario does at points of its parameter space: one real run of the file on SUMO for each.

Workers last as long as the evaluator does. What does not change from run to run (the parsed scenario, its catalogues, the
road, SUMO's network) each of them reads once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import KW_ONLY, dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from generation.outcomes.outcomes import Outcomes
from runner.batch.jobs import Job, Outcome, failure
from runner.batch.pool import Pool
from runner.measures.rss import parameter_set
from runner.settings import RunSettings
from xodr.array_types import FloatArray

if TYPE_CHECKING:
    from generation.search.space import Space
    from runner.measures.criticality import Criticality


@dataclass(eq=False)
class Simulator:
    """Runs scenarios in lasting processes. A context manager.

    The outcomes are the same whatever the number of processes; a run that fails, or takes its process down, says so in them.

    Args:
        run: the settings of the runs. Their defaults are those of `xosc-run`, so that a generated file gives the same
            verdict there.
        rss: the RSS parameter set of R_risk.
        processes: how many run at a time.

    Raises:
        UsageError: a setting is wrong.
    """

    _: KW_ONLY
    run: RunSettings = field(default_factory=RunSettings)
    rss: str = "ad-rss"
    processes: int = 2
    calls: int = field(default=0, init=False)
    """Runs so far: what a budget of simulator calls counts"""

    def __post_init__(self) -> None:
        parameter_set(self.rss)
        self._pool = Pool(self.processes, partial(_episode, settings=self.run, rss=self.rss), _lost)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.close()

    def of(self, jobs: Iterable[Job | Outcome]) -> Outcomes:
        """The outcomes of jobs, in their order."""
        found = list(self._pool.execute(iter(jobs)))
        self.calls += len(found)
        collision = np.array([one.state == "failed" for one in found], bool)
        times = np.array([one.measures.get("min_ttc", math.inf) for one in found], float)
        return Outcomes(
            collision=collision,
            r_risk=np.array([one.measures.get("r_risk", 0.0) for one in found], float),
            min_ttc=np.where(collision, 0.0, times),  # a side touched is no lead's rear
            end_time=np.array([one.end_time or 0.0 for one in found], float),
            status=np.array([one.status or "error" for one in found], str),
            error=np.array([one.message if one.state == "error" else "" for one in found], str),
        )


@dataclass(eq=False)
class Evaluator(Simulator):
    """Runs a logical scenario at points of its parameter space; settings as those of `Simulator`.

    Args:
        scenario: the file.
        space: the parameters that are searched, and the values of the others.
    """

    scenario: Path
    space: Space

    def __call__(self, theta: FloatArray) -> Outcomes:
        """The outcomes at points (n, d), in their order."""
        values = ({**self.space.pinned, **self.space.values(row)} for row in theta)
        return self.of(Job(str(number), self.scenario, self.scenario, each) for number, each in enumerate(values))


def _measures(criticality: Criticality, rss: str) -> dict[str, Any]:
    ttc = criticality.ttc.value[criticality.ttc.valid]
    return {"r_risk": criticality.risk(rss) or 0.0, "min_ttc": float(ttc.min(initial=math.inf))}


def _episode(job: Job, settings: RunSettings, rss: str) -> Outcome:
    from runner.interpreter.execution import run

    try:
        result = run(job.scenario, settings, parameters=job.parameters)
        measures = _measures(result.criticality, rss) if result.criticality is not None else {}
    except Exception as error:  # whatever it is, the search goes on
        return failure(job, error)
    state = "passed" if result.verdict.passed else "failed"
    return Outcome(job, state, 0, status=result.status, end_time=result.end_time, measures=measures)


def _lost(job: Job) -> Outcome:
    return Outcome(job, "error", 5, "the process that ran it died")
