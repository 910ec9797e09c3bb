"""Libraries that come with an extra of the package: what is said where one is missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from schemas.errors import UsageError

_EXTRAS = {
    "fmpy": "fmi",
    "gymnasium": "gym",
    "google": "osi",
    "lz4": "osi",
    "mcap": "osi",
    "osi3": "osi",
    "osi_utilities": "osi",
    "ray": "ray",
    "safetensors": "recognition",
    "sklearn": "recognition",
    "skops": "recognition",
    "threadpoolctl": "recognition",
    "torch": "recognition",
    "zstandard": "osi",
    "ribs": "search",
    "cma": "study",
    "greenlet": "study",
    "optuna": "study",
    "pymoo": "study",
}
"""The extra that brings a library, by the name that it is imported by."""

_WITHOUT = {
    "fmi": "all other systems under test",
    "gym": "runner.Session steps through a run",
    "osi": "all other systems, outputs and targets of xosc-export",
    "ray": "--jobs N runs N processes on this machine",
    "recognition": "--labels rules labels by rules",
    "search": "xosc-run runs variation files, --sample N draws from them; xosc-recognize --labels rules makes catalogues",
    "study": "xosc-generate searches by its own methods",
}
"""Functions that work without an extra."""


class MissingExtra(UsageError):
    """A library is missing that an extra brings; says what to type, and what works without it."""


def optional(module: str) -> Any:
    """A module of a library that an extra brings.

    Raises:
        MissingExtra: the library is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise missing(error) or error from None


def missing(error: BaseException, extra: str | None = None) -> MissingExtra | None:
    """Return the error for a library that an extra installs and that is missing; None for other errors.

    Args:
        extra: what to install instead of the extra that brings this library alone.
    """
    library = (error.name or "").partition(".")[0] if isinstance(error, ModuleNotFoundError) else ""
    if library not in _EXTRAS:
        return None
    named = extra or _EXTRAS[library]
    return MissingExtra(f'{library} is missing; type: pip install "xosc-toolchain[{named}]"; without it: {_WITHOUT[named]}')
