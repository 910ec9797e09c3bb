"""Which files a command line means: files, folders with all that is below them, and globs."""

from __future__ import annotations

from collections.abc import Iterable
from glob import glob, has_magic
from pathlib import Path

from schemas.errors import UsageError

SUFFIXES = (".xosc", ".xodr")


def expand(arguments: Iterable[str]) -> list[Path]:
    """The files meant by command line arguments: each once, in the order of the arguments and sorted within each.

    A file is taken as it is, whatever its name, and also where it does not exist; a folder stands for the scenario and
    road files in it and below it; a glob (`**` for any depth) for the scenario and road files that it matches, and for
    those in the folders that it matches.

    Raises:
        UsageError: a folder or a glob stands for no file.
    """
    return list(dict.fromkeys(path for argument in arguments for path in _expand(argument)))


def _expand(argument: str) -> list[Path]:
    path = Path(argument)
    try:
        is_glob = has_magic(argument) and not path.exists()
        if not is_glob and not path.is_dir():
            return [path]
    except (OSError, ValueError):
        return [path]  # no such name can be; the check says so
    matches = [Path(match) for match in sorted(glob(argument, recursive=True))] if is_glob else [path]
    found = [file for match in matches for file in files_in(match)]
    if not found:
        raise UsageError(f"this stands for no {' or '.join(SUFFIXES)} file", path=argument)
    return found


def files_in(path: Path) -> list[Path]:
    """The scenario and road files in a folder and below it, sorted; a file itself, if it is one."""
    candidates = sorted(path.rglob("*")) if path.is_dir() else [path]
    return [candidate for candidate in candidates if candidate.suffix.lower() in SUFFIXES and candidate.is_file()]
