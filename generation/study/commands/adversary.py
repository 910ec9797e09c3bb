"""`python -m generation.study adversary`: what learning is worth to an adversary that acts within the episode."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from generation.options import Sut
from runner.settings import DEFAULT_SYSTEM, RunSettings
from schemas.commands.options import Verbose, Version, interruptible

NAME = "python -m generation.study adversary"


def command(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO", help="A scenario with an actor beside the ego.")],
    sut: Sut = DEFAULT_SYSTEM,
    rounds: Annotated[int, typer.Option(min=1, metavar="N", help="Rounds of each search.")] = 20,
    seed: Annotated[int, typer.Option(help="Seed of all searches.")] = 100,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Count the failures on the twin of actions that are drawn evenly, and of policies that learn by each objective."""
    from generation.adversary.actions import OWN, Actions
    from generation.adversary.course import Scene
    from generation.adversary.driving import Driving
    from generation.adversary.environment import OBJECTIVES
    from generation.adversary.pipeline import starts_of
    from generation.adversary.search import AdversarySettings, search
    from generation.search.space import Space
    from generation.study.described import as_maneuvers
    from generation.twin.episodes import Twin

    settings = {"drawn evenly": AdversarySettings(rounds, learns=False)}
    settings |= {f"TD3 by {name}": AdversarySettings(rounds, objective=name) for name in OBJECTIVES}
    with interruptible(NAME):
        scene, driving, starts = Scene.of(scenario), Driving(Actions.read(OWN)), starts_of(scenario, {})
        space = Space.of(scenario)
        twin = Twin(scenario, space, RunSettings(sut=sut))
        for name, each in settings.items():
            found = search(scene, driving, starts, sut, RunSettings.timestep, seed, each)
            episodes, foreseeable = (sum(getattr(one, part) for one in found.rounds) for part in ("episodes", "foreseeable"))
            failures = sum(one.failures for one in found.rounds)
            distinct = len(found.failures.contact)
            reached = int(twin(as_maneuvers(scene, space, found.failures, RunSettings.timestep)).collision.sum())
            print(f"{name}: {episodes} episodes, {foreseeable} foreseeable, {failures} failures, {distinct} distinct", flush=True)
            print(f"  the manoeuvres nearest to {reached} of these collide too, of {distinct - reached} they do not", flush=True)
