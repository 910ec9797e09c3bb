"""From a Lanelet2 file to an OpenDRIVE file."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from xodr.lanelet2.assembly import build
from xodr.lanelet2.crosswalks import with_crosswalks
from xodr.lanelet2.deviation import deviation
from xodr.lanelet2.reading.completion import completed
from xodr.lanelet2.reading.reader import read_lanelets
from xodr.reader import load

_ASTRAY = 0.5
"""Lanes farther away than this from their lanelets are named, m."""


class Conversion(NamedTuple):
    """What became of a Lanelet2 map.

    Attributes:
        path: the OpenDRIVE file.
        lanelets: road id and lane id of each lanelet that became a lane.
        notes: what was assumed, changed or left out, one sentence each.
        deviation: largest distance between a lanelet's borders or centre line and those of its lane, m.
    """

    path: Path
    lanelets: dict[str, tuple[str, int]]
    notes: list[str]
    deviation: float


def convert(osm: str | PathLike[str], origin: tuple[float, float] | None, target: str | PathLike[str]) -> Conversion:
    """Write a Lanelet2 map as OpenDRIVE, in the coordinates of the tracks that were recorded on it.

    Args:
        osm: the map.
        origin: latitude and longitude of the origin of the coordinates, degrees; None for that of the map's own local
            coordinates, or of INTERACTION (0, 0) where it has none.
        target: the OpenDRIVE file to write.

    Raises:
        InvalidFile: the map is malformed; names file, line and element.
        UsageError: the origin is no place on Earth.
    """
    source = Path(osm)
    found = read_lanelets(source, origin)
    lanelets, added = completed(found.lanes)
    built = build(lanelets, source.stem, found.geo, found.priorities)
    written = replace(built.map, roads=with_crosswalks(built.map.roads, found.crosswalks)).write(target)
    away = deviation(built.parts, built.lanelets, load(written))
    astray = [f"{name} ({distance:.1f} m)" for name, distance in away.items() if distance > _ASTRAY]
    notes = [f"lanes that are not everywhere where their lanelets are: {', '.join(astray)}"] if astray else []
    return Conversion(written, built.lanelets, [*found.notes, *added, *built.notes, *notes], max(away.values()))
