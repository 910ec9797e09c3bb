"""The verdict table of `xosc-run`: a line a run as it ends, a summary at the end."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runner.jobs import Outcome

_WORDS = {"passed": "PASSED", "failed": "FAILED", "error": "ERROR"}
_COLOURS = {"passed": "\033[32m", "failed": "\033[31m", "error": "\033[35m"}
_BOLD, _OFF, _CLEAR = "\033[1m", "\033[0m", "\r\033[K"
_NAME = 44


class Table:
    """Prints outcomes as they come; colours and a progress line on a terminal only.

    Args:
        verbose: print tracebacks of errors too.
        quiet: print failures and errors only.
        total: number of runs, where it is known.
    """

    def __init__(self, *, verbose: bool, quiet: bool, total: int | None = None) -> None:
        self._verbose, self._quiet, self._total = verbose, quiet, total
        self._terminal = sys.stdout.isatty()
        self._progress = sys.stderr.isatty() and not quiet and total != 1
        self._counts = dict.fromkeys(_WORDS, 0)
        if not quiet:
            self._print(f"{'verdict':8}{'run':{_NAME}}  {'end':>9}  ended by")

    def show(self, outcome: Outcome) -> None:
        """Print one run's line."""
        self._counts[outcome.state] += 1
        if not self._quiet or outcome.state != "passed":
            self._print(self._line(outcome))
            if self._verbose and outcome.trace:
                self._print(outcome.trace.rstrip())
        if self._progress:
            done = sum(self._counts.values())
            sys.stderr.write(f"{_CLEAR}{done}{f' of {self._total}' if self._total else ''} runs done")
            sys.stderr.flush()

    def _line(self, outcome: Outcome) -> str:
        word = f"{_WORDS[outcome.state]:8}"
        if self._terminal:
            word = f"{_COLOURS[outcome.state]}{word}{_OFF}"
        name = outcome.job.name
        if len(name) > _NAME:
            name = name[: _NAME // 2 - 1] + "…" + name[-_NAME // 2 :]
        if outcome.state == "error":
            return f"{word}{name:{_NAME}}  {outcome.message}"
        end = f"{outcome.end_time:7.2f} s" if outcome.end_time is not None else ""
        how = {"completed": "stop trigger", "timeout": "time limit", "compiled": "not run (--dry-run)"}.get(outcome.status, "")
        return f"{word}{name:{_NAME}}  {end:>9}  {how}{': ' if how and outcome.message else ''}{outcome.message}".rstrip()

    def close(self) -> None:
        """Print the summary, where there was more than one run."""
        if self._progress:
            sys.stderr.write(_CLEAR)
        runs = sum(self._counts.values())
        if runs > 1 and not self._quiet:
            text = f"{runs} runs: " + ", ".join(f"{count} {state}" for state, count in self._counts.items())
            self._print(f"{_BOLD}{text}{_OFF}" if self._terminal else text)

    def _print(self, text: str) -> None:
        if self._progress:
            sys.stderr.write(_CLEAR)
            sys.stderr.flush()
        print(text, flush=True)
