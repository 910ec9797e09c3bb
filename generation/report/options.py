"""The options that several commands of generation take besides whole settings, and the studies with
single ones."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from generation.search.settings import FATES, Ask, SearchSettings
from schemas.common.errors import UsageError
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
    offered = {name: Fate(name) for name in FATES}
    for text in texts or ():
        if text not in offered:
            raise UsageError(f"--fail-if {text!r}: one of {', '.join(offered)} is expected")
    return tuple(offered[text] for text in texts or (Fate.NEW,))
