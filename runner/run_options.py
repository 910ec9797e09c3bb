"""The options that commands share which run scenarios; see `runner.run` for what they mean."""

from __future__ import annotations

from typing import Annotated

import typer

Param = Annotated[
    list[str] | None, typer.Option("--param", "-p", metavar="NAME=VALUE", help="Value of a global parameter (repeatable).")
]
Sut = Annotated[
    str, typer.Option(help="System under test that drives the ego: cas, sumo, none, one installed by pip, module:Class.")
]
Ego = Annotated[str | None, typer.Option(metavar="NAME", help="The ego, where it is not found by itself.")]
Timestep = Annotated[float, typer.Option(metavar="SECONDS", help="Time step.")]
Seed = Annotated[int, typer.Option(help="Seed of everything random.")]
MaxTime = Annotated[float | None, typer.Option(metavar="SECONDS", help="Limit of simulated time for each run.  [default: 300]")]
World = Annotated[str, typer.Option(help="sumo, or kinematic: scripted motion without a simulator.")]
