"""OpenDRIVE files moved and turned, and given another projection.

A motion takes a place p (x, y in m) of the old coordinates to R(turn) p + (x, y) in the new ones;
heights rise by z. The header's offset takes coordinates to those of the projection (OpenDRIVE
8.5). It is changed with the coordinates, so that a map stays where it is on earth.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lxml import etree

from schemas.common.array_types import FloatArray
from schemas.common.errors import InvalidFile, Unsupported, UsageError
from schemas.common.terminal.text import finite_number
from schemas.common.xml import line_of
from xodr.formats.maps.editing.tree import EditedRoads, number
from xodr.formats.maps.projecting import Projector
from xodr.graph.network import RoadNetwork
from xodr.lookup.arrays import sample, stations
from xodr.reader import load

Offset = tuple[float, float, float, float]
_NONE: Offset = (0.0, 0.0, 0.0, 0.0)


class MapMotion(NamedTuple):
    """A turn (rad, about the origin), and then a move (m)."""

    turn: float = 0.0
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    @classmethod
    def about(
        cls, center: tuple[float, float], turn: float, move: tuple[float, float, float]
    ) -> MapMotion:
        """A turn (rad) about a place (m), and then a move (m)."""
        x, y = cls(turn).place(*center)
        return cls(turn, center[0] - x + move[0], center[1] - y + move[1], move[2])

    def place(self, x: float, y: float) -> tuple[float, float]:
        """New coordinates (m) of a place."""
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        return cos * x - sin * y + self.x, sin * x + cos * y + self.y

    def offset(self, old: Offset) -> Offset:
        """The header's offset that keeps the coordinates of the projection."""
        heading = old[3] - self.turn
        x, y = MapMotion(heading).place(self.x, self.y)
        return old[0] - x, old[1] - y, old[2] - self.z, heading


def place(
    path: Path,
    motion: MapMotion | None = None,
    *,
    projection: str | None = None,
    without_offset: bool = False,
    elsewhere: bool = False,
) -> tuple[bytes, list[str]]:
    """An OpenDRIVE file in other coordinates, and what that means for it, one sentence each.

    Args:
        motion: of the coordinates; none where it is None.
        projection: PROJ string or code that takes the place of the one that the file names. The
            offset then is the turn and move that fit best: scales of projections differ, and the
            largest rest is a note.
        without_offset: make the offset part of the coordinates, after all else: for readers that do
            not look at it.
        elsewhere: keep projection and offset as they are, so that the map lies elsewhere on earth.

    Raises:
        InvalidFile: it is no OpenDRIVE file; names file, line and element.
        Unsupported: it has a surface in coordinates of its own (CRG, mode global).
        UsageError: it has no projection that another could take the place of.
    """
    network = load(path)
    file = EditedRoads(path)
    root, notes = file.root, list(file.remarks)
    offset = network.header.offset
    motion = motion or MapMotion()
    reference = network.geo_reference
    if not elsewhere and (reference is not None or offset != _NONE):
        offset = motion.offset(offset)
    if projection is not None:
        if reference is None:
            raise UsageError("it names no projection that another could replace", path=path)
        moved = np.array([motion.place(x, y) for x, y in places(network)])
        offset, rest = _fit(moved, Projector(reference, offset), projection, offset[2])
        notes.append(f"the offset of the new projection fits all places within {rest:.4f} m")
        reference = projection
    if without_offset and offset != _NONE:
        last = MapMotion(offset[3], *offset[:3])
        x, y = last.place(motion.x, motion.y)
        motion = MapMotion(motion.turn + last.turn, x, y, motion.z + last.z)
        offset = _NONE
    if motion != MapMotion():
        notes += move(file, motion)
    _write_header(root, reference, offset)
    if reference is None and offset == _NONE:
        notes.append("the file names no projection: it has no place on earth")
    if root.find(".//userData") is not None:
        notes.append("userData stays as it is written, whatever places it names")
    return file.content(), notes


def places(network: RoadNetwork) -> FloatArray:
    """Places (n, 2) on all reference lines, m."""
    lines = [sample(road, stations(road, 50.0))[:, :2] for road in network.roads.values()]
    return np.vstack(lines)


def best_motion(places: FloatArray, targets: FloatArray) -> tuple[MapMotion, float]:
    """The turn and move that take places (n, 2) nearest to others, by least squares, and the
    largest rest (m)."""
    middle, there = places.mean(axis=0), targets.mean(axis=0)
    one, other = places - middle, targets - there
    turn = math.atan2(
        float((one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]).sum()), float((one * other).sum())
    )
    x, y = MapMotion(turn).place(*middle.tolist())
    motion = MapMotion(turn, float(there[0]) - x, float(there[1]) - y)
    cos, sin = math.cos(turn), math.sin(turn)
    reached = places @ np.array([[cos, sin], [-sin, cos]]) + (motion.x, motion.y)
    return motion, float(np.hypot(*(reached - targets).T).max())


def _fit(
    places: FloatArray, old: Projector, projection: str, height: float
) -> tuple[Offset, float]:
    flat = np.column_stack([places, np.zeros(len(places))])
    wanted = Projector(projection, _NONE).to_map(np.column_stack(old.to_geodetic(flat)))[:, :2]
    if not np.isfinite(wanted).all():
        raise UsageError(f"the projection {projection!r} does not reach this map")
    motion, rest = best_motion(places, wanted)
    return (motion.x, motion.y, height, motion.turn), rest


def _write_header(root: etree._Element, reference: str | None, offset: Offset) -> None:
    header = root.find("header")
    assert header is not None  # loading refuses files without
    found = header.find("geoReference")
    if reference is not None and (found is None or (found.text or "").strip() != reference):
        found = etree.SubElement(header, "geoReference") if found is None else found
        found.text = etree.CDATA(reference)
    element = header.find("offset")
    if offset == _NONE:
        if element is not None:
            header.remove(element)
        return
    if element is None:
        element = etree.Element("offset")
        header.insert(0 if found is None else header.index(found) + 1, element)
    for name, value in zip(("x", "y", "z", "hdg"), offset, strict=True):
        element.set(name, repr(value))


def move(file: EditedRoads, motion: MapMotion) -> list[str]:
    """Move and turn all roads of a file, but not the header's offset; what that leaves open, one
    sentence each.

    Raises:
        Unsupported: it has a surface in coordinates of its own (CRG, mode global).
    """
    root = file.root
    for surface in root.iter("CRG"):
        if surface.get("mode") == "global":
            raise Unsupported(
                "CRG with mode='global' has coordinates of its own: the map can't be moved with it",
                path=file.path, line=line_of(surface),
            )  # fmt: skip
    for element in (*root.iterfind(".//planView/geometry"), *root.iter("positionInertial")):
        x, y = motion.place(*(number(element, name, file.path) for name in ("x", "y")))
        element.set("x", repr(x))
        element.set("y", repr(y))
        element.set("hdg", repr(number(element, "hdg", file.path) + motion.turn))
    if motion.z:
        _raise(file, motion.z)
    return list(_bounds(file, motion))


def _raise(file: EditedRoads, z: float) -> None:
    root, path = file.root, file.path
    for element in root.iter("positionInertial"):
        element.set("z", repr(number(element, "z", path) + z))
    for road in root.iterfind("road"):
        records = road.findall("elevationProfile/elevation")
        if not records or number(records[0], "s", path) > 0.0:
            profile = road.find("elevationProfile")
            if profile is None:
                profile = etree.Element("elevationProfile")
                plan = road.find("planView")
                assert plan is not None  # loading refuses roads without
                plan.addnext(profile)
            first = etree.Element("elevation", s="0", a="0", b="0", c="0", d="0")
            profile.insert(0, first)
            records.insert(0, first)
        for record in records:
            record.set("a", repr(number(record, "a", path) + z))
    for grid in root.iterfind("junction/elevationGrid/elevation"):
        for name in ("left", "center", "right"):
            if name not in grid.attrib:
                continue
            heights = [finite_number(part) for part in grid.get(name, "").split()]
            if None in heights:
                raise InvalidFile(
                    f"{name}={grid.get(name)!r}: numbers are expected",
                    path=path, line=line_of(grid), element="elevation",
                )  # fmt: skip
            grid.set(name, " ".join(repr(height + z) for height in heights if height is not None))


def _bounds(file: EditedRoads, motion: MapMotion) -> Iterator[str]:
    """Bounds of the header: those of the old ones' moved corners."""
    header = file.root.find("header")
    names = ("west", "south", "east", "north")
    if header is None or any(header.get(name) is None for name in names):
        return
    west, south, east, north = (number(header, name, file.path) for name in names)
    if west == east == south == north == 0.0:  # many files leave them at 0
        return
    corners = [motion.place(x, y) for x in (west, east) for y in (south, north)]
    for name, value in zip(names, bounds(corners), strict=True):
        header.set(name, repr(value))
    if motion.turn:
        yield "the header's bounds are those of the turned box, and may be wider than the map"


def bounds(corners: Iterable[tuple[float, float]]) -> tuple[float, float, float, float]:
    """West, south, east and north (m) of places."""
    xs, ys = zip(*corners, strict=True)
    return min(xs), min(ys), max(xs), max(ys)
