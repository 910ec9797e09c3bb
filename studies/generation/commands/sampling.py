"""`python -m studies.generation sampling`: spread of estimated failure probabilities by draws of
the density, strata and chosen draws at equal time."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from runner.batch.options import Timestep
from runner.judging.settings import RunSettings
from schemas.common.errors import Unsupported
from schemas.common.terminal.command_line import Verbose, Version, interruptible

NAME = "python -m studies.generation sampling"


def command(
    scenario: Annotated[
        Path, typer.Argument(metavar="SCENARIO", help="A logical scenario that plays in arrays.")
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the draws that regions are of.")
    ],
    generator: Annotated[
        str, typer.Option(help="Generator of planted systems: development, reported.")
    ] = "reported",
    draws: Annotated[int, typer.Option(min=64, metavar="N", help="Plays of each estimate.")] = 4096,
    repeats: Annotated[
        int, typer.Option(min=5, metavar="N", help="Estimates of each system by each method.")
    ] = 20,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of systems and draws.")] = 9900,
    timestep: Timestep = RunSettings.timestep,
    pool: Annotated[
        int, typer.Option(min=1000, metavar="N", help="Draws that regions are measured by.")
    ] = 30_000,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Estimate the probability of planted failures again and again: which draws spread least in the
    same processor time?"""
    from generation.search.methods.models import Frame
    from studies.generation.planted.sampling import Sampler, estimates, table
    from studies.generation.planted.study import PLANS
    from studies.generation.planted.systems import UNDRIVEN, Pool, plant
    from studies.generation.problem import posed

    with interruptible(NAME), posed(scenario, UNDRIVEN, 1, None, None, timestep) as posing:
        problem, plans = posing.problem, PLANS[generator]
        if problem.plays is None or problem.prior is None:
            raise Unsupported("this scenario does not play in arrays", path=scenario)
        prior, plays = problem.prior, posing.plays
        kept = out / f"{scenario.stem}_{timestep:g}_pool_{pool}.npz"
        drawn = Pool.of(prior, plays, pool, kept)
        systems = [plant(plan, problem.space, prior, plays, drawn, seed) for plan in plans]
        frame = Frame.of(problem.space, prior, np.random.default_rng(0))
        sampler = Sampler(prior, frame, plays, systems, draws)
        found, spent = estimates(sampler, repeats, seed)
        playing = draws * sampler.seconds / sampler.played
        print(table(plans, found, spent, playing))
        print(f"\n{draws} plays of an estimate: {playing:.2f} s of processor time")
