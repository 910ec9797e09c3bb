"""Maps as files of their own: converted, compared, described, cut, shown; `xosc_toolchain.road` and
the command `xosc-road`.

A map is read into lanes (`xodr.formats.maps.lane_map.LaneMap`) whatever its format is.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from lxml import etree

from schemas.common.errors import UsageError
from schemas.common.terminal.text import finite_number
from schemas.common.xml import parse
from xodr.formats.maps.comparing import Distances, MapDifference
from xodr.formats.maps.comparing import compare as compare_maps
from xodr.formats.maps.converting import FORMATS, MapConversion, convert, format_of, read_map
from xodr.formats.maps.editing.cut import along, cut, on_way, within
from xodr.formats.maps.editing.joining import join
from xodr.formats.maps.editing.placing import MapMotion, place
from xodr.formats.maps.editing.tree import EditedRoads
from xodr.formats.maps.lane_map import LaneMap, MapLane, MapSignal
from xodr.formats.maps.page import MapFinding
from xodr.formats.maps.projecting import Projector
from xodr.formats.sumo_net.driving import ConnectionDrive, drive_connections
from xodr.graph.network import RoadNetwork
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
    "faults",
    "format_of",
    "info",
    "join_maps",
    "place_map",
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
        limited: the roads of an OpenDRIVE map, else the lanes, that have such lanes, by limit.
        roads, junctions: numbers; of an OpenDRIVE map, else None.
        signals: number of signals by kind.
        furniture: number of crosswalks, stop lines and poles, and of other objects by type.
        bounds: west, south, east, north, m.
        heights: lowest and highest, m.
        projection, offset: as in `LaneMap`.
        corner: latitude and longitude (degrees) of the south-western corner; None without a
            projection.
        left_hand: whether traffic keeps to the left.
        notes: what was assumed, one sentence each.
    """

    format: str
    lanes: int
    lengths: dict[str, float]
    limits: dict[str, float]
    limited: dict[str, list[str]]
    roads: int | None
    junctions: int | None
    signals: dict[str, int]
    furniture: dict[str, int]
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
    limited = defaultdict[str, dict[str, None]](dict)
    for name, lane in made.lanes.items():
        lengths[lane.type] += lane.length
        if lane.type == "driving":
            limit = "none" if lane.limit is None else f"{lane.limit * 3.6:.0f}"
            limits[limit] += lane.length
            # Lanes of OpenDRIVE are named ROAD/SECTION/LANE.
            limited[limit][name.rsplit("/", 2)[0] if kind == "opendrive" else name] = None
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
    # Roads and junctions are OpenDRIVE's alone; other formats have lanes.
    network = load(file) if kind == "opendrive" else None
    notes = made.notes + (
        [str(remark) for remark in network.remarks] if network is not None else []
    )
    return MapInfo(
        kind, len(made.lanes), dict(sorted(lengths.items(), key=lambda item: -item[1])),
        dict(sorted(limits.items())), {limit: [*places] for limit, places in limited.items()},
        len(network.roads) if network is not None else None,
        len(network.junctions) if network is not None else None,
        dict(signals), _furniture(made), (west, south, east, north), (low, high),
        made.projection, made.offset, corner, made.left_hand, notes,
    )  # fmt: skip


def _furniture(made: LaneMap) -> dict[str, int]:
    counts = {
        "crosswalks": len(made.crosswalks), "stop lines": len(made.stop_lines),
        "poles": len(made.poles), **made.objects,
    }  # fmt: skip
    return {name: count for name, count in counts.items() if count}


def faults(path: str | PathLike[str]) -> tuple[list[MapFinding], list[str]]:
    """Findings of `xosc-check` in an OpenDRIVE file: with a place on the map, and without one."""
    import schemas

    network, located, elsewhere = load(path), list[MapFinding](), list[str]()
    # By the paths of the problems: the reader of roads keeps no elements.
    tree = parse(Path(path), []).getroot()
    for problem in schemas.check(path):
        place = _place(tree, network, problem.element or "")
        # Problems of the header and of junctions have no place.
        if place is None:
            elsewhere.append(str(problem))
        else:
            text = f"line {problem.line}: {problem.level}: {problem.message}"
            located.append(MapFinding(*place, text))
    return located, elsewhere


def _place(root: etree._Element, network: RoadNetwork, element: str) -> tuple[float, float] | None:
    """Place of the road of an element, at its s; None for those of no road."""
    try:
        elements = root.xpath(element) if element else []
    except etree.XPathError:  # a text that is no path
        elements = []
    first = elements[0] if isinstance(elements, list) and elements else None
    if not isinstance(first, etree._Element):
        return None
    chain = [first, *first.iterancestors()]
    road = next((network.roads.get(one.get("id", "")) for one in chain if one.tag == "road"), None)
    if road is None:
        return None
    # Offsets from a section's s are short beside a map: the section is near enough.
    texts = [one.get("s", "") for one in chain]
    s = next((value for text in texts if (value := finite_number(text)) is not None), 0.0)
    x, y = road.pose(min(max(s, 0.0), road.length), 0.0)[:2]
    return x, y


def compare(
    one: str | PathLike[str],
    other: str | PathLike[str],
    *,
    origin: tuple[float, float] | None = None,
) -> MapDifference:
    """Compare two maps of one place, of any formats: an old and a new version, a source and a
    conversion.

    Coordinates of both are taken as they are; where both have projections, those of the second are
    turned into the first's.

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
        # Both are kept once worked out, from the borders that were just replaced.
        lane.__dict__.pop("centre", None)
        lane.__dict__.pop("length", None)
    return one


def cut_roads(
    path: str | PathLike[str],
    *,
    box: tuple[float, float, float, float] | None = None,
    polygon: Sequence[tuple[float, float]] | None = None,
    roads: Sequence[str] | None = None,
    route: Sequence[str] | None = None,
) -> tuple[bytes, list[str]]:
    """Cut whole roads out of an OpenDRIVE map, with the links to all others closed.

    Args:
        box: west, south, east, north (m): roads that touch it stay.
        polygon: corners (m) of an area, likewise.
        roads: ids of roads that stay, and the ways through junctions between them.
        route: ids of roads that a way leads over: the roads of the shortest one stay.

    Returns:
        The content of the file, and what became of what led beyond, one sentence each.

    Raises:
        UsageError: not one of the four is given, or no road stays.
    """
    file = Path(path)
    if sum(choice is not None for choice in (box, polygon, roads, route)) != 1:
        raise UsageError("state one of box, polygon, roads and route")
    network = load(file)
    if roads is not None:
        return cut(file, along(network, roads))
    if route is not None:
        return cut(file, on_way(network, route))
    if box is not None:
        west, south, east, north = box
        polygon = [(west, south), (east, south), (east, north), (west, north)]
    assert polygon is not None
    return cut(file, within(network, polygon))


def place_map(
    path: str | PathLike[str],
    *,
    move: tuple[float, float, float] = (0.0, 0.0, 0.0),
    turn: float = 0.0,
    about: tuple[float, float] = (0.0, 0.0),
    projection: str | None = None,
    without_offset: bool = False,
    elsewhere: bool = False,
) -> tuple[bytes, list[str]]:
    """Move and turn the coordinates of an OpenDRIVE map, or give it another projection.

    The header's offset is changed with them, so that the map stays where it is on earth.

    Args:
        move: x, y and z, m, after the turn.
        turn: angle, rad.
        about: x and y of the place that it is turned about, m.
        projection: PROJ string or code that takes the place of that of the file. The offset is the
            turn and move that fit best; what is left, since scales differ, is a note.
        without_offset: make the offset part of the coordinates, for readers that do not look at it.
        elsewhere: keep projection and offset, so that the map lies elsewhere on earth.

    Returns:
        The content of the file, and what was assumed or is left, one sentence each.

    Raises:
        InvalidFile: it is malformed; names file, line and element.
        Unsupported: it has a surface in coordinates of its own (CRG, mode global).
        UsageError: it has no projection that another could replace, a number is not finite, or
            PROJ does not understand the projection.
    """
    if not np.isfinite([*move, turn, *about]).all():
        raise UsageError("places and angles are finite numbers")
    motion = MapMotion.about(about, turn, move)
    return place(
        Path(path),
        motion,
        projection=projection,
        without_offset=without_offset,
        elsewhere=elsewhere,
    )


def join_maps(
    paths: Sequence[str | PathLike[str]], *, within: float = 0.05
) -> tuple[bytes, list[str]]:
    """Join OpenDRIVE maps to one, with ids that are unique and open ends that meet linked.

    Args:
        paths: two files or more; the first gives coordinates, projection and header.
        within: distance (m) of lane borders that meet.

    Returns:
        The content of the file, and what became of ids, coordinates and ends, one sentence each.

    Raises:
        InvalidFile: one is malformed; names file, line and element.
        Unsupported: one that has to be moved has a surface in coordinates of its own.
        UsageError: there are fewer than two.
    """
    return join([Path(path) for path in paths], within)


class Repaired(NamedTuple):
    """A repaired map: the content of its file, and each repair with its rule and line."""

    content: bytes
    remarks: list[str]


def repair(path: str | PathLike[str]) -> Repaired:
    """Make the repairs of an OpenDRIVE file that loading makes in memory; all else stays as it was
    written.

    Raises:
        InvalidFile: it has a fault that has no sensible mend.
    """
    file = EditedRoads(path)
    return Repaired(file.content(), file.remarks)
