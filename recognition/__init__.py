"""TRFE: recordings of traffic become labelled, unknown and newly discovered scenario classes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from recognition.trfe.config import Config as Config
    from recognition.trfe.trfe import TRFE as TRFE
    from recognition.trfe.trfe import Recognition as Recognition

__all__ = ["TRFE", "Config", "Recognition"]


def __getattr__(name: str) -> Any:
    """Import on first use: the command line must answer `--help` at once."""
    if name == "Config":
        from recognition.trfe.config import Config

        return Config
    if name in __all__:
        from recognition.trfe import trfe

        return getattr(trfe, name)
    raise AttributeError(f"module 'recognition' has no attribute {name!r}")
