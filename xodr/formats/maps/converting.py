"""Conversion of maps between formats, with the error that it makes: the result is read back and
compared with the source."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from schemas.common.errors import InvalidFile, Unsupported, UsageError, guess
from schemas.common.fates import LOST, Fates, changed, kept, lost
from schemas.common.policy import scratch
from schemas.common.storage import keep, writing
from schemas.common.xml import parse
from xodr.formats import commonroad, geojson, opendrive, sumo
from xodr.formats.lanelet2 import lanes as lanelet2
from xodr.formats.maps import lane_map
from xodr.formats.maps.comparing import MapDifference, compare
from xodr.formats.maps.editing.changes import Version
from xodr.formats.maps.editing.versions import in_version, version_of
from xodr.formats.maps.lane_map import LaneMap
from xodr.formats.maps.projecting import Projector
from xodr.formats.sumo_net.building import osm_network
from xodr.reader import load

FORMATS = {
    "opendrive": "ASAM OpenDRIVE, .xodr",
    "lanelet2": "Lanelet2, .osm with lanelets",
    "sumo": "SUMO network, .net.xml",
    "commonroad": "CommonRoad map, .xml",
    "geojson": "GeoJSON of lanes, borders and signals, .geojson",
    "openstreetmap": "OpenStreetMap, .osm; read by SUMO's netconvert, roughly; not written",
}
"""Formats by name."""

MAP_FIELDS = {
    "lane borders": "",
    "centre lines": "",
    "heights": "elevation, superelevation, lane heights",
    "lane types": "",
    "road types": "",
    "speed limits": "",
    "road marks": "",
    "lane links": "",
    "neighbours": "",
    "junctions": "",
    "junction priorities": "",
    "crosswalks": "",
    "traffic lights": "",
    "signs": "",
    "stop lines": "",
    "poles": "",
    "other objects": "trees, barriers, buildings",
    "projection": "",
    "offset": "with height and heading",
    "rule of traffic": "right, left",
    "names and ids": "of roads and lanes",
    "lateral profiles": "reference lines, lane sections",
}
"""Fields of a map; `FATES` has the fate of each in every format that is written."""
_TYPES = "types that the format has; others are left out or the nearest"
FATES: Mapping[str, Fates] = {
    "opendrive": {
        "lane borders": kept("within 5 cm"), "centre lines": kept("within 5 cm"),
        "heights": kept("within 5 cm"), "lane types": kept(), "road types": kept(),
        "speed limits": kept(), "road marks": changed("types; not colours, widths"),
        "lane links": kept(),
        "neighbours": changed("of lanes that lead the same way"), "junctions": kept(),
        "junction priorities": kept(),
        "crosswalks": kept("outlines on the road's surface"), "traffic lights": kept(),
        "signs": kept("beside their lanes"), "stop lines": kept("objects `roadMark`"),
        "poles": kept("`pole`"), "other objects": lost("lanes have none"),
        "projection": kept(),
        "offset": kept(), "rule of traffic": changed("roads are one-way, right-hand"),
        "names and ids": changed("new ids; names of lanes are in the names of roads"),
        "lateral profiles": changed("one road for each bundle of lanes"),
    },
    "lanelet2": {
        "lane borders": kept("ways"), "centre lines": kept("between the ways"),
        "heights": kept("`ele`"),
        "lane types": kept("subtypes, areas, tag `lane_type`"),
        "road types": kept("`location`, tag `road_type`"),
        "speed limits": kept("`speed_limit`"),
        "road marks": changed("thin lines; not colours, widths"),
        "lane links": kept("shared nodes"),
        "neighbours": changed("shared ways: not across a kerb"),
        "junctions": lost("Lanelet2 has none; lanelets cross"),
        "junction priorities": kept("`right_of_way`"), "crosswalks": kept("lanelets `crosswalk`"),
        "traffic lights": kept("`traffic_light`"), "signs": kept("`traffic_sign`"),
        "stop lines": kept("`stop_line`, `ref_line` of rules"),
        "poles": kept("nodes `pole`"), "other objects": lost("lanes have none"),
        "projection": kept("latitudes, longitudes"), "offset": kept("`local_x`, `local_y`"),
        "rule of traffic": lost("directions say it"), "names and ids": changed("tag `name`"),
        "lateral profiles": lost("lanelets have none"),
    },
    "sumo": {
        "lane borders": changed("one width for SUMO; exact in parameters `border.left`, "
                                "`border.right`"),
        "centre lines": kept("shapes"), "heights": kept("shapes"),
        "lane types": kept("`type`, `allow`"),
        "road types": lost("no attribute"), "speed limits": kept("`speed`"),
        "road marks": lost("SUMO has none"),
        "lane links": kept("connections"), "neighbours": changed("lanes of an edge"),
        "junctions": changed("netconvert's nodes"),
        "junction priorities": lost("netconvert ranks roads"),
        "crosswalks": lost("netconvert makes its own"),
        "traffic lights": changed("programs of netconvert; not the place of lights"),
        "signs": lost("SUMO has none"),
        "stop lines": changed("`stopOffset` of lanes outside junctions"),
        "poles": lost("networks have none"), "other objects": lost("networks have none"),
        "projection": kept("`projParameter`"),
        "offset": changed("`netOffset`; not height and turn, which lose the projection"),
        "rule of traffic": kept("`lefthand`"),
        "names and ids": kept("`origId`"), "lateral profiles": lost("networks have none"),
    },
    "commonroad": {
        "lane borders": kept("bounds"), "centre lines": kept("between the bounds"),
        "heights": kept("z of points"),
        "lane types": changed(_TYPES), "road types": changed("urban, country, interstate"),
        "speed limits": kept("sign 274"),
        "road marks": changed("types; not colours, widths"), "lane links": kept("`successor`"),
        "neighbours": kept("`adjacentLeft`, `adjacentRight`"),
        "junctions": changed("type intersection of lanelets"),
        "junction priorities": lost("not written"), "crosswalks": kept("lanelets `crosswalk`"),
        "traffic lights": changed("place and lanes; without phases"),
        "signs": lost("but for speed limits of lanes"),
        "stop lines": kept("`stopLine` of lanelets"),
        "poles": changed("pillars; without height"), "other objects": lost("lanes have none"),
        "projection": kept("`geoReference`"), "offset": changed("without height"),
        "rule of traffic": lost("directions say it"),
        "names and ids": lost("numbers"), "lateral profiles": lost("lanelets have none"),
    },
    "geojson": {
        "lane borders": kept("`border`"), "centre lines": kept("`centre`"),
        "heights": kept("third coordinate"),
        "lane types": kept(), "road types": kept(), "speed limits": kept(), "road marks": kept(),
        "lane links": kept("`successors`"),
        "neighbours": kept("`left`, `right`"), "junctions": changed("a property of lanes"),
        "junction priorities": kept("`priorities`"),
        "crosswalks": kept("areas"), "traffic lights": kept("points"),
        "signs": kept("points"), "stop lines": kept("lines"),
        "poles": kept("points"), "other objects": lost("lanes have none"),
        "projection": kept("and WGS 84 coordinates"), "offset": kept(),
        "rule of traffic": kept(), "names and ids": kept("`id`: road/section/lane"),
        "lateral profiles": lost("lanes only"),
    },
}  # fmt: skip


@dataclass(eq=False)
class MapConversion:
    """A converted map.

    Attributes:
        path: the file that was written.
        source_format, target_format: names in `FORMATS`.
        notes: what was assumed, changed or left out, one sentence each.
        difference: between source and result, which was read back.
        source, result: the lanes of both.
    """

    path: Path
    source_format: str
    target_format: str
    notes: list[str]
    difference: MapDifference
    source: LaneMap
    result: LaneMap


def format_of(path: Path) -> str:
    """The format of a file: by its name, and where that leaves a choice by its content.

    Raises:
        UsageError: no format has such a name.
        InvalidFile: it can't be read.
    """
    name = path.name.lower()
    for ending, kind in (
        (".xodr", "opendrive"),
        (".net.xml", "sumo"),
        (".geojson", "geojson"),
        (".json", "geojson"),
    ):
        if name.endswith(ending):
            return kind
    if name.endswith(".osm"):
        # A name to be written: of the two formats with this ending only one is written.
        if not path.exists():
            return "lanelet2"
        root = parse(path).getroot()
        # Both formats are XML of OpenStreetMap; only Lanelet2 has relations of this type.
        lanelets = any(
            tag.get("k") == "type" and tag.get("v") == "lanelet"
            for tag in root.iterfind("relation/tag")
        )
        return "lanelet2" if lanelets else "openstreetmap"
    if name.endswith(".xml"):
        root_tag = parse(path).getroot().tag if path.exists() else "commonRoad"
        kinds = {"commonRoad": "commonroad", "net": "sumo", "OpenDRIVE": "opendrive"}
        if str(root_tag) in kinds:
            return kinds[str(root_tag)]
        raise InvalidFile(
            f"the root element {root_tag!r} is of no map format that is known", path=path
        )
    raise UsageError(
        f"the format of {path.name!r} is not known; {_ending_meant(name)}names end in .xodr, .osm,"
        " .net.xml, .xml or .geojson"
    )


_ENDINGS = {
    "opendrive": ".xodr", "odr": ".xodr", "xodrz": ".xodr", "lanelet2": ".osm", "autoware": ".osm",
    "openstreetmap": ".osm", "sumo": ".net.xml", "net": ".net.xml", "commonroad": ".xml",
    "geojson": ".geojson", "gis": ".geojson", "qgis": ".geojson",
}  # fmt: skip
"""Endings of names by words for their formats"""


def _ending_meant(name: str) -> str:
    """The question for the ending that a name without a known one may mean."""
    word = name.rpartition(".")[2]
    return guess(_ENDINGS.get(word, f".{word}"), _ENDINGS.values())


def read_map(
    path: Path, origin: tuple[float, float] | None = None, format: str | None = None
) -> LaneMap:
    """The lanes of a map.

    Args:
        origin: latitude and longitude (degrees) of the origin of Lanelet2's UTM coordinates.
        format: name in `FORMATS`; None: found by `format_of`.

    Raises:
        InvalidFile: the file is malformed; names file, line and element.
        UsageError: there is no such format.
    """
    kind = format or format_of(path)
    if origin is not None and kind != "lanelet2":
        raise UsageError(f"an origin is for Lanelet2 maps; this is {kind}", path=path)
    if kind == "opendrive":
        made = lane_map.of_network(load(path))
    else:
        made = _read_lanes(path, origin, kind)
    _check_size(made, path)
    try:
        Projector.of(made)
    except UsageError as error:  # PROJ reads no file for it
        # A map is as good without its place on Earth; coordinates stay what they are.
        made.projection = None
        made.notes.append(f"{error.message}; it is left out")
    if kind == "opendrive":
        return made
    # Of OpenDRIVE sides follow from the signs of lanes: there they can't be exchanged.
    crossed = [lane.id for lane in made.lanes.values() if lane_map.sides_exchanged(lane)]
    if crossed:
        made.notes.append(
            f"the left border lies to the right of the right one on {len(crossed)} of"
            f" {len(made.lanes)} lanes: "
            f"{' '.join(crossed[:_NAMED])}{' …' * (len(crossed) > _NAMED)}"
        )
    return made


def _check_size(made: LaneMap, path: Path) -> None:
    """Refuse lanes that are none on Earth: places along them fill the memory.

    Raises:
        InvalidFile: a border or the offset has no finite place or lies too far off, or lanes are
            too long.
    """
    if not np.abs(made.offset).max() <= _FARTHEST:  # NaN as well
        raise InvalidFile(
            f"the map's offset has numbers beyond {_FARTHEST:g}, or no numbers", path=path
        )
    total = 0.0
    for lane in made.lanes.values():
        for border in (lane.left, lane.right):
            if len(border) < 2:
                raise InvalidFile(
                    "a border of the lane is missing", path=path, element=f"lane {lane.id}"
                )
            if not np.abs(border).max(initial=0.0) <= _FARTHEST:  # NaN as well
                raise InvalidFile(
                    f"a border of the lane has coordinates beyond {_FARTHEST:g} m, or no numbers",
                    path=path,
                    element=f"lane {lane.id}",
                )
        total += lane.length
        if total > _LONGEST:
            raise InvalidFile(
                f"lanes are longer than {_LONGEST / 1000.0:,.0f} km together",
                path=path,
                element=f"lane {lane.id}",
            )


_FARTHEST, _LONGEST = 1e8, 2e7
"""Largest coordinate, and length of all lanes of a map, m"""
_NAMED = 10
"""Most lanes that a note names"""


def _read_lanes(path: Path, origin: tuple[float, float] | None, kind: str) -> LaneMap:
    if kind == "lanelet2":
        return lanelet2.read(path, origin)
    if kind == "sumo":
        return sumo.read(path)
    if kind == "commonroad":
        return commonroad.read(path)
    if kind == "geojson":
        return geojson.read(path)
    if kind == "openstreetmap":
        with scratch("xosc-osm-") as folder:
            made = sumo.read(osm_network(path, folder))
        made.name = path.stem
        made.notes.insert(
            0,
            "OpenStreetMap has no lanes: netconvert guessed their number, width and "
            "ways through junctions",
        )
        return made
    raise UsageError(f"there is no format {kind!r}, only {', '.join(FORMATS)}")


def convert(
    source: str | PathLike[str],
    target: str | PathLike[str],
    *,
    origin: tuple[float, float] | None = None,
    revision: str | None = None,
    overwrite: bool = False,
) -> MapConversion:
    """Convert a map, read the result back, and measure what became of its lanes.

    Args:
        source: the map; its format is found by name and content.
        target: the file to write; its name says the format.
        origin: latitude and longitude (degrees) of the origin of Lanelet2's UTM coordinates; None
            for its local coordinates.
        revision: version of OpenDRIVE to write, `1.4` to `1.9`; an OpenDRIVE source is converted as
            it is written.
        overwrite: replace a file that is there.

    Raises:
        InvalidFile: the source is malformed; names file, line and element.
        Unsupported: the target can't have it.
        UsageError: a format is not known, or the target is in the way or can't be written.

    Example:
        >>> import xosc_toolchain as xt
        >>> made = xt.road.convert(
        ...     "xodr/library/sharp_curve.xodr", "out/sharp_curve.osm", overwrite=True)
        >>> made.difference.borders.largest < 0.05, len(made.difference.connections_lost)
        (True, 0)
    """
    there, here = Path(target), Path(source)
    source_format, target_format = format_of(here), format_of(Path(there.name))
    if revision is not None and target_format != "opendrive":
        raise UsageError(f"a revision is for OpenDRIVE; this is {target_format}", path=there)
    if source_format == target_format and revision is None:
        hint = "; state the revision to write" if target_format == "opendrive" else ""
        raise UsageError(f"source and target are both {source_format}{hint}", path=there)
    version = version_of(revision) if revision is not None else None
    if there.exists() and not overwrite:
        raise UsageError("a file is in the way; --overwrite replaces it", path=there)
    one = read_map(here, origin, source_format)
    content, notes = _written(one, here, source_format, target_format, version)
    with writing("the map", there):
        keep(content, there)
    result = read_map(there, None, target_format)
    difference = compare(one, result)
    # An OpenDRIVE file that only changes its version keeps what it has.
    lacking = [] if source_format == target_format else left_out(one, target_format)
    notes = [*one.notes, *lacking, *notes, *_shortfall(difference)]
    return MapConversion(there, source_format, target_format, notes, difference, one, result)


def left_out(one: LaneMap, target: str) -> Iterator[str]:
    """Sentences on what a map has and a format has not, by `FATES`."""
    lanes = one.lanes.values()
    present = {
        "road types": sum(lane.road_type != "unknown" for lane in lanes),
        "road marks": sum(mark[0] != "none" for lane in lanes for mark in lane.marks),
        "junction priorities": len(one.priorities), "crosswalks": len(one.crosswalks),
        "traffic lights": sum(signal.kind == "light" for signal in one.signals),
        "signs": sum(signal.kind == "sign" for signal in one.signals),
        "stop lines": len(one.stop_lines), "poles": len(one.poles),
        "other objects": sum(one.objects.values()),
    }  # fmt: skip
    for field, count in present.items():
        fate = FATES[target][field]
        if count and fate.outcome == LOST:
            some = ", ".join(f"{kind} {number}" for kind, number in one.objects.items())
            detail = f" ({some})" if field == "other objects" else ""
            yield f"{field} are left out, {count}{detail}: {fate.text}"


_ENOUGH = 0.95
"""Share of the lanes' length within 5 cm, and of connections, below which a note says so"""


def _shortfall(difference: MapDifference) -> Iterator[str]:
    """Sentences on a result that is far from its source."""
    if difference.within < _ENOUGH:
        yield (
            f"only {difference.within:.1%} of the lanes' length has borders within 5 cm of the"
            f" source's (largest distance {difference.borders.largest:.2f} m,"
            f" {sum(difference.lost.values()):.0f} m without a lane): is the source right?"
        )
    if difference.connections_kept < _ENOUGH:
        lost = len(difference.connections_lost)
        yield f"{lost} of {difference.connections} connections are lost: is the source right?"


def _written(
    one: LaneMap, path: Path, source: str, target: str, version: Version | None
) -> tuple[bytes, list[str]]:
    if version is not None:
        return _in_version(one, path, source, version)
    if target == "openstreetmap":
        raise Unsupported("OpenStreetMap is not written")
    if target == "opendrive":
        return opendrive.write(one)
    if target == "lanelet2":
        return lanelet2.write(one)
    if target == "commonroad":
        return commonroad.write(one)
    if target == "geojson":
        return geojson.write(one)
    if source == "opendrive":
        return sumo.write(load(path))
    with scratch("xosc-road-") as folder:
        content, notes = opendrive.write(one)
        between = folder / f"{one.name}.xodr"
        between.write_bytes(content)
        made, more = sumo.write(load(between))
    return made, [*notes, *more]


def _in_version(one: LaneMap, path: Path, source: str, version: Version) -> tuple[bytes, list[str]]:
    if source == "opendrive":
        return in_version(path, version)
    with scratch("xosc-road-") as folder:
        content, notes = opendrive.write(one)
        between = folder / f"{one.name}.xodr"
        between.write_bytes(content)
        made, more = in_version(between, version)
    return made, [*notes, *more]
