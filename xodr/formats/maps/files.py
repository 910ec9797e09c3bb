"""Maps as files of their own: converted, compared, described, cut, shown; `xosc_toolchain.road` and the command `xosc-road`.

A map is read into lanes (`xodr.formats.maps.lane_map.LaneMap`) whatever its format is.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from schemas.common.errors import UsageError
from schemas.common.xml import parse
from xodr.formats.maps.comparing import Distances, MapDifference
from xodr.formats.maps.comparing import compare as compare_maps
from xodr.formats.maps.converting import FORMATS, MapConversion, convert, format_of, read_map
from xodr.formats.maps.cut import along, cut, within
from xodr.formats.maps.lane_map import LaneMap, MapLane, MapSignal
from xodr.formats.maps.projecting import Projector
from xodr.formats.sumo_net.driving import ConnectionDrive, drive_connections
from xodr.reader import load

__all__ = [
    "FORMATS",
    "ConnectionDrive",
    "Distances",
    "LaneMap",
    "MapConversion",
    "MapDifference",
    "MapInfo",
    "MapLane",
    "MapSignal",
    "Repaired",
    "compare",
    "convert",
    "cut_roads",
    "drive_connections",
    "format_of",
    "info",
    "read_map",
    "repair",
]  # fmt: skip


class MapInfo(NamedTuple):
    """Summary of a map.

    Attributes:
        format: name in `FORMATS`.
        lanes: number of lanes.
        lengths: length (m) of lanes by type, longest first.
        limits: length (m) of lanes for vehicles by speed limit (km/h, or "none").
        roads, junctions: numbers; of an OpenDRIVE map, else None.
        signals: number of signals by kind.
        bounds: west, south, east, north, m.
        heights: lowest and highest, m.
        projection, offset: as in `LaneMap`.
        corner: latitude and longitude (degrees) of the south-western corner; None without a projection.
        left_hand: whether traffic keeps to the left.
        notes: what was assumed, one sentence each.
    """

    format: str
    lanes: int
    lengths: dict[str, float]
    limits: dict[str, float]
    roads: int | None
    junctions: int | None
    signals: dict[str, int]
    bounds: tuple[float, float, float, float]
    heights: tuple[float, float]
    projection: str | None
    offset: tuple[float, float, float, float]
    corner: tuple[float, float] | None
    left_hand: bool
    notes: list[str]

    def as_json(self) -> dict[str, Any]:
        """The summary as plain values."""
        return self._asdict()


def info(path: str | PathLike[str], *, origin: tuple[float, float] | None = None) -> MapInfo:
    """Describe a map.

    Args:
        origin: latitude and longitude (degrees) of the origin of Lanelet2's UTM coordinates.

    Raises:
        InvalidFile: it is malformed; names file, line and element.
        UsageError: its format is not known.

    Example:
        >>> import xosc_toolchain as xt
        >>> about = xt.road.info("xodr/library/sharp_curve.xodr")
        >>> about.roads, round(about.lengths["driving"])
        (1, 1438)
    """
    file = Path(path)
    kind = format_of(file)
    made = read_map(file, origin, kind)
    lengths, limits, signals = (
        defaultdict[str, float](float),
        defaultdict[str, float](float),
        defaultdict[str, int](int),
    )
    for lane in made.lanes.values():
        lengths[lane.type] += lane.length
        if lane.type == "driving":
            limits["none" if lane.limit is None else f"{lane.limit * 3.6:.0f}"] += lane.length
    for signal in made.signals:
        signals[signal.kind] += 1
    points = np.vstack(
        [line for lane in made.lanes.values() for line in (lane.left, lane.right)]
        or [np.zeros((1, 3))]
    )
    west, south, low = points.min(axis=0).tolist()
    east, north, high = points.max(axis=0).tolist()
    projector, corner = Projector.of(made), None
    if projector is not None:
        longitude, latitude, _ = projector.to_geodetic(np.array([[west, south, 0.0]]))
        corner = (float(latitude[0]), float(longitude[0]))
    network = load(file) if kind == "opendrive" else None
    notes = made.notes + (
        [str(remark) for remark in network.remarks] if network is not None else []
    )
    return MapInfo(
        kind, len(made.lanes), dict(sorted(lengths.items(), key=lambda item: -item[1])), dict(sorted(limits.items())),
        len(network.roads) if network is not None else None, len(network.junctions) if network is not None else None,
        dict(signals), (west, south, east, north), (low, high), made.projection, made.offset, corner, made.left_hand, notes,
    )  # fmt: skip


def compare(
    one: str | PathLike[str],
    other: str | PathLike[str],
    *,
    origin: tuple[float, float] | None = None,
) -> MapDifference:
    """Compare two maps of one place, of any formats: an old and a new version, a source and a conversion.

    Coordinates of both are taken as they are; where both have projections, those of the second are turned into the first's.

    Args:
        origin: latitude and longitude (degrees) of the origin of Lanelet2's UTM coordinates.

    Raises:
        InvalidFile, UsageError: as in `info`.
    """
    first, second = (_read(Path(path), origin) for path in (one, other))
    return compare_maps(first, _aligned(second, first))


def _read(path: Path, origin: tuple[float, float] | None) -> LaneMap:
    kind = format_of(path)
    return read_map(path, origin if kind == "lanelet2" else None, kind)


def _aligned(one: LaneMap, like: LaneMap) -> LaneMap:
    """A map in the coordinates of another one, where both have a projection and these differ."""
    if one.projection is None or like.projection is None:
        return one
    if (one.projection, one.offset) == (like.projection, like.offset):
        return one
    here, there = Projector.of(one), Projector.of(like)
    assert here is not None and there is not None
    for lane in one.lanes.values():
        for side in ("left", "right"):
            line = getattr(lane, side)
            setattr(lane, side, there.to_map(np.column_stack(here.to_geodetic(line))))
        lane.__dict__.pop("centre", None)
        lane.__dict__.pop("length", None)
    return one


def cut_roads(
    path: str | PathLike[str],
    *,
    box: tuple[float, float, float, float] | None = None,
    polygon: Sequence[tuple[float, float]] | None = None,
    roads: Sequence[str] | None = None,
) -> tuple[bytes, list[str]]:
    """Cut whole roads out of an OpenDRIVE map, with the links to all others closed.

    Args:
        box: west, south, east, north (m): roads that touch it stay.
        polygon: corners (m) of an area, likewise.
        roads: ids of roads that stay, and the ways through junctions between them.

    Returns:
        The content of the file, and what became of what led beyond, one sentence each.

    Raises:
        UsageError: not one of the three is given, or no road stays.
    """
    file = Path(path)
    if sum(each is not None for each in (box, polygon, roads)) != 1:
        raise UsageError("state one of box, polygon and roads")
    network = load(file)
    if roads is not None:
        return cut(file, along(network, roads))
    if box is not None:
        west, south, east, north = box
        polygon = [(west, south), (east, south), (east, north), (west, north)]
    assert polygon is not None
    return cut(file, within(network, polygon))


class Repaired(NamedTuple):
    """A repaired map: the content of its file, and each repair with its rule and line."""

    content: bytes
    remarks: list[str]


def repair(path: str | PathLike[str]) -> Repaired:
    """Make the repairs of an OpenDRIVE file that loading makes in memory; all else stays as it was written.

    Raises:
        InvalidFile: it has a fault that has no sensible mend.
    """
    from lxml import etree

    from schemas.common.remarks import Remark
    from xodr.reader.repairs import repair as mend

    file = Path(path)
    load(file)  # refuses what can't be mended
    outside: list[Remark] = []
    root = parse(file, outside).getroot()
    found = [*outside, *mend(root, file)]
    content = etree.tostring(root.getroottree(), xml_declaration=True, encoding="UTF-8")
    return Repaired(content, [str(remark) for remark in found])
