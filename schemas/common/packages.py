"""Packages: public names imported on first use, the version, and libraries that an extra of the package brings."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from typing import Any

from schemas.common.errors import UsageError

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


@cache
def version() -> str:
    """Version of xosc-toolchain, from the installed metadata; "unknown" where it is used without being installed."""
    from importlib import metadata

    try:
        return metadata.version("xosc-toolchain")
    except metadata.PackageNotFoundError:
        return "unknown"


def public(package: str, homes: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` of a package whose public names are imported on first use: commands answer `--help` at once.

    They know `__version__` as well.

    Args:
        package: the package's name.
        homes: the module that each name is in, as `module:name` where it has another name there.
    """

    def __getattr__(name: str) -> Any:
        if name == "__version__":
            return version()
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, _, own = homes[name].partition(":")
        return getattr(optional(module), own or name)

    def __dir__() -> list[str]:
        names = vars(sys.modules[package])
        special = {name for name in names if name.startswith("__")}
        return sorted({*special, *names.get("__all__", ()), *homes, "__version__"})

    return __getattr__, __dir__
