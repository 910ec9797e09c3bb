"""What a loop has done so far, in its output folder: each finished stage leaves what it found as JSON, and is not done again."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from schemas.errors import UsageError
from schemas.storage import keep, read_object, writing

_FOLDER = "stages"
_SETTINGS = "loop.json"
_REMEDY = "remove it to have it done again"

Found = dict[str, Any]
"""What a stage has found, JSON-able."""


class Stages:
    """The stages of one loop.

    Args:
        out: the output folder; made where it does not exist.
        settings: all that decides what the stages find.
        done: told the name, the finding and the time (s) of each stage as it is finished; of one that was before, no time.

    Raises:
        UsageError: the folder holds a loop with other settings, or something else, or can't be made.
        InvalidFile: the settings there are not readable.
    """

    def __init__(self, out: Path, settings: Mapping[str, Any], done: Callable[[str, Found, float | None], None]) -> None:
        self._folder, self._done = out / _FOLDER, done
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

    def once(self, name: str, work: Callable[[], Found]) -> Found:
        """What a stage finds; it does its work only where it has not been finished before.

        Raises:
            InvalidFile: what it has left is not readable.
        """
        path = self._folder / f"{name}.json"
        if path.is_file():
            found = read_object(path, _REMEDY)
            self._done(name, found, None)
            return found
        begun = time.monotonic()
        found = work()
        _write(path, found)
        self._done(name, found, time.monotonic() - begun)
        return found


def _write(path: Path, found: Mapping[str, Any]) -> None:
    content = (json.dumps(found, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()
    with writing("this", path):
        keep(content, path)
