"""OpenDRIVE files of sites: where they are, or made of what the data set has instead."""

from __future__ import annotations

import tempfile
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from recognition.datasets import Source
from recognition.datasets.formats import interaction, ngsim, runs
from recognition.datasets.formats.commonroad import files as commonroad
from recognition.datasets.formats.commonroad import lanelets
from recognition.datasets.formats.commonroad.elements import invalid
from recognition.datasets.roads.straight import straight_road
from runner.recording import Recording
from schemas.errors import UsageError
from schemas.storage import digest, keep, writing


class Map(NamedTuple):
    """An OpenDRIVE file, and the roads in it that traffic lights are for, where something else tells so."""

    path: Path
    lights: frozenset[str] = frozenset()


def map_of(source: Source, recording: Recording, folder: Path) -> Map:
    """The map of a recording, made in `folder` where there is none as OpenDRIVE.

    Raises:
        InvalidFile: a file is malformed, or a run's road is not where it was.
        UsageError: nothing tells of the roads, or the folder can't be written.
    """
    beside = source.path.parent / f"{source.site}.xodr"
    if recording.network is not None:
        return Map(Path(recording.network.path))
    if source.format == runs.FORMAT:
        return Map(runs.road(source.path))
    if beside.is_file():
        return Map(beside)
    with writing("the road", folder):
        if source.format == interaction.FORMAT and source.map is not None:
            return Map(_converted(source.map, source.map.stat().st_mtime_ns, source.origin, folder))
        if source.format == commonroad.FORMAT:
            return _of_lanelets(source, folder)
        if source.format == ngsim.FORMAT:
            content = straight_road(recording, source.site).to_xml()
            return Map(keep(content, folder / f"{_plain(source.site)}-{digest(content)}.xodr"))
    what = f"{source.name} has no map: neither {beside.name} beside it nor a Lanelet2 map {source.site}.osm"
    raise UsageError(what, path=source.path)


def _plain(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name)


@lru_cache(maxsize=64)
def _converted(osm: Path, _version: int, origin: tuple[float, float] | None, folder: Path) -> Path:
    """A Lanelet2 map; named by its own content, so that roles that a person edited stay with it."""
    from xodr.lanelet2 import convert

    target = folder / f"{osm.stem}-{digest(osm.read_bytes() + repr(origin).encode())}.xodr"
    with tempfile.TemporaryDirectory() as drafts:
        return keep(convert(osm, origin, Path(drafts) / target.name).path.read_bytes(), target)


def _of_lanelets(source: Source, folder: Path) -> Map:
    """The map that a CommonRoad scenario brings along. Its lanelets have no speed limits, and "urban" is what all of them say."""
    from xodr.lanelet2 import Lanelet, Neighbour, build

    root = commonroad.document(source)
    found = lanelets.lanelets(root)
    if not found:
        raise invalid(root, "there is no lanelet, so nothing tells of the roads")

    def beside(neighbour: lanelets.Neighbour | None) -> Neighbour | None:
        return None if neighbour is None else Neighbour(neighbour.id, neighbour.same_direction)

    built = build(
        [
            Lanelet(
                one.id, one.left, one.right, one.predecessors, one.successors, beside(one.beside_left), beside(one.beside_right),
                _lane_type(one.types), "motorway" if set(one.types) & _MOTORWAY else "unknown", float("inf"),
            )
            for one in found
        ],
        source.site,
    )  # fmt: skip
    content = built.map.to_xml()
    lit = [element.get("id") for element in root.iterchildren("lanelet") if element.find("trafficLightRef") is not None]
    lights = frozenset(built.lanelets[one][0] for one in lit if one in built.lanelets)
    return Map(keep(content, folder / f"{_plain(source.site)}-{digest(content)}.xodr"), lights)


_MOTORWAY = {"highway", "interstate", "mainCarriageWay", "accessRamp", "exitRamp"}
_LANE_TYPES = {
    "sidewalk": "sidewalk", "crosswalk": "sidewalk", "bicycleLane": "biking", "busLane": "bus", "shoulder": "shoulder",
    "accessRamp": "onRamp", "exitRamp": "offRamp", "border": "border",
}  # fmt: skip


def _lane_type(types: tuple[str, ...]) -> str:
    return next((_LANE_TYPES[one] for one in types if one in _LANE_TYPES), "driving")
