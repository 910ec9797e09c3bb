"""The verdict table of `xosc-run`: a line a run as it ends, a summary at the end; errors on standard error."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runner.batch.jobs import Outcome

_WORDS = {"passed": "PASSED", "failed": "FAILED", "error": "ERROR"}
_COLOURS = {"passed": "\033[32m", "failed": "\033[31m", "error": "\033[35m"}
_BOLD, _OFF, _CLEAR = "\033[1m", "\033[0m", "\r\033[K"
_NAME = 44
_ENDS = {"completed": "stop trigger", "timeout": "time limit", "collision": "", "compiled": "not run (--dry-run)"}
_ERRORS = {2: "wrong usage", 3: "invalid file", 4: "not supported", 5: "internal error"}


class Table:
    """Prints outcomes as they come; colours and a progress line on a terminal only.

    Args:
        verbose: print tracebacks of errors too.
        quiet: print failures and errors only.
    """

    def __init__(self, *, verbose: bool, quiet: bool) -> None:
        self._verbose, self._quiet = verbose, quiet
        self._terminal = sys.stdout.isatty()
        self._progress = sys.stderr.isatty() and not quiet
        self._counts = dict.fromkeys(_WORDS, 0)

    def show(self, outcome: Outcome) -> None:
        """Print one run's line."""
        if not self._quiet and not any(self._counts.values()):
            self._print(f"{'verdict':8}{'run':{_NAME}}  {'end':>9}  ended by")
        self._counts[outcome.state] += 1
        if not self._quiet or outcome.state != "passed":
            self._print(self._line(outcome))
        if outcome.state == "error":
            trace = outcome.trace if self._verbose else ""
            print(f"{trace}xosc-run: {outcome.message}", file=sys.stderr, flush=True)
        if self._progress:
            sys.stderr.write(f"{_CLEAR}{sum(self._counts.values())} runs done")
            sys.stderr.flush()

    def _line(self, outcome: Outcome) -> str:
        word = f"{_WORDS[outcome.state]:8}"
        if self._terminal:
            word = f"{_COLOURS[outcome.state]}{word}{_OFF}"
        name = outcome.job.name
        if len(name) > _NAME:
            name = name[: _NAME // 2 - 1] + "…" + name[-_NAME // 2 :]
        end = f"{outcome.end_time:7.2f} s" if outcome.end_time is not None else ""
        how = _ERRORS[outcome.exit_code] if outcome.state == "error" else _ENDS[outcome.status]
        if outcome.message and outcome.state != "error":
            how = ": ".join(filter(None, (how, outcome.message)))
        return f"{word}{name:{_NAME}}  {end:>9}  {how}"

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
