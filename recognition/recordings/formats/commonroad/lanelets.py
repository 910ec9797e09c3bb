"""Roads of lanelets of CommonRoad scenarios, and values in their XML."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lxml import etree

from recognition.recordings.road_sources import keep_road
from recognition.recordings.source import SiteRoad
from recognition.recordings.table import GREATEST
from schemas.common.array_types import FloatArray
from schemas.common.errors import InvalidFile, Unsupported
from schemas.common.xml import line_of
from xodr.formats.lanelet2 import Lanelet, LaneletNeighbour, build


def child(parent: etree._Element, *path: str) -> etree._Element:
    """The element at the end of a path of names.

    Raises:
        InvalidFile: it is not there.
    """
    for name in path:
        found = next(parent.iterchildren(name), None)
        if found is None:
            raise invalid(parent, f"there is no {name}")
        parent = found
    return parent


def number(parent: etree._Element, *path: str) -> float:
    """The number in the element at the end of a path of names."""
    element = child(parent, *path)
    return measured(element.text or "", element)


def measured(text: str, element: etree._Element) -> float:
    """A finite number of the magnitude of a measured value.

    Raises:
        InvalidFile: it is none.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= GREATEST:
        raise invalid(element, f"{text.strip()!r} is no measured value")
    return value


def invalid(element: etree._Element, message: str) -> InvalidFile:
    """The error for an element that is wrong."""
    return InvalidFile(
        message, path=_file(element), line=line_of(element), element=str(element.tag)
    )


def unsupported(element: etree._Element, message: str) -> Unsupported:
    """The error for an element that is right, but asks for something that is not done here."""
    return Unsupported(
        message, path=_file(element), line=line_of(element), element=str(element.tag)
    )


def _file(element: etree._Element) -> str | None:
    return element.getroottree().docinfo.URL


class CommonRoadLanelet(NamedTuple):
    """A piece of a lane, from its first to its last points.

    left, right: its bounds, (n, 2), m. predecessors, successors: lanelets before and after it.
    beside_left, beside_right: neighbours. types: as in `laneletType`, e.g. highway, onRamp.
    limit: speed limit (m/s) of the traffic signs that it refers to, infinite without.
    """

    id: str
    left: FloatArray
    right: FloatArray
    predecessors: tuple[str, ...]
    successors: tuple[str, ...]
    beside_left: LaneletNeighbour | None
    beside_right: LaneletNeighbour | None
    types: tuple[str, ...]
    limit: float = math.inf


def lanelets(root: etree._Element) -> list[CommonRoadLanelet]:
    """The lanelets of a scenario (the root of `recognition.recordings.formats.commonroad.document`).

    Raises:
        InvalidFile: a bound has fewer than two points, or the bounds have unequally many; names
            line and element.
    """
    limits = _limits(root)
    return [_lanelet(element, limits) for element in root.iterchildren("lanelet")]


def _limits(root: etree._Element) -> dict[str, float]:
    """Speed limits (m/s) by the ids of their traffic signs."""
    return {
        sign.get("id") or "": float(value[1]) * _UNITS[value[2]]
        for sign in root.iterchildren("trafficSign")
        for part in sign.iterchildren("trafficSignElement")
        if part.findtext("trafficSignID", "").strip() in _SPEED_LIMITS
        and (value := _SPEED.fullmatch(part.findtext("additionalValue", "").strip()))
    }


def _lanelet(element: etree._Element, limits: dict[str, float]) -> CommonRoadLanelet:
    left, right = _bound(element, "leftBound"), _bound(element, "rightBound")
    if len(left) != len(right):
        raise invalid(element, f"the left bound has {len(left)} points, the right one {len(right)}")
    types = tuple((kind.text or "").strip() for kind in element.iterchildren("laneletType"))
    return CommonRoadLanelet(
        element.get("id") or "", left, right, _refs(element, "predecessor"), _refs(element, "successor"),
        _beside(element, "adjacentLeft"), _beside(element, "adjacentRight"), types,
        min((limits[sign] for sign in _refs(element, "trafficSignRef") if sign in limits), default=math.inf),
    )  # fmt: skip


def _bound(element: etree._Element, name: str) -> FloatArray:
    bound = child(element, name)
    points = [(number(point, "x"), number(point, "y")) for point in bound.iterchildren("point")]
    if len(points) < 2:
        raise invalid(bound, "a bound has two points or more")
    return np.array(points)


def _refs(element: etree._Element, name: str) -> tuple[str, ...]:
    return tuple(link.get("ref") or "" for link in element.iterchildren(name))


def _beside(element: etree._Element, name: str) -> LaneletNeighbour | None:
    link = element.find(name)
    return (
        LaneletNeighbour(link.get("ref") or "", link.get("drivingDir") == "same")
        if link is not None
        else None
    )


# the road ----------------------------------------------------------------------------------

_MOTORWAY = {"highway", "interstate", "mainCarriageWay", "accessRamp", "exitRamp"}
_TAGS = {"interstate": "motorway", "highway": "motorway", "urban": "town"}
"""Tags of scenarios that say what kind of road they are on, the more telling first"""
_SPEED_LIMITS = ("274", "R2-1")
"""Ids of signs for speed limits, in Europe and in the United States"""
_SPEED = re.compile(r"([0-9]{1,3}(?:\.[0-9]*)?) *(kmh|mph|)")
_UNITS = {"": 1.0, "kmh": 1.0 / 3.6, "mph": 0.44704}
"""Factors to m/s, which values without a unit are in"""
_LANE_TYPES = {
    "sidewalk": "sidewalk", "crosswalk": "sidewalk", "bicycleLane": "biking", "busLane": "bus", "shoulder": "shoulder",
    "accessRamp": "onRamp", "exitRamp": "offRamp", "border": "border",
}  # fmt: skip


def _lane_type(types: tuple[str, ...]) -> str:
    return next((_LANE_TYPES[one] for one in types if one in _LANE_TYPES), "driving")


def road_of(root: etree._Element, site: str, folder: Path) -> SiteRoad:
    """The road that a scenario brings along, written into a folder.

    Types of lanelets seldom tell motorways: in NGSIM's scenarios all are "urban". Where they don't,
    the scenario's tags do. Where these are silent too, speed limits decide; without limits one
    "urban" lanelet makes a town of all that say nothing else.

    Raises:
        InvalidFile: it has no lanelets, or malformed ones.
    """
    found = lanelets(root)
    if not found:
        raise invalid(root, "there is no lanelet, so its roads are unknown")

    tagged = _tagged(root)
    unlimited = (
        "town" if tagged == "unknown" and any("urban" in one.types for one in found) else tagged
    )

    def kind(one: CommonRoadLanelet) -> str:
        if set(one.types) & _MOTORWAY:
            return "motorway"
        return unlimited if math.isinf(one.limit) else tagged

    built = build(
        [
            Lanelet(
                one.id, one.left, one.right, one.predecessors, one.successors, one.beside_left, one.beside_right,
                _lane_type(one.types), kind(one), one.limit,
            )
            for one in found
        ],
        site,
    )  # fmt: skip
    lit = [
        element.get("id")
        for element in root.iterchildren("lanelet")
        if element.find("trafficLightRef") is not None
    ]
    lights = frozenset(built.lanelets[one][0] for one in lit if one in built.lanelets)
    return SiteRoad(keep_road(built.map.to_xml(), site, folder), lights, notes=tuple(built.notes))


def _tagged(root: etree._Element) -> str:
    """The type of roads in OpenDRIVE that a scenario's tags tell: elements from 2020a on, words of an attribute before."""
    tags = {str(tag.tag) for tag in root.iterfind("scenarioTags/*")} | set(
        (root.get("tags") or "").split()
    )
    return next((kind for tag, kind in _TAGS.items() if tag in tags), "unknown")
