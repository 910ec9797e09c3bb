"""Tables that an experiment prints, kept as result files beside the command that made them."""

from __future__ import annotations

import io
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import monotonic
from typing import TextIO

from schemas.common.errors import UsageError
from schemas.common.storage import keep
from schemas.common.terminal.text import csv_text
from studies.publication.results import entry, write_journal
from studies.publication.stages import Stage

_RULE = re.compile(r"\|(\s*:?-+:?\s*\|)+")


class Printed(io.StringIO):
    """Copy of the text that is written to a stream."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__()
        self._stream = stream
        self._start = monotonic()

    def write(self, text: str) -> int:
        """Write to both."""
        self._stream.write(text)
        return super().write(text)

    def flush(self) -> None:
        """Flush the stream, on which others may wait."""
        self._stream.flush()

    def keep(self, folder: Path, command: Sequence[str]) -> None:
        """Write each table into a folder, named after its first heading, and the command with its
        times.

        Raises:
            UsageError: no table was printed.
        """
        found = list(tables(self.getvalue()))
        if not found:
            raise UsageError("this experiment prints no table: --results has nothing to keep")
        names = list[str]()
        for rows in found:
            name = re.sub(r"\W+", "-", rows[0][0]).strip("-") or "table"
            names.append(name)
            number = f"-{names.count(name)}" if names.count(name) > 1 else ""
            folder.mkdir(parents=True, exist_ok=True)
            keep(csv_text(rows).encode(), folder / f"{name}{number}.csv")
        made = Stage(folder.name, ("studies.generation", *command))
        seconds = monotonic() - self._start
        write_journal([entry(made, folder, seconds, sum(os.times()[:4]))], folder)


def tables(text: str) -> Iterator[list[list[str]]]:
    """Tables in Markdown: rows of cells, the header first."""
    rows = list[list[str]]()
    for line in [*text.splitlines(), ""]:
        if line.startswith("|"):
            if not _RULE.fullmatch(line):
                rows.append([cell.strip() for cell in line.strip("|").split("|")])
        elif rows:
            yield rows
            rows = []
