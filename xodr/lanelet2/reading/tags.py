"""What the tags of Lanelet2 mean in OpenDRIVE: lane types, speed limits, road marks.

Source: Lanelet2 documentation, "LaneletAndAreaTagging" and "LinestringTagging"; limits where a map gives none: its German
traffic rules.
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from xodr.lanelet2.reading.osm import Relation, Tags

CROSSWALK = "crosswalk"


class Kind(NamedTuple):
    """What a lanelet is in OpenDRIVE. type: lane type, or `CROSSWALK` for an object on the road."""

    type: str
    road_type: str
    speed_limit: float


_SUBTYPES = {
    "road": "driving",
    "highway": "driving",
    "play_street": "driving",
    "bus_lane": "bus",
    "emergency_lane": "stop",
    "exit": "exit",
    "bicycle_lane": "biking",
    "bikelane": "biking",  # TAF-BW
    "walkway": "sidewalk",
    "shared_walkway": "sidewalk",
    "stairs": "sidewalk",
    "crosswalk": CROSSWALK,
    "rail": "rail",
}
_ROAD_TYPES = {"highway": "motorway", "play_street": "lowSpeed"}
_LIMITS = {"motorway": math.inf, "rural": 100 / 3.6, "town": 50 / 3.6, "lowSpeed": 7 / 3.6}
_TYPE_LIMITS = {"sidewalk": 10 / 3.6, CROSSWALK: 10 / 3.6, "biking": 30 / 3.6}

_SPEED = re.compile(r"(\d+(?:\.\d*)?|\.\d+)\s*(km/h|kmh|kph|mph|m/s|mps)?", re.IGNORECASE)
_UNITS = {"mph": 0.44704, "m/s": 1.0, "mps": 1.0}
_SPEED_TAGS = ("speed_limit", "maxspeed")

_MARKS = {
    ("line_thin", "dashed"): "broken", ("line_thick", "dashed"): "broken",
    ("line_thin", "solid_solid"): "solid solid", ("line_thick", "solid_solid"): "solid solid",
    ("line_thin", "solid_dashed"): "solid broken", ("line_thick", "solid_dashed"): "solid broken",
    ("line_thin", "dashed_solid"): "broken solid", ("line_thick", "dashed_solid"): "broken solid",
}  # fmt: skip
_LINES = {"line_thin": "solid", "line_thick": "solid", "curbstone": "curb", "road_border": "curb"}


def kind_of(relation: Relation) -> Kind | None:
    """What a lanelet is in OpenDRIVE; None where its subtype is not known. Lanelets without a subtype are roads."""
    tags = relation.tags
    subtype = tags.get("subtype") or "road"
    lane_type = _SUBTYPES.get(subtype)
    if lane_type is None:
        return None
    usual = "rural" if tags.get("location") == "nonurban" else "town"
    road_type = _ROAD_TYPES.get(subtype, usual)
    limit = speed_limit(relation)
    return Kind(lane_type, road_type, _TYPE_LIMITS.get(lane_type, _LIMITS[road_type]) if limit is None else limit)


def speed_limit(relation: Relation) -> float | None:
    """The limit [m/s] that a relation's own tags give, None where they do not.

    Raises:
        InvalidFile: it is no speed.
    """
    for name in _SPEED_TAGS:
        text = relation.tags.get(name)
        if text is not None:
            return speed(relation, name, text)
    return None


def speed(relation: Relation, name: str, text: str) -> float:
    """A speed in m/s from a text like "50", "50 km/h" or "30 mph".

    Raises:
        InvalidFile: it is none, or not positive.
    """
    match = _SPEED.fullmatch(text)
    value = float(match[1]) * _UNITS.get((match[2] or "").lower(), 1 / 3.6) if match else 0.0
    if not 0.0 < value < math.inf:
        raise relation.invalid(f"{name}={text!r} is no speed limit such as '50' or '50 km/h'")
    return value


def mark_of(tags: Tags) -> str:
    """The road mark that a bound is."""
    kind = tags.get("type", "")
    return _MARKS.get((kind, tags.get("subtype", ""))) or _LINES.get(kind, "none")
