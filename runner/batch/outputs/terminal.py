"""Verdict table of `xosc-run`: a line a run as it ends, a summary at the end; errors on standard
error, shared ones once."""

from __future__ import annotations

import re
import shutil
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from schemas.common.remarks import told_quietly
from schemas.common.terminal.text import alike, many, one_line

if TYPE_CHECKING:
    from runner.batch.batch import BatchComparison
    from runner.batch.jobs import Outcome

_WORDS = {
    "error": "ERROR",
    "failed": "FAILED",
    "inconclusive": "INCONCLUSIVE",
    "passed": "PASSED",
    "loaded": "LOADED",
}
"""By state, the gravest first."""
_GRAVE = ("error", "failed", "inconclusive")
_COLOURS = {
    "passed": "\033[32m", "loaded": "\033[32m",
        "inconclusive": "\033[33m", "failed": "\033[31m", "error": "\033[35m",
}  # fmt: skip
_WORD = 13
"""Width of the column with verdicts"""
_BOLD, _OFF, _CLEAR = "\033[1m", "\033[0m", "\r\033[K"
_NAME = 44
"""Least width of the column with the names of runs"""
_REST = 60
"""Width of all other columns, with room for a reason"""
_VALUES = 8
"""Least room for the values of a run at the end of its line"""
_LISTED = 5
"""Runs that are named in a group of the summary, and among the worst"""
_PAGES = ("before-and-after.html", "replay.html")
"""Names of the pages of a run, as of `runner.view.replay.player`; the first that there is is named
"""
_ENDS = {
    "completed": "stop trigger",
    "timeout": "time limit",
    "collision": "",
    "compiled": "not run (--dry-run)",
}
_ERROR_STATUSES = {
    "system": "the system under test failed",
    "died": "its process died",
    "memory": "too little memory",
}
"""Ends of runs with an error by their status (`runner.batch.jobs.Outcome.status`); others by their
exit code"""
_ERRORS = {2: "wrong usage", 3: "invalid file", 4: "not supported", 5: "internal error"}
IN_ARRAYS = "in arrays, kinematically"
"""Message of a run that passed in arrays where the world of the others is another one"""
_NUMBER = re.compile(r"-?\b\d+(\.\d+)?\b")
_DRAWN = re.compile(r"(?<==)-?\d+\.\d{5,}\b")
"""Values with more digits than a reader needs, as draws of a distribution have them"""


_EVIDENCE = {
    "presence": "there until the end",
    "limits": "measures of --fail-if defined for",
    "reserve": "at the end full braking is, of what avoids the next contact,",
}
"""Words for kinds of evidence whose names alone do not say what is counted"""
_FAR = 3.0
"""Reserve of braking from which on the end of the run was near no contact"""


class OutcomeTable:
    """Prints outcomes as they come; colours and a progress line on a terminal only.

    Args:
        verbose: print tracebacks of errors too.
        quiet: print failures, inconclusive runs and errors only.
        total: how many runs there will be at most; 0 where that is not known.
    """

    def __init__(self, *, verbose: bool, quiet: bool, total: int = 0) -> None:
        self._verbose, self._quiet, self._total = verbose, quiet, total
        self._terminal = sys.stdout.isatty()
        self._progress = sys.stderr.isatty() and not quiet
        self._begun = time.monotonic()
        self._width = (
            max(_NAME, shutil.get_terminal_size().columns - _REST) if self._terminal else _NAME
        )
        self._counts = dict.fromkeys(_WORDS, 0)
        self._in_arrays = 0
        # Of a million runs nothing is kept but what the summary prints.
        self._groups: Counter[tuple[str, str]] = Counter()
        self._named: dict[tuple[str, str], list[str]] = {}
        self._remarks: Counter[str] = Counter()
        self._told: set[str] = set()
        self._worst: list[tuple[str, dict[str, Any]]] = []
        self._contacts = 0
        self._last = self._evidence = ""

    def show(self, outcome: Outcome) -> None:
        """Print one run's line."""
        if not self._quiet and not any(self._counts.values()) and outcome.state != "loaded":
            self._print(f"{'verdict':{_WORD}}{'run':{_NAME}}  {'end':>9}  ended by")
        self._counts[outcome.state] += 1
        self._in_arrays += outcome.message == IN_ARRAYS
        self._last = outcome.job.name if outcome.state != "error" else ""
        self._evidence = told_evidence(outcome.evidence)
        grave = outcome.state in _GRAVE
        if grave:
            group = outcome.state, _cause(outcome)
            self._groups[group] += 1
            if self._groups[group] <= _LISTED:
                self._named.setdefault(group, []).append(_title(outcome))
        if outcome.impact is not None:
            self._contacts += 1
            worst = [*self._worst, (_title(outcome), outcome.impact)]
            self._worst = sorted(worst, key=_harm)[:_LISTED]
        self._remarks.update(outcome.remarks)
        if grave or not self._quiet:
            self._print(self._line(outcome))
            if self._verbose and self._evidence:
                self._print(f"{'':{_WORD}}{self._evidence}")
        # One error of a file comes with each of its sets.
        if outcome.state == "error" and outcome.message not in self._told:
            self._told.add(outcome.message)
            trace = (
                "".join(f"{one_line(line)}\n" for line in outcome.trace.splitlines())
                if self._verbose
                else ""
            )
            print(f"{trace}xosc-run: {outcome.message}", file=sys.stderr, flush=True)
        if self._progress:
            sys.stderr.write(f"{_CLEAR}{self._done()}")
            sys.stderr.flush()

    @property
    def shown(self) -> int:
        """Number of outcomes so far."""
        return sum(self._counts.values())

    @property
    def only(self) -> str | None:
        """Name of the run where there was one, without an error; else None."""
        return self._last if self._last and sum(self._counts.values()) == 1 else None

    def _done(self) -> str:
        """Describe progress and the remaining time."""
        done, failed = sum(self._counts.values()), self._counts["failed"] + self._counts["error"]
        seconds = (time.monotonic() - self._begun) / done * max(self._total - done, 0)
        parts = [f"{done} of {self._total} runs" if self._total >= done else f"{done} runs done"]
        parts += [f"{failed} failed"] if failed else []
        parts += (
            [f"{self._counts['inconclusive']} inconclusive"] if self._counts["inconclusive"] else []
        )
        parts += [f"about {_duration(seconds)} left"] if self._total > done else []
        return ", ".join(parts)

    def _line(self, outcome: Outcome) -> str:
        word = f"{_WORDS[outcome.state]:{_WORD}}"
        if self._terminal:
            word = f"{_COLOURS[outcome.state]}{word}{_OFF}"
        name, width = one_line(outcome.job.name), self._width
        # Cut on a terminal only: logs and pipes keep whole names.
        if self._terminal and len(name) > width:
            # In the middle: names of sets differ at their ends.
            name = name[: width // 2 - 1] + "…" + name[-(width - width // 2) :]
        end = f"{outcome.end_time:7.2f} s" if outcome.end_time is not None else ""
        if outcome.state == "error":
            how = _ERROR_STATUSES.get(outcome.status) or _ERRORS[outcome.exit_code]
        else:
            how = _ENDS.get(outcome.status, "")
        if outcome.message and outcome.state != "error":
            how = ": ".join(filter(None, (how, outcome.message)))
        if outcome.remarks:
            how += f" ({many(len(outcome.remarks), 'remark')})"
        # Values come last: there may be many, and verdict and reason are looked for first.
        values = _title(outcome)[len(one_line(outcome.job.name)) :].strip()
        line = f"{name:{_NAME}}  {end:>9}  {how}"
        if values and self._terminal:
            room = shutil.get_terminal_size().columns - _WORD - len(line) - 2
            cut = f"{values[: room - 1]}…" if room >= _VALUES else ""
            values = values if len(values) <= room else cut
        return f"{word}{line}  {values}".rstrip()

    def working(self, count: int) -> None:
        """Show how many parameter sets have been rehearsed of files that have no line yet."""
        if self._progress:
            sys.stderr.write(f"{_CLEAR}{count:,} parameter sets rehearsed")
            sys.stderr.flush()

    def close(self, left_out: Mapping[Path, int] = MappingProxyType({})) -> None:
        """Print remarks, equal ones once, and a summary of several runs: failures by cause, the
        gravest first, and all.

        A quiet table has one line, on standard error, where files break their standard and were
        read all the same.

        Args:
            left_out: numbers of parameter sets that violate constraints, by variation file.
        """
        # The progress line shares the terminal with the table.
        if self._progress:
            sys.stderr.write(_CLEAR)
        runs = sum(self._counts.values())
        if self._quiet:
            if repaired := told_quietly(self._remarks):
                print(f"xosc-run: {one_line(repaired)}", file=sys.stderr, flush=True)
            return
        for remark in alike(self._remarks.elements()):
            self._print(f"remark: {remark}")
        for path, count in left_out.items():
            text = (
                f"{path}: {many(count, 'more parameter set')} left out: the values violate the "
                "scenario's constraints"
            )
            self._print(f"remark: {one_line(text)}")
        if runs < 2:
            if self._evidence and not self._verbose:
                self._print(f"evidence: {self._evidence}")
            return
        # The gravest first, as `_WORDS` has them.
        for group, count in sorted(
            self._groups.items(), key=lambda entry: list(_WORDS).index(entry[0][0])
        ):
            state, cause = group
            self._print(f"{_WORDS[state]}, {many(count, 'run')}: {cause}")
            left = [f"and {count - _LISTED} more"] if count > _LISTED else []
            self._print("\n".join(f"    {name}" for name in self._named[group] + left))
        self._tell_worst()
        notes = {"passed": f" ({self._in_arrays} {IN_ARRAYS})" if self._in_arrays else ""}
        counts = ", ".join(
            f"{count} {state}{notes.get(state, '')}"
            for state, count in self._counts.items()
            if count
        )
        text = f"{many(runs, 'file' if self._counts['loaded'] else 'run')}: {counts}"
        self._print(f"{_BOLD}{text}{_OFF}" if self._terminal else text)

    def compare(self, earlier: BatchComparison, replays: Path | None) -> None:
        """Print the changes since an earlier batch; a quiet table prints their numbers alone.

        Args:
            replays: output folder with replays of the runs; None where there are none.
        """
        harder = {id(outcome): earlier.harder(outcome) for outcome in earlier.still}
        # What has become worse must not be among the many that a long list leaves out.
        still = sorted(earlier.still, key=lambda outcome: harder[id(outcome)] is None)
        kinds = {"new": earlier.new, "fixed": earlier.fixed, "still failing": still}
        worse = sum(speeds is not None for speeds in harder.values())
        self._print(
            f"since {one_line(earlier.title)}: "
            + ", ".join(f"{len(runs)} {kind}" for kind, runs in kinds.items())
            + (f" ({worse} with a harder impact)" if worse else "")
        )
        for kind, runs in kinds.items():
            for outcome in runs[:_LISTED]:
                was = earlier.was(outcome) or "not in it"
                was += ", of files that have changed" if earlier.changed(outcome) else ""
                if speeds := harder.get(id(outcome)):
                    was += f" at {speeds[0]:.1f} m/s, now {speeds[1]:.1f} m/s"
                pages = (
                    replays / outcome.job.name / name for name in _PAGES if replays is not None
                )
                link = next((f"  {page}" for page in pages if page.is_file()), "")
                why = f"  {one_line(outcome.message)}" if outcome.message else ""
                self.tell(f"    {kind:15}{_title(outcome)} (before: {was}){why}{link}")
            if len(runs) > _LISTED:
                self.tell(f"    {kind:15}and {len(runs) - _LISTED} more")

    def tell(self, line: str) -> None:
        """Print a line, unless failures only are asked for."""
        if not self._quiet:
            self._print(line)

    def _tell_worst(self) -> None:
        """Print the contacts with the greatest risk of a death."""
        if self._contacts < 2:
            return
        from runner.judging.measures.contacts import sentence  # needs numpy

        contacts = many(self._contacts, "contact")
        self._print(
            f"worst {len(self._worst)} of {contacts}, by the risk that one of the two dies:"
        )
        for name, each in self._worst:
            who = sentence("the ego", one_line(each["other"]), each["side"], each["strikes"])
            size = (
                f"{each['speed']:5.1f} m/s, change of velocity {each['delta_v']:4.1f} m/s, risk "
                f"{percent(each['risk'])}"
            )
            self._print(f"    {size}  {name}: {who}")

    def _print(self, text: str) -> None:
        if self._progress:
            sys.stderr.write(_CLEAR)
            sys.stderr.flush()
        print(text, flush=True)


def _harm(contact: tuple[str, dict[str, Any]]) -> tuple[float, float, str]:
    """Key that sorts contacts, named by their runs, with the worst first."""
    name, impact = contact
    return -impact["risk"], -impact["speed"], name


def told_evidence(evidence: Sequence[Mapping[str, Any]]) -> str:
    """Return the numbers of evidence, as `runner.batch.outputs.report.evidence` gives it, in one
    line, without shares of times."""
    from runner.batch.outputs.report import evidence_text  # needs lxml

    told = (row for row in evidence if row["unit"] != "yes" and not row["name"].endswith("_share"))
    return ", ".join(
        f"{_EVIDENCE.get(row['name'], row['name'].removesuffix('_seconds'))} {evidence_text(row)}"
        for row in told
        if row["name"] != "reserve" or row["value"] < _FAR
    )


def _title(outcome: Outcome) -> str:
    """Label of a run, long values to six digits; `--only` runs it again with all of them."""
    return one_line(_DRAWN.sub(lambda found: f"{float(found[0]):.6g}", outcome.job.title))


def _cause(outcome: Outcome) -> str:
    """Cause of a failure, without the numbers and the file in which failures of one kind differ."""
    first = outcome.message.partition("; ")[0]
    return _NUMBER.sub(
        "…",
        first.removeprefix(str(outcome.job.scenario))
        .removeprefix(str(outcome.job.source))
        .lstrip(": "),
    )


def percent(share: float) -> str:
    """A share in per cent, with two digits below 10 %."""
    if share < 0.001:
        return "<0.1 %"
    return f"{100.0 * share:.0f} %" if share >= 0.1 else f"{100.0 * share:.1f} %"


def _duration(seconds: float) -> str:
    """A time as people say it, from seconds to hours."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
