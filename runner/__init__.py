"""Execute OpenSCENARIO files: `runner.run(path)` runs one scenario and returns what happened.

`runner.prepare(path)` compiles one that is to be run several times; `runner.Session(path)` runs one step by step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.common.packages import public

if TYPE_CHECKING:
    from runner.interpreter.execution import Prepared as Prepared
    from runner.interpreter.execution import Session as Session
    from runner.interpreter.execution import prepare as prepare
    from runner.interpreter.execution import run as run
    from runner.interpreter.result import RunResult as RunResult
    from runner.settings import RunSettings as RunSettings

    __version__: str
else:
    __getattr__, __dir__ = public(
        __name__,
        {
            "Prepared": "runner.interpreter.execution",
            "RunResult": "runner.interpreter.result",
            "RunSettings": "runner.settings",
            "Session": "runner.interpreter.execution",
            "prepare": "runner.interpreter.execution",
            "run": "runner.interpreter.execution",
        },
    )

__all__ = ["Prepared", "RunResult", "RunSettings", "Session", "prepare", "run"]
