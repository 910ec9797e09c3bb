"""The results of a run as a folder of files."""

from __future__ import annotations

import secrets
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runner.outputs import report, trajectories
from schemas.common.errors import UsageError
from schemas.common.storage import DRAFT, digest

if TYPE_CHECKING:
    from runner.interpreter.result import RunResult

RESULT, PICTURE = "result.json", "picture.png"
_FILES = {
    RESULT,
    "trajectories.parquet",
    "trajectories.csv",
    "criticality.parquet",
    "events.jsonl",
    PICTURE,
    "replay.html",
    "before-and-after.html",
}
"""Names of the files of a run"""


def write_run(result: RunResult, folder: Path, plot: bool = False) -> dict[str, Any]:
    """Write a run's files into its folder, which appears only when it is complete; its criticality measures.

    Args:
        plot: add a picture.

    Raises:
        UsageError: something else is in the way.
    """
    draft = folder.parent / f"{DRAFT}{secrets.token_hex(4)}"
    draft.mkdir()
    try:
        values = report.summary(result)
        trajectories.write_parquet(result, draft / "trajectories.parquet")
        trajectories.write_csv(result, draft / "trajectories.csv")
        trajectories.write_criticality(result, draft / "criticality.parquet")
        report.write_events(result.events, draft / "events.jsonl")
        report.write_json(values, draft / RESULT)
        if plot:
            from runner.outputs.picture import write_picture

            write_picture(result, draft / PICTURE)
        _replace(folder, draft)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return values["criticality"] or {}


def _replace(folder: Path, draft: Path) -> None:
    """Put a folder in the place of one that an earlier run left, whole or not, and of nothing else."""
    if folder.is_symlink() or folder.exists():
        is_run = folder.is_dir() and not folder.is_symlink()
        if not is_run or not ((folder / RESULT).is_file() or {path.name for path in folder.iterdir()} <= _FILES):
            raise UsageError("this is in the way of a run's results, and is not of a run", path=folder)
        shutil.rmtree(folder)
    draft.rename(folder)


def digests(folder: Path) -> dict[str, str]:
    """Digests of the files in the folder of a run's results, by name; none where it is not there or can't be read."""
    try:
        return {path.name: digest(path.read_bytes()) for path in sorted(folder.iterdir()) if path.is_file()}
    except OSError:
        return {}
