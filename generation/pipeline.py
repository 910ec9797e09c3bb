"""From a logical scenario and recorded parameters to files of edge cases."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from generation.density.base import Density
from generation.density.gate import Gate, measured
from generation.density.marginals import Marginal
from generation.density.model import DEFAULT, JUDGE, UNIFORM
from generation.density.prior import Prior
from generation.estimation.estimate import RUNS, Estimate, EstimateSettings, Known, estimate
from generation.estimation.rates import driving
from generation.outcomes.cases import Cases, Choice, choose
from generation.outcomes.evaluator import Evaluate, Evaluator
from generation.outcomes.inputs import inputs
from generation.outcomes.outcomes import Episodes, joined
from generation.outcomes.references import Drivers
from generation.recorded import Recorded
from generation.search.memory import Memory
from generation.search.method import DEFAULT as METHOD
from generation.search.method import method
from generation.search.problem import History, Problem, counted
from generation.search.reward import Realism, Reward
from generation.search.space import Space
from generation.twin.episodes import Twin
from generation.variations import Evidence, Writer, Written
from runner.settings import RunSettings
from runner.sut import system_name
from schemas.errors import Unsupported, UsageError
from schemas.storage import alone, digest, write_object
from xodr.array_types import FloatArray

LEAST = 30
"""Fewest recorded manoeuvres inside the box that a density is fitted on."""
_GATED = 30, 300
"""Least and most runs of each kind that a density is measured by; between them a tenth of the budget"""


@dataclass(frozen=True)
class SearchSettings:
    """What to search for, and how.

    Attributes:
        run: how scenarios are run, with the system under test; `seed` is that of the search.
        method: name of the search method (`generation.search.method`).
        budget: simulator calls.
        seed: of the search.
        density: name of the density model (`generation.density.model`).
        weight: of realism in the reward; None for the one of `Reward`.
        rss: name of the RSS parameter set.
        processes: how many runs at a time.
        ray: address of a Ray cluster that does the runs, or `local`; None for processes of one's own.
        pinned: values of parameters that are not searched.
        free: names of parameters to search besides the default ones.
        marginals: densities, and ranges, of parameters to search besides.
        default: whether to search what is searched by default; otherwise only what is free or has a range.
        choice: which episodes become files.
        concrete: whether each case becomes a scenario of its own as well.
        estimate: whether to estimate how often the system fails, by `RUNS` more runs, or as many as the budget.
    """

    run: RunSettings = field(default_factory=RunSettings)
    method: str = METHOD
    budget: int = 3000
    seed: int = 0
    density: str = JUDGE
    weight: float | None = None
    rss: str = "ad-rss"
    processes: int = 2
    ray: str | None = None
    pinned: Mapping[str, str] = field(default_factory=dict)
    free: Sequence[str] = ()
    marginals: Mapping[str, Marginal] = field(default_factory=dict)
    default: bool = True
    choice: Choice = field(default_factory=Choice)
    concrete: bool = False
    estimate: bool = False

    def space(self, scenario: Path) -> Space:
        """What is searched of a scenario.

        Raises:
            UsageError, Unsupported: it can't be. InvalidFile: the scenario is malformed.
        """
        return Space.of(scenario, self.pinned, self.free, ranges=self.marginals, default=self.default)


@dataclass(frozen=True, eq=False)
class Generated:
    """What came of a search.

    Attributes:
        space: what was searched, and what was pinned.
        recorded: the recorded manoeuvres that the density was fitted on, inside the limits.
        prior: what traffic does.
        history: all episodes.
        episodes: all runs that are kept: of this search and of those before, draws of the density, runs of the estimate.
        cases: the edge cases.
        files: what was written; empty where there are no edge cases.
        gate: what the density was measured by.
        reused: how many answers came from runs that were kept.
        estimate: how often the system fails; None where that was not asked for.
    """

    space: Space
    recorded: Recorded
    prior: Prior
    history: History
    episodes: Episodes
    cases: Cases
    files: list[Path]
    gate: Gate
    reused: int = 0
    estimate: Estimate | None = None


def generate(
    scenario: Path,
    recorded: Callable[[Space], Recorded],
    out: Path,
    settings: SearchSettings,
    progress: Callable[[int], None] = lambda runs: None,
    found: FloatArray | None = None,
) -> Generated:
    """Search a logical scenario for edge cases and write them.

    Runs are kept in the folder as they come: after an interruption the same call goes on where it was, and one with another
    budget, seed or method extends the search. Edge cases are chosen from all runs that are kept; files of a search before that
    nobody has changed are replaced. Draws of the density and runs of an estimate are among those that cases are chosen from.

    Args:
        scenario: the file.
        recorded: gives the recorded parameters of a space.
        out: folder for the files.
        settings: what to search for.
        progress: called with the number of runs after each batch of them.
        found: critical points (m, d) of earlier searches of the same space: this one starts from them, where its method
            starts from scenarios at all, and none of its cases is much like one of them.

    Raises:
        UsageError: a setting is wrong, the method searches no manoeuvres, too few recorded ones are inside the box, or something
            is in the way in the folder.
        InvalidFile: the scenario is malformed.
    """
    search = method(settings.method)
    space = settings.space(scenario)
    source = recorded(space)
    real = source.within(space)
    realism, prior = _realism(real, settings.density, scenario), source.prior(space, settings.density)
    with alone(out, "a search"), evaluator_of(scenario, space, settings) as evaluator:
        draws, memory, more = (
            Memory(evaluator, _runs_file(scenario, space, out, settings, kind)) for kind in ("draws", "runs", "estimate")
        )
        gate = _gate(scenario, source, space, out, settings, prior, draws)
        evaluate = counted(memory, progress)
        reward = Reward(realism) if settings.weight is None else Reward(realism, settings.weight)
        problem = Problem(space, evaluate, reward, real.theta, found, prior, _twin(scenario, space, settings))
        history = search(problem, settings.budget, settings.seed)
        judged = prior.judged if gate.refusal is None else prior.unjudged
        every = _joined([_rewarded(each, reward) for each in (memory, draws)])
        rate = _estimate(problem, source, more, evaluator, every, settings) if settings.estimate else None
        every = _joined([every, _rewarded(more, reward)])
        cases = choose(space, every, judged, evaluator, settings.choice, found, problem.twin)
        if rate is not None:
            of = {"scenario": scenario.name, "sut": settings.run.sut, "pinned": dict(space.pinned)}
            write_object({**of, **rate.as_json()}, out / estimate_file(scenario))
        written = Written(out, scenario.stem)
        written.withdraw()
        files = _write(scenario, space, out, settings, cases, realism.density) if len(cases) else []
        written.note()
    return Generated(space, real, prior, history, every, cases, files, gate, memory.reused, rate)


def _rewarded(memory: Memory, reward: Reward) -> Episodes:
    """All runs that are remembered."""
    theta, outcomes = memory.everything
    return Episodes(theta, outcomes, reward(theta, outcomes) if len(theta) else np.empty(0))


def _joined(parts: Sequence[Episodes]) -> Episodes:
    """Several runs after each other, without those parts that have none."""
    kept = [each for each in parts if len(each.theta)] or parts[:1]
    theta, outcomes, rewards = zip(*kept, strict=True)
    return Episodes(np.concatenate(theta), joined(outcomes), np.concatenate(rewards))


def _gate(
    scenario: Path, recorded: Recorded, space: Space, out: Path, settings: SearchSettings, prior: Prior, run: Evaluate
) -> Gate:
    """Replays of the recorded units, and draws of the density."""
    most = min(settings.budget, max(_GATED[0], min(settings.budget // 10, _GATED[1])))
    replays = recorded.replays(space)
    if replays is None:
        return measured(prior, run, None, run, most)
    own, units = replays
    with evaluator_of(scenario, own, settings) as evaluator:
        replay = Memory(evaluator, _runs_file(scenario, own, out, settings, "replays"))
        return measured(prior, run, units, replay, most)


def _estimate(
    problem: Problem, recorded: Recorded, run: Evaluate, drivers: Drivers, episodes: Episodes, settings: SearchSettings
) -> Estimate:
    """How often the system fails."""
    assert problem.prior is not None
    known = Known(episodes.theta, episodes.outcomes.collision)
    chosen = EstimateSettings(min(RUNS, settings.budget), settings.seed)
    found = estimate(problem.prior, run, drivers, known, problem.twin, chosen)
    return found._replace(driving=driving(recorded, problem.space, problem.prior))


def estimate_file(scenario: Path) -> str:
    """Name of the file, in a search's folder, that says how often the system fails."""
    return f"{scenario.stem}_estimate.json"


def _realism(real: Recorded, name: str, scenario: Path) -> Realism:
    """What recorded parameters make of realism."""
    if len(real.theta) < LEAST:
        reason = f"{len(real.theta)} recorded manoeuvres are inside the limits of its parameters, at least {LEAST} are needed"
        raise UsageError(reason, path=scenario)
    return Realism.fitted(DEFAULT if name == UNIFORM else name, real.theta, real.recordings)


def _runs_file(scenario: Path, space: Space, out: Path, settings: SearchSettings, kind: str) -> Path:
    """The file of the runs of a kind, another one for everything that decides what a run gives."""
    deciding = (inputs(scenario, settings.run, settings.rss, space.pinned), space.names, sorted(space.pinned.items()))
    return out / f"{scenario.stem}_{kind}_{digest(repr(deciding).encode())}.jsonl"


def _twin(scenario: Path, space: Space, settings: SearchSettings) -> Twin | None:
    """The scenario's twin; None where it, its system under test or a setting is nothing that a twin can play."""
    try:
        return Twin(scenario, space, settings.run, settings.rss)
    except Unsupported:
        return None


def evaluator_of(scenario: Path, space: Space, settings: SearchSettings) -> Evaluator:
    """What runs points of a search.

    Raises:
        UsageError: a setting is wrong, or there is no such cluster.
    """
    return Evaluator(scenario, space, run=settings.run, rss=settings.rss, processes=settings.processes, ray=settings.ray)


def evidence(settings: SearchSettings) -> Evidence:
    """What holds for all files of a search."""
    run = settings.run
    return Evidence(system_name(run.sut), settings.method, settings.rss, settings.seed, settings.budget, run.timestep)


def _write(scenario: Path, space: Space, out: Path, settings: SearchSettings, cases: Cases, density: Density) -> list[Path]:
    of, writer = evidence(settings), Writer(scenario, space, out, settings.run)
    files = [writer.cases(cases, of), writer.density(density, settings.seed)]
    return files + (writer.concrete(cases, of) if settings.concrete else [])
