"""The verdict table of `xosc-run`: a line a run as it ends, a summary at the end; errors on standard error,
those that many runs share once."""

from __future__ import annotations

import re
import shutil
import sys
import time
from typing import TYPE_CHECKING

from schemas.commands.wording import many

if TYPE_CHECKING:
    from runner.batch.jobs import Outcome

_WORDS = {"error": "ERROR", "failed": "FAILED", "passed": "PASSED", "loaded": "LOADED"}
"""By state, the gravest first."""
_COLOURS = {"passed": "\033[32m", "loaded": "\033[32m", "failed": "\033[31m", "error": "\033[35m"}
_BOLD, _OFF, _CLEAR = "\033[1m", "\033[0m", "\r\033[K"
_NAME = 44
"""Least width of the column with the names of runs"""
_REST = 60
"""Width of all other columns, with room for a reason"""
_LISTED = 5
"""Runs that are named in a group of the summary"""
_ENDS = {"completed": "stop trigger", "timeout": "time limit", "collision": "", "compiled": "not run (--dry-run)"}
_ERRORS = {2: "wrong usage", 3: "invalid file", 4: "not supported", 5: "internal error"}
_LOCATION = re.compile(r"^.*?:\d+: ")
"""Where a remark begins: the file and its line"""
_NUMBER = re.compile(r"-?\b\d+(\.\d+)?\b")


class Table:
    """Prints outcomes as they come; colours and a progress line on a terminal only.

    Args:
        verbose: print tracebacks of errors too.
        quiet: print failures and errors only.
        total: how many runs there will be at most; 0 where that is not known.
    """

    def __init__(self, *, verbose: bool, quiet: bool, total: int = 0) -> None:
        self._verbose, self._quiet, self._total = verbose, quiet, total
        self._terminal = sys.stdout.isatty()
        self._progress = sys.stderr.isatty() and not quiet
        self._begun = time.monotonic()
        self._width = max(_NAME, shutil.get_terminal_size().columns - _REST) if self._terminal else _NAME
        self._counts = dict.fromkeys(_WORDS, 0)
        self._groups: dict[tuple[str, str], list[str]] = {}
        self._remarks: dict[str, list[str]] = {}
        self._told: set[str] = set()

    def show(self, outcome: Outcome) -> None:
        """Print one run's line."""
        if not self._quiet and not any(self._counts.values()) and outcome.state != "loaded":
            self._print(f"{'verdict':8}{'run':{self._width}}  {'end':>9}  ended by")
        self._counts[outcome.state] += 1
        grave = outcome.state in ("failed", "error")
        if grave:
            self._groups.setdefault((outcome.state, _cause(outcome)), []).append(outcome.job.title)
        for remark in outcome.remarks:
            self._remarks.setdefault(_LOCATION.sub("", remark), []).append(remark)
        if grave or not self._quiet:
            self._print(self._line(outcome))
        if outcome.state == "error" and outcome.message not in self._told:
            self._told.add(outcome.message)
            trace = outcome.trace if self._verbose else ""
            print(f"{trace}xosc-run: {outcome.message}", file=sys.stderr, flush=True)
        if self._progress:
            sys.stderr.write(f"{_CLEAR}{self._done()}")
            sys.stderr.flush()

    def _done(self) -> str:
        """How far it is, and how long it will take in about."""
        done, failed = sum(self._counts.values()), self._counts["failed"] + self._counts["error"]
        seconds = (time.monotonic() - self._begun) / done * max(self._total - done, 0)
        parts = [f"{done} of {self._total} runs" if self._total >= done else f"{done} runs done"]
        parts += [f"{failed} failed"] if failed else []
        parts += [f"about {_duration(seconds)} left"] if self._total > done else []
        return ", ".join(parts)

    def _line(self, outcome: Outcome) -> str:
        word = f"{_WORDS[outcome.state]:8}"
        if self._terminal:
            word = f"{_COLOURS[outcome.state]}{word}{_OFF}"
        name, width = outcome.job.title, self._width
        if self._terminal and len(name) > width:
            name = name[: width // 2 - 1] + "…" + name[-(width - width // 2) :]
        end = f"{outcome.end_time:7.2f} s" if outcome.end_time is not None else ""
        how = _ERRORS[outcome.exit_code] if outcome.state == "error" else _ENDS[outcome.status]
        if outcome.message and outcome.state != "error":
            how = ": ".join(filter(None, (how, outcome.message)))
        if outcome.remarks:
            how += f" ({many(len(outcome.remarks), 'remark')})"
        return f"{word}{name:{width}}  {end:>9}  {how}"

    def close(self) -> None:
        """Print remarks, equal ones once, and a summary of several runs: failures by cause, the gravest first, and all."""
        if self._progress:
            sys.stderr.write(_CLEAR)
        runs = sum(self._counts.values())
        if self._quiet:
            return
        for same in self._remarks.values():
            times = f" (and {len(same) - 1} more like it)" if len(same) > 1 else ""
            self._print(f"remark: {same[0]}{times}")
        if runs < 2:
            return
        for (state, cause), names in sorted(self._groups.items(), key=lambda group: list(_WORDS).index(group[0][0])):
            self._print(f"{_WORDS[state]}, {many(len(names), 'run')}: {cause}")
            more = [f"and {len(names) - _LISTED} more"] if len(names) > _LISTED else []
            self._print("\n".join(f"    {name}" for name in names[:_LISTED] + more))
        counts = ", ".join(f"{count} {state}" for state, count in self._counts.items() if count)
        text = f"{many(runs, 'file' if self._counts['loaded'] else 'run')}: {counts}"
        self._print(f"{_BOLD}{text}{_OFF}" if self._terminal else text)

    def _print(self, text: str) -> None:
        if self._progress:
            sys.stderr.write(_CLEAR)
            sys.stderr.flush()
        print(text, flush=True)


def _cause(outcome: Outcome) -> str:
    """Why a run failed, without the numbers and the file in which failures of one kind differ."""
    first = outcome.message.partition("; ")[0]
    return _NUMBER.sub("…", first.removeprefix(str(outcome.job.scenario)).removeprefix(str(outcome.job.source)).lstrip(": "))


def _duration(seconds: float) -> str:
    """A time as people say it, from seconds to hours."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
