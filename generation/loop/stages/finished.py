"""What a loop has done so far, in its output folder: each finished stage leaves what it found as JSON, and is not done again."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from generation.loop.stages.findings import Finding, Searched
from generation.loop.stages.records import from_json
from schemas.errors import InvalidFile, UsageError
from schemas.storage import LOCK, check_settings, read_object, write_object, writing

_FOLDER = "stages"
_SETTINGS = "loop.json"
_REMEDY = "remove it to have it done again"

F = TypeVar("F", bound=Finding)


class Stage(NamedTuple):
    """A stage: what is done, in which round, and of what; 0 and empty where it is of none."""

    task: str
    round: int = 0
    target: str = ""

    @property
    def name(self) -> str:
        """The name of its file."""
        parts = (f"round_{self.round}" if self.round else "", self.task, self.target)
        return "_".join(part for part in parts if part)


Report = Callable[[Stage, Finding, float | None], None]
"""Called with each finished stage, what it found, and the time (s) that was waited for it; None where it was finished before."""


class FinishedStages:
    """The stages of one loop.

    Args:
        out: the output folder; made where it does not exist.
        settings: all that decides what the stages find.
        report: called with each stage as it is finished.

    Raises:
        UsageError: the folder holds a loop with other settings, or something else, or can't be made.
    """

    def __init__(self, out: Path, settings: Mapping[str, Any], report: Report) -> None:
        self._folder, self._report = out / _FOLDER, report
        path = out / _SETTINGS
        check_settings(path, settings, "a loop")
        if not path.exists() and out.is_dir() and any(each.name != LOCK for each in out.iterdir()):
            raise UsageError("there is something else in this folder: a loop needs one of its own", path=out)
        write_object(settings, path)

    def has(self, stage: Stage, of: str = "") -> bool:
        """Whether a stage has been finished, of the same content."""
        path = self._path(stage)
        return path.is_file() and _is_done(_read(path), of)

    def once(self, stage: Stage, kind: type[F], work: Callable[[], F], of: str = "", made: Sequence[Path] = ()) -> F:
        """What a stage finds, of that kind; it does its work only where it has not been finished before.

        Args:
            work: what it does.
            of: the content of its inputs. Where it has changed, what was made of the old one is removed, and the work done again.
            made: files and folders that it writes.

        Raises:
            InvalidFile: what it has left is not readable.
            UsageError: what it has left can't be removed.
        """
        path = self._path(stage)
        before = _read(path) if path.is_file() else {"of": of, "found": None}
        if _is_done(before, of):
            found = _finding(path, kind, before)
            self._report(stage, found, None)
            return found
        if before["of"] != of:
            _remove(made)
        write_object({"of": of, "found": None}, path)
        begun = time.monotonic()
        found = work()
        write_object({"of": of, "found": asdict(found)}, path)
        self._report(stage, found, time.monotonic() - begun)
        return found

    def _path(self, stage: Stage) -> Path:
        return self._folder / f"{stage.name}.json"


def searches(out: Path) -> tuple[str, list[Searched]]:
    """The system under test of a loop that is in a folder, and its searches, round after round.

    Raises:
        UsageError: no loop is there. InvalidFile: what it has left is not readable.
    """
    path = out / _SETTINGS
    if not path.is_file():
        raise UsageError("no loop is in this folder", path=out)
    left = ((each, _read(each)) for each in sorted((out / _FOLDER).glob("round_*_search_*.json")))
    found = [_finding(path, Searched, record) for path, record in left if record["found"] is not None]
    return str(read_object(path).get("sut", "")), sorted(found, key=lambda each: each.round)


def _read(path: Path) -> dict[str, Any]:
    record = read_object(path, _REMEDY)
    if set(record) != {"of", "found"}:
        raise InvalidFile(f"this is not what a stage leaves; {_REMEDY}", path=path)
    return record


def _is_done(record: Mapping[str, Any], of: str) -> bool:
    return record["of"] == of and record["found"] is not None


def _finding(path: Path, kind: type[F], record: Mapping[str, Any]) -> F:
    try:
        return from_json(kind, record["found"])
    except (TypeError, ValueError) as error:
        raise InvalidFile(f"this is not what the stage finds: {error}; {_REMEDY}", path=path) from None


def _remove(made: Sequence[Path]) -> None:
    for path in made:
        with writing("the folder", path):
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink(missing_ok=True)
