"""Results as notebooks show them: a small table and the page that plays the run, or the report of a
batch, in a frame.

    import xosc_toolchain as xt

    # As the last line of a cell: table and replay.
    xt.run("xosc/library/simple_cut_in.xosc", sut="adas")
    # A folder that xosc-run --out has written, of a run or of a batch.
    xt.show("results")

The frame is sandboxed: its page runs its own script, and reaches neither the notebook nor a
network."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
from os import PathLike, path
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from runner.batch import journal
from runner.batch.outputs.folder import load_run
from runner.view.replay.player import REPLAY, replay_page
from runner.view.report import write_report
from schemas.common.terminal.text import many

if TYPE_CHECKING:
    from runner.batch.jobs import Outcome
    from runner.judging.result import RunResult

_HIGH = 640
"""Height of a frame, px"""
_LARGEST = 8_000_000
"""Size of pages above which notebooks get a link's worth of text instead, bytes: a notebook keeps
its outputs"""
_LISTED = 10
"""Runs of a batch that the table lists, failures first"""
_ORDER = ("failed", "error", "inconclusive", "passed")


def run_html(result: RunResult) -> str:
    """Table and replay of a run."""
    rows = {
        "verdict": str(result.verdict),
        "end": f"{result.end_time:.2f} s, {result.status}",
        "system under test": result.sut,
        "parameters": ", ".join(f"{name} = {value}" for name, value in result.parameters.items())
        or "as declared",
        "participants": ", ".join(result.recording.tracks),
        "remarks": str(len(result.remarks)),
    }
    page = replay_page([result])
    return _table(result.name, rows.items()) + _frame(
        f"Replay of {result.name}", page, "result.replay() writes it"
    )


def show(folder: str | PathLike[str]) -> RunResult | BatchView:
    """Return the run or the batch of a folder that `xosc-run --out` or `run_batch` has written;
    notebooks show either.

    Raises:
        UsageError: the folder is not that of a run or a batch.
        InvalidFile: a file in it is damaged.

    Example:
        >>> from pathlib import Path
        >>> import xosc_toolchain as xt
        >>> from runner.batch.outputs.folder import write_run
        >>> result = xt.run("xosc/library/simple_cut_in.xosc", world="kinematic", max_time=1.0)
        >>> written = write_run(result, Path("run"))
        >>> xt.show("run").end_time
        1.0
    """
    found = Path(folder)
    return BatchView(found) if journal.is_batch(found) else load_run(found)


class BatchView:
    """A batch as notebooks show it: counts, the first failures with links to their replays, and the
    report.

    Attributes:
        folder: the output folder of the batch; its report is written anew.
        outcomes: of all finished runs, by name.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.outcomes: Mapping[str, Outcome] = journal.finished(folder).outcomes

    def __repr__(self) -> str:
        return f"<BatchView {self.folder}: {self._counts()}>"

    def _counts(self) -> str:
        states = [outcome.state for outcome in self.outcomes.values()]
        counts = [f"{states.count(state)} {state}" for state in _ORDER if state in states]
        return f"{many(len(states), 'run')}{': ' if counts else ''}{', '.join(counts)}"

    def _repr_html_(self) -> str:
        # The gravest first, as only some runs are listed.
        ranked = sorted(
            self.outcomes.items(), key=lambda item: (_ORDER.index(item[1].state), item[0])
        )
        rows = [
            (self._link(name), f"{outcome.state}: {outcome.message}".rstrip(": "))
            for name, outcome in ranked[:_LISTED]
        ]
        title = f"{self.folder.resolve().name}, {self._counts()}"
        report = write_report(self.folder)
        return _table(title, rows) + _frame(
            f"Report of {title}", report.read_text(encoding="utf-8"), f"open {report}"
        )

    def _link(self, name: str) -> Any:
        """The name of a run, linked to its replay where there is one."""
        page = self.folder / name / REPLAY
        return (
            _Html(f'<a href="{quote(path.relpath(page))}">{escape(name)}</a>')
            if page.is_file()
            else name
        )


class _Html(str):
    """Text that is HTML already."""


def _table(title: str, rows: Iterable[tuple[str, str]]) -> str:
    cells = "".join("<tr><th>{}</th><td>{}</td></tr>".format(*map(_cell, row)) for row in rows)
    return f"<table><caption>{escape(title)}</caption>{cells}</table>"


def _cell(text: str) -> str:
    return text if isinstance(text, _Html) else escape(text)


def _frame(title: str, page: str, instead: str) -> str:
    size = len(page.encode())
    if size > _LARGEST:
        return (
            f"<p>The page has {size / 1e6:.0f} MB, too much for a notebook: {escape(instead)}.</p>"
        )
    style = f"width:100%;height:{_HIGH}px;border:0"
    sandbox = 'sandbox="allow-scripts" allow="fullscreen"'
    return (
        f'<iframe title="{escape(title)}" {sandbox} style="{style}" '
        f'srcdoc="{escape(page)}"></iframe>'
    )
