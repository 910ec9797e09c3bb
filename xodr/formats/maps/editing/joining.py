"""OpenDRIVE files put together: ids made unique, coordinates made one, open ends
that meet linked.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from copy import deepcopy
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lxml import etree
from scipy.spatial import cKDTree

from schemas.common.array_types import FloatArray
from schemas.common.errors import UsageError
from schemas.common.policy import scratch
from xodr.formats.maps.editing.placing import MapMotion, best_motion, bounds, move, places
from xodr.formats.maps.editing.tree import EditedRoads, number
from xodr.formats.maps.projecting import Projector
from xodr.graph.network import RoadNetwork
from xodr.graph.ways import DRIVABLE
from xodr.model.road import Road
from xodr.reader import load

_IDS = {
    "road": (
        ("road", "id"), ("connection", "incomingRoad"), ("connection", "connectingRoad"),
        ("connection", "linkedRoad"), ("priority", "high"), ("priority", "low"),
        ("segment", "roadId"),
        ("crossPath", "crossingRoad"), ("crossPath", "roadAtStart"), ("crossPath", "roadAtEnd"),
        ("positionRoad", "roadId"), ("junction", "mainRoad"), ("mainTrack", "id"),
        ("sideTrack", "id"),
    ),
    "junction": (("junction", "id"), ("road", "junction"), ("junctionReference", "junction")),
    "signal": (("signal", "id"), ("signalReference", "id"), ("control", "signalId"),
        ("dependency", "id")),
    "object": (("object", "id"), ("objectReference", "id")),
    "controller": (("controller", "id"),),
    "junctionGroup": (("junctionGroup", "id"),),
    "bridge": (("bridge", "id"),),
    "tunnel": (("tunnel", "id"),),
    "switch": (("switch", "id"), ("partner", "id")),
    "station": (("station", "id"),),
}  # fmt: skip
"""Elements and attributes that hold ids, by kind; the first of each kind declares the id.

Further ids are in `elementId`, whose kind `elementType` names.
"""
_ORDER = ("header", "road", "controller", "junction", "junctionGroup", "station")
_NEAR, _TURNED = 30.0, math.radians(10.0)
"""Distance (m) of reference lines and difference of headings (rad) of ends that may continue each
other"""


def join(paths: Sequence[Path], within: float = 0.05) -> tuple[bytes, list[str]]:
    """One OpenDRIVE file of several, and what became of them, one sentence each.

    Roads of the first file keep their ids. Where both have a projection, the others are moved into
    the coordinates of the first one. Ends of roads without a link are linked where both borders of
    a lane meet; an end that meets several others would need a junction, and stays open.

    Args:
        paths: two files or more.
        within: distance (m) of lane borders that meet.

    Raises:
        InvalidFile: one of them is no OpenDRIVE file; names file, line and element.
        Unsupported: one that must be moved has a surface in coordinates of its own.
        UsageError: there are fewer than two.
    """
    if len(paths) < 2:
        raise UsageError("two maps or more are joined")
    base, *others = (EditedRoads(path) for path in paths)
    notes = list(base.remarks)
    for other in others:
        notes += other.remarks
        notes += _align(other, base)
        notes += _rename(other, base)
        notes += _merge_headers(base, other)
        for child in other.root:
            if child.tag != "header":
                base.root.append(deepcopy(child))
    base.root[:] = sorted(base.root, key=_rank)
    notes += _link(base, within)
    return base.content(), notes


def _rank(child: etree._Element) -> int:
    return _ORDER.index(child.tag) if child.tag in _ORDER else len(_ORDER)


def _align(other: EditedRoads, base: EditedRoads) -> Iterator[str]:
    network, like = load(other.path), load(base.path)
    here, there = network.header, like.header
    if here.geo_reference is None or there.geo_reference is None:
        if here.geo_reference != there.geo_reference:
            yield (
                f"{other.path.name}: only one of the maps has a projection; coordinates "
                "are taken as they are"
            )
        return
    if (here.geo_reference, here.offset) == (there.geo_reference, there.offset):
        return
    old = places(network)
    flat = np.column_stack([old, np.zeros(len(old))])
    geodetic = np.column_stack(Projector(here.geo_reference, here.offset).to_geodetic(flat))
    wanted = Projector(there.geo_reference, there.offset).to_map(geodetic)[:, :2]
    motion, rest = best_motion(old, wanted)
    motion = MapMotion(motion.turn, motion.x, motion.y, here.offset[2] - there.offset[2])
    yield f"{other.path.name}: moved to the coordinates of {base.path.name}, within {rest:.4f} m"
    yield from move(other, motion)


# ids --------------------------------------------------------------------------------------------


def _declared(root: etree._Element, kind: str) -> set[str]:
    tag, attribute = _IDS[kind][0]
    elements = root.iterfind(tag) if kind == "controller" else root.iter(tag)
    return {element.get(attribute, "") for element in elements}


def _rename(other: EditedRoads, base: EditedRoads) -> Iterator[str]:
    """Give new ids to what has one that the base has already."""
    for kind, holders in _IDS.items():
        taken, own = _declared(base.root, kind), _declared(other.root, kind)
        doubled = sorted(taken & own)
        if not doubled:
            continue
        names = dict(zip(doubled, _unused(taken | own), strict=False))
        _replace(other.root, kind, holders, names)
        old, new = next(iter(names.items()))
        yield (
            f"{other.path.name}: {len(names)} ids of {kind} elements are in use, and become "
            f"others: {old} is {new}"
        )


def _unused(taken: set[str]) -> Iterator[str]:
    number = max((int(name) for name in taken if name.isdecimal()), default=0)
    while True:
        number += 1
        yield str(number)


def _replace(
    root: etree._Element, kind: str, holders: Sequence[tuple[str, str]], names: dict[str, str]
) -> None:
    for tag, attribute in holders:
        for element in root.iter(tag):
            name = element.get(attribute)
            if name in names:
                element.set(attribute, names[name])
    for element in root.iter("predecessor", "successor", "neighbor", "reference"):
        name = element.get("elementId")
        if element.get("elementType") == kind and name in names:
            element.set("elementId", names[name])


def _merge_headers(base: EditedRoads, other: EditedRoads) -> Iterator[str]:
    one, two = base.root.find("header"), other.root.find("header")
    assert one is not None and two is not None  # loading refuses files without
    minor = [int(header.get("revMinor", "0")) for header in (one, two)]
    if minor[0] != minor[1]:
        one.set("revMinor", str(max(minor)))
        yield (
            f"{other.path.name} is OpenDRIVE 1.{minor[1]}, the first file 1.{minor[0]}: "
            "the newer is declared"
        )
    names = ("west", "south", "east", "north")
    boxes = [
        [number(header, name, file.path) for name in names]
        for header, file in ((one, base), (two, other))
    ]
    if all(any(box) for box in boxes):
        corners = [corner for box in boxes for corner in ((box[0], box[1]), (box[2], box[3]))]
        for name, value in zip(names, bounds(corners), strict=True):
            one.set(name, repr(value))
    left = sorted({child.tag for child in two if child.tag not in ("geoReference", "offset")})
    if left:
        yield f"{other.path.name}: {', '.join(map(str, left))} of its header is left out"


# open ends --------------------------------------------------------------------------------------


class _OpenEnd(NamedTuple):
    """An open end of a road: its place, the heading out of the road, and borders (inner, outer) of
    its lanes."""

    road: Road
    at_start: bool
    place: tuple[float, float]
    heading: float
    lanes: dict[int, FloatArray]

    @property
    def s(self) -> float:
        """Position (m) on the road."""
        return 0.0 if self.at_start else self.road.length

    def leads_out(self, lane: int) -> bool:
        """Whether traffic on a lane leaves the road at this end."""
        return (self.road.direction(lane, self.s) > 0) != self.at_start


def _link(base: EditedRoads, within: float) -> Iterator[str]:
    with scratch("xosc-road-") as folder:
        path = folder / "joined.xodr"
        path.write_bytes(base.content())
        network = load(path)
    ends = list(_open_ends(network))
    pairs = {}
    partners: dict[int, list[int]] = defaultdict(list)
    tree = cKDTree([end.place for end in ends]) if ends else None
    for one, two in sorted(tree.query_pairs(_NEAR)) if tree is not None else ():
        lanes = _continued(ends[one], ends[two], within)
        if lanes:
            pairs[one, two] = lanes
            partners[one].append(two)
            partners[two].append(one)
    elements = {road.get("id"): road for road in base.root.iterfind("road")}
    linked = 0
    for (one, two), lanes in pairs.items():
        if len(partners[one]) == len(partners[two]) == 1:
            linked += 1
            back = {there: here for here, there in lanes.items()}
            _write_link(elements[ends[one].road.id], ends[one], ends[two], lanes)
            _write_link(elements[ends[two].road.id], ends[two], ends[one], back)
    several = [ends[index] for index, found in sorted(partners.items()) if len(found) > 1]
    yield f"{linked} pairs of open ends are linked"
    if several:
        first = several[0]
        yield (
            f"{len(several)} open ends meet several others, and would need a "
            "junction: they stay open,"
            f" such as the {'start' if first.at_start else 'end'} of road {first.road.id}"
        )


def _open_ends(network: RoadNetwork) -> Iterator[_OpenEnd]:
    for road in network.roads.values():
        for at_start, link in ((True, road.predecessor), (False, road.successor)):
            if link is not None or road.junction_id is not None:
                continue
            s = 0.0 if at_start else road.length
            pose = road.pose(s)
            lanes = {
                lane.id: np.array([(p.x, p.y, p.z) for p in (road.pose(s, lane.inner(s)),
                    road.pose(s, lane.outer(s)))])
                for lane in road.section(s).lanes.values()
                if lane.id and abs(lane.outer(s) - lane.inner(s)) > 0.01
            }  # fmt: skip
            heading = pose.h + (math.pi if at_start else 0.0)
            yield _OpenEnd(road, at_start, (pose.x, pose.y), heading, lanes)


def _continued(one: _OpenEnd, other: _OpenEnd, within: float) -> dict[int, int]:
    """Lanes of an end, each with the lane of another end that continues it; empty where none is."""
    turned = math.remainder(one.heading - other.heading - math.pi, math.tau)
    if abs(turned) > _TURNED or (one.road is other.road and one.at_start == other.at_start):
        return {}
    continued: dict[int, int] = {}
    for here, borders in one.lanes.items():
        for there, like in other.lanes.items():
            apart = min(
                float(np.linalg.norm(borders - turn, axis=1).max()) for turn in (like, like[::-1])
            )
            driven = one.road.lane_type(one.s, here) in DRIVABLE
            if apart <= within and (not driven or one.leads_out(here) != other.leads_out(there)):
                continued[here] = there
    return continued


def _write_link(
    road: etree._Element, end: _OpenEnd, other: _OpenEnd, lanes: dict[int, int]
) -> None:
    name = "predecessor" if end.at_start else "successor"
    contact = "start" if other.at_start else "end"
    link = road.find("link")
    if link is None:
        link = etree.Element("link")
        road.insert(0, link)
    _put(link, name, elementType="road", elementId=other.road.id, contactPoint=contact)
    section = road.findall("lanes/laneSection")[0 if end.at_start else -1]
    for lane in section.iterfind("*/lane"):
        there = lanes.get(int(lane.get("id", "0")))
        if there is None:
            continue
        link = lane.find("link")
        if link is None:
            link = etree.Element("link")
            lane.insert(0, link)
        if link.find(name) is None:
            _put(link, name, id=str(there))


def _put(link: etree._Element, name: str, **attributes: str) -> None:
    """Add a predecessor, which comes first, or a successor."""
    link.insert(0 if name == "predecessor" else len(link), etree.Element(name, attributes))
