"""Which files of a folder are recordings, and of which format."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from recognition.datasets.formats import highd, interaction, ngsim, runs
from recognition.datasets.formats.commonroad import files as commonroad
from recognition.datasets.source import DataSet, Source
from schemas.errors import InvalidFile
from xodr.sumo_net.cache import folder as cache_folder


class _Format(NamedTuple):
    """claims: whether a file is the main file of recordings. sources: those recordings; the folder is for new roads."""

    claims: Callable[[Path], bool]
    sources: Callable[[Path, Path], list[Source]]


_FORMATS = [_Format(module.claims, module.sources) for module in (highd, interaction, runs, commonroad, ngsim)]


def cache_roads() -> Path:
    """Folder for roads that are made from recordings, where no other is named."""
    return cache_folder() / "roads"


def open(path: str | PathLike[str], roads: str | PathLike[str] | None = None) -> DataSet:
    """The recordings in a folder (with all that is below it) or a file.

    Formats: highD, INTERACTION, CommonRoad XML (also packed in a tar archive), NGSIM tables and folders with results of
    `xosc-run --out`. Nothing is read before `DataSet.sources` is asked for, and no track before a source is loaded.

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
    claimed = ((file, next((form for form in _FORMATS if form.claims(file)), None)) for file in files)
    found = _told_apart([source for file, form in claimed if form is not None for source in form.sources(file, roads)], path)
    if not found:
        known = "highD, INTERACTION, CommonRoad, NGSIM, or results of xosc-run"
        raise InvalidFile(f"no recording of a known format is here ({known})", path=path)
    for source in found:
        if not source.name.isprintable():
            raise InvalidFile(f"the name of recording {source.name!r} has characters that can't be printed", path=source.path)
    return found


def _told_apart(sources: list[Source], folder: Path) -> list[Source]:
    """The sources, with names that several have led by the place of their files in the folder."""
    counts = Counter(source.name for source in sources)

    def renamed(source: Source) -> Source:
        return replace(source, name=f"{source.path.relative_to(folder).as_posix()}/{source.name}")

    return [renamed(source) if counts[source.name] > 1 else source for source in sources]
