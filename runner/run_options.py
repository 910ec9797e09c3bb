"""The command-line options of a run, one for each of its settings but `fail_if`, and the values of the scenario's parameters."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Annotated, Any

import typer

from runner.measures.measure import EVENTS, NEW_FAILURE, UNITS
from runner.settings import RunSettings
from schemas.common.command_line import CatalogPath, RoadPath, explain

if TYPE_CHECKING:
    from xosc.distributions.space import Selection

Param = Annotated[
    list[str] | None, typer.Option("--param", "-p", metavar="NAME=VALUE", help="Value of a global parameter (repeatable).")
]
Only = Annotated[
    str | None, typer.Option(metavar="NUMBERS", help="These parameter sets of variation files only, as 3,7-9, from 0.")
]
Sample = Annotated[int | None, typer.Option(min=1, metavar="N", help="N parameter sets of each variation file, drawn by --seed.")]
Sut = Annotated[
    str,
    typer.Option(
        metavar="NAME[:PARAMETER=VALUE,...]",
        help="System under test that drives the ego, with arguments of its class.",
    ),
]


def _systems() -> tuple[str, list[tuple[str, str]]]:
    from runner.sut import systems  # takes long to load

    return "Systems under test", list(systems().items())


explain("sut", _systems)
FailIf = Annotated[
    list[str] | None,
    typer.Option(
        "--fail-if",
        metavar="LIMIT",
        help=f"Fail runs by a measure, as min_ttc<1 ({', '.join(UNITS)}), or by {', '.join((*EVENTS, NEW_FAILURE))} "
        "(repeatable).",
    ),
]
Timestep = Annotated[float, typer.Option(metavar="SECONDS", help="Time step.")]
_OPTIONS: dict[str, Any] = {
    "sut": Sut,
    "ego": Annotated[str | None, typer.Option(metavar="NAME", help="The ego, where it is not found by itself.")],
    "timestep": Timestep,
    "seed": Annotated[int, typer.Option(help="Seed of everything random.")],
    "max_time": Annotated[float, typer.Option(metavar="SECONDS", help="Limit of simulated time for each run.")],
    "world": Annotated[str, typer.Option(help="sumo, or kinematic: scripted motion without a simulator.")],
    "end_after_collision": Annotated[
        bool | None,
        typer.Option(
            "--end-after-collision/--continue-after-collision",
            help="End a run one second after the ego's first contact.  [default: with a system under test]",
            show_default=False,
        ),
    ],
    "enforce_constraints": Annotated[
        bool,
        typer.Option(
            "--constraints/--no-constraints",
            help="Refuse parameter values that violate constraint groups; leave such sets of a distribution out.",
        ),
    ],
    "strict": Annotated[
        bool, typer.Option("--strict", help="Refuse files that break their standard instead of repairing them with a remark.")
    ],
    "road": Annotated[
        str | None,
        typer.Option(
            metavar="FILE|auto",
            help="Where the road network is missing: an OpenDRIVE file; auto: straight roads as the positions use them.",
        ),
    ],
    "road_path": RoadPath,
    "catalog_path": CatalogPath,
}
"""By the name of the setting; the defaults are those of `RunSettings`, but where a command's own is None."""
_LISTS = ("road_path", "catalog_path")
"""Settings of options that can be repeated."""


def selection_of(only: str | None, sample: int | None, seed: int) -> Selection:
    """The parameter sets that the options choose.

    Raises:
        UsageError: they exclude each other, or the numbers are none.
    """
    from xosc.distributions.space import Selection, spans

    return Selection(spans(only) if only is not None else (), sample, seed)


def with_run_settings(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of a run in the place of its parameter `settings`, a `RunSettings`."""

    @wraps(command)
    def with_options(**given: Any) -> None:
        command(settings=_settings({name: given.pop(name) for name in _OPTIONS}), **given)

    own = inspect.signature(command, eval_str=True).parameters.values()
    in_place = [_parameter(name, _default(name), option) for name, option in _OPTIONS.items()]
    parameters = [
        each
        for one in own
        for each in (in_place if one.name == "settings" else [_parameter(one.name, one.default, one.annotation)])
    ]
    with_options.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    with_options.__annotations__ = {each.name: each.annotation for each in parameters}
    return with_options


def _parameter(name: str, default: Any, annotation: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def _default(name: str) -> Any:
    return None if name in _LISTS else getattr(RunSettings, name)


def _settings(given: dict[str, Any]) -> RunSettings:
    """Settings from the values of options."""
    for name in _LISTS:
        given[name] = tuple(given.get(name) or ())
    return RunSettings(**given)
