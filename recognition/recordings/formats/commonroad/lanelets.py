"""Roads of lanelets of CommonRoad scenarios, and values in their XML."""

from __future__ import annotations

import math
from pathlib import Path

from lxml import etree

from recognition.recordings.road_sources import keep_road
from recognition.recordings.source import SiteRoad
from xodr.formats.commonroad import CommonRoadLanelet, invalid, lane_type, lanelets
from xodr.formats.lanelet2 import Lanelet, build

# the road ----------------------------------------------------------------------------------

_MOTORWAY = {"highway", "interstate", "mainCarriageWay", "accessRamp", "exitRamp"}
_TAGS = {"interstate": "motorway", "highway": "motorway", "urban": "town"}
"""Tags of scenarios that say what kind of road they are on, the more telling first"""


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
                lane_type(one.types), kind(one), one.limit,
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
