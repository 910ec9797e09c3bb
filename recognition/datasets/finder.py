"""Which files of a folder are recordings, and of which format."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module
from os import PathLike
from pathlib import Path
from types import ModuleType
from typing import NoReturn

from recognition.datasets.source import DataSet, Source
from schemas import discovery
from schemas.errors import InvalidFile
from xodr.sumo_net.cache import folder as cache_folder

FORMATS = "recognition.datasets.formats"


def cache_roads() -> Path:
    """Folder for roads that are made from recordings, where no other is named."""
    return cache_folder() / "roads"


def open(path: str | PathLike[str], roads: str | PathLike[str] | None = None) -> DataSet:
    """The recordings in a folder (with all that is below it) or a file.

    Formats are the modules of `recognition.datasets.formats`. Nothing is read before `DataSet.sources` is asked for, and no track
    before a source is loaded.

    Args:
        roads: folder for roads that are made from recordings (highD); `cache_roads` by default.

    Raises:
        InvalidFile: there is no such folder or file.
    """
    path = Path(path)
    if not path.exists():
        raise InvalidFile("no such file or folder", path=path)
    return DataSet(path, partial(_find, path, Path(roads) if roads is not None else cache_roads()))


def _find(path: Path, roads: Path) -> list[Source]:
    files = sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]
    by_content = discovery.described(FORMATS, "BY_CONTENT")
    formats = [import_module(f"{FORMATS}.{name}") for name in sorted(by_content, key=lambda name: by_content[name])]
    found = _told_apart([source for file in files for source in _sources(file, formats, roads)], path)
    if not found:
        known = ", ".join(discovery.described(FORMATS, "TITLE").values())
        raise InvalidFile(f"no recording of a known format is here ({known})", path=path)
    for source in found:
        if not source.name.isprintable():
            raise InvalidFile(f"the name of recording {source.name!r} has characters that can't be printed", path=source.path)
    return found


def _sources(file: Path, formats: Sequence[ModuleType], roads: Path) -> list[Source]:
    """The recordings in a file. One that can't be read may be a recording or not: a source that says so when it is loaded."""
    try:
        form = next((each for each in formats if each.claims(file)), None)
        return form.sources(file, roads) if form is not None else []
    except InvalidFile as error:
        return [Source(file.name, file.stem, "", file, partial(_fail, error))]


def _fail(error: InvalidFile) -> NoReturn:
    raise error


def _told_apart(sources: list[Source], folder: Path) -> list[Source]:
    """The sources, with names that several have led by the place of their files in the folder."""
    counts = Counter(source.name for source in sources)

    def renamed(source: Source) -> Source:
        return replace(source, name=f"{source.path.relative_to(folder).as_posix()}/{source.name}")

    return [renamed(source) if counts[source.name] > 1 else source for source in sources]
