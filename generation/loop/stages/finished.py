"""What a loop has done so far, in its output folder: each finished stage leaves what it found as JSON, and is not done again."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from generation.loop.stages.findings import Finding
from generation.loop.stages.records import from_json
from schemas.errors import InvalidFile, UsageError
from schemas.storage import keep, read_object, writing

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
"""Is told each finished stage, what it found, and the time (s) that it took; None where it was finished before."""


class FinishedStages:
    """The stages of one loop.

    Args:
        out: the output folder; made where it does not exist.
        settings: all that decides what the stages find.
        report: told each stage as it is finished.

    Raises:
        UsageError: the folder holds a loop with other settings, or something else, or can't be made.
        InvalidFile: the settings there are not readable.
    """

    def __init__(self, out: Path, settings: Mapping[str, Any], report: Report) -> None:
        self._folder, self._report = out / _FOLDER, report
        path = out / _SETTINGS
        if path.is_file():
            before = read_object(path, _REMEDY)
            changed = [name for name in settings if settings[name] != before.get(name)]
            if changed:
                reason = f"this folder holds a loop with other settings ({', '.join(changed)}): give the same, or another folder"
                raise UsageError(reason, path=out)
        elif out.is_dir() and any(out.iterdir()):
            raise UsageError("there is something else in this folder: a loop needs one of its own", path=out)
        _write(path, settings)

    def once(self, stage: Stage, kind: type[F], work: Callable[[], F]) -> F:
        """What a stage finds, of that kind; it does its work only where it has not been finished before.

        Raises:
            InvalidFile: what it has left is not readable.
        """
        path = self._folder / f"{stage.name}.json"
        if path.is_file():
            found = _read(path, kind)
            self._report(stage, found, None)
            return found
        begun = time.monotonic()
        found = work()
        _write(path, asdict(found))
        self._report(stage, found, time.monotonic() - begun)
        return found


def _read(path: Path, kind: type[F]) -> F:
    try:
        return from_json(kind, read_object(path, _REMEDY))
    except (TypeError, ValueError) as error:
        raise InvalidFile(f"this is not what the stage finds: {error}; {_REMEDY}", path=path) from None


def _write(path: Path, values: Mapping[str, Any]) -> None:
    content = (json.dumps(values, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()
    with writing("this", path):
        keep(content, path)
