"""The command-line options of a run, one for each of its settings and the values of the scenario's parameters."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from typing import Annotated, Any

import typer

from runner.settings import RunSettings

Param = Annotated[
    list[str] | None, typer.Option("--param", "-p", metavar="NAME=VALUE", help="Value of a global parameter (repeatable).")
]
Sut = Annotated[
    str, typer.Option(help="System under test that drives the ego: cas, sumo, none, one installed by pip, module:Class.")
]
Timestep = Annotated[float, typer.Option(metavar="SECONDS", help="Time step.")]

_OPTIONS: dict[str, Any] = {
    "sut": Sut,
    "ego": Annotated[str | None, typer.Option(metavar="NAME", help="The ego, where it is not found by itself.")],
    "timestep": Timestep,
    "seed": Annotated[int, typer.Option(help="Seed of everything random.")],
    "max_time": Annotated[float, typer.Option(metavar="SECONDS", help="Limit of simulated time for each run.")],
    "world": Annotated[str, typer.Option(help="sumo, or kinematic: scripted motion without a simulator.")],
    "enforce_constraints": Annotated[
        bool,
        typer.Option(
            "--constraints/--no-constraints",
            help="Refuse parameter values that violate constraint groups; leave such sets of a distribution out.",
        ),
    ],
}
"""By the name of the setting; the defaults are those of `RunSettings`."""


def with_run_settings(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of a run in the place of its parameter `settings`, a `RunSettings`."""

    @wraps(command)
    def with_options(**given: Any) -> None:
        command(settings=RunSettings(**{name: given.pop(name) for name in _OPTIONS}), **given)

    options = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=getattr(RunSettings, name), annotation=option)
        for name, option in _OPTIONS.items()
    ]
    own = inspect.signature(command, eval_str=True).parameters.values()
    parameters = [each for one in own for each in (options if one.name == "settings" else [_keyword_only(one)])]
    with_options.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    with_options.__annotations__ = {each.name: each.annotation for each in parameters}
    return with_options


def _keyword_only(parameter: inspect.Parameter) -> inspect.Parameter:
    return parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY)
