"""Result files: small tables in `studies/results/SCALE/STAGE`, beside the journal of the commands
that made them."""

from __future__ import annotations

import csv
import os
import shutil
import subprocess
from collections.abc import Iterable
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

from schemas.common.errors import InvalidFile
from schemas.common.storage import keep
from schemas.common.terminal.text import csv_text
from studies.publication.stages import Stage

RESULTS = Path(__file__).parents[1] / "results"
JOURNAL = "stages.csv"
_WORK = "WORK"
"""In the place of the folder of a run, which others do not have"""


class Entry(NamedTuple):
    """A stage that was run.

    Attributes:
        stage, command: its name, and what follows `python -m`, with WORK for the folder of the run.
        seconds: time that it took on the cores.
        date, commit, version: day (ISO), commit of the source, and version of the toolchain.
        device: accelerator beside the cores; blank without one.
        note: what of it was not made, and anything else to know; blank for all of it.
        processor: processor time of its processes (s); blank where it was not measured.
    """

    stage: str
    command: str
    seconds: float
    cores: int
    date: str
    commit: str
    version: str
    device: str = ""
    note: str = ""
    processor: str = ""


def entry(stage: Stage, work: Path, seconds: float, processor: float) -> Entry:
    """The entry of a stage that has just been run, in so many seconds by the clock and of the
    processors."""
    return Entry(
        stage.name,
        written(stage, work),
        round(seconds, 1),
        os.cpu_count() or 1,
        date.today().isoformat(),
        _commit(),
        version("xosc-toolchain"),
        _device(),
        processor=f"{processor:.1f}",
    )


def written(stage: Stage, work: Path) -> str:
    """The command of a stage as it stands in the journal."""
    return " ".join(part.replace(str(work), _WORK) for part in stage.command)


def read_journal(folder: Path) -> dict[str, Entry]:
    """The entries of a folder by stage; none where it has no journal.

    Raises:
        InvalidFile: the journal is damaged.
    """
    path = folder / JOURNAL
    if not path.exists():
        return {}
    header, *rows = read_table(path)
    try:
        found = [Entry(a, b, float(c), int(d), *rest) for a, b, c, d, *rest in rows]
    except (TypeError, ValueError):
        raise InvalidFile(f"no journal of stages: {', '.join(header)}", path=path) from None
    return {each.stage: each for each in found}


def write_journal(entries: Iterable[Entry], folder: Path) -> None:
    """Write the journal of a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    keep(csv_text([Entry._fields, *entries]).encode(), folder / JOURNAL)


def publish(stages: Iterable[Stage], work: Path, folder: Path) -> None:
    """Copy the tables of stages, and the journal of a run, into a folder of results; what was there
    goes."""
    shutil.rmtree(folder, ignore_errors=True)
    for stage in stages:
        for table in sorted(stage.tables.glob("*.csv")) if stage.tables else ():
            kept = folder / stage.name / table.name
            kept.parent.mkdir(parents=True, exist_ok=True)
            keep(table.read_bytes(), kept)
    write_journal(read_journal(work).values(), folder)


def read_table(path: Path) -> list[list[str]]:
    """Rows of a table, its header first.

    Raises:
        InvalidFile: it is missing, or has no row.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = [[_shown(text) for text in row] for row in csv.reader(file)]
    except OSError as error:
        raise InvalidFile(f"can't be read: {error.strerror}", path=path) from None
    if not rows:
        raise InvalidFile("the table is empty", path=path)
    return rows


def _shown(text: str) -> str:
    """A cell without the apostrophe that keeps a spreadsheet from taking it for a formula."""
    return text[1:] if text.startswith("'") else text


def _device() -> str:
    """Name of the accelerator on which torch trains; blank without one."""
    import torch

    return torch.cuda.get_device_name() if torch.cuda.is_available() else ""


def _commit() -> str:
    """The commit of the source, with a + where files differ from it; blank outside a repository."""
    git = shutil.which("git")
    if git is None:
        return ""
    described = subprocess.run(
        [git, "describe", "--always", "--dirty=+", "--exclude=*"],
        cwd=Path(__file__).parent,
        capture_output=True,
        text=True,
        check=False,
    )
    return described.stdout.strip()
