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
    road files in it and below it; a glob (`**` for any depth) for what it matches, files and folders alike.

    Raises:
        UsageError: a folder or a glob stands for no file.
    """
    return list(dict.fromkeys(path for argument in arguments for path in _expand(argument)))


def _expand(argument: str) -> list[Path]:
    path = Path(argument)
    try:
        if path.is_dir():
            return _below(path)
        if not has_magic(argument) or path.exists():
            return [path]
    except (OSError, ValueError):
        return [path]
    matches = [Path(match) for match in sorted(glob(argument, recursive=True))]
    files = [match for match in matches if match.is_file() and (match.suffix.lower() in SUFFIXES or not argument.endswith("*"))]
    found = files or [file for match in matches if match.is_dir() for file in _below(match)]
    if not found:
        raise UsageError(f"no file matches {argument!r}")
    return found


def _below(folder: Path) -> list[Path]:
    found = sorted(path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file())
    if not found:
        raise UsageError(f"the folder {str(folder)!r} holds no {' or '.join(SUFFIXES)} file")
    return found
