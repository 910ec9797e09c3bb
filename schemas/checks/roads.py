"""Road networks as references into them need them: ids, lengths and lanes, no geometry; and where they are, in the folders that
were asked for, where they are not where a LogicFile says."""

from __future__ import annotations

import math
import os
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from os import PathLike
from pathlib import Path

from lxml import etree

from schemas.errors import InvalidFile
from schemas.storage import Stamp, search_path, stamp
from schemas.xml import local_name, parse

VARIABLE = "XOSC_ROAD_PATH"
"""Environment variable with more folders of road networks, separated as in PATH."""
_SUFFIX = ".xodr"


@dataclass(frozen=True)
class Road:
    """Length in metres, and the lane ids from each lane section's start on."""

    length: float
    sections: tuple[tuple[float, frozenset[str]], ...]

    def lanes(self, s: float) -> frozenset[str]:
        """Lane ids at a road coordinate, the centre lane among them."""
        index = bisect_right([start for start, _ in self.sections], s) - 1
        return self.sections[max(index, 0)][1] if self.sections else frozenset()


@dataclass(frozen=True)
class Roads:
    """The referable parts of a road network."""

    path: Path
    geo_reference: bool
    roads: dict[str, Road] = field(default_factory=dict)
    signals: frozenset[str] = frozenset()
    controllers: frozenset[str] = frozenset()


def read(path: Path) -> Roads:
    """Read a road network; cached until the file changes.

    Raises:
        InvalidFile: the file can't be read, or is no OpenDRIVE file.
    """
    return _read(path, stamp(path))


@lru_cache(maxsize=64)
def _read(path: Path, _stamp: Stamp) -> Roads:
    root = parse(path).getroot()
    if local_name(root) != "OpenDRIVE":
        raise InvalidFile(f"the root element is <{local_name(root)}>, not OpenDRIVE", path=path)
    roads = {element.get("id") or "": _road(element) for element in root.iterchildren("{*}road")}
    signals = {element.get("id") or "" for element in root.iter("{*}signal")}
    controllers = {element.get("id") or "" for element in root.iter("{*}controller")}
    geo_reference = any((element.text or "").strip() for element in root.iter("{*}geoReference"))
    return Roads(path, geo_reference, roads, frozenset(signals), frozenset(controllers))


def _road(element: etree._Element) -> Road:
    sections = []
    for section in element.iterfind("{*}lanes/{*}laneSection"):
        lanes = frozenset(lane.get("id") or "" for lane in section.iterfind("{*}*/{*}lane"))
        sections.append((_number(section.get("s")), lanes))
    return Road(_number(element.get("length")), tuple(sorted(sections, key=lambda section: section[0])))


def _number(text: str | None) -> float:
    try:
        return float(text or "nan")
    except ValueError:
        return math.nan


# where they are --------------------------------------------------------------------------------


def asked_for(name: str, folders: Sequence[str | PathLike[str]] = ()) -> Path | None:
    """The first file of that name, with or without the ending .xodr, in these folders and those in XOSC_ROAD_PATH."""
    return first(search_path(folders, VARIABLE), name)


def first(folders: Iterable[Path], name: str) -> Path | None:
    """The first file of that name, with or without the ending .xodr, in one of the folders."""
    return next((file for file in candidates(folders, name) if os.path.isfile(file)), None)


def candidates(folders: Iterable[Path], name: str) -> Iterator[Path]:
    """What a file of that name may be called in the folders, in the order in which it is taken."""
    stem = name.removesuffix(_SUFFIX)
    names = [each for each in dict.fromkeys((name, stem + _SUFFIX, stem)) if each]
    yield from (folder / each for folder in folders for each in names)
