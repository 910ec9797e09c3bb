"""Positions are on their roads."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule

UID = "xosc.toolchain:xosc:1.0.0:positioning.position_is_on_the_road"

_TOLERANCE = 0.01


@rule(UID, kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """The s coordinate of a position must be between 0 and the length of the road."""
    network = document.road_network
    for element in document.elements("LanePosition", "RoadPosition") if network else ():
        road = network.roads.get(document.value(element, "roadId") or "") if network else None
        s = document.number(element, "s")
        if road is not None and s is not None and not -_TOLERANCE <= s <= road.length + _TOLERANCE:
            yield Finding(element, f"s={s:g} is not on road {element.get('roadId')}, which is {road.length:g} m long")
