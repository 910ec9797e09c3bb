"""The page that plays runs, one HTML file that needs no network, and the names of pages in folders of results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from runner.replay.page import page, write_page
from runner.replay.scene.scene import scene

if TYPE_CHECKING:
    from runner.interpreter.result import RunResult

REPLAY = "replay.html"
"""A run's page, in the folder of its results"""
PAIR = "before-and-after.html"
"""The page of a run beside what it was in an earlier batch, in the folder of its results"""
REPORT = "report.html"
"""A batch's page, in its output folder"""
TO_REPORT = f"../{REPORT}"
"""The address of a batch's page, from the pages of its runs"""


_STYLES = ("base.css", "play/colours.css", "play/replay.css")
_FLAT = ("data", "drawing", "pair", "view", "charts", "timeline", "account", "controls")
_SOLID = ("gl", "ground", "bodies", "space")
_SCRIPTS = ("dom.js", *(f"play/{part}.js" for part in _FLAT), *(f"solid/{part}.js" for part in _SOLID), "play/player.js")


def replay_page(results: Sequence[RunResult], report: str | None = None) -> str:
    """The page of one run, or of two side by side: the same runs give the same text.

    Args:
        report: where the report lies that the page leads back to, as a relative address; None where there is none.
    """
    title = " and ".join(result.name for result in results)
    return page(f"{title} – replay", _STYLES, _SCRIPTS, {**scene(results), "report": report})


def keep_replay(result: RunResult, out: Path | None) -> None:
    """Write the page of a run into the folder of its results below `out`, or into the working directory."""
    write_replay([result], kept_replay(result.name, out), None if out is None else TO_REPORT)


def kept_replay(name: str, out: Path | None) -> Path:
    """The page of a run by its name: in the folder of its results below `out`, or in the working directory."""
    return Path(f"{name}.html") if out is None else out / name / REPLAY


def write_replay(results: Sequence[RunResult], path: Path, report: str | None = None) -> None:
    """Write the page of one run, or of two side by side; arguments as in `replay_page`.

    Example:
        >>> from pathlib import Path
        >>> import xosc_toolchain as xt
        >>> result = xt.run("xosc/library/simple_cut_in.xosc", world="kinematic", max_time=1.0)
        >>> xt.replay([result], Path("replay.html"))
        >>> Path("replay.html").is_file()
        True
    """
    write_page(path, replay_page(results, report))
