"""Reading files that may be anything, writing files whole or not at all, and resuming work only with the same settings."""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from schemas.errors import InvalidFile, UsageError

MAX_BYTES = 256 * 1024 * 1024
"""Largest file that is read. The biggest public road networks have about a tenth of it."""


def read_bytes(path: Path) -> bytes:
    """The content of a file that may be anything, a device without an end included.

    Raises:
        InvalidFile: it is missing, no regular file, or larger than `MAX_BYTES`.
    """
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise InvalidFile("this is a folder, a file is expected", path=path)
        if not stat.S_ISREG(status.st_mode):
            raise InvalidFile("this is not a regular file", path=path)
        if status.st_size > MAX_BYTES:
            raise InvalidFile(f"the file has {status.st_size} bytes, at most {MAX_BYTES} are read", path=path)
        return path.read_bytes()
    except FileNotFoundError:
        raise InvalidFile("no such file", path=path) from None
    except (OSError, ValueError) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise InvalidFile(f"the file can't be read: {reason}", path=path) from None


def search_path(folders: Sequence[str | PathLike[str]], variable: str) -> list[Path]:
    """Folders that were asked for: these, then those of an environment variable, separated as in PATH."""
    return [Path(folder) for folder in (*folders, *filter(None, os.environ.get(variable, "").split(os.pathsep)))]


def in_any_case(path: Path) -> Path | None:
    """The one file or folder that a path names where upper and lower case are the same, as on Windows; None without one."""
    found = Path(path.anchor)
    for part in path.parts[bool(path.anchor) :]:
        if not os.path.exists(found / part):  # unlike that of Path it takes names of any length
            try:
                alike = [name for name in os.listdir(found) if name.lower() == part.lower()]
            except (OSError, ValueError):
                return None
            if len(alike) != 1:
                return None
            part = alike[0]
        found /= part
    return found


def above(path: Path, file: Path) -> Iterator[Path]:
    """Where a path that a file names relative to its folder leads from that folder and those above, without the steps upwards."""
    if path.is_relative_to(file.parent):
        below = [part for part in path.relative_to(file.parent).parts if part != ".."]
        yield from (folder.joinpath(*below) for folder in Path(os.path.abspath(file)).parents)


_ENDING = 2.0
"""Time (s) that the workers of a process that was killed have to notice it and to end"""

LOCK = ".lock"
"""Name of the file by which `alone` keeps others out"""
Stamp = tuple[int, int]
"""Modification time in nanoseconds and size in bytes: together they tell whether a file has changed."""


def stamp(path: str | PathLike[str]) -> Stamp:
    """The stamp of a file; zeros where there is none."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return (0, 0)
    return (status.st_mtime_ns, status.st_size)


def read_object(path: Path, remedy: str = "") -> dict[str, Any]:
    """The object that a JSON file holds.

    Args:
        remedy: what can be done about a file that holds none.

    Raises:
        InvalidFile: it can't be read, is not JSON, or holds something else.
    """
    return parse_object(read_bytes(path), path, remedy=remedy)


def parse_object(content: bytes, path: Path, line: int | None = None, remedy: str = "") -> dict[str, Any]:
    """The object that a JSON text holds.

    Args:
        path, line: what errors name; by default the line of the defect.
        remedy: as in `read_object`.

    Raises:
        InvalidFile: it is not JSON, or holds something else.
    """
    try:
        found = json.loads(content)
        reason = "a JSON object is expected"
    except json.JSONDecodeError as error:
        found, line, reason = None, line or error.lineno, f"not readable as JSON: {error.msg}"
    except (ValueError, RecursionError) as error:
        found, reason = None, f"not readable as JSON: {error}"
    if not isinstance(found, dict):
        raise InvalidFile("; ".join(filter(None, (reason, remedy))), path=path, line=line)
    return found


def write_object(values: Mapping[str, Any], path: Path) -> None:
    """Write a JSON object, whole or not at all (see `keep`). Numbers must be finite.

    Raises:
        UsageError: the file can't be written.
    """
    text = json.dumps(values, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    with writing("this", path):
        keep(text.encode(errors="backslashreplace"), path)  # which is how JSON writes bytes in file names


def check_settings(path: Path, settings: Mapping[str, Any], what: str) -> None:
    """Refuse to go on with work that was begun with other settings; fine where none was begun.

    Whoever begins work that can be resumed checks its settings, then keeps them beside it by `write_object`.

    Args:
        path: the file beside the work that holds its settings.
        settings: JSON-able; all that decides what the work finds, or a part of it.
        what: the work, for the message: "a batch".

    Raises:
        UsageError: the work has other settings, which are named, or they are not readable.
    """
    if not path.exists():
        return
    try:
        before = read_object(path)
    except InvalidFile as error:
        raise UsageError(f"the settings of {what} in this folder can't be read: {error.message}", path=path) from None
    mine = json.loads(json.dumps(settings))
    changed = [name for name, value in mine.items() if name not in before or before[name] != value]
    if changed:
        reason = f"this folder holds {what} with other settings ({', '.join(changed)}): give the same, or another folder"
        raise UsageError(reason, path=path.parent)


@contextmanager
def writing(what: str, path: Path) -> Iterator[None]:
    """Around all that writes something.

    Raises:
        UsageError: it can't be written.
    """
    try:
        yield
    except OSError as error:
        raise UsageError(f"{what} can't be written: {error.strerror or error}", path=path) from None


@contextmanager
def alone(folder: Path, what: str) -> Iterator[None]:
    """Around all that only one process at a time may do in a folder, which is made; a hidden lock file stays in it.

    Args:
        what: the work, for the message: "a batch".

    Raises:
        UsageError: another process does it, or the folder can't be written into.
    """
    with writing("the folder", folder):
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(folder / LOCK, timeout=_ENDING)
        try:
            lock.acquire()
        except Timeout:
            raise UsageError(
                f"{what} of another process writes into this folder: wait for it, or give another", path=folder
            ) from None
    try:
        yield
    finally:
        lock.release()


def keep(content: bytes, path: Path) -> Path:
    """Write a file whole or not at all, also for those who write the same beside; nothing where it has that content already.

    It gets the permissions that the user's umask leaves to a new file.

    Raises:
        OSError: the file can't be written.
    """
    if path.is_file() and path.read_bytes() == content:
        return path
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f"{path.name}.{secrets.token_hex(4)}")  # what tempfile makes is for its owner's eyes only
    try:
        draft.write_bytes(content)
        return draft.replace(path)
    except PermissionError:  # Windows replaces no file that is open: one who writes the same was first, and it is read
        if path.is_file() and path.read_bytes() == content:
            return path
        raise
    finally:
        draft.unlink(missing_ok=True)


def digest(content: bytes) -> str:
    """A short name for some content, to tell files apart."""
    return hashlib.blake2b(content, digest_size=6).hexdigest()
