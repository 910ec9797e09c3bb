"""The options that several commands of generation take besides whole settings, and the studies with
single ones."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from generation.search.settings import Ask, SearchSettings
from schemas.common.errors import UsageError
from schemas.common.policy import current
from schemas.common.terminal.command_line import say
from schemas.common.terminal.options import option_of

if TYPE_CHECKING:
    from generation.report.regression import Fate

Recorded = Annotated[Path | None, option_of(Ask, "recordings")]
Kind = Annotated[str | None, option_of(Ask, "kind")]
Density = Annotated[str, option_of(Ask, "density")]
Pin = Annotated[list[str] | None, option_of(Ask, "pinned")]
Ray = Annotated[str | None, option_of(SearchSettings, "ray")]
Failing = Annotated[
    list[str] | None,
    typer.Option(
        "--fail-if",
        metavar="LIMIT",
        help="Search failures by a limit, as min_ttc<1 or KeepLaneTest; with --against: new, "
        "still-there (repeatable).",
    ),
]


def budget_within_limits(budget: int, more: int, name: str) -> int:
    """Return the runs that a search may spend under `--max-runs`; a reduction is reported on
    standard error.

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
        raise UsageError(
            f"--estimate takes up to {more} runs, and the search some: --max-runs {most} is too few"
        )
    say(
        f"{name}: --max-runs {most} leaves {most - more} of {budget} runs to the search",
        to=sys.stderr,
    )
    return most - more


_FATES = ("new", "still-there")
"""Fates of failures (`generation.report.regression.Fate`) that `--fail-if` may name"""


def limits_and_fates(texts: Sequence[str] | None) -> tuple[tuple[str, ...], list[str]]:
    """Limits of runs among texts of `--fail-if`, and the other texts.

    Raises:
        UsageError: a limit is none.
    """
    from runner.judging.measures.measure import Limit

    named = [text for text in texts or () if text.strip() in _FATES]
    limits = [text for text in texts or () if text not in named]
    try:
        return tuple(Limit.parse(text).text for text in limits), [text.strip() for text in named]
    except UsageError as error:
        raise UsageError(f"{error}; with --against also {' or '.join(_FATES)}") from None


def fates(texts: Sequence[str] | None, against: Path | None) -> tuple[Fate, ...]:
    """Fates that `--fail-if` names; new failures alone by default, so that an unchanged system
    raises no alarm.

    Raises:
        UsageError: it names something else, or there is no `--against`.
    """
    from generation.report.regression import Fate

    if texts and against is None:
        raise UsageError(
            "--fail-if is about failures of another version: --against says where these are"
        )
    offered = {name: Fate(name) for name in _FATES}
    for text in texts or ():
        if text not in offered:
            raise UsageError(f"--fail-if {text!r}: one of {', '.join(offered)} is expected")
    return tuple(offered[text] for text in texts or (Fate.NEW,))
