"""Execute OpenSCENARIO files: `runner.run(path)` runs one scenario and returns what happened."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from runner.interpreter.execution import run as run
    from runner.interpreter.result import RunResult as RunResult

__all__ = ["RunResult", "run"]


def __getattr__(name: str) -> Any:
    """Import on first use: the command line must answer `--help` at once."""
    if name == "run":
        from runner.interpreter.execution import run

        return run
    if name == "RunResult":
        from runner.interpreter.result import RunResult

        return RunResult
    raise AttributeError(f"module 'runner' has no attribute {name!r}")
