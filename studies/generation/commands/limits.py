"""`python -m studies.generation limits`: whether the distance to a limit leads a search to what
exceeds it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runner.batch.options import Timestep
from runner.judging.settings import RunSettings
from schemas.common.terminal.command_line import Verbose, Version, interruptible, say

if TYPE_CHECKING:
    from generation.search.problem import SearchProblem
    from schemas.common.array_types import BoolArray, FloatArray

NAME = "python -m studies.generation limits"
_SYSTEMS = "cas", "adas", "aeb", "idm", "rss", "fsm"
_LIMITS = "min_ttc<1", "max_drac>6", "min_distance<1"
_GUIDED, _BLIND, _DRAWS = "cover", "cover, without the margin", "draws"
_RAREST, _COMMONEST = 5e-4, 0.05
"""Probabilities of a failure between which a search is judged: few draws of the pool fail, or most
searches find all"""


def command(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO", help="A logical scenario.")],
    systems: Annotated[
        list[str] | None,
        typer.Option("--system", metavar="NAME", help="Only these systems (repeatable)."),
    ] = None,
    limits: Annotated[
        list[str] | None,
        typer.Option("--limit", metavar="LIMIT", help="Only these limits (repeatable)."),
    ] = None,
    budget: Annotated[int, typer.Option(min=100, metavar="N", help="Runs of each search.")] = 300,
    seeds: Annotated[int, typer.Option(min=1, metavar="N", help="Searches of each.")] = 2,
    first: Annotated[int, typer.Option(metavar="N", help="First seed.")] = 0,
    pool: Annotated[
        int,
        typer.Option(min=1000, metavar="N", help="Draws of the density that recall is of."),
    ] = 20_000,
    timestep: Timestep = RunSettings.timestep,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Search what exceeds limits with the margin, without it, and by draws of the density.

    Recall is the share of failing draws within 10 % of the ranges of a found failure. Runs are
    played in arrays and choose nothing else; no judges.
    """
    import numpy as np

    from generation.search.plays import ArrayPlays
    from generation.search.problem import Realism, Reward, SearchProblem
    from generation.search.settings import Ask
    from generation.search.variations import asked_of
    from generation.space.density.models import DEFAULT, JUDGE
    from generation.space.space import Space
    from studies.generation.planted.study import interval

    asked = asked_of(Ask(), scenario)
    space = Space.of(scenario, asked.choice)
    units = asked.recorded(space)
    real = units.within(space)
    reward = Reward(Realism.fitted(DEFAULT, real.theta, real.recordings))
    prior = units.prior(space, JUDGE)
    drawn = prior.sample(pool, np.random.default_rng(7))
    recalls: dict[str, list[float]] = {_GUIDED: [], _BLIND: [], _DRAWS: []}
    say("| system, limit | P(failure) | " + " | ".join(recalls) + " |", "|---|---|---|---|---|")
    with interruptible(NAME, "nothing is kept"):
        for sut in systems or _SYSTEMS:
            for limit in limits or _LIMITS:
                run = RunSettings(sut=sut, timestep=timestep, world="kinematic", fail_if=(limit,))
                plays = ArrayPlays(scenario, space, run, fast=False)
                outcomes = plays(drawn)
                failing = drawn[outcomes.collision & outcomes.executed]
                chance = len(failing) / pool
                if not _RAREST <= chance <= _COMMONEST:
                    say(f"| {sut}, {limit} | {chance:.2%} | left out |")
                    continue
                problem = SearchProblem(space, plays, reward, real.theta, None, prior)
                found = {
                    name: [
                        _recall(problem, name, budget, seed, failing)
                        for seed in range(first, first + seeds)
                    ]
                    for name in recalls
                }
                for name, values in found.items():
                    recalls[name] += values
                means = " | ".join(f"{np.mean(values):.2f}" for values in found.values())
                say(f"| {sut}, {limit} | {chance:.2%} | {means} |")
    guided = np.array(recalls[_GUIDED])
    say("", f"| {_GUIDED} over | lead | pairs |", "|---|---|---|")
    for other in (_BLIND, _DRAWS):
        ahead = guided - np.array(recalls[other])
        low, high = interval(ahead)
        lead = f"{ahead.mean():+.2f} ({low:+.2f} to {high:+.2f})"
        say(f"| {other} | {lead} | {len(ahead)} |")


def _recall(
    problem: SearchProblem, name: str, budget: int, seed: int, failing: FloatArray
) -> float:
    """Share of failing draws (n, d) near a failure that a search finds."""
    import numpy as np

    from generation.search.gate import NEAR
    from generation.search.methods.cover import cover, draws
    from generation.search.outcomes import Outcomes
    from generation.space.space import KnownRows, distinctive

    def blind(theta: FloatArray) -> Outcomes:
        outcomes = problem.evaluate(theta)
        return replace(outcomes, margin=np.full(len(theta), np.inf))

    posed = replace(problem, evaluate=blind) if name == _BLIND else problem
    history = (draws if name == _DRAWS else cover)(posed, budget, seed)
    fails: BoolArray = history.outcomes.collision & history.outcomes.executed
    columns, known = distinctive(problem.space), KnownRows()
    known.add(problem.space.unit(history.theta[fails])[:, columns])
    near = known.distances(problem.space.unit(failing)[:, columns]) < NEAR
    return float(near.mean())
