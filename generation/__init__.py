"""MCSG: a space of manoeuvre parameters, how likely its points are, and the search for plausible
ones that are critical."""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.common.packages import public

if TYPE_CHECKING:
    from generation.pipeline import Generated as Generated
    from generation.pipeline import generate as generate
    from generation.search.settings import SearchSettings as SearchSettings

    __version__: str
else:
    __getattr__, __dir__ = public(
        __name__,
        {
            "Generated": "generation.pipeline",
            "SearchSettings": "generation.search.settings",
            "generate": "generation.pipeline",
        },
    )

__all__ = ["Generated", "SearchSettings", "generate"]
