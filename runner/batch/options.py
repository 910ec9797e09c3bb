"""Command-line options of runs besides their settings: values of parameters, parameter sets, limits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runner.judging.measures.measure import EVENTS, NEW_FAILURE, UNITS
from runner.judging.settings import RunSettings
from schemas.common.errors import ToolchainError, UsageError
from schemas.common.terminal.options import option_of

if TYPE_CHECKING:
    from xosc.distributions.space import Selection

Param = Annotated[
    list[str] | None,
    typer.Option(
        "--param", "-p", metavar="NAME=VALUE", help="Value of a global parameter (repeatable)."
    ),
]
Only = Annotated[
    str | None,
    typer.Option(
        metavar="NUMBERS", help="These parameter sets of variation files only, as 3,7-9, from 0."
    ),
]
Sample = Annotated[
    int | None,
    typer.Option(
        min=1, metavar="N", help="N parameter sets of each variation file, drawn by --seed."
    ),
]
Sut = Annotated[str, option_of(RunSettings, "sut")]
FailIf = Annotated[
    list[str] | None,
    typer.Option(
        "--fail-if",
        metavar="LIMIT",
        help=f"Fail runs by a measure, as min_ttc<1 ({', '.join(UNITS)}), or by {', '.join((*EVENTS, NEW_FAILURE))} "
        "(repeatable).",
    ),
]
Timestep = Annotated[float, option_of(RunSettings, "timestep")]


def selection_of(
    only: str | None, sample: int | None, seed: int, files: Sequence[Path]
) -> Selection:
    """The parameter sets of files that the options choose.

    Raises:
        UsageError: the options exclude each other, or the numbers are none, or no file has
            parameter sets.
    """
    from xosc.distributions.space import Selection, spans

    selection = Selection(spans(only) if only is not None else (), sample, seed)
    if selection.only and not any(map(_may_vary, files)):
        raise UsageError(
            "--only names parameter sets of variation files, and there is none among the files"
        )
    return selection


def _may_vary(file: Path) -> bool:
    """Whether a file is a distribution; one that can't be read is refused in its turn, with its own reason."""
    from xosc.document import load

    try:
        return load(file).kind == "distribution"
    except ToolchainError:
        return True
