"""Execute OpenSCENARIO files: `runner.run(path)` runs one scenario and returns what happened.

`runner.prepare(path)` compiles one that is to be run several times; `runner.Session(path)` runs one
step by step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.common.packages import offer, public

if TYPE_CHECKING:
    from runner.judging.execution import Prepared as Prepared
    from runner.judging.execution import Session as Session
    from runner.judging.execution import prepare as prepare
    from runner.judging.execution import run as run
    from runner.judging.result import RunResult as RunResult
    from runner.judging.settings import RunSettings as RunSettings

    __version__: str
else:
    __getattr__, __dir__ = public(
        __name__,
        {
            "Prepared": "runner.judging.execution",
            "RunResult": "runner.judging.result",
            "RunSettings": "runner.judging.settings",
            "Session": "runner.judging.execution",
            "prepare": "runner.judging.execution",
            "run": "runner.judging.execution",
        },
    )

# Results write and show themselves by rooms above theirs.
offer(
    {
        "write a run": "runner.batch.outputs.folder:write_run",
        "write a replay": "runner.view.replay.player:write_replay",
        "show a run": "runner.view.replay.notebook:run_html",
    }
)

__all__ = ["Prepared", "RunResult", "RunSettings", "Session", "prepare", "run"]
