"""Batches of several versions as one page: a row a run, a column a version, without a server."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from runner.batch import journal
from runner.batch.batch import Identity, identity
from runner.outputs.folder import RESULT
from runner.replay.page import page, write_page
from runner.replay.player import REPLAY, REPORT
from runner.replay.report import number, rounded, runs_of, varied
from schemas.common.errors import InvalidFile, UsageError
from schemas.common.storage import read_object

HISTORY = "history.html"
"""Name of the page, in the output folder of the last batch"""
_STYLES = ("base.css", "report.css")
_SCRIPTS = ("dom.js", "axes.js", "history.js")
_MEASURES = ("impact_speed", "min_distance", "min_ttc")
"""Measures that a cell tells, where the run has them"""


def write_history(batches: Sequence[Path], path: Path | None = None) -> Path:
    """Write the page of several batches, the oldest first; the same batches give the same bytes.

    Args:
        batches: their output folders, two or more.
        path: the page; by default `HISTORY` in the last of them.

    Raises:
        UsageError: a folder is not that of a batch, or one is given twice.
        InvalidFile: a table of runs is damaged.
    """
    if len({batch.resolve() for batch in batches}) < len(batches):
        raise UsageError("a history needs different batches, and one is given twice", path=batches[-1])
    target = path or batches[-1] / HISTORY
    write_page(target, page(f"{batches[-1].resolve().name} – history", _STYLES, _SCRIPTS, history(batches, target.parent)))
    return target


def history(batches: Sequence[Path], folder: Path) -> dict[str, Any]:
    """Data of the page: versions, and each run with its state in every one of them; None where a batch lacks it.

    Args:
        batches: their output folders, the oldest first.
        folder: that of the page, from which links lead.
    """
    versions, rows = [], dict[Identity, dict[str, Any]]()
    titles = _titles(batches)
    for column, batch in enumerate(batches):
        runs = runs_of(batch)
        counts = Counter(run["state"] for run in runs)
        versions.append(_version(batch, titles[column], folder) | {"counts": dict(sorted(counts.items()))})
        for run in runs:
            known = identity(Path(run["file"]), run["parameters"], run["seed"])
            row = rows.setdefault(known, {"cells": [None] * len(batches)})
            row |= {"name": run["name"], "group": Path(run["file"]).stem, "parameters": dict(run["parameters"])}
            row["cells"][column] = _cell(run, batch, folder)
    parameters = varied(row["parameters"] for row in rows.values())
    shown = [row | {"parameters": [number(row["parameters"].get(name, "")) for name in parameters]} for row in rows.values()]
    return {"title": batches[-1].resolve().name, "versions": versions, "parameters": parameters, "rows": shown}


def _titles(batches: Sequence[Path]) -> list[str]:
    """Names of the folders, with those above them where they are alike."""
    names = [batch.resolve().name for batch in batches]
    return [
        name if names.count(name) == 1 else batch.resolve().relative_to(batch.resolve().parents[1]).as_posix()
        for name, batch in zip(names, batches, strict=True)
    ]


def _version(batch: Path, title: str, folder: Path) -> dict[str, Any]:
    """Title, system under test, version of the toolchain, and link to the report of a batch."""
    settings = journal.settings(batch)
    results = (each / RESULT for each in sorted(batch.iterdir()) if (each / RESULT).is_file())
    try:
        tool = str(read_object(next(results)).get("version", ""))
    except (StopIteration, InvalidFile):
        tool = ""
    report = batch / REPORT
    link = _link(report, folder) if report.is_file() else None
    return {"title": title, "system": str(settings.get("sut")), "tool": tool, "report": link}


def _cell(run: dict[str, Any], batch: Path, folder: Path) -> dict[str, Any]:
    measured = next(((name, run[name]) for name in _MEASURES if run.get(name) is not None), None)
    replay = batch / run["name"] / REPLAY
    return {
        "state": run["state"],
        "message": run["message"],
        "measure": None if measured is None else [measured[0], rounded(measured[1])],
        "replay": _link(replay, folder) if replay.is_file() else None,
    }


def _link(path: Path, folder: Path) -> str:
    return quote(Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix())
