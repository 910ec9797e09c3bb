"""Outcomes of runs at points of a parameter space, and the judges of failures.

Judges are reference drivers and the bound of full braking; they decide which failures are edge
cases.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, asdict, dataclass, field, fields, replace
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from generation.search.settings import Choice
from generation.space.space import Space, apart, distinctive, diverse
from runner.batch.jobs import CODES, Job, Outcome, failure
from runner.batch.pool import Pool
from runner.engine.motion.rss import parameter_set
from runner.judging.result import INCONCLUSIVE
from runner.judging.settings import RunSettings
from runner.judging.verdict import margin
from runner.systems.arrays import BatchControl, BatchObservation, BatchParticipants
from runner.systems.base import Control, Observation, Participant
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import UsageError, guess
from schemas.common.policy import limited
from schemas.common.storage import keep, writing
from schemas.common.terminal.text import many, one_line
from xosc.listing.tables import EPISODES

if TYPE_CHECKING:
    from runner.batch.pool import RayPool
    from runner.judging.measures.measure import Limit
    from runner.judging.result import RunResult


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
    "margin": math.inf,
}
"""The outcome of an episode in which nothing happens, by the names of `Outcomes`."""


@dataclass(frozen=True, eq=False)
class Outcomes:
    """Outcomes of n episodes; arrays of length n.

    Args:
        collision: whether the run failed: the ego touched another participant, a criterion of the
            scenario failed, or a limit (`--fail-if`) was not kept.
        r_risk: share of the time steps, up to a collision, in which a participant is nearer than
            both RSS distances; 0 to 1. It depends on how long the scene is, and serves the
            published reward alone.
        min_ttc: least time to collision with the lead, s; 0 with a collision, infinite where there
            never was a lead.
        end_time: simulated time at the end, s.
        status: `completed` (by the stop trigger), `timeout`, `error` (no run took place) or
            `inconclusive` (it did not test what the file describes); with the last two the other
            values say nothing.
        error: what went wrong, or was not tested; empty where nothing did.
        risk: share of the `RISK_WINDOW` up to the conflict in which a participant is nearer than
            both RSS distances; time before the scene's start counts as safe, so that a short scene
            gains nothing.
        max_drac: greatest deceleration that just avoids a collision with the lead, m/s²; 0 where
            there never was a lead.
        clearance: least distance of the ego's box to another one, m; 0 with a collision, infinite
            without others.
        conflict: time of the first contact, else of the least clearance, s.
        impact_speed: relative speed at the first contact, m/s; 0 without one.
        side: side of the ego that is touched first: `front`, `rear`, `left`, `right`; empty without
            contact.
        striking: whether the ego hit the other one; false where it was hit, and without contact.
        margin: least signed distance to the limits (`runner.judging.measures.measure.Limit`), at
            most 0 where one is not kept; infinite without limits.
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
    margin: FloatArray

    @classmethod
    def of(cls, n: int, **known: Any) -> Outcomes:
        """Outcomes of n episodes, from known columns; the others are as where nothing happens."""
        columns = {
            name: np.asarray(known.get(name, [value] * n), type(value))
            for name, value in NOTHING.items()
        }
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
    def touching(self) -> BoolArray:
        """The episodes that took place in which the ego touched another participant; all failures
        but those by a limit alone."""
        return self.executed & self.collision & ((self.margin > 0.0) | (self.clearance <= 0.0))

    @property
    def survived(self) -> BoolArray:
        """The episodes that took place without a failure."""
        return self.executed & ~self.collision

    @property
    def critical(self) -> BoolArray:
        """The episodes that took place and have a collision or a violation of RSS distances."""
        return self.executed & (self.collision | (self.r_risk > 0.0))

    def take(self, chosen: BoolArray | IntArray) -> Outcomes:
        """Return a subset of the episodes, by a mask (n,) or by indices."""
        return Outcomes(
            **{field.name: getattr(self, field.name)[chosen] for field in fields(Outcomes)}
        )


class Episodes(NamedTuple):
    """Points (n, d), their outcomes, and their rewards (n,)."""

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
        kept = [part for part in parts if len(part.theta)] or parts[:1]
        theta, outcomes, rewards = zip(*kept, strict=True)
        return cls(np.concatenate(theta), joined(outcomes), np.concatenate(rewards))


def joined(parts: Sequence[Outcomes]) -> Outcomes:
    """Outcomes one after the other."""
    return Outcomes(
        **{
            field.name: np.concatenate([getattr(part, field.name) for part in parts])
            for field in fields(Outcomes)
        }
    )


Evaluate = Callable[[FloatArray], Outcomes]
"""Outcomes of the points (n, d), in their order; `Evaluator` is one."""


@dataclass(frozen=True)
class SimulationJob(Job):
    """A run.

    Args:
        sut: name of the system under test that drives the ego; None for that of the settings.
        seed: of the run; None for that of the settings.
    """

    sut: str | None = None
    seed: int | None = None


@dataclass(eq=False)
class Simulator:
    """Runs scenarios in lasting processes. A context manager.

    The outcomes are the same whatever the number of processes; a run that fails, or takes its
    process down, says so in them.

    Args:
        run: the settings of the runs. Their defaults are those of `xosc-run`, so that a generated
            file gives the same verdict there.
        rss: the RSS parameter set of R_risk.
        processes: how many run at a time.
        ray: address of a Ray cluster that does the runs, or `local` (`runner.batch.pool`); None for
            processes on this machine.

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
            Pool(self.processes, work, _lost)
            if self.ray is None
            else _cluster(self.ray, self.processes, work)
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.close()

    def of(self, jobs: Iterable[Job | Outcome]) -> Outcomes:
        """The outcomes of jobs, in their order."""
        outcomes = list(self._pool.execute(iter(jobs)))
        self.calls += len(outcomes)
        rows = [_row(one) for one in outcomes]
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

    def __call__(
        self, theta: FloatArray, sut: str | None = None, seed: int | None = None
    ) -> Outcomes:
        """The outcomes at points (n, d), in their order.

        Args:
            sut: name of the system under test, where another one than that of the settings is to
                drive.
            seed: of the runs; None for that of the settings.
        """
        values = ({**self.space.pinned, **self.space.values(row)} for row in theta)
        return self.of(
            SimulationJob(str(number), self.scenario, self.scenario, parameters, sut=sut, seed=seed)
            for number, parameters in enumerate(values)
        )


def measures(result: RunResult, rss: str, limits: Sequence[Limit] = ()) -> dict[str, Any]:
    """The columns of `Outcomes` that a run says something about.

    Args:
        rss: name of the RSS parameter set.
        limits: by which runs fail besides collisions.
    """
    failing, seen = bool(result.verdict.failures), result.criticality
    judged = {"collision": failing, "margin": margin(result, limits)}
    if seen is None or seen.conflict is None:
        return judged
    touched = seen.impact is not None
    measured = judged | {
        "r_risk": seen.risk(rss) or 0.0,
        # A contact at the side has no time to collision with a lead: by definition it is 0 then.
        "min_ttc": 0.0
        if touched
        else float(
            seen.ttc.value[seen.ttc.valid].min(initial=math.inf)
        ),  # a side is no lead's rear
        "risk": seen.risk_before(rss, seen.conflict, RISK_WINDOW),
        "max_drac": float(seen.drac.value[seen.drac.valid].max(initial=0.0)),
        "clearance": float(seen.distance.value[seen.distance.valid].min()),
        "conflict": seen.conflict,
    }
    impact = seen.impact
    return (
        measured
        if impact is None
        else measured
        | {"impact_speed": impact.speed, "side": impact.side, "striking": impact.striking}
    )


def _cluster(address: str, processes: int, work: Callable[[Job], Outcome]) -> RayPool:
    from runner.batch.pool import RayPool

    return RayPool(address, processes, work, _lost)


def episode(job: Job, settings: RunSettings, rss: str) -> dict[str, Any]:
    """Run a job in this process; the columns of `Outcomes` by name."""
    return _row(_episode(job, settings, rss))


def _row(outcome: Outcome) -> dict[str, Any]:
    """Return the columns of `Outcomes` for one run. An inconclusive run is
    neither a success of the system nor a failure.
    """
    # Kept apart from failures: a run that tested nothing must not count for or against the system.
    lost = outcome.state in ("error", INCONCLUSIVE)
    status = outcome.state if lost else outcome.status
    ended = {
        "end_time": outcome.end_time or 0.0,
        "status": status,
        "error": _from_here(outcome.message, outcome.job.scenario) if lost else "",
    }
    return {**NOTHING, **outcome.measures, **ended}


def _from_here(message: str, scenario: Path) -> str:
    """The message with files named from the folder of the scenario: the same search in another
    folder has the same history.
    """
    for folder in (scenario.parent, scenario.resolve().parent):
        if folder.name:
            message = message.replace(f"{folder}{os.sep}", "")
    return message


def _episode(job: Job, settings: RunSettings, rss: str) -> Outcome:
    from runner.judging.execution import run

    try:
        chosen = settings
        if isinstance(job, SimulationJob):
            chosen = replace(
                chosen,
                sut=chosen.sut if job.sut is None else job.sut,
                seed=chosen.seed if job.seed is None else job.seed,
            )
        # The run's own default ends with the first contact, which would cut the measures after it.
        if (
            chosen.end_after_collision is None
        ):  # measures are of the whole encounter, with every driver
            chosen = replace(chosen, end_after_collision=False)
        # an end shortly before a contact is an episode like any other: its measures say how near
        chosen = replace(chosen, least=("reserve=0", *chosen.least))
        with limited():
            result = run(job.scenario, chosen, parameters=job.parameters)
            verdict = result.verdict
            measured = (
                measures(result, rss, chosen.limits) if verdict.outcome != INCONCLUSIVE else {}
            )
    # One broken point of a thousand is a row with an error, not the end of the search.
    except Exception as error:  # whatever it is, the search goes on
        return failure(job, error)
    told = one_line("; ".join(verdict.reasons))
    return Outcome(
        job, verdict.outcome, CODES[verdict.outcome], told, result.status, result.end_time, measured
    )


def _lost(job: Job, _signal: int | None) -> Outcome:
    return Outcome(job, "error", 5, "the process that ran it died")


_CHANGED = 1e-3
"""Change of a speed (m/s) or of a lateral position (m) above which a vehicle is active"""


@dataclass
class FullBraking:
    """Brakes fully from the first instant at which anyone changes speed or place
    in the lane, the ego itself included.

    It is no system that could be built: it knows that whatever begins will be dangerous. What it
    hits, braking does not avoid.

    Args:
        brake: deceleration, m/s².
    """

    brake: float = 9.0
    _before: dict[str, tuple[float, float]] = field(init=False, repr=False, default_factory=dict)
    _begun: bool = field(init=False, repr=False, default=False)
    _states: FloatArray = field(init=False, repr=False, default_factory=lambda: np.empty((0, 0, 0)))
    _active: BoolArray = field(init=False, repr=False, default_factory=lambda: np.empty(0, bool))

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Forget the last run."""
        self._before, self._begun = {}, False

    def reset_batch(self, egos: BatchParticipants, timestep: float, seeds: IntArray) -> None:
        """Forget the last runs."""
        self._states, self._active = np.empty((0, 0, len(seeds))), np.zeros(len(seeds), bool)

    def control_batch(self, observations: BatchObservation, dt: float) -> BatchControl:
        """`control` in many runs."""
        run, ego, others = observations.run, observations.ego, observations.others
        names = ("speed", "x", "y", "z", "h")
        now = np.array(
            [np.concatenate([[getattr(ego, name)], getattr(others, name)]) for name in names]
        )
        there = np.concatenate([[np.ones(len(run), bool)], others.present])
        # NaN compares false with anything: an entity that appears counts as unchanged.
        now = np.where(there, now, np.nan)
        if not self._states.size:
            self._states = np.full((*now.shape[:2], len(self._active)), np.nan)
        speed, x, y, _, h = before = self._states[:, :, run]
        active = np.abs(now[0] - speed) > _CHANGED
        # motion along the heading keeps the place in a straight lane; other motion is looked up
        aside = (now[2] - y) * np.cos(h) - (now[1] - x) * np.sin(h)
        waiting = ~self._active[run] & ~active.any(axis=0)
        for who, row in zip(*np.nonzero((np.abs(aside) > _CHANGED / 2) & waiting), strict=True):
            if (network := observations.network[row]) is not None:
                places = (state[1:4, who, row].tolist() for state in (before, now))
                first, last = (network.locate(*place).offset for place in places)
                active[who, row] |= abs(last - first) > _CHANGED
        self._active[run] |= active.any(axis=0)
        self._states[:, :, run] = now
        return BatchControl(np.full(len(run), -self.brake), self._active[run])

    def control(self, observation: Observation, dt: float) -> Control:
        """Leave all to the scenario until the manoeuvre begins, then brake fully."""
        now = {
            participant.name: _state(observation, participant)
            for participant in (observation.ego, *observation.others)
        }
        self._begun = self._begun or any(
            _changed(self._before[name], state)
            for name, state in now.items()
            if name in self._before
        )
        self._before = now
        return Control(-self.brake, reason="the manoeuvre has begun") if self._begun else Control()


def _state(observation: Observation, who: Participant) -> tuple[float, float]:
    """Speed (m/s), and offset (m) from the middle of the lane; 0 off the roads."""
    network = observation.network
    return who.speed, network.locate(who.x, who.y, who.z).offset if network is not None else 0.0


def _changed(before: tuple[float, float], now: tuple[float, float]) -> bool:
    return any(abs(a - b) > _CHANGED for a, b in zip(before, now, strict=True))


CAREFUL = "r157-cc"
"""The careful and competent human driver of UN Regulation 157"""
JUDGES = (CAREFUL, "fsm")
"""A failure is preventable where one of these drivers survives the same case (METHOD.md §6)."""
FULL_BRAKING = "generation.search.outcomes:FullBraking"
"""Full braking from the instant at which the manoeuvre begins: what this hits,
no braking from then on avoids
"""
NEVER_BRAKED = "nobody changes speed or lane before the contact, so that full braking never begins"
REFERENCES: Mapping[str, str] = {
    **{name: name for name in (*JUDGES, "aeb", "idm", "rss", "r157-reg")},
    "full braking": FULL_BRAKING,
}
"""Systems under test by the names that reports have for them: the columns of the
matrix of reference drivers.
"""


R157 = "r157"
"""Operational domain of systems by UN Regulation 157"""
REGULATION = (CAREFUL, "r157-reg")
"""Judges in that domain: the regulation's driver, and its requirement on the system"""


def judges_of(names: Sequence[str], domain: Sequence[str] = ()) -> tuple[str, ...]:
    """Judges by their names, in the order given; without names those of the regulation in the
    domain `R157`, else `JUDGES`.

    Raises:
        UsageError: no reference driver has a name.
    """
    offered = [name for name, sut in REFERENCES.items() if name == sut]
    for name in names:
        if name not in offered:
            raise UsageError(
                f"--judge {name!r}: {guess(name, offered)}one of {', '.join(offered)} is expected"
            )
    return tuple(dict.fromkeys(names)) or (REGULATION if R157 in domain else JUDGES)


Drivers = Callable[[FloatArray, str], Outcomes]
"""Outcomes of points (n, d), driven by the system under test of a name;
`generation.search.outcomes.Evaluator` is one.
"""


def survivors(theta: FloatArray, drivers: Drivers, judges: Sequence[str] = JUDGES) -> BoolArray:
    """The points (n,) of (n, d) that one of the judges survives; each is asked
    only where those before it have not.
    """
    prevented = np.zeros(len(theta), bool)
    # Runs are what a search pays for: the second judge drives only what the first one does not
    # survive.
    for judge in judges:
        left = np.flatnonzero(~prevented)
        if left.size:
            prevented[left] = drivers(theta[left], judge).survived
    return prevented


Run = Callable[[int], tuple[BoolArray, BoolArray]]
"""Runs all failures with a seed: which were executed (n,), and which failed (n,)"""


class Repeats(NamedTuple):
    """Repetitions of failures, one a row.

    A run is a function of its values and its seed, unless its system has chance of its own (a
    learnt policy that samples, a clock, threads): the run of such a failure's file may pass, which
    a run with the same seed shows. Runs with other seeds say how often the values fail; the run
    that found the failure is not among them, since a search prefers those that failed.

    Attributes:
        again: whether each fails again with the seed of the search (n,).
        failing, runs: how many runs with other seeds fail, of those executed (n,).
    """

    again: BoolArray
    failing: IntArray
    runs: IntArray

    @classmethod
    def of(cls, count: int, run: Run, seed: int, number: int) -> Repeats:
        """Run failures again.

        Args:
            count: how many there are.
            seed: that they were found with. number: how many other seeds are tried.
        """
        failing, runs = np.zeros(count, np.int64), np.zeros(count, np.int64)
        if not count:
            return cls(np.zeros(0, bool), failing, runs)
        executed, again = run(seed)
        for other in range(seed + 1, seed + 1 + number):
            tested, failed = run(other)
            runs += tested
            failing += tested & failed
        return cls(executed & again, failing, runs)

    def take(self, rows: BoolArray | IntArray) -> Self:
        """Return some of them, by a mask (n,) or by indices."""
        return type(self)(self.again[rows], self.failing[rows], self.runs[rows])

    @property
    def lost(self) -> int:
        """Number of failures that do not fail again."""
        return int((~self.again).sum())

    @property
    def gone(self) -> int:
        """Number of failures that fail in none of their repetitions."""
        return int((~self.again & (self.failing == 0)).sum())

    def as_json(self) -> dict[str, Any]:
        """Return the counts as a JSON object, for files."""
        return {
            "failures": len(self.again),
            "again": int(self.again.sum()),
            "other_seeds": {"runs": int(self.runs.sum()), "failing": int(self.failing.sum())},
        }

    def __str__(self) -> str:
        failures = many(len(self.again), "failure")
        same = "with the same seed"
        found = (
            f"{self.lost} of {failures} did not fail again {same}: chance decides in the system"
            if self.lost
            else (
                f"{failures}, repeated {same}: "
                f"{'all fail' if len(self.again) > 1 else 'it fails'} again"
            )
        )
        runs = int(self.runs.sum())
        if not runs:
            more = "; --repeat N tells how often each fails" if self.lost else ""
            return f"{found}{more}"
        shares = self.failing / np.maximum(self.runs, 1)
        least = int(np.argmin(np.where(self.runs > 0, shares, np.inf)))
        seeds = f"{int(self.failing.sum())} of {many(runs, 'run')} with other seeds fail"
        return f"{found}; {seeds}, of the least one {self.failing[least]} of {self.runs[least]}"


class Matrix(NamedTuple):
    """Outcomes of points with each of the reference drivers, by their names in reports.

    Attributes:
        drivers: outcomes by name.
        agreed: verdicts of the judges, all the same in arrays, on which the others were played; 0
            where all were run.
    """

    drivers: Mapping[str, Outcomes]
    agreed: int = 0


_FEWEST_PLAYED = 30
"""Points from which on a driver takes less time in arrays than in single runs"""


def matrix(
    theta: FloatArray,
    drivers: Drivers,
    plays: Drivers | None = None,
    judges: Sequence[str] = JUDGES,
) -> Matrix:
    """The matrix of points (n, d). The judges are run; the others are played in arrays, if plays
    agree with all verdicts of the judges, and run otherwise.

    Args:
        plays: plays points with the system of a name; None for none.
        judges: names of the reference drivers that judge.
    """
    judged = {name: drivers(theta, REFERENCES[name]) for name in judges}
    others = {name: sut for name, sut in REFERENCES.items() if name not in judges}
    if (
        plays is None
        or len(theta) < _FEWEST_PLAYED
        or not all(agrees(judged[name], plays(theta, REFERENCES[name])) for name in judges)
    ):
        return Matrix(judged | {name: _driven(theta, sut, drivers) for name, sut in others.items()})
    return Matrix(
        judged | {name: _driven(theta, sut, plays) for name, sut in others.items()},
        len(judges) * len(theta),
    )


def _driven(theta: FloatArray, sut: str, drivers: Drivers) -> Outcomes:
    """Outcomes of a driver; where full braking never begins, its collision says nothing of what
    braking can do, and counts as a run that failed: it is the same as that of
    what the scenario scripts alone.
    """
    outcomes = drivers(theta, sut)
    rows = np.flatnonzero(outcomes.executed & outcomes.collision)
    if sut != FULL_BRAKING or not rows.size:
        return outcomes
    # If nobody changes anything before the contact, full braking never starts: its run is the
    # scripted one, contact and all.
    hit, scripted = outcomes.take(rows), drivers(theta[rows], "none")
    same = np.isclose(hit.conflict, scripted.conflict) & np.isclose(
        hit.impact_speed, scripted.impact_speed
    )
    never = np.zeros(len(theta), bool)
    never[rows] = scripted.executed & scripted.collision & same
    status, error = (
        np.where(never, "error", outcomes.status),
        np.where(never, NEVER_BRAKED, outcomes.error),
    )
    return replace(outcomes, status=status, error=error, collision=outcomes.collision & ~never)


def agrees(one: Outcomes, other: Outcomes) -> bool:
    """Whether all points were executed twice, with the same verdicts."""
    return bool(((one.collision == other.collision) & one.executed & other.executed).all())


def remembering(drivers: Drivers) -> Drivers:
    """The same drivers, which run no case twice with the same system."""
    known: dict[tuple[str, tuple[float, ...]], Outcomes] = {}

    def driving(theta: FloatArray, sut: str) -> Outcomes:
        keys = [(sut, tuple(row)) for row in theta.tolist()]
        # A dict drops rows that are asked for twice in one call.
        missing = {key: row for row, key in enumerate(keys) if key not in known}
        if missing:
            outcomes = drivers(theta[list(missing.values())], sut)
            known.update(
                (key, outcomes.take(np.array([place]))) for place, key in enumerate(missing)
            )
        return joined([known[key] for key in keys]) if keys else Outcomes.of(0)

    return driving


COLLISION, LIMIT, VIOLATION = "collision", "limit not kept", "violation of RSS distances"
AVOIDED, UNKNOWN = "avoids a collision", "unknown: the run failed"
Judged = Callable[[FloatArray], tuple[FloatArray, BoolArray]]
"""Log-densities (n,) of points (n, d), and which of them are foreseeable."""


_FARTHEST = 1e3
"""Clearances above this (m), and log-densities below its negative, are written as this"""


@dataclass(frozen=True, eq=False)
class Cases:
    """Edge cases, one a row: failures first, the likelier first.

    Attributes:
        theta: parameters (n, d).
        outcomes, rewards: at theta.
        log_likelihood: log-density (n,) at theta.
        drivers: outcomes of the reference drivers there, by their names
            (`generation.search.outcomes.REFERENCES`).
        agreed: verdicts of the judges that plays in arrays share, all of them, where these are of
            the other drivers; 0 where all were run.
        repeats: runs of the failures again, which are the first rows; None where none was repeated.
        judges: names of the drivers of which one survives a failure that counts as preventable.
    """

    theta: FloatArray
    outcomes: Outcomes
    rewards: FloatArray
    log_likelihood: FloatArray
    drivers: Mapping[str, Outcomes]
    agreed: int = 0
    repeats: Repeats | None = None
    judges: Sequence[str] = JUDGES

    def __len__(self) -> int:
        return len(self.rewards)

    def take(self, rows: BoolArray | IntArray) -> Cases:
        """Return a subset of the episodes, by a mask (n,) or by indices."""
        drivers = {name: outcomes.take(rows) for name, outcomes in self.drivers.items()}
        return Cases(
            self.theta[rows],
            self.outcomes.take(rows),
            self.rewards[rows],
            self.log_likelihood[rows],
            drivers,
            self.agreed,
            None if self.repeats is None else self.repeats.take(self._failures(rows)),
            self.judges,
        )

    def _failures(self, rows: BoolArray | IntArray) -> IntArray:
        """Rows of `repeats` that belong to some of the cases."""
        chosen = np.arange(len(self))[rows]
        return chosen[self.outcomes.collision[chosen]]

    def prevented_by(self) -> dict[str, int]:
        """Number of collisions by the judges that prevent them, as `both` 51, `fsm only` 49;
        without those of no collision.
        """
        collision = self.outcomes.collision
        survived = np.array([self.drivers[name].survived for name in self.judges]) & collision
        counts: dict[str, int] = {}
        for row in survived.T[collision]:
            by = [name for name, survives in zip(self.judges, row, strict=True) if survives]
            if len(by) == len(self.judges) > 1:
                name = "both" if len(by) == 2 else "all"
            else:
                name = " and ".join(by) + (" only" if len(self.judges) > 1 else "")
            if by:
                counts[name] = counts.get(name, 0) + 1
        return dict(sorted(counts.items(), key=lambda item: -item[1]))

    @property
    def careful(self) -> Outcomes:
        """Outcomes with the careful and competent driver of UN R157."""
        return self.drivers[CAREFUL]

    @property
    def avoidable(self) -> BoolArray:
        """The collisions (n,) that the careful driver is known to avoid."""
        return self.outcomes.collision & self.careful.survived

    def tags(self) -> dict[str, list[str] | list[float]]:
        """The values of each case, by the names of their tags."""
        outcomes, repeats = self.outcomes, self.repeats
        again = [""] * len(self)
        if repeats is not None:
            for row, (fails, failing, runs) in enumerate(zip(*repeats, strict=True)):
                others = f"; {failing} of {runs} runs with other seeds" if runs else ""
                again[row] = f"{'again' if fails else 'not again'} with the same seed{others}"
        survived = {name: driven.survived for name, driven in self.drivers.items()}
        return {
            "Verdict": np.select(
                [outcomes.touching, outcomes.collision], [COLLISION, LIMIT], VIOLATION
            ).tolist(),
            "CarefulDriver": np.select(
                [self.careful.survived, self.careful.collision], [AVOIDED, COLLISION], UNKNOWN
            ).tolist(),
            "SurvivedBy": [
                ", ".join(name for name in survived if survived[name][row])
                for row in range(len(self))
            ],
            "Fails": again,
            "Reward": _rounded(self.rewards),
            "LogLikelihood": _rounded(np.maximum(self.log_likelihood, -_FARTHEST)),
            "RRisk": _rounded(outcomes.r_risk),
            "Risk": _rounded(outcomes.risk),
            "ConflictTime": _rounded(outcomes.conflict),
            "Clearance": _rounded(np.minimum(outcomes.clearance, _FARTHEST)),
            "MaxDRAC": _rounded(outcomes.max_drac),
            "ImpactSpeed": _rounded(outcomes.impact_speed),
            "ImpactSide": outcomes.side.tolist(),
            "Striking": np.where(
                outcomes.striking, "ego", np.where(outcomes.side != "", "other", "")
            ).tolist(),
        }


def choose(
    space: Space,
    episodes: Episodes,
    judged: Judged,
    drivers: Drivers,
    choice: Choice = Choice(),  # noqa: B008 - frozen
    found: FloatArray | None = None,
    plays: Drivers | None = None,
    judges: Sequence[str] = JUDGES,
) -> Cases:
    """The foreseeable and preventable failures that are far enough from each
    other, the likelier first.

    Args:
        judged: says how likely points are, and which are foreseeable.
        drivers: runs scenarios with a system under test of a name.
        found: points (m, d) that the cases are to be far enough from as well.
        plays: plays reference drivers that are no judges, where they agree with the judges' runs;
            None for none.
        judges: names of the drivers of which one has to survive a failure.
    """
    drivers = remembering(drivers)
    log_likelihood, foreseeable = judged(episodes.theta)
    executed, collision = episodes.outcomes.executed, episodes.outcomes.collision
    # Stable, so that equal likelihoods keep the order of the search, on every platform.
    order = np.argsort(-log_likelihood, kind="stable")
    taken = _Taken(space, choice, found)
    taken.add(
        episodes.theta,
        # Cheap conditions first: preventability costs runs of the judges, and is asked last, of
        # few.
        order[(executed & collision & foreseeable)[order]],
        lambda rows: survivors(rows, drivers, judges),
    )
    if choice.violations:
        touched = executed & ~collision & foreseeable & (episodes.outcomes.risk > 0.0)
        taken.add(episodes.theta, order[touched[order]], lambda rows: np.ones(len(rows), bool))
    chosen = np.array(taken.rows, np.int64)
    theta = episodes.theta[chosen]
    references = matrix(theta, drivers, plays, judges)
    outcomes = episodes.outcomes.take(chosen)
    rewards = episodes.rewards[chosen]
    return Cases(theta, outcomes, rewards, log_likelihood[chosen], *references, judges=judges)


class _Taken:
    """The rows that are cases so far."""

    def __init__(self, space: Space, choice: Choice, found: FloatArray | None) -> None:
        self.rows: list[int] = []
        self._space, self._choice, self._told = space, choice, distinctive(space)
        self._found = np.empty((0, len(space.parameters))) if found is None else found

    def add(
        self, theta: FloatArray, order: IntArray, counts: Callable[[FloatArray], BoolArray]
    ) -> None:
        """Take rows in an order, those that count and are apart; no row is
        looked at that is near to one taken.

        Args:
            theta: all points (n, d). order: of the rows that may be taken.
            counts: which of some points (k, d) count; to be asked of as few as possible.
        """
        unit, found = (self._space.unit(rows)[:, self._told] for rows in (theta, self._found))
        order = order[
            apart(unit[order], np.concatenate([unit[self.rows], found]), self._choice.apart)
        ]
        # In rounds: rows that are apart from each other are judged together, which fills the
        # processes, and those near to a row that counts are dropped unjudged.
        while order.size and len(self.rows) < self._choice.most:
            some = order[
                diverse(unit[order], self._choice.apart, self._choice.most - len(self.rows))
            ]
            self.rows += some[counts(theta[some])].tolist()
            order = order[~np.isin(order, some)]
            order = order[apart(unit[order], unit[self.rows], self._choice.apart)]


def _rounded(values: FloatArray) -> list[float]:
    """Values to six decimal digits."""
    rounded: list[float] = np.round(values, 6).tolist()
    return rounded


# table of all runs of a search ---------------------------------------------------------------


def write_episodes(space: Space, parts: Mapping[str, Episodes], out: Path) -> Path:
    """Write the table into a search's folder; its path.

    Columns: part (a key of `parts`), the parameters by name, those of `Outcomes`, and reward.
    Infinite values are null.

    Raises:
        NotWritten: it can't be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    content = BytesIO()
    tables = [
        pa.table(_columns(space, name, episodes))
        for name, episodes in parts.items()
        if len(episodes.theta)
    ]
    if tables:
        pq.write_table(pa.concat_tables(tables), content, compression="zstd")
    path = out / EPISODES
    with writing("the table of runs", path):
        if tables:
            keep(content.getvalue(), path)
    return path


def _columns(space: Space, part: str, episodes: Episodes) -> dict[str, Any]:
    import pyarrow as pa

    outcomes = {name: np.asarray(values) for name, values in asdict(episodes.outcomes).items()}
    theta = dict(zip(space.names, episodes.theta.T, strict=True))
    columns = {"part": np.full(len(episodes.theta), part), **theta, **outcomes}
    columns["reward"] = np.asarray(episodes.rewards)
    return {
        # Null, since readers of Parquet differ in what they make of infinity.
        name: pa.array(values, mask=~np.isfinite(values) if values.dtype.kind == "f" else None)
        for name, values in columns.items()
    }
