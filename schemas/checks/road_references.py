"""Road networks as references into them need them: ids, lengths and lanes, no geometry; and where
they are, in the folders that were asked for, where they are not where a LogicFile says."""

from __future__ import annotations

import math
import os
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from lxml import etree

from schemas.common.errors import InvalidFile
from schemas.common.policy import current
from schemas.common.storage import Stamp, search_path, stamp
from schemas.common.xml import local_name, parse

VARIABLE = "XOSC_ROAD_PATH"
"""Environment variable with more folders of road networks, separated as in PATH."""
_SUFFIX = ".xodr"


class SectionLanes(NamedTuple):
    """The lane ids of a section, the centre lane among them, from its start on, up to its end if it
    says so (m)."""

    start: float
    end: float
    ids: frozenset[str]


@dataclass(frozen=True)
class ReferencedRoad:
    """Length in metres, and the lanes from each lane section's start on: the permanent ones, and
    the temporary ones of 1.9."""

    length: float
    sections: tuple[SectionLanes, ...]
    temporary: tuple[SectionLanes, ...] = ()

    def lanes(self, s: float, layer: str | None = None) -> frozenset[str]:
        """Lane ids at a road coordinate, the centre lane among them: those in force, or those of
        the permanent layer."""
        usual = _at(self.sections, s, first=True)
        temporary = _at(self.temporary, s)
        if layer == "permanent" or not temporary:
            return usual
        # OpenDRIVE 1.9, 11.2: temporary lanes take precedence. They replace the permanent ones of a
        # side.
        sides = {lane.startswith("-") for lane in temporary if lane != "0"}
        return temporary | {lane for lane in usual if lane.startswith("-") not in sides}


def _at(sections: tuple[SectionLanes, ...], s: float, first: bool = False) -> frozenset[str]:
    """The lanes of the section at s; with `first` those of the first one before all of them."""
    index = bisect_right([section.start for section in sections], s) - 1
    if not sections or (index < 0 and not first):
        return frozenset()
    # Before the first section its lanes count: files begin it at 0.001 and the like.
    section = sections[max(index, 0)]
    return section.ids if s <= section.end else frozenset()


@dataclass(frozen=True)
class ReferencedRoads:
    """The referable parts of a road network."""

    path: Path
    geo_reference: bool
    roads: dict[str, ReferencedRoad] = field(default_factory=dict)
    signals: frozenset[str] = frozenset()
    controllers: frozenset[str] = frozenset()


def read(path: Path) -> ReferencedRoads:
    """Read a road network; cached until the file changes.

    Raises:
        InvalidFile: the file can't be read, or is no OpenDRIVE file.
    """
    return _read(path, stamp(path))


@lru_cache(maxsize=64)
def _read(path: Path, _stamp: Stamp) -> ReferencedRoads:
    root = parse(path).getroot()
    if local_name(root) != "OpenDRIVE":
        raise InvalidFile(f"the root element is <{local_name(root)}>, not OpenDRIVE", path=path)
    # `{*}`, here and below, since exports of editors have ASAM's namespace.
    roads = {element.get("id") or "": _road(element) for element in root.iterchildren("{*}road")}
    signals = {element.get("id") or "" for element in root.iter("{*}signal")}
    controllers = {element.get("id") or "" for element in root.iter("{*}controller")}
    geo_reference = any((element.text or "").strip() for element in root.iter("{*}geoReference"))
    return ReferencedRoads(path, geo_reference, roads, frozenset(signals), frozenset(controllers))


def _road(element: etree._Element) -> ReferencedRoad:
    # OpenDRIVE 1.9 has a second `lanes` for temporary layers; earlier versions have one without
    # layer.
    layers: dict[bool, list[SectionLanes]] = {False: [], True: []}
    for lanes in element.iterfind("{*}lanes"):
        for section in lanes.iterfind("{*}laneSection"):
            ids = frozenset(lane.get("id") or "" for lane in section.iterfind("{*}*/{*}lane"))
            start, own = _number(section.get("s")), _number(section.get("length"))
            end = math.inf if math.isnan(own) else start + own
            layers[lanes.get("layer") == "temporary"].append(SectionLanes(start, end, ids))
    permanent, temporary = (
        tuple(sorted(sections, key=lambda section: section.start)) for sections in layers.values()
    )
    return ReferencedRoad(_number(element.get("length")), permanent, temporary)


def _number(text: str | None) -> float:
    try:
        return float(text or "nan")
    except ValueError:
        return math.nan


# where they are --------------------------------------------------------------------------------


def asked_for(name: str, folders: Sequence[str | PathLike[str]] = ()) -> Path | None:
    """The first file of that name, with or without the ending .xodr, in these folders and those in
    XOSC_ROAD_PATH."""
    return first(search_path(folders, VARIABLE), name)


def first(folders: Iterable[Path], name: str) -> Path | None:
    """The first file of that name, with or without the ending .xodr, in one of the folders."""
    return next(
        (
            file
            for file in candidates(folders, name)
            if current().allows(file) and os.path.isfile(file)
        ),
        None,
    )


def candidates(folders: Iterable[Path], name: str) -> Iterator[Path]:
    """Yield the paths that may be meant by a file name, in order of preference."""
    stem = name.removesuffix(_SUFFIX)
    # As it is written first: a file without ending may lie beside one with it.
    names = [text for text in dict.fromkeys((name, stem + _SUFFIX, stem)) if text]
    yield from (folder / name for folder in folders for name in names)
