"""Failures that need two adversaries: those that vanish where either of the two keeps its speed and
lane."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

import xosc
from generation.search.outcomes import Evaluator, Outcomes, survivors
from generation.search.plays import ArrayPlays
from generation.search.problem import History, Plays
from generation.search.settings import Choice
from generation.space.logical.library import SCENARIOS, pair_scenarios
from generation.space.logical.pairs import PairScenario
from generation.space.space import distinctive, diverse
from runner.judging.settings import RunSettings
from schemas.common.array_types import FloatArray
from schemas.common.errors import Unsupported, UsageError
from schemas.common.terminal.text import many
from studies.generation.problem import Posed
from xosc.exports.draft import Folder
from xosc.exports.standard import export


class Needed(NamedTuple):
    """Of one search.

    Attributes:
        runs: of the system under test. failures: distinct foreseeable and preventable ones, on
            SUMO.
        alone: how many of these one adversary brings about alone, by its name.
        both: how many need both: the system survives whichever of the two keeps its speed and lane.
    """

    runs: int
    failures: int
    alone: dict[str, int]
    both: int

    def __str__(self) -> str:
        alone = ", ".join(f"{count} by {name} alone" for name, count in self.alone.items())
        found = f"{many(self.failures, 'distinct failure')} in {many(self.runs, 'run')}"
        return f"{found}: {self.both} need both adversaries; {alone}"


class Coordinated:
    """Plays points of two adversaries, where only collisions that need both count as collisions.

    Args:
        plays: of both. alone: of each where the other one does nothing.
    """

    def __init__(self, plays: Plays, alone: Mapping[str, Plays]) -> None:
        self._plays, self._alone = plays, alone

    def __call__(self, theta: FloatArray, sut: str | None = None) -> Outcomes:
        """The outcomes at points (n, d); with another system than that of the settings, all
        collisions count."""
        outcomes = self._plays(theta, sut)
        if sut is not None:
            return outcomes
        counted = outcomes.collision.copy()
        for plays in self._alone.values():
            rows = np.flatnonzero(counted)
            if rows.size:
                counted[rows] = ~plays(theta[rows]).collision
        return replace(outcomes, collision=counted)


def acting_alone(scenario: Path, folder: Path) -> dict[str, Path]:
    """Scenarios, written into a folder, of each of two adversaries where the other one does
    nothing, by name.

    Raises:
        UsageError: the scenario is none of two adversaries.
    """
    pair = dict(pair_scenarios()).get(scenario.stem)
    if pair is None:
        raise UsageError("this is no scenario of two adversaries", path=scenario)
    names = pair.pair.actors
    return {
        name: _without(pair, other, folder / name)
        for name, other in zip(names, reversed(names), strict=True)
    }


def _without(pair: PairScenario, name: str, folder: Path) -> Path:
    path = folder / f"{pair.name}.xosc"
    export(SCENARIOS / path.name, "1.3", Folder(folder))
    road = xosc.load(path).node.need("RoadNetwork", "LogicFile").get("filepath")
    xosc.write(PairScenario(pair.name, pair.pair, without=name).document(path, road), path)
    return path


def coordinated(posed: Posed, alone: Mapping[str, Path], sut: str) -> Posed:
    """The problem in which only failures count that need both.

    Raises:
        Unsupported: the problem has no plays in arrays.
    """
    problem = posed.problem
    if problem.plays is None:
        raise Unsupported("two adversaries are distinguished in arrays, where this does not play")
    singly = {
        name: ArrayPlays(path, problem.space, RunSettings(sut=sut)) for name, path in alone.items()
    }
    return posed._replace(problem=replace(problem, plays=Coordinated(problem.plays, singly)))


def needed(
    alone: Mapping[str, Path], history: History, posed: Posed, sut: str, processes: int
) -> Needed:
    """Run the failures of a search again with each adversary alone, on SUMO."""
    problem, theta = posed.problem, history.theta
    assert problem.prior is not None
    failing = history.outcomes.collision & history.outcomes.executed
    failing[failing] = problem.prior.foreseeable(theta[failing])
    failing[failing] = survivors(theta[failing], posed.sumo)
    found = theta[failing]
    found = found[diverse(problem.space.unit(found)[:, distinctive(problem.space)], Choice().apart)]
    stay = {}
    for name, path in alone.items():
        with Evaluator(path, problem.space, run=RunSettings(sut=sut), processes=processes) as run:
            stay[name] = run(found).collision
    both = ~np.any(list(stay.values()), axis=0) if len(found) else np.zeros(0, bool)
    return Needed(
        len(theta),
        len(found),
        {name: int(each.sum()) for name, each in stay.items()},
        int(both.sum()),
    )
