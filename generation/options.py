"""The options that the commands of generation share."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from generation.density.models import UNIFORM, models
from generation.density.roles import ROLES
from generation.search.methods import offered
from schemas.common.command_line import say
from schemas.common.errors import UsageError
from schemas.common.policy import current

Recorded = Annotated[
    Path | None,
    typer.Option(metavar="PATH", help="Recordings, or a table of their units.  [default: our own recordings' units]"),
]
Kind = Annotated[str | None, typer.Option(help="Kind of recorded units: cut_in, cut_out, lane_change, braking, acceleration.")]
_METHODS = tuple(offered())


def _offered(name: str) -> str:
    """A wrong name is better known before anything else is asked for."""
    if name not in _METHODS:
        raise UsageError(f"there is no search method {name!r}; methods: {', '.join(_METHODS)}")
    return name


Method = Annotated[str, typer.Option(callback=_offered, help=f"Search method: {', '.join(_METHODS)}.")]
Density = Annotated[
    str,
    typer.Option(
        help=f"Density of recorded parameters: {', '.join(models())}; or {UNIFORM} within all limits, without recordings."
    ),
]
Free = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME[=LOW..HIGH]", help="Search a parameter besides the default ones, between these limits (repeatable)."
    ),
]
Map = Annotated[
    list[str] | None,
    typer.Option(
        "--map", metavar="NAME=ROLE[*FACTOR]", help=f"What a parameter is in recordings: {', '.join(ROLES)} (repeatable)."
    ),
]
Pin = Annotated[list[str] | None, typer.Option(metavar="NAME=VALUE", help="Keep a parameter at a value (repeatable).")]
Domain = Annotated[
    list[str] | None,
    typer.Option(
        "--domain",
        metavar="LIMIT",
        help="Operational domain of the system: r157 (ego up to 130 km/h), road (its speed limit), NAME=LOW..HIGH (repeatable).",
    ),
]
FailIf = Annotated[
    list[str] | None,
    typer.Option(
        "--fail-if",
        metavar="FATE",
        help="With --against, what ends with exit code 1: new, still-there (repeatable).  [default: new]",
    ),
]
Timestep = Annotated[float, typer.Option(metavar="SECONDS", help="Time step of runs.")]
Jobs = Annotated[int, typer.Option("--jobs", "-j", min=1, metavar="N", help="Number of processes.")]
Ray = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Run on this Ray cluster; 'local' starts one of --jobs processes on this machine."),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]


def budget_within_limits(budget: int, more: int, name: str) -> int:
    """Return the runs that a search may spend under `--max-runs`; fewer than asked for are said on standard error.

    Args:
        budget: the runs asked for.
        more: runs that are done besides.
        name: of the command.

    Raises:
        UsageError: `--max-runs` leaves none.
    """
    most = current().max_runs
    if most is None or budget + more <= most:
        return budget
    if most <= more:
        raise UsageError(f"--estimate takes up to {more} runs, and the search some: --max-runs {most} is too few")
    say(f"{name}: --max-runs {most} leaves {most - more} of {budget} runs to the search", to=sys.stderr)
    return most - more
