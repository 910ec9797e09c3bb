"""`python -m studies.generation objectives`: what learning is worth to an adversary that acts
within the episode."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from runner.batch.options import Sut
from runner.judging.settings import DEFAULT_SYSTEM, RunSettings
from schemas.common.errors import UsageError
from schemas.common.terminal.command_line import Verbose, Version, interruptible
from studies.generation.adversary import OBJECTIVES

NAME = "python -m studies.generation objectives"
_EVEN = "even"
"""Actions that are drawn evenly"""


def command(
    scenario: Annotated[
        Path, typer.Argument(metavar="SCENARIO", help="A scenario with an actor beside the ego.")
    ],
    sut: Sut = DEFAULT_SYSTEM,
    rounds: Annotated[int, typer.Option(min=1, metavar="N", help="Rounds of each search.")] = 20,
    seed: Annotated[int, typer.Option(help="Seed of the first search with each setting.")] = 100,
    seeds: Annotated[
        int,
        typer.Option(min=1, metavar="N", help="Searches with each setting, of consecutive seeds."),
    ] = 1,
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help=f"{_EVEN}, or what shapes the reward: {', '.join(OBJECTIVES)} (repeatable).  "
            "[default: all]",
        ),
    ] = None,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Count the failures in arrays of actions that are drawn evenly, and of policies that learn by
    each objective."""
    from generation.search.plays import ArrayPlays
    from generation.space.space import Space
    from studies.generation.adversary.actions import OWN, Actions
    from studies.generation.adversary.course import Scene
    from studies.generation.adversary.driving import Driving
    from studies.generation.adversary.pipeline import starts_of
    from studies.generation.adversary.search import AdversarySettings, search
    from studies.generation.described import as_maneuvers

    settings = {_EVEN: AdversarySettings(rounds, learns=False)}
    settings |= {name: AdversarySettings(rounds, objective=name) for name in OBJECTIVES}
    if unknown := set(only or ()) - settings.keys():
        raise UsageError(f"--only {min(unknown)!r}: settings are {', '.join(settings)}")
    with interruptible(NAME):
        scene, driving, starts = (
            Scene.of(scenario),
            Driving(Actions.read(OWN)),
            starts_of(scenario, {}),
        )
        space = Space.of(scenario)
        plays = ArrayPlays(scenario, space, RunSettings(sut=sut))
        for name, each in ((name, settings[name]) for name in only or settings):
            for own in range(seed, seed + seeds):
                found = search(scene, driving, starts, sut, RunSettings.timestep, own, each)
                counts = (
                    sum(getattr(one, part) for one in found.rounds)
                    for part in ("episodes", "foreseeable", "failures")
                )
                distinct = len(found.failures.contact)
                reached = int(
                    plays(
                        as_maneuvers(scene, space, found.failures, RunSettings.timestep)
                    ).collision.sum()
                )
                print(
                    f"{name}, seed {own}: "
                    + "{} episodes, {} foreseeable, {} failures".format(*counts),
                    end="",
                )
                print(
                    f", {distinct} distinct, of which the nearest manoeuvres "
                    f"collide too: {reached}",
                    flush=True,
                )
