"""All searches of a study, one after the other; what is there already is not made again."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

import numpy as np

from generation.search.outcomes import CAREFUL, Evaluate, Evaluator, Outcomes
from generation.search.plays import ArrayPlays
from generation.search.problem import (
    History,
    Memory,
    Plays,
    Realism,
    Reward,
    SearchProblem,
    counted,
    method,
)
from generation.space import SpaceChoice
from generation.space.density.prior import Prior
from generation.space.recorded import Recorded
from generation.space.space import Space
from recognition.trfe.training.windows import seeded
from runner.judging.settings import DEFAULT_SYSTEM, RunSettings
from schemas.common.array_types import FloatArray
from schemas.common.errors import Unsupported, UsageError
from studies.generation.comparison.measures import avoided
from studies.generation.knots.motion import knots_of
from studies.generation.knots.problem import Trajectories
from studies.generation.knots.scenario import setting_of, write
from studies.generation.lockstep import as_ended
from studies.generation.methods import METHODS, TRAJECTORIES
from studies.recognition.protocol.store import Key as Place
from studies.recognition.protocol.store import Store


@dataclass(frozen=True)
class StudySettings:
    """Settings that make results comparable: only results of the same settings share a folder.

    Attributes:
        sut: name of the system under test.
        budget: simulator calls of each search.
        density: name of the density model.
        weight: of realism in the reward.
        rss: name of the RSS parameter set. timestep: s.
        pinned: values of parameters that are not searched.
        arrays: whether plays in arrays answer, kinematically, if the scenario plays so; else each
            run is SUMO's.
    """

    sut: str = DEFAULT_SYSTEM
    budget: int = 3000
    density: str = "kde"
    weight: float = Reward.weight
    rss: str = "ad-rss"
    timestep: float = RunSettings.timestep
    pinned: dict[str, str] = field(default_factory=dict)
    arrays: bool = True


_BESIDE = 24
"""Searches side by side, but for those of one seed, which always are"""


class Key(NamedTuple):
    """A search: name of the method, and seed."""

    method: str
    seed: int


class Study:
    """A study in a folder; a context manager, whose simulators end with it.

    Args:
        scenario: the logical scenario.
        recorded: gives the recorded parameters of its space.
        out: folder of the results.
        settings: what makes results comparable.
        processes: how many runs at a time; results do not depend on it.
        evaluators: makes what runs a scenario at points of a space, given the name of a system
            under test; by default, real runs.

    Attributes:
        recorded: parameters from recordings that lie in the box.
        problem: what all methods are given, but those that search trajectories.

    Raises:
        InvalidFile: the scenario is malformed.
        UsageError: a setting is wrong, or the folder holds results of others.
    """

    def __init__(
        self,
        scenario: Path,
        recorded: Callable[[Space], Recorded],
        out: Path,
        settings: StudySettings,
        processes: int = 2,
        evaluators: Callable[[str, Path, Space], Evaluate] | None = None,
    ) -> None:
        self.scenario, self.out, self.settings, self.store = scenario, out, settings, Store(out)
        self.space = Space.of(scenario, SpaceChoice(pinned=settings.pinned))
        samples = recorded(self.space)
        self.recorded = samples.within(self.space)
        self.store.open(
            {**asdict(settings), "scenario": scenario.name, "inputs": self._fingerprint()}
        )
        self._processes, self._stack = processes, ExitStack()
        self._made: dict[tuple[str, Path], Evaluate] = {}
        self._evaluators = evaluators or self._simulator
        prior = samples.prior(self.space, settings.density)
        self.problem = self._posed(scenario, self.space, self.recorded.theta, prior)

    def __enter__(self) -> Study:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stack.close()

    def pending(self, seeds: int, names: Sequence[str] | None = None) -> list[Key]:
        """Searches that are not there yet, in the order in which `run` makes them: all methods of a
        seed, then the next seed."""
        keys = [
            Key(name, seed)
            for seed in range(seeds)
            for name in METHODS
            if names is None or name in names
        ]
        return [key for key in keys if not self._path(key).exists()]

    def run(
        self, pending: Sequence[Key], progress: Callable[[int], None] = lambda calls: None
    ) -> Iterator[Key]:
        """Make searches, some side by side; each is given back when it is on disk. `progress` is
        called with the number of points just evaluated."""
        # One thread of torch, whose number the searches must not change for each other.
        with seeded(0):
            for keys in _groups(pending):
                for knots in (False, True):
                    some = [key for key in keys if (key.method in TRAJECTORIES) is knots]
                    if some:
                        yield from self._beside(some, knots, progress)

    def _beside(
        self, keys: Sequence[Key], knots: bool, progress: Callable[[int], None]
    ) -> Iterator[Key]:
        """Searches of the scenario, or of its trajectories, in lockstep."""
        scenario, problem = (
            (self.trajectories.scenario, self.trajectories.problem)
            if knots
            else (self.scenario, self.problem)
        )

        def plays(theta: FloatArray, sut: str | None = None) -> Outcomes:
            return self._evaluator(sut or self.settings.sut, scenario, problem.space)(theta)

        works = [partial(self._search, key, problem, progress) for key in keys]
        for number, _ in as_ended(works, plays):
            yield keys[number]

    def _search(
        self, key: Key, problem: SearchProblem, progress: Callable[[int], None], plays: Plays
    ) -> None:
        """Search, have the careful driver judge, and keep both."""
        path = self._path(key)
        path.parent.mkdir(parents=True, exist_ok=True)
        calls = path.with_suffix(".jsonl")
        remembered = Memory(counted(plays, progress), calls)
        history = method(key.method, METHODS)(
            replace(problem, evaluate=remembered), self.settings.budget, key.seed
        )
        share = avoided(history, lambda theta: plays(theta, CAREFUL))
        self.store.write(_place(key), {"avoidable": share})
        if key.method in TRAJECTORIES:
            history.save(self._knots(key))
            history = self.trajectories.as_maneuvers(history, self.problem.reward)
        history.save(path)
        calls.unlink(missing_ok=True)

    @cached_property
    def trajectories(self) -> Trajectories:
        """Inputs of methods that search trajectories: the same recorded manoeuvres, described by
        knots.

        Raises:
            UsageError: there are no trajectories beside the scenario.
        """
        setting = setting_of(self.scenario, self.space)
        scenario = write(self.out / "knots", self.space, setting)
        space = Space.of(scenario, SpaceChoice(pinned=self.settings.pinned))
        return Trajectories(
            scenario,
            setting,
            self._posed(scenario, space, space.clip(knots_of(self.recorded.theta, setting))),
        )

    def searches(self) -> list[Key]:
        """Searches that are there, methods in their order."""
        found = [
            Key(path.parent.name, int(path.stem))
            for path in (self.out / "searches").glob("*/*.npz")
        ]
        return sorted(found, key=lambda key: (list(METHODS).index(key.method), key.seed))

    def history(self, key: Key) -> History:
        """Return a search's history in the parameters of the scenario; for trajectories, the
        manoeuvres nearest to them."""
        return History.load(self._path(key))

    def knots(self, key: Key) -> History:
        """Return the history of a search of trajectories in its own parameters."""
        return History.load(self._knots(key))

    def avoidable(self, key: Key) -> float | None:
        """Share of a search's collisions that a careful and competent driver avoids; None without
        collisions."""
        found: float | None = self.store.read(_place(key))["avoidable"]
        return found

    def _posed(
        self, scenario: Path, space: Space, real: FloatArray, prior: Prior | None = None
    ) -> SearchProblem:
        """The problem of a scenario, given its recorded parameters."""
        realism = Realism.fitted(self.settings.density, real, self.recorded.recordings)
        reward = Reward(realism, self.settings.weight)
        return SearchProblem(
            space,
            self._evaluator(self.settings.sut, scenario, space),
            reward,
            real,
            prior=prior,
        )

    def _evaluator(self, sut: str, scenario: Path, space: Space) -> Evaluate:
        """Answers of a system under test, made when it is first asked."""
        if (sut, scenario) not in self._made:
            self._made[sut, scenario] = self._evaluators(sut, scenario, space)
        return self._made[sut, scenario]

    def _simulator(self, sut: str, scenario: Path, space: Space) -> Evaluate:
        settings = self.settings
        run = RunSettings(sut=sut, timestep=settings.timestep)
        if settings.arrays:
            try:
                return ArrayPlays(scenario, space, run, settings.rss, fast=False)
            except Unsupported:
                pass
        evaluator = Evaluator(scenario, space, run=run, rss=settings.rss, processes=self._processes)
        return self._stack.enter_context(evaluator)

    def _path(self, key: Key) -> Path:
        return self.out / "searches" / key.method / f"{key.seed}.npz"

    def _knots(self, key: Key) -> Path:
        return self.out / "knots" / f"{key.method}-{key.seed}.npz"

    def _fingerprint(self) -> str:
        """Of the scenario's text and the recorded parameters."""
        if not len(self.recorded.theta):
            raise UsageError(
                "no recorded manoeuvre is inside the limits of its parameters", path=self.scenario
            )
        content = self.scenario.read_bytes() + np.ascontiguousarray(self.recorded.theta).tobytes()
        return hashlib.sha256(content).hexdigest()[:16]


def _groups(keys: Sequence[Key]) -> list[list[Key]]:
    """Keys that are searched side by side: whole seeds, so that those that are
    done are complete.
    """
    seeds: dict[int, list[Key]] = {}
    for key in keys:
        seeds.setdefault(key.seed, []).append(key)
    groups: list[list[Key]] = []
    for some in seeds.values():
        if groups and len(groups[-1]) + len(some) <= _BESIDE:
            groups[-1] += some
        else:
            groups.append(list(some))
    return groups


def _place(key: Key) -> Place:
    return Place("avoidable", key.method, key.seed, 1)
