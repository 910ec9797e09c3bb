"""Files that arguments of commands stand for: paths, folders, globs, and names
of shipped scenarios.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator
from fnmatch import filter as filter_names
from functools import cache
from glob import escape, glob, has_magic
from pathlib import Path

from schemas.common.errors import InvalidFile, UsageError, nearest, similar
from schemas.common.storage import alike
from schemas.common.terminal.text import one_line

LIBRARY = Path(__file__).parents[3] / "xosc" / "library"
"""The shipped scenarios"""
ROADS = Path(__file__).parents[3] / "xodr" / "library"
"""The shipped roads"""
SUFFIXES = (".xosc", ".xodr")
_SHOWN = "xosc list shows all of these, and a pattern stands for several, as 'cut_in_*'"


def expand(arguments: Iterable[str]) -> list[Path]:
    """The files meant by command line arguments: each once, in the order of the
    arguments and sorted within each.

    A file is taken as it is, whatever its name, and also where it does not exist; a name without an
    ending stands for a scenario (`named`); a folder stands
    for the scenario and road files in it and below it, see `files_in`; a glob (`**` for any depth)
    for the scenario and road files that it matches, and for those in the folders that it matches;
    where it matches none, for the shipped scenarios whose names it matches.

    Raises:
        UsageError: a folder or a glob stands for no file.
        InvalidFile: a name stands for no scenario.
    """
    return list(dict.fromkeys(path for argument in arguments for path in _expand(argument)))


def named(path: Path) -> Path:
    """Return the scenario that a name without folder and ending stands for; any
    other path as it is.

    A file of that name in the working folder comes before a shipped one, with a remark on standard
    error.

    Raises:
        InvalidFile: there is none, with the most similar name.
    """
    name, path = str(path), _in_clone(path)
    if path.suffix or path.name != name or os.path.lexists(path):
        return path
    own = path.with_suffix(".xosc")
    if own.is_file():
        if name in shipped():
            _remark(own)
        return own
    if name in shipped():
        return _relative(LIBRARY / own)
    hint = similar(name, shipped()) or alike(path).removeprefix("; ") or _SHOWN
    told = f"neither a file nor the name of a shipped scenario; {hint}"
    raise InvalidFile(told, path=path)


def named_road(path: Path) -> Path:
    """Return the shipped road that a name without folder and ending stands for;
    any other path as it is.

    Raises:
        InvalidFile: there is none, with the most similar name.
    """
    name, path = str(path), _in_clone(path)
    if path.suffix or path.name != name or os.path.lexists(path):
        return path
    if name in shipped_roads():
        return _relative(ROADS / f"{name}.xodr")
    told = f"neither a file nor the name of a shipped road; {nearest(name, shipped_roads())}"
    raise InvalidFile(told, path=path)


def _in_clone(path: Path) -> Path:
    """Return the shipped file or folder that a path as in a clone (`xosc/library/…`), of which
    documents speak, stands for where there is no clone; any other path as it is."""
    for folder in (LIBRARY, ROADS):
        beneath = Path(*folder.parts[-2:])
        if path.is_relative_to(beneath) and not os.path.lexists(beneath):
            return folder / path.relative_to(beneath)
    return path


@cache
def shipped() -> tuple[str, ...]:
    """Return the names of the shipped scenarios and variations."""
    return tuple(sorted(path.stem for path in LIBRARY.glob("*.xosc")))


@cache
def shipped_roads() -> tuple[str, ...]:
    """Return the names of the shipped roads."""
    return tuple(sorted(path.stem for path in ROADS.glob("*.xodr")))


def complete_name(incomplete: str) -> list[str]:
    """Names of shipped scenarios that begin as typed; none where a file of the
    user's does, which the shell completes.
    """
    return _unless_file(incomplete, shipped())


def complete_road(incomplete: str) -> list[str]:
    """Names of shipped roads, as `complete_name` those of scenarios."""
    return _unless_file(incomplete, shipped_roads())


def _unless_file(incomplete: str, names: Iterable[str]) -> list[str]:
    if glob(f"{escape(incomplete)}*"):
        return []
    return [name for name in names if name.startswith(incomplete)]


def _relative(path: Path) -> Path:
    """A path as from the working folder where it lies in that."""
    working = Path(os.path.abspath(os.curdir))
    return path.relative_to(working) if path.is_relative_to(working) else path


def _remark(path: Path) -> None:
    name = Path(sys.argv[0]).stem
    told = f"{path} of this folder counts, not the shipped scenario of that name"
    print(one_line(f"{name}: remark: {told}"), file=sys.stderr, flush=True)


def _expand(argument: str) -> list[Path]:
    if not str(argument).strip():
        raise UsageError("an empty name stands for no file; '.' is the working folder")
    path = _in_clone(Path(argument))
    argument = argument if path == Path(argument) else str(path)
    try:
        is_glob = has_magic(argument) and not path.exists()
        if not is_glob and not path.is_dir():
            return [named(path)]
    except (OSError, ValueError):
        return [path]  # no such name can be; the check says so
    matches = (
        [Path(match) for match in sorted(glob(argument, recursive=True))] if is_glob else [path]
    )
    files = [file for match in matches for file in files_in(match)]
    # As a name does, a pattern without a folder stands for shipped scenarios where no file has it.
    if not files and is_glob and path.name == argument:
        files = [_relative(LIBRARY / f"{name}.xosc") for name in filter_names(shipped(), argument)]
    if not files:
        raise UsageError(f"this stands for no {' or '.join(SUFFIXES)} file", path=argument)
    return files


def files_in(path: Path) -> list[Path]:
    """The scenario and road files in a folder and below it, sorted; a file itself, if it is one.

    Names that begin with a dot are left out: drafts that a killed command has left, and
    environments as .venv, which hold files of packages. Names of such files that are none, as a
    dangling link or a FIFO, and folders that can't be read count, so that the reader says so.
    """
    if not path.is_dir():
        return [path] if path.suffix.lower() in SUFFIXES else []
    unread: list[Path] = []
    visible = [file for file in _visible(path, unread) if file.suffix.lower() in SUFFIXES]
    return sorted([*(file for file in visible if not file.is_dir()), *unread])


def _visible(folder: Path, unread: list[Path]) -> Iterator[Path]:
    def refuse(error: OSError) -> None:
        unread.append(Path(error.filename))

    for parent, folders, files in os.walk(folder, onerror=refuse):
        # In place: os.walk goes on with what this list holds.
        folders[:] = [folder for folder in folders if not folder.startswith(".")]
        yield from (Path(parent, name) for name in files if not name.startswith("."))
