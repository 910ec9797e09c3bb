"""Journal of a batch in its output folder: finished runs, entered after their results are synced to
disk.

Where the environment variable XOSC_SEAL_KEY has a key, each entry is sealed by it (HMAC, SHA-256),
and with it the digests of all that went into the run and of its files. An entry without the seal
does not count then.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import shlex
import shutil
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

from runner.batch.jobs import FLEETING, Job, Outcome, is_sound
from runner.batch.outputs.folder import RESULT, digests
from runner.batch.outputs.report import finite
from runner.batch.outputs.work import WORK
from runner.judging.settings import RunSettings
from schemas.common.errors import UsageError
from schemas.common.packages import version
from schemas.common.policy import current
from schemas.common.storage import (
    DRAFT,
    Records,
    alone,
    check_settings,
    fingerprint,
    read_object,
    sync,
    write_object,
    writing,
)
from schemas.common.terminal.settings_file import in_use
from schemas.common.terminal.text import many

_JOURNAL, _SETTINGS = "runs.jsonl", "batch.json"
_TABLE, _PAGES = (
    "runs.parquet",
    ("sets.parquet", "report.html", "history.html", "assessment.html", "assessment.csv"),
)
"""Further files of a batch in its folder"""
BATCH_FILES = frozenset({_JOURNAL, _SETTINGS, _TABLE, WORK, *_PAGES})
"""Names of all files that a batch writes into its folder itself"""
_MOVING = frozenset({
    "sut", "sut_timeout", "sut_in_process", "ego", "timestep", "seed", "max_time", "world",
    "end_after_collision", "enforce_constraints", "strict", "road", "road_path", "catalog_path",
})  # fmt: skip
"""Settings of a batch by which its runs come out again"""
FORMAT = 1
"""Version of the files in the folder of a batch; it changes where a reader of older ones would
misread them"""
_GROUP = 1.0
"""Time (s) in which finished runs are gathered: a disk syncs the files of many in little more time
than those of one"""


SEAL_KEY = "XOSC_SEAL_KEY"
"""Environment variable with the key that seals entries"""
_SHORTEST_KEY = 16
"""Characters of a key at least"""


def seal_key() -> bytes | None:
    """The user's key; None where there is none.

    Raises:
        UsageError: it is too short to be a secret.
    """
    key = os.environ.get(SEAL_KEY, "").strip()
    if key and len(key) < _SHORTEST_KEY:
        raise UsageError(f"{SEAL_KEY} is too short: a key has {_SHORTEST_KEY} characters or more")
    # Environments may hold bytes that are no UTF-8.
    return key.encode("utf-8", "surrogateescape") or None


def sealed(outcome: Outcome, key: bytes) -> Outcome:
    """The outcome with its seal."""
    entry = {name: value for name, value in _entry(outcome).items() if name != "seal"}
    # Sorted keys: the seal must not depend on the order of fields.
    content = json.dumps(entry, sort_keys=True, allow_nan=False).encode()
    return replace(outcome, seal=hmac.new(key, content, hashlib.sha256).hexdigest())


def is_sealed(outcome: Outcome, key: bytes) -> bool:
    """Whether an outcome has the seal of a key."""
    # In constant time: response times must not tell how much of a seal is right.
    return hmac.compare_digest(str(outcome.seal).encode(), sealed(outcome, key).seal.encode())


class Finished(NamedTuple):
    """Finished runs of a batch.

    Attributes:
        outcomes: by name.
        damaged: numbers of the journal's lines that are damaged.
        foreign: number of entries that no run of this version has made.
    """

    outcomes: dict[str, Outcome]
    damaged: list[int]
    foreign: int


class Journal:
    """The finished runs of a batch in an output folder, for the one process that writes it.

    A run is entered when its files are on the disk, with their digests and with that of all that
    went in. So an entry is as good as its run: where anything has changed since, or a file is
    damaged or gone, the run is not finished.

    Args:
        out: the output folder, made ready by `begin`.

    Attributes:
        done: outcomes of the runs that were finished before, by name.
        sealed: whether their entries are sealed by the user's key.
    """

    def __init__(self, out: Path, done: dict[str, Outcome]) -> None:
        self.done, self._key = done, seal_key()
        self.sealed = self._key is not None
        self._out, self._records = out, Records(out / _JOURNAL)
        self._waiting: list[Outcome] = []
        self._taken: set[str] = set()
        self._flushed = -_GROUP

    def enter(self, outcome: Outcome) -> None:
        """Add a finished run; it is entered with others, within a second or with the next one.

        A run is taken in once: an interrupt between this call and its caller's note of it may bring
        the run a second time.

        Raises:
            OSError: they can't be written: the runs are not entered.
        """
        if outcome.job.name in self._taken:
            return
        self._taken.add(outcome.job.name)
        self._waiting.append(outcome if self._key is None else sealed(outcome, self._key))
        # The first run at once, further ones in groups: an interruption loses a second at most.
        if time.monotonic() - self._flushed >= _GROUP:
            self.flush()

    def flush(self) -> None:
        """Enter all runs that were taken in; errors as of `enter`."""
        if not self._waiting:
            return
        finished, self._waiting = (
            self._waiting,
            [],
        )  # what could not be synced once is not to be trusted a second time
        folders = [self._out / outcome.job.name for outcome in finished if outcome.files]
        # Files before folders before the journal: a power loss never leaves an
        # entry without its run.
        sync(
            [self._out / outcome.job.name / name for outcome in finished for name in outcome.files]
        )
        sync([*folders, self._out])
        self._records.add(map(_entry, finished))
        self._flushed = time.monotonic()

    def close(self) -> Iterator[Outcome]:
        """Enter all, and yield all finished runs in the order of their names, with one in memory at
        a time; errors as of `enter`."""
        self.flush()
        # In several processes runs end in another order: the same batch gives the same bytes.
        self._records.sort(_name)
        return (outcome for entry in self._records if entry and (outcome := _outcome(entry)))


def begin(
    out: Path,
    settings: dict[str, Any],
    resume: bool,
    inputs: Callable[[Job], str],
    sources: Collection[Path] | None = None,
    tell: Callable[[str], None] = lambda line: None,
    needs: Sequence[str] = (),
    named: Callable[[Job], bool] = lambda job: True,
) -> Journal:
    """Make an output folder ready for a batch with these settings.

    Args:
        resume: go on with the batch that it holds.
        inputs: gives the digest of all that decides what a run gives.
        sources: the files of the batch; None where they are not known beforehand.
        tell: called with a line about finished runs that have to be repeated.
        needs: names of files that a finished run has; one without is repeated.
        named: whether a job has the name of this batch: files that were added may rename others.

    Raises:
        UsageError: the folder holds results already (and `resume` is not set), or those of a batch
            of other files or with other settings.
    """
    records, manifest = Records(out / _JOURNAL), out / _SETTINGS
    settings = finite(settings)
    if records.path.exists() and not resume:
        raise UsageError(
            "this folder holds the results of an earlier batch; use --resume to go on with it, "
            "--overwrite to replace it",
            path=out,
        )
    done: dict[str, Outcome] = {}
    if records.path.exists():
        if not manifest.exists():
            raise UsageError("the settings of the batch to go on with are missing", path=manifest)
        check_settings(manifest, settings, "a batch")
        before = finished(out)
        # Before anything is removed: a wrong folder stays as it is.
        _refuse_others(out, before.outcomes.values(), sources)
        faults = {
            name: fault
            for name, outcome in before.outcomes.items()
            if (fault := _fault(out, outcome, inputs, needs) if named(outcome.job) else _RENAMED)
        }
        # Left there, a folder of a former name would count as a run in pages and tables.
        for name, fault in faults.items():
            if fault == _RENAMED and (out / name / RESULT).is_file():
                shutil.rmtree(out / name)
        done = {name: outcome for name, outcome in before.outcomes.items() if name not in faults}
        _tell(faults, before, records.path, tell)
        clear_drafts(out)
    # Settings before entries: a journal without them can't be resumed.
    write_object({**settings, **_origin()}, manifest)
    records.replace(map(_entry, done.values()))
    sync([out.parent])
    return Journal(out, done)


_RENAMED = "of a file that has another name now, as files were added"
"""Fault of a finished run"""


def _origin() -> dict[str, Any]:
    """Version of the tool and of its files, and the settings file with its content's digest, where
    one counts."""
    file = in_use()
    used = {"path": file.path.as_posix(), "digest": fingerprint(file.content)} if file else None
    return {"version": version(), "format": FORMAT, "settings_file": used}


def _refuse_others(out: Path, before: Iterable[Outcome], sources: Collection[Path] | None) -> None:
    other = next(
        (
            outcome.job.source
            for outcome in before
            if sources is not None and outcome.job.source not in sources
        ),
        None,
    )
    if other is not None:
        reason = (
            f"this folder holds a batch with runs of {other}, which is not among the files: give "
            "the same, or another folder"
        )
        raise UsageError(reason, path=out)


def _fault(out: Path, outcome: Outcome, inputs: Callable[[Job], str], needs: Sequence[str]) -> str:
    """Reason why an entered run does not count as finished; empty if it does."""
    key = seal_key()
    if current().untrusted and key is None:
        return f"that --untrusted does not believe without {SEAL_KEY}"
    # What a lack of memory ended may pass at the next try.
    if outcome.status in FLEETING:
        return f"ended by {FLEETING[outcome.status]}"
    if outcome.inputs != inputs(outcome.job):
        return "of files, a system or a toolchain that have changed"
    if key is not None and not is_sealed(outcome, key):
        return f"without the seal of {SEAL_KEY}"
    # Digests last, since they read all files of the run.
    found = digests(out / outcome.job.name)
    if any(found.get(name) != digest for name, digest in outcome.files.items()):
        return "with results that are damaged or missing"
    if outcome.state != "error" and (
        missing := [name for name in needs if name not in outcome.files]
    ):
        return f"without {' and '.join(missing)}"
    return ""


def _tell(
    faults: dict[str, str], before: Finished, journal: Path, tell: Callable[[str], None]
) -> None:
    for fault in sorted(set(faults.values())):
        names = [name for name, other in faults.items() if other == fault]
        tell(
            f"{many(len(names), 'finished run')} {fault}: run anew "
            f"({names[0]}{', …' if len(names) > 1 else ''})"
        )
    if before.damaged:
        lines = many(len(before.damaged), "line")
        tell(f"{journal}:{before.damaged[0]}: {lines} damaged: the runs are run anew")
    if before.foreign:
        entries = many(before.foreign, "entry", "entries")
        tell(f"{journal}: {entries} that no run makes: the runs are run anew")


def _entry(outcome: Outcome) -> dict[str, Any]:
    job = outcome.job
    entry = {key: value for key, value in asdict(outcome).items() if key != "trace"}
    entry["job"] = asdict(job) | {"source": str(job.source), "scenario": str(job.scenario)}
    found: dict[str, Any] = finite(entry)
    return found


def clear_drafts(out: Path) -> None:
    """Remove drafts of interrupted runs."""
    for draft in out.glob(f"{DRAFT}*"):
        if draft.is_dir():
            shutil.rmtree(draft, ignore_errors=True)
        else:
            draft.unlink(missing_ok=True)


def discard(out: Path) -> None:
    """Remove the batch of an output folder: results of its runs, its journal, settings and pages;
    nothing where there is none.

    Files that are not of the batch stay.

    Raises:
        UsageError: another process writes into the folder, or something can't be removed.
    """
    if not is_batch(out):
        return
    with alone(out, "a batch"), writing("the earlier batch", out):
        clear_drafts(out)
        names = {
            # A link could lead out of the folder: its target is none of the batch's.
            folder.name
            for folder in out.iterdir()
            if (folder / RESULT).is_file() and not folder.is_symlink()
        }
        # Both are needed: a folder with a result, and an entry in the journal.
        for name in names & finished(out).outcomes.keys():
            shutil.rmtree(out / name)
        # The journal last: until then it is the batch's.
        for name in sorted(BATCH_FILES, key=_JOURNAL.__eq__):
            (out / name).unlink(missing_ok=True)


def is_batch(out: Path) -> bool:
    """Whether a folder is the output folder of a batch."""
    return (out / _JOURNAL).is_file()


def finished(out: Path) -> Finished:
    """The finished runs of a batch by name, as its output folder says; lines of the journal that
    are damaged are left out.

    Raises:
        UsageError: the folder is not that of a batch.
    """
    if not is_batch(out):
        raise _no_batch(out, "no journal")
    try:
        kept = Records(out / _JOURNAL).read()
    except OSError as error:
        raise UsageError(
            f"the journal can't be read: {error.strerror or error}", path=out / _JOURNAL
        ) from None
    restored = [_outcome(record) for record in kept.records]
    outcomes = {outcome.job.name: outcome for outcome in restored if outcome is not None}
    return Finished(outcomes, kept.damaged, restored.count(None))


def _no_batch(out: Path, lack: str) -> UsageError:
    """Error of a folder that is none of a batch."""
    if not out.exists():
        return UsageError("there is no such folder", path=out)
    return UsageError(f"this is not the output folder of a batch: it has {lack}", path=out)


def _name(entry: dict[str, Any]) -> str | None:
    """The name of an entry's run; None where it is one of another version."""
    outcome = _outcome(entry)
    return None if outcome is None else outcome.job.name


def _outcome(entry: dict[str, Any]) -> Outcome | None:
    """The outcome of an entry; None where it is one of another version."""
    try:
        job = entry.pop("job")
        # An edited name could lead outside of the folder, also for `--overwrite`.
        if not is_folder_name(job["name"]):
            return None
        restored = Job(**{**job, "source": Path(job["source"]), "scenario": Path(job["scenario"])})
        outcome = Outcome(restored, **entry)
        return outcome if is_sound(outcome) else None
    except (ValueError, TypeError, KeyError, AttributeError):
        return None


_SWITCHES = {
    "enforce_constraints": (False, "--no-constraints"),
    "strict": (True, "--strict"),
    "sut_in_process": (True, "--sut-in-process"),
    "end_after_collision": (False, "--continue-after-collision"),
}
"""Options of settings that are true or false: the value that they stand for"""
_NAMED = 5
"""Files that a command names, at most; of more it names their folder"""


def jobs_at(path: Path) -> tuple[Path, list[Job]]:
    """Return the batch that a folder is or lies in, and the finished runs that the folder stands
    for; none where it is neither a batch nor a run.
    """
    batch = path if is_batch(path) else path.parent
    if not is_batch(batch):
        return batch, []
    jobs = [outcome.job for outcome in finished(batch).outcomes.values()]
    return batch, [job for job in jobs if path in (batch, batch / job.name)]


def run_settings(batch: Path) -> RunSettings:
    """Return the settings of a batch by which its runs come out again; limits, which only judge
    them, are left out.

    Raises:
        UsageError: the folder is not that of a batch.
        InvalidFile: their file is damaged.
    """
    kept = {name: value for name, value in settings(batch).items() if name in _MOVING}
    # JSON has lists where settings have tuples.
    listed = {name: tuple(value) for name, value in kept.items() if isinstance(value, list)}
    return RunSettings(**(kept | listed))


def repeated_by(path: Path) -> str:
    """Return the command that repeats a batch, or a run of it; empty where the
    folder is neither.
    """
    batch, jobs = jobs_at(path)
    if not jobs:
        return ""
    sources = list(dict.fromkeys(str(job.source) for job in jobs))
    if len(sources) > _NAMED:
        sources = [os.path.commonpath(sources)]
    words = ["xosc-run", *sources]
    given = settings(batch)
    # Options with their default values would only make the command hard to read.
    usual = RunSettings(sut=str(given.get("sut"))).as_json()
    for name, value in given.items():
        option = f"--{name.replace('_', '-')}"
        if name in _SWITCHES:
            meant, switch = _SWITCHES[name]
            words += [switch] * (value == meant != usual[name])
        elif name in usual and (value != usual[name] or name == "sut"):
            for text in value if isinstance(value, list) else [value]:
                words += [option, str(text)]
    # A set of a distribution is chosen by its number, which the name has.
    if len(jobs) == 1 and jobs[0].source != jobs[0].scenario and "~" in jobs[0].name:
        words += ["--only", str(int(jobs[0].name.split("~")[1]))]
    elif len(sources) == 1 and all(job.source == job.scenario for job in jobs):
        words += [f"-p {name}={value}" for name, value in jobs[0].parameters.items()]
    return " ".join(word if word.startswith("-p ") else shlex.quote(word) for word in words)


def is_folder_name(name: str) -> bool:
    """Whether the name of a job is that of one folder: results of an edited journal must not lie
    outside of its folder."""
    return name not in ("", ".", "..") and not any(sign in name for sign in "/\\:\0")


def settings(out: Path) -> dict[str, Any]:
    """The settings that all runs of a batch share, as its output folder says.

    Raises:
        UsageError: the folder is not that of a batch.
        InvalidFile: their file is damaged.
    """
    if not (out / _SETTINGS).is_file():
        raise _no_batch(out, f"no {_SETTINGS}")
    return read_object(out / _SETTINGS)
