"""Reader of an OpenDRIVE file into a `RoadNetwork`: header, roads, junctions, controllers, and
their references."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import NamedTuple, TypeVar

from lxml import etree

from schemas.checks.road_elements import Unknown, unknown
from schemas.common.errors import InvalidFile, ToolchainError, nearest
from schemas.common.remarks import Remark, Remarks
from schemas.common.storage import Stamp, stamp
from schemas.common.xml import line_of, local_name, parse
from schemas.expressions.values import quoted
from xodr.graph.network import RoadNetwork
from xodr.model import CrossPath, CrossPathEnd, Header, Junction
from xodr.model.road import Road
from xodr.reader.elements import (
    connections,
    integer,
    invalid,
    not_followed,
    number,
    read_controller,
    read_junction,
    text,
)
from xodr.reader.roads import read_road

_CACHED_FILES = 64
_VALID = "asam.net:xodr:1.0.0:xml.valid_schema"
_UNIQUE = "asam.net:xodr:1.4.0:ids.id_unique_in_class"
_TOUCH = "asam.net:xodr:1.7.0:road.geometry.contact_point"

_REACHES = "asam.net:xodr:1.8.0:junctions.cross_path.lane_linkage"

_JUMP = 1.0
"""Distance (m) between the ends of linked lanes from which a link is reported when a file is read.
"""

T = TypeVar("T")


def load(path: str | PathLike[str], *, strict: bool = False) -> RoadNetwork:
    """Read an OpenDRIVE file, or hand back the network read before from the same unchanged file.

    Args:
        strict: refuse what is otherwise repaired; the network's remarks say what was.

    Raises:
        InvalidFile: missing, malformed, or not OpenDRIVE; names file, line and element.
        Unsupported: valid, but uses something that is not supported.

    Example:
        >>> import xosc_toolchain as xt
        >>> network = xt.load_road("xodr/library/highway_straight.xodr")
        >>> sorted(network.roads), network.roads["1"].length
        (['1'], 2000.0)
    """
    return _load(Path(path), stamp(path), strict)


@lru_cache(maxsize=_CACHED_FILES)
def _load(path: Path, _stamp: Stamp, strict: bool) -> RoadNetwork:
    outside: list[Remark] = []
    # Strict, the parser refuses faults outside of the elements, too, which are mended else.
    root = parse(path, None if strict else outside).getroot()
    try:
        _plain_names(root)
        faults = (*_not_read(root, path), *_doubled_signals(root, path))
        outside += faults
        # Read as it stands first: repairs change the document, and few files need them.
        try:
            network = _network(path, root, tuple(outside))
            Remarks(strict).add(*faults)
        except InvalidFile:
            remarks = () if strict else _repaired(root, path)
            if not remarks:
                raise
            # Where every road was left out, the first fault says more than "has no road".
            if root.find("road") is None:
                raise remarks[0].error() from None
            network = _network(path, root, (*outside, *remarks))
        broken = _broken_links(network, root)
        Remarks(strict).add(
            *broken, *(remark for remark in network.remarks if remark.rule == _REACHES)
        )
        network.remarks = (*network.remarks, *broken)
        return network
    except ToolchainError as error:
        error.path = error.path or str(path)
        raise


def _repaired(root: etree._Element, path: Path) -> tuple[Remark, ...]:
    from xodr.reader.repairs import repair  # which most files do not need

    return repair(root, path)


def _not_read(root: etree._Element, path: Path) -> Iterator[Remark]:
    """Remarks on elements that no version has at their place, one for each kind of place.

    They make a run inconclusive where they may decide shapes.
    """
    by_place: dict[str, list[Unknown]] = {}
    for element in unknown(root):
        by_place.setdefault(element.parent, []).append(element)
    for found in by_place.values():
        first, name = found[0].element, local_name(found[0].element)
        more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
        hint = f"; {nearest(name, sorted(found[0].expected))}" if found[0].expected else ""
        message = (
            f"the element {quoted(name)} is in no version of the standard here{more}; "
            f"it is NOT read{hint}"
        )
        cause = "ignored" if found[0].decides else ""
        yield Remark(_VALID, message, str(path), line_of(first), cause, local_name(first))


def _doubled_signals(root: etree._Element, path: Path) -> Iterator[Remark]:
    """A remark where several signals have one id: scenarios that name it mean the first of them."""
    seen: set[str] = set()
    doubled = list[etree._Element]()
    for signal in root.iterfind("road/signals/signal"):
        name = signal.get("id", "")
        if name in seen:
            doubled.append(signal)
        seen.add(name)
    if doubled:
        more = f" (and {len(doubled) - 1} more ids used again)" if len(doubled) > 1 else ""
        message = (
            f"the id {quoted(doubled[0].get('id', ''))} is that of another signal, too{more}; the "
            "first with an id is meant"
        )
        yield Remark(_UNIQUE, message, str(path), line_of(doubled[0]), element="signal")


class LinkedEnds(NamedTuple):
    """Two ends of roads that a link joins: the element that declares it, and of each road whether
    it is its start."""

    element: etree._Element
    road: Road
    at_start: bool
    other: Road
    other_at_start: bool

    def __str__(self) -> str:
        here, there = (
            "start" if at_start else "end" for at_start in (self.at_start, self.other_at_start)
        )
        return (
            f"the {here} of the road {self.road.id!r} and the {there} of the road {self.other.id!r}"
        )

    def apart(self, t: float = 0.0, other_t: float = 0.0) -> float:
        """Distance (m) between the points at t (m) of both ends; by default of
        the reference lines.
        """
        here, there = _end(self.road, self.at_start), _end(self.other, self.other_at_start)
        return math.dist(self.road.pose(here, t)[:3], self.other.pose(there, other_t)[:3])


def _end(road: Road, at_start: bool) -> float:
    return 0.0 if at_start else road.length


def linked_roads(network: RoadNetwork, root: etree._Element) -> Iterator[LinkedEnds]:
    """Ends of roads that links between roads join: once for each link element that names a contact
    point."""
    for element in root.iterfind("{*}road"):
        road = network.roads.get(element.get("id", ""))
        # A link with elementS meets the other road between its ends (OpenDRIVE 1.9, 12.7), no end.
        for at_start, name in ((True, "predecessor"), (False, "successor")):
            link = element.find(f"{{*}}link/{{*}}{name}")
            if (
                road is None
                or link is None
                or link.get("elementType") != "road"
                or link.get("elementS")
            ):
                continue
            other, contact = network.roads.get(link.get("elementId", "")), link.get("contactPoint")
            if other is not None and contact in ("start", "end"):
                yield LinkedEnds(link, road, at_start, other, contact == "start")


def _broken_links(network: RoadNetwork, root: etree._Element) -> tuple[Remark, ...]:
    """Remark on linked lanes with ends apart: road users jump from one to the other."""
    broken = list[tuple[float, LinkedEnds]]()
    seen: set[tuple[str, bool, str, bool]] = set()
    for ends in linked_roads(network, root):
        pair, back = (ends.road.id, ends.at_start), (ends.other.id, ends.other_at_start)
        # Both roads declare one joint; it counts once.
        if (*back, *pair) in seen:
            continue
        seen.add((*pair, *back))
        # Lanes that widen or narrow at a joint differ: broken is a joint where no pair of lanes
        # meets.
        distance = min(_lanes_apart(network, ends), default=0.0)
        if distance > _JUMP:
            broken.append((distance, ends))
    if not broken:
        return ()
    distance, ends = max(broken, key=lambda pair: pair[0])
    more = f" (and {len(broken) - 1} more links of roads that are apart)" if len(broken) > 1 else ""
    message = f"a link joins {ends}, {distance:.3g} m apart{more}; road users jump there"
    return (Remark(_TOUCH, message, str(network.path), line_of(ends.element), element="road"),)


def _lanes_apart(network: RoadNetwork, ends: LinkedEnds) -> Iterator[float]:
    """Distances (m) between the centres of lanes that are linked at two ends of roads."""
    here, there = _end(ends.road, ends.at_start), _end(ends.other, ends.other_at_start)
    sections = ends.road.section(here), ends.other.section(there)
    for lane in sections[0].lanes.values():
        for link in network.links(ends.road.id, lane.id, not ends.at_start) if lane.id else ():
            if link.road_id == ends.other.id and link.at_start == ends.other_at_start:
                yield ends.apart(lane.center(here), sections[1].lanes[link.lane_id].center(there))


def cross_path_gaps(roads: Mapping[str, Road], path: CrossPath) -> tuple[float, float]:
    """Distances (m) sideways of the start and the end of a cross path from the lanes that they are
    linked to; 0 within them."""
    road = roads[path.road_id]
    places = ((path.start, 0.0), (path.end, road.length))
    return tuple(_beside(roads[end.road_id], end, road, s) for end, s in places)  # type: ignore[return-value]


def _beside(main: Road, end: CrossPathEnd, road: Road, own_s: float) -> float:
    # Files round s, which may then lie a little beyond the end of the road.
    s, own = min(end.s, main.length), road.section(own_s).lanes.get(end.own_lane)
    lane = main.section(s).lanes.get(end.lane_id)
    if lane is None or own is None:
        return math.inf
    here, there = main.pose(s, 0.0), road.pose(own_s, own.center(own_s))
    # The main road's t of the end of the cross path, taken from its pose there: projected, not
    # searched.
    t = (there.y - here.y) * math.cos(here.h) - (there.x - here.x) * math.sin(here.h)
    return max(min(lane.inner(s), lane.outer(s)) - t, t - max(lane.inner(s), lane.outer(s)), 0.0)


def _placed_cross_paths(
    path: Path, root: etree._Element, roads: dict[str, Road], junctions: dict[str, Junction]
) -> Iterator[Remark]:
    """Exchange the lane links of cross paths that are laid the other way round.

    One remark for each of them, and for each that misses its lanes.
    """
    for element in root.iterfind("junction"):
        junction = junctions[element.get("id", "")]
        for place, (cross_path, item) in enumerate(
            zip(junction.cross_paths, element.iterfind("crossPath"), strict=True)
        ):
            gap = max(cross_path_gaps(roads, cross_path))
            if gap <= _JUMP:
                continue
            turned, outcome = (
                cross_path._replace(start=cross_path.end, end=cross_path.start),
                "road users jump there",
            )
            # Exchanged only if that mends more than half: a path far from both stays as it is
            # written.
            if max(cross_path_gaps(roads, turned)) < 0.5 * gap:
                found = junction.cross_paths
                junction.cross_paths = (*found[:place], turned, *found[place + 1 :])
                outcome = "its lane links are exchanged, which fits better"
            elif gap == math.inf:
                outcome = "it leads nowhere there"
            where = (
                f"ends {gap:.3g} m beside a lane that it links"
                if gap < math.inf
                else "links a lane that does not exist"
            )
            message = (
                f"the cross path {cross_path.id!r} of the junction "
                f"{junction.id!r} {where}; {outcome}"
            )
            yield Remark(_REACHES, message, str(path), line_of(item))


def _plain_names(root: etree._Element) -> None:
    """Take the namespace from the names of all elements: files since OpenDRIVE 1.8 may have it."""
    if local_name(root) != "OpenDRIVE":
        raise invalid(root, "the root element of a road network is OpenDRIVE")
    if root.tag != "OpenDRIVE":
        for element in root.iter("{*}*"):
            element.tag = local_name(element)


def _network(path: Path, root: etree._Element, remarks: tuple[Remark, ...] = ()) -> RoadNetwork:
    header = _header(root)
    roads = _by_id(root, "road", lambda element: read_road(path, element))
    if not roads:
        raise invalid(root, "the road network has no road")
    junctions = _by_id(root, "junction", read_junction)
    _check_references(root, roads, junctions)
    remarks = (*remarks, *_placed_cross_paths(path, root, roads, junctions))
    controllers = _by_id(root, "controller", read_controller)
    try:
        return RoadNetwork(
            path, header, roads, junctions, controllers, (*remarks, *not_followed(root, path))
        )
    except ValueError as error:
        raise invalid(root, str(error)) from None


def _by_id(root: etree._Element, tag: str, read: Callable[[etree._Element], T]) -> dict[str, T]:
    by_id: dict[str, T] = {}
    for element in root.iterfind(tag):
        name = text(element, "id")
        if name in by_id:
            raise invalid(element, f"the id {name!r} is used twice")
        by_id[name] = read(element)
    return by_id


def _check_references(
    root: etree._Element, roads: dict[str, Road], junctions: dict[str, Junction]
) -> None:
    # Unchecked, a wrong id would come up as a KeyError when links are followed, far from its line.
    for element in root.iterfind("road/link/*"):
        kind, name = element.get("elementType"), element.get("elementId")
        if (kind == "road" and name not in roads) or (kind == "junction" and name not in junctions):
            raise invalid(element, f"the {kind} {name!r} that is linked here does not exist")
    for junction in root.iterfind("junction"):
        for element in connections(junction):
            for attribute in ("incomingRoad", "connectingRoad", "linkedRoad"):
                name = element.get(attribute)
                if name is not None and name not in roads:
                    raise invalid(element, f"{attribute}={name!r} does not exist")
        for path, names in (
            ("crossPath", ("crossingRoad", "roadAtStart", "roadAtEnd")),
            ("boundary/segment", ("roadId",)),
        ):
            for element in junction.iterfind(path):
                for attribute in names:
                    if element.get(attribute) not in roads:
                        raise invalid(
                            element, f"{attribute}={element.get(attribute)!r} does not exist"
                        )


def _header(root: etree._Element) -> Header:
    element = root.find("header")
    if element is None:
        raise invalid(root, "the element header is missing")
    reference = element.findtext("geoReference", "").strip() or None
    offset = element.find("offset")
    shift = (0.0, 0.0, 0.0, 0.0)
    if offset is not None:
        shift = (
            number(offset, "x", 0.0),
            number(offset, "y", 0.0),
            number(offset, "z", 0.0),
            number(offset, "hdg", 0.0),
        )
    version = (integer(element, "revMajor"), integer(element, "revMinor"))
    return Header(version, element.get("name", ""), reference, shift)
