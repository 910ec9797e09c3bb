"""What a batch has done so far, in its output folder: one line for each finished run, safely on disk before the next."""

from __future__ import annotations

import errno
import json
import os
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import Any

from runner.batch.jobs import Job, Outcome
from runner.outputs.folder import DRAFT
from runner.outputs.report import finite
from schemas.errors import UsageError
from schemas.storage import check_settings, write_object

_JOURNAL, _SETTINGS = "runs.jsonl", "batch.json"
_BEGINNING = b'{"job": {"name": '


def enter(out: Path, outcome: Outcome) -> None:
    """Write down a finished run; several processes may do so at a time."""
    job = outcome.job
    entry = {key: value for key, value in asdict(outcome).items() if key != "trace"}  # begins with the job: _BEGINNING
    entry["job"] = asdict(job) | {"source": str(job.source), "scenario": str(job.scenario)}
    line = json.dumps(finite(entry), allow_nan=False) + "\n"
    binary = getattr(os, "O_BINARY", 0)  # else Windows makes two bytes of the end of a line
    file = os.open(out / _JOURNAL, os.O_WRONLY | os.O_APPEND | os.O_CREAT | binary, 0o644)
    try:
        content = line.encode()
        if os.write(file, content) < len(content):  # one call: lines of several processes do not mix
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(out / _JOURNAL))
        os.fsync(file)
    finally:
        os.close(file)


def begin(out: Path, settings: dict[str, Any], resume: bool) -> dict[str, Outcome]:
    """Make an output folder ready for a batch with these settings.

    Returns:
        Outcomes of the runs that it holds already, by name; none unless `resume` is set.

    Raises:
        UsageError: the folder holds results already (and `resume` is not set), or those of a batch with other settings.
    """
    journal, manifest = out / _JOURNAL, out / _SETTINGS
    settings = finite(settings)
    if journal.exists() and not resume:
        raise UsageError("this folder holds the results of an earlier batch; use --resume to go on with it", path=out)
    done: dict[str, Outcome] = {}
    if journal.exists():
        if not manifest.exists():
            raise UsageError("the settings of the batch to go on with are missing", path=manifest)
        check_settings(manifest, settings, "a batch")
        done = _read(journal)
        clear_drafts(out)
    write_object(settings, manifest)
    journal.touch()
    return done


def clear_drafts(out: Path) -> None:
    """Remove what interrupted runs left behind."""
    for draft in out.glob(f"{DRAFT}*"):
        shutil.rmtree(draft, ignore_errors=True)


def is_batch(out: Path) -> bool:
    """Whether a folder is the output folder of a batch."""
    return (out / _JOURNAL).is_file()


def finished(out: Path) -> dict[str, Outcome]:
    """The finished runs of a batch by name, as its output folder says.

    Raises:
        UsageError: the folder is not that of a batch, or its journal is damaged.
    """
    try:
        whole = (out / _JOURNAL).read_bytes().rpartition(b"\n")[0]
    except OSError:
        raise UsageError("this is not the output folder of a batch: it has no journal", path=out) from None
    return _outcomes(whole, out / _JOURNAL)


def settings(out: Path) -> dict[str, Any]:
    """The settings that all runs of a batch share, as its output folder says."""
    try:
        values = json.loads((out / _SETTINGS).read_text(encoding="utf-8"))
        return dict(values)
    except (OSError, ValueError, TypeError):
        raise UsageError("this is not the output folder of a batch: its settings can't be read", path=out) from None


def _read(journal: Path) -> dict[str, Outcome]:
    """The finished runs; a line that an interruption cut short is dropped, and with it that run."""
    whole, _, rest = journal.read_bytes().rpartition(b"\n")
    if rest:
        os.truncate(journal, len(whole) + 1 if whole else 0)
    return _outcomes(whole, journal)


def _outcomes(whole: bytes, journal: Path) -> dict[str, Outcome]:
    """What lines say; one that is not whole is no outcome where it begins as others do (a full disk cut it), else a fault."""
    done = {}
    for number, line in enumerate(whole.splitlines(), 1):
        try:
            entry = json.loads(line)
            job = entry.pop("job")
            restored = Job(**{**job, "source": Path(job["source"]), "scenario": Path(job["scenario"])})
            done[restored.name] = Outcome(restored, **entry)
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            if isinstance(error, json.JSONDecodeError) and line.startswith(_BEGINNING):
                continue
            raise UsageError("this line is not of a batch's journal", path=journal, line=number) from None
    return done
