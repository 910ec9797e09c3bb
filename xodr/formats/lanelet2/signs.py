"""Signs of Lanelet2 maps: regulatory elements `traffic_sign` and `speed_limit`, which refer to ways
along the faces of signs, and which lanelets refer to; stop lines and poles.

Source: Lanelet2 documentation, "RegulatoryElementTagging": a face runs from its left to its right
edge as seen from the front; the way's subtype (or the element's `sign_type`) is a country and a
number, such as `de205`. The tags `signal_type`, `signal_subtype`, `signal_country`, `signal_value`
and `signal_unit`, which Lanelet2 does not read, have the attributes of OpenDRIVE.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from schemas.common.array_types import FloatArray
from schemas.common.terminal.text import finite_number
from xodr.formats.lanelet2.osm import Osm, Relation
from xodr.formats.maps.lane_map import MapPole, MapSignal

Place = tuple[float, float, float]
"""x, y, z, m."""

_HALF = 0.2
"""Half the width (m) of the faces that are written."""
_CODE = re.compile(r"([a-z]{2})([A-Z0-9][^-]*)(?:-(.+))?")
_PREFIX = "signal_"
_NO_SUBTYPE = ("", "-1")


def face(place: Place, heading: float) -> FloatArray:
    """The line (2, 3) along the face of a sign or light, from left to right as seen from the
    front."""
    across = np.array([-math.sin(heading), math.cos(heading), 0.0])
    return np.array(place) + np.outer([-_HALF, _HALF], across)


def facing(line: FloatArray) -> tuple[Place, float]:
    """The middle of a face, and the direction (rad) in which it looks."""
    x, y, z = (0.5 * (line[0] + line[-1])).tolist()
    # The inverse of `face`.
    dx, dy = (line[-1] - line[0])[:2].tolist()
    return (x, y, z), math.atan2(-dx, dy)


def way_tags(sign: MapSignal) -> dict[str, str]:
    """Tags of the way of a sign."""
    return {"type": "traffic_sign", "subtype": _code(sign)}


def element_tags(sign: MapSignal) -> dict[str, str]:
    """Tags of the regulatory element of a sign."""
    values = {
        "type": sign.type, "subtype": sign.subtype, "country": sign.country, "unit": sign.unit,
        "value": "" if sign.value is None else repr(sign.value),
    }  # fmt: skip
    own = {_PREFIX + name: value for name, value in values.items() if value}
    return {"type": "regulatory_element", "subtype": "traffic_sign", "name": sign.id, **own}


def _code(sign: MapSignal) -> str:
    # Lanelet2 has two letters; `OpenDRIVE` as a country is none.
    country = sign.country.lower() if len(sign.country) == 2 else ""
    subtype = "" if sign.subtype in _NO_SUBTYPE else f"-{sign.subtype}"
    return f"{country}{sign.type}{subtype}"


def signs_of(
    osm: Osm, points: Mapping[str, tuple[float, float]], users: Mapping[str, Sequence[str]]
) -> list[MapSignal]:
    """The signs of a map, one for each way that a regulatory element refers to.

    Args:
        points: x and y of each node, m.
        users: lanelets by the regulatory elements that they refer to.

    Raises:
        InvalidFile: a value is no number.
    """
    found = []
    for rule in osm.relations.values():
        tags = rule.tags
        if tags.get("type") != "regulatory_element" or tags.get("subtype") not in _SUBTYPES:
            continue
        lines = face_lines(osm, rule, points)
        for number, (line, subtype) in enumerate(lines):
            name = tags.get("name") or rule.id
            place, heading = facing(line)
            found.append(
                MapSignal(
                    name if len(lines) == 1 else f"{name}/{number}", "sign",
                    _meaning(rule, subtype),
                    place, heading, tuple(users.get(rule.id, ())),
                )
            )  # fmt: skip
    return found


_SUBTYPES = ("traffic_sign", "speed_limit")


def face_lines(
    osm: Osm, rule: Relation, points: Mapping[str, tuple[float, float]]
) -> list[tuple[FloatArray, str]]:
    """The faces (n, 3) that a regulatory element refers to, with the subtypes of their ways."""
    lines = []
    for ref in rule.refs("refers", "way"):
        way = osm.ways[ref]
        line = np.array([(*points[node], osm.nodes[node].height) for node in way.nodes])
        # A face of one place looks nowhere.
        if len(line) > 1 and np.hypot(*(line[-1] - line[0])[:2]) > 0.0:
            lines.append((line, way.tags.get("subtype", "")))
    return lines


MADE = "made at the end of the lane"
"""Tag `note` of stop lines that no map has, which are written since traffic lights want one."""


def stop_lines_of(
    osm: Osm, points: Mapping[str, tuple[float, float]]
) -> Iterator[tuple[str, FloatArray]]:
    """Name and points (n, 3), m, of each stop line of a map."""
    for way in osm.ways.values():
        if way.tags.get("type") == "stop_line" and way.tags.get("note") != MADE:
            line = np.array([(*points[node], osm.nodes[node].height) for node in way.nodes])
            if len(line) > 1:
                yield way.tags.get("name") or way.id, line


def poles_of(osm: Osm, points: Mapping[str, tuple[float, float]]) -> Iterator[MapPole]:
    """The poles of a map: tagged nodes, and ways from their foot to their top."""
    for name, node in osm.nodes.items():
        if node.tags.get("type") == "pole":
            place = (*points[name], node.height)
            height = finite_number(node.tags.get("height", "0"))
            yield MapPole(node.tags.get("name") or name, place, height or 0.0)
    for way in osm.ways.values():
        if way.tags.get("type") == "pole" and way.nodes:
            heights = [osm.nodes[node].height for node in way.nodes]
            foot = way.nodes[heights.index(min(heights))]
            place = (*points[foot], min(heights))
            yield MapPole(way.tags.get("name") or way.id, place, max(heights) - min(heights))


def _meaning(rule: Relation, subtype: str) -> tuple[str, str, str, float | None, str]:
    own = {
        name: rule.tags.get(_PREFIX + name, "") for name in ("type", "subtype", "country", "unit")
    }
    text = rule.tags.get(_PREFIX + "value")
    value = finite_number(text) if text is not None else None
    if text is not None and value is None:
        raise rule.invalid(f"{_PREFIX}value={text!r} is no finite number")
    # Written by this project: exact, where a code is a guess.
    if own["type"]:
        return own["type"], own["subtype"], own["country"], value, own["unit"]
    code = rule.tags.get("sign_type") or subtype
    match = _CODE.fullmatch(code)
    if match is None:
        return code, "-1", "", value, ""
    return match[2], match[3] or "-1", match[1].upper(), value, ""
