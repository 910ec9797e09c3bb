"""Work of a batch that was planned and done: files and runs, beside the table of its runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from runner.batch.jobs import Jobs, Outcome
from schemas.common.errors import InvalidFile
from schemas.common.storage import read_object, write_object

WORK = "work.json"
"""Name of the file in the output folder"""


class WorkDone:
    """Counts outcomes of a batch against the planned number.

    Args:
        jobs: of the batch.
    """

    def __init__(self, jobs: object) -> None:
        self._jobs = jobs if isinstance(jobs, Jobs) else None
        self._states: Counter[str] = Counter()
        self._broken: set[Path] = set()
        self._seen: set[Path] = set()

    def add(self, outcome: Outcome) -> None:
        """Count an outcome."""
        self._states[outcome.state] += 1
        self._seen.add(outcome.job.source)
        if outcome.state == "error":
            # A file counts as done only without an error in any of its runs.
            self._broken.add(outcome.job.source)

    @property
    def total(self) -> int:
        """Number of outcomes."""
        return sum(self._states.values())

    def rows(self) -> list[dict[str, Any]]:
        """Return name, planned and done of each kind of work.

        Files are done that had no error, runs that came to an end, and tested are runs that passed
        or failed. An interrupted batch has planned the runs that it came to.
        """
        # Files are planned from the start; runs of an interrupted batch are those it came to.
        files = len(self._jobs.sources) if self._jobs is not None else len(self._seen)
        runs = self._jobs.planned if self._jobs is not None else self.total
        tested = self._states["passed"] + self._states["failed"]
        return [
            {"name": "files", "planned": files, "done": len(self._seen - self._broken)},
            {"name": "runs", "planned": runs, "done": self.total - self._states["error"]},
            {"name": "tested", "planned": runs, "done": tested},
        ]


def write_work(rows: list[dict[str, Any]], out: Path) -> None:
    """Write the work of a batch into its folder."""
    write_object({"work": rows}, out / WORK)


def work_of(out: Path) -> list[dict[str, Any]]:
    """The work of the batch of a folder; none where it says nothing that can be read."""
    try:
        rows = read_object(out / WORK)["work"]
        return [
            {"name": str(row["name"]), "planned": int(row["planned"]), "done": int(row["done"])}
            for row in rows
        ]
    except (InvalidFile, KeyError, TypeError, ValueError):
        return []


def work_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """The rows in a line."""
    return ", ".join(f"{row['name']} {row['done']} of {row['planned']}" for row in rows)
