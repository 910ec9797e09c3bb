"""TRFE: recordings of traffic become labelled, unknown and newly discovered scenario classes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.common.packages import public

if TYPE_CHECKING:
    from recognition.trfe.config import Config as Config
    from recognition.trfe.trfe import TRFE as TRFE
    from recognition.trfe.trfe import Recognition as Recognition

    __version__: str
else:
    __getattr__, __dir__ = public(
        __name__,
        {
            "Config": "recognition.trfe.config",
            "Recognition": "recognition.trfe.trfe",
            "TRFE": "recognition.trfe.trfe",
        },
    )

__all__ = ["TRFE", "Config", "Recognition"]
