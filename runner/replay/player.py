"""Runs as a page that plays them: one HTML file that needs no network."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from runner.replay.page import page, write_page
from runner.replay.scene.scene import scene

if TYPE_CHECKING:
    from runner.interpreter.result import RunResult

REPLAY = "replay.html"
"""Name of a run's page in the folder of its results"""
_STYLES = ("base.css", "play/replay.css")
_PARTS = ("data", "drawing", "view", "charts", "timeline", "player")
_SCRIPTS = ("dom.js", *(f"play/{part}.js" for part in _PARTS))


def replay_page(results: Sequence[RunResult]) -> str:
    """The page of one run, or of two side by side: the same runs give the same text."""
    title = " and ".join(result.name for result in results)
    return page(f"{title} – replay", _STYLES, _SCRIPTS, scene(results))


def keep_replay(result: RunResult, out: Path | None) -> None:
    """Write the page of a run into the folder of its results below `out`, or into the working directory."""
    write_replay([result], out / result.name / REPLAY if out is not None else Path(f"{result.name}.html"))


def write_replay(results: Sequence[RunResult], path: Path) -> None:
    """Write the page of one run, or of two side by side."""
    write_page(path, replay_page(results))
