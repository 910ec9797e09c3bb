"""The map of a CommonRoad scenario: its elements lanelet and trafficSign, from OpenDRIVE roads.

Source: CommonRoad "XML Format" 2020a. Points are in the plane: heights are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count

from lxml import etree

from runner.exports.lanelets import Lanelet
from runner.exports.moments import decimal

_LANES = {
    "sidewalk": "sidewalk", "walking": "sidewalk", "biking": "bicycleLane", "shoulder": "shoulder", "stop": "shoulder",
    "bus": "busLane", "exit": "exitRamp", "offRamp": "exitRamp", "entry": "accessRamp", "onRamp": "accessRamp",
    "parking": "parking", "border": "border", "restricted": "restricted",
}  # fmt: skip
"""Lanelet types by OpenDRIVE lane type; other lanes have the type of their road."""
_ROADS = {
    "motorway": "interstate", "rural": "country", "town": "urban", "townExpressway": "urban", "lowSpeed": "urban",
    "pedestrian": "sidewalk", "bicycle": "bicycleLane",
}  # fmt: skip
_MARKS = {
    "none": "no_marking", "solid": "solid", "broken": "dashed", "solid solid": "solid_solid", "broken broken": "dashed_dashed",
    "solid broken": "solid_dashed", "broken solid": "dashed_solid", "curb": "curb",
}  # fmt: skip
_SPEED_LIMIT = "274"
"""Number of the sign (German, and that of CommonRoad's land Zamunda)."""


def map_elements(lanes: Sequence[Lanelet], numbers: count[int]) -> list[etree._Element]:
    """The lanelets, and one sign for each speed limit, which they refer to.

    Args:
        numbers: gives the ids, which are unique in a scenario.
    """
    ids = {lanelet.key: str(next(numbers)) for lanelet in lanes}
    limits = sorted({lanelet.limit for lanelet in lanes if lanelet.limit is not None})
    signs = {limit: str(next(numbers)) for limit in limits}
    made = []
    for lanelet in lanes:
        element = etree.Element("lanelet", id=ids[lanelet.key])
        for tag, points, mark in zip(("leftBound", "rightBound"), (lanelet.left, lanelet.right), lanelet.marks, strict=True):
            bound = etree.SubElement(element, tag)
            bound.extend(point(place) for place in points)
            etree.SubElement(bound, "lineMarking").text = _MARKS.get(mark, "unknown")
        for tag, keys in (("predecessor", lanelet.predecessors), ("successor", lanelet.successors)):
            element.extend(etree.Element(tag, ref=ids[key]) for key in keys)
        for tag, beside in zip(("adjacentLeft", "adjacentRight"), lanelet.beside, strict=True):
            if beside is not None:
                etree.SubElement(element, tag, ref=ids[beside[0]], drivingDir="same" if beside[1] else "opposite")
        for kind in _types(lanelet):
            etree.SubElement(element, "laneletType").text = kind
        if lanelet.limit is not None:
            etree.SubElement(element, "trafficSignRef", ref=signs[lanelet.limit])
        made.append(element)
    first = {limit: next(lanelet for lanelet in lanes if lanelet.limit == limit) for limit in limits}
    return made + [_sign(signs[limit], limit, first[limit]) for limit in limits]


def _types(lanelet: Lanelet) -> list[str]:
    own = _LANES.get(lanelet.lane_type) or _ROADS.get(lanelet.road_type, "unknown")
    return [own, *(["intersection"] if lanelet.in_junction else [])]


def _sign(number: str, limit: float, lanelet: Lanelet) -> etree._Element:
    sign = etree.Element("trafficSign", id=number)
    element = etree.SubElement(sign, "trafficSignElement")
    etree.SubElement(element, "trafficSignID").text = _SPEED_LIMIT
    etree.SubElement(element, "additionalValue").text = decimal(limit)
    etree.SubElement(sign, "position").append(point(lanelet.right[0]))
    etree.SubElement(sign, "virtual").text = "true"
    return sign


def point(place: Sequence[float]) -> etree._Element:
    """The element point of the first two coordinates of a place, m."""
    element = etree.Element("point")
    for tag, value in zip("xy", place, strict=False):
        etree.SubElement(element, tag).text = decimal(value)
    return element
