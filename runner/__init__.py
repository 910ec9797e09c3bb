"""Execute OpenSCENARIO files: `runner.run(path)` runs one scenario and returns what happened."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from runner.interpreter.execution import run as run
    from runner.interpreter.result import RunResult as RunResult
    from runner.settings import RunSettings as RunSettings

_HOMES = {"RunResult": "runner.interpreter.result", "RunSettings": "runner.settings", "run": "runner.interpreter.execution"}

__all__ = ["RunResult", "RunSettings", "run"]


def __getattr__(name: str) -> Any:
    """Import on first use: the command line must answer `--help` at once."""
    if name not in _HOMES:
        raise AttributeError(f"module 'runner' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    """The public names, also before they are used."""
    return [*globals(), *__all__]
