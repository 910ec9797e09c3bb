"""MCSG: a space of manoeuvre parameters, how likely its points are, and the search for plausible ones that are critical."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from generation.pipeline import Generated as Generated
    from generation.pipeline import Settings as Settings
    from generation.pipeline import generate as generate

__all__ = ["Generated", "Settings", "generate"]


def __getattr__(name: str) -> Any:
    """Import on first use: the command line must answer `--help` at once."""
    if name in __all__:
        from generation import pipeline

        return getattr(pipeline, name)
    raise AttributeError(f"module 'generation' has no attribute {name!r}")
