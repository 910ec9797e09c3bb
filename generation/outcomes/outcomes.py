"""Episodes: runs of a logical scenario at points of its parameter space, and how they ended."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, fields, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from runner.batch.jobs import CODES, Job, Outcome, failure
from runner.batch.pool import Pool
from runner.interpreter.result import INCONCLUSIVE
from runner.measures.rss import parameter_set
from runner.settings import RunSettings
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.policy import limited
from schemas.common.text import one_line

if TYPE_CHECKING:
    from generation.search.space import Space
    from runner.batch.pool import RayPool
    from runner.interpreter.result import RunResult


RISK_WINDOW = 3.0
"""Time (s) up to the conflict over which `Outcomes.risk` is measured"""
NOTHING: Mapping[str, Any] = {
    "collision": False,
    "r_risk": 0.0,
    "min_ttc": math.inf,
    "end_time": 0.0,
    "status": "completed",
    "error": "",
    "risk": 0.0,
    "max_drac": 0.0,
    "clearance": math.inf,
    "conflict": 0.0,
    "impact_speed": 0.0,
    "side": "",
    "striking": False,
}
"""The outcome of an episode in which nothing happens, by the names of `Outcomes`."""


@dataclass(frozen=True, eq=False)
class Outcomes:
    """Outcomes of n episodes; arrays of length n.

    Args:
        collision: whether the ego touched another participant.
        r_risk: share of the time steps, up to a collision, in which a participant is nearer than both RSS distances; 0 to 1. It
            depends on how long the scene is, and serves the published reward alone.
        min_ttc: least time to collision with the lead, s; 0 with a collision, infinite where there never was a lead.
        end_time: simulated time at the end, s.
        status: `completed` (by the stop trigger), `timeout`, `error` (no run took place) or `inconclusive` (it did not test what
            the file describes); with the last two the other values say nothing.
        error: what went wrong, or was not tested; empty where nothing did.
        risk: share of the `RISK_WINDOW` up to the conflict in which a participant is nearer than both RSS distances; time before
            the scene's start counts as safe, so that a short scene gains nothing.
        max_drac: greatest deceleration that just avoids a collision with the lead, m/s²; 0 where there never was a lead.
        clearance: least distance of the ego's box to another one, m; 0 with a collision, infinite without others.
        conflict: time of the first contact, else of the least clearance, s.
        impact_speed: relative speed at the first contact, m/s; 0 without one.
        side: side of the ego that is touched first: `front`, `rear`, `left`, `right`; empty without contact.
        striking: whether the ego hit the other one; false where it was hit, and without contact.
    """

    collision: BoolArray
    r_risk: FloatArray
    min_ttc: FloatArray
    end_time: FloatArray
    status: NDArray[np.str_]
    error: NDArray[np.str_]
    risk: FloatArray
    max_drac: FloatArray
    clearance: FloatArray
    conflict: FloatArray
    impact_speed: FloatArray
    side: NDArray[np.str_]
    striking: BoolArray

    @classmethod
    def of(cls, n: int, **known: Any) -> Outcomes:
        """Of n episodes, with what is known of them; the rest as where nothing happens."""
        columns = {name: np.asarray(known.get(name, [value] * n), type(value)) for name, value in NOTHING.items()}
        return cls(**columns)

    def __len__(self) -> int:
        return len(self.status)

    @property
    def executed(self) -> BoolArray:
        """The episodes that took place, and tested the system."""
        return (self.status != "error") & ~self.inconclusive

    @property
    def inconclusive(self) -> BoolArray:
        """The episodes that took place, but did not test what the file describes."""
        return self.status == "inconclusive"

    @property
    def survived(self) -> BoolArray:
        """The episodes that took place and have no collision."""
        return self.executed & ~self.collision

    @property
    def critical(self) -> BoolArray:
        """The episodes that took place and have a collision or a violation of RSS distances."""
        return self.executed & (self.collision | (self.r_risk > 0.0))

    def take(self, chosen: BoolArray | IntArray) -> Outcomes:
        """Some of the episodes, by a mask (n,) or by indices."""
        return Outcomes(**{each.name: getattr(self, each.name)[chosen] for each in fields(Outcomes)})


class Episodes(NamedTuple):
    """Points (n, d), what came of them, and their rewards (n,)."""

    theta: FloatArray
    outcomes: Outcomes
    rewards: FloatArray

    def first(self, n: int) -> Episodes:
        """The first n of them, or all."""
        rows = np.arange(min(n, len(self.theta)))
        return Episodes(self.theta[rows], self.outcomes.take(rows), self.rewards[rows])

    @classmethod
    def joined(cls, parts: Sequence[Episodes]) -> Episodes:
        """Several runs after each other, without empty parts."""
        kept = [each for each in parts if len(each.theta)] or parts[:1]
        theta, outcomes, rewards = zip(*kept, strict=True)
        return cls(np.concatenate(theta), joined(outcomes), np.concatenate(rewards))


def joined(parts: Sequence[Outcomes]) -> Outcomes:
    """Outcomes one after the other."""
    return Outcomes(**{each.name: np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(Outcomes)})


Evaluate = Callable[[FloatArray], Outcomes]
"""Outcomes of the points (n, d), in their order; `Evaluator` is one."""


@dataclass(frozen=True)
class SimulationJob(Job):
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
        ray: address of a Ray cluster that does the runs, or `local` (`runner.batch.pool`); None for processes of one's own.

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
        return self.of(
            SimulationJob(str(number), self.scenario, self.scenario, each, sut=sut) for number, each in enumerate(values)
        )


def measures(result: RunResult, rss: str) -> dict[str, Any]:
    """The columns of `Outcomes` that a run says something about.

    Args:
        rss: name of the RSS parameter set.
    """
    collision, seen = bool(result.verdict.failures), result.criticality
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
    from runner.batch.pool import RayPool

    return RayPool(address, processes, work, _lost)


def _row(found: Outcome) -> dict[str, Any]:
    """The columns of `Outcomes` for one run; one that tested nothing is no success of the system and no failure."""
    lost = found.state in ("error", INCONCLUSIVE)
    status = found.state if lost else found.status
    ended = {"end_time": found.end_time or 0.0, "status": status, "error": found.message if lost else ""}
    return {**NOTHING, **found.measures, **ended}


def _episode(job: Job, settings: RunSettings, rss: str) -> Outcome:
    from runner.interpreter.execution import run

    try:
        chosen = replace(settings, sut=job.sut) if isinstance(job, SimulationJob) and job.sut is not None else settings
        if chosen.end_after_collision is None:  # measures are of the whole encounter, with every driver
            chosen = replace(chosen, end_after_collision=False)
        with limited():
            result = run(job.scenario, chosen, parameters=job.parameters)
            verdict = result.verdict
            found = measures(result, rss) if verdict.outcome != INCONCLUSIVE else {}
    except Exception as error:  # whatever it is, the search goes on
        return failure(job, error)
    told = one_line("; ".join(verdict.reasons))
    return Outcome(job, verdict.outcome, CODES[verdict.outcome], told, result.status, result.end_time, found)


def _lost(job: Job, _signal: int | None) -> Outcome:
    return Outcome(job, "error", 5, "the process that ran it died")
