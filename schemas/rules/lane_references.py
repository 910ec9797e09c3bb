"""Lanes that positions name exist."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule

UID = "xosc.toolchain:xosc:1.0.0:reference_control.lane_exists_on_road"


@rule(UID, kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """The laneId of a LanePosition must be a lane of the road at that s coordinate; expressions may write it as -2.0."""
    network = document.road_network
    for element in document.elements("LanePosition") if network else ():
        road = network.roads.get(document.value(element, "roadId") or "") if network else None
        lane, s = document.value(element, "laneId"), document.number(element, "s")
        if road is None or lane is None or s is None or not 0 <= s <= road.length:
            continue
        lanes, number = road.lanes(s), document.number(element, "laneId")
        if lane.strip() not in lanes and (number is None or f"{number + 0.0:g}" not in lanes):
            known = ", ".join(sorted(lanes, key=_number))
            yield Finding(
                element, f"laneId: there is no lane {lane!r} at s={s:g} of road {element.get('roadId')}, it has {known}"
            )


def _number(lane: str) -> float:
    try:
        return -float(lane)
    except ValueError:
        return 0.0
