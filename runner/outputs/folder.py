"""The results of a run as a folder of files."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runner.outputs import report, trajectories
from schemas.errors import UsageError

if TYPE_CHECKING:
    from runner.interpreter.result import RunResult

DRAFT = ".draft-"
"""Beginning of the names of folders that are being written."""


def write_run(result: RunResult, folder: Path, plot: bool = False) -> dict[str, Any]:
    """Write a run's files into its folder, which appears only when it is complete; its criticality measures.

    Args:
        plot: add a picture.

    Raises:
        UsageError: something else is in the way.
    """
    draft = Path(tempfile.mkdtemp(prefix=DRAFT, dir=folder.parent))
    try:
        values = report.summary(result)
        trajectories.write_parquet(result, draft / "trajectories.parquet")
        trajectories.write_csv(result, draft / "trajectories.csv")
        trajectories.write_criticality(result, draft / "criticality.parquet")
        report.write_events(result.events, draft / "events.jsonl")
        report.write_json(values, draft / "result.json")
        if plot:
            from runner.outputs.picture import write_picture

            write_picture(result, draft / "picture.png")
        draft.chmod(0o755)
        _replace(folder, draft)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return values["criticality"] or {}


def _replace(folder: Path, draft: Path) -> None:
    """Put a folder in the place of one that an interrupted batch left, and of nothing else."""
    if folder.exists():
        if not (folder / "result.json").is_file():
            raise UsageError("this is in the way of a run's results, and is not of a run", path=folder)
        shutil.rmtree(folder)
    draft.rename(folder)
