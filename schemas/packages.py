"""Public face of each package: public names, imported on first use, and the version."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from schemas.extras import optional


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
        return sorted({*vars(sys.modules[package]), *homes, "__version__"})

    return __getattr__, __dir__
