"""Libraries that only some methods need."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from schemas.errors import UsageError


def need(module: str) -> Any:
    """A module of an optional library.

    Raises:
        UsageError: it is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        library = module.partition(".")[0]
        if error.name != library:
            raise
        raise UsageError(f"this search method needs {library}: pip install 'xosc-toolchain[search]'") from None
