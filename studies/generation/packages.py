"""Packages that studies compare with and that no extra brings."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from schemas.common.errors import UsageError


def package(name: str, what: str) -> Any:
    """The package of that name.

    Args:
        what: begins the message where it is missing, as "subset simulation is that" does.

    Raises:
        UsageError: it is not installed.
    """
    try:
        return import_module(name)
    except ModuleNotFoundError:
        raise UsageError(
            f"{what} of the package {name}, which no extra brings: pip install {name}"
        ) from None
