"""Lane layouts and parameter checks that several builders share."""

from __future__ import annotations

import math
from dataclasses import replace

from schemas.errors import UsageError
from xodr.builders.curves import Pose, connect
from xodr.builders.elements import Cubic, Lane, Link, Road, RoadMap, Section

LANE = "driving"


def require(name: str, value: float, minimum: float, maximum: float = math.inf) -> None:
    """UsageError unless `minimum` <= value <= `maximum` and the value is finite."""
    if not (math.isfinite(value) and minimum <= value <= maximum):
        bounds = f"between {minimum:g} and {maximum:g}" if math.isfinite(maximum) else f"at least {minimum:g}"
        raise UsageError(f"{name}={value!r} must be {bounds}")


def for_traffic(built: RoadMap, rule: str) -> RoadMap:
    """A map that was built for right-hand traffic, for the asked side: `RHT` or `LHT`."""
    if rule not in ("RHT", "LHT"):
        raise UsageError(f"rule={rule!r} must be RHT or LHT")
    return built if rule == "RHT" else built.mirrored()


def constant(width: float) -> tuple[Cubic, ...]:
    """A width that does not change."""
    return (Cubic(0.0, width),)


def opening(width: float, length: float) -> tuple[Cubic, ...]:
    """A width that grows smoothly from 0 to `width` over `length` (zero slope at both ends)."""
    return (Cubic(0.0, 0.0, 0.0, 3 * width / length**2, -2 * width / length**3),)


def closing(width: float, length: float) -> tuple[Cubic, ...]:
    """A width that shrinks smoothly from `width` to 0 over `length`."""
    return (Cubic(0.0, width, 0.0, -3 * width / length**2, 2 * width / length**3),)


def carriageway(lanes: int, width: float, side: int = -1, edge: float = 0.0) -> dict[int, Lane]:
    """`lanes` driving lanes on one side (-1 right, +1 left of the reference line) and, where `edge` > 0, a shoulder."""
    built = {
        side * number: Lane(LANE, constant(width), mark="broken" if number < lanes else "solid") for number in range(1, lanes + 1)
    }
    if edge > 0:
        built[side * (lanes + 1)] = Lane("shoulder", constant(edge))
    return built


def linked(section: Section, predecessors: dict[int, int] | None, successors: dict[int, int] | None) -> Section:
    """The section with lane links filled in; None links every lane to its own id, an empty table none."""
    lanes = {
        key: replace(
            lane,
            predecessor=key if predecessors is None else predecessors.get(key),
            successor=key if successors is None else successors.get(key),
        )
        for key, lane in section.lanes.items()
    }
    return replace(section, lanes=lanes)


def two_way(lanes: int, opposite: int, width: float, edge: float = 0.0) -> Section:
    """Driving lanes on both sides of the reference line, with a shoulder where `edge` > 0."""
    layout = carriageway(lanes, width, edge=edge)
    if opposite:
        layout |= carriageway(opposite, width, side=1, edge=edge)
    return Section(0.0, layout, centre_mark="broken" if lanes + opposite < 4 else "solid solid")


def connecting_road(number: int, junction: int, before: tuple[Road, int], after: tuple[Road, int], width: float) -> Road:
    """One lane (-1) through a junction, from a lane to a lane of equal width: a single clothoid that fits both exactly.

    Its reference line leads along the lane's inner border. A left-hand lane is entered from or left
    towards the start of its road, a right-hand lane at the other end, as right-hand traffic has it.
    """
    start, first = _mouth(*before, width, entering=False)
    end, last = _mouth(*after, width, entering=True)
    lane = Lane(LANE, constant(width), predecessor=before[1], successor=after[1])
    return Road(
        number, f"{before[0].name} to {after[0].name}", start, (connect(start, end),), (Section(0.0, {-1: lane}),),
        after[0].type, min(before[0].speed_limit, after[0].speed_limit), junction=junction,
        predecessor=Link("road", before[0].id, first), successor=Link("road", after[0].id, last),
    )  # fmt: skip


def _mouth(road: Road, lane: int, width: float, entering: bool) -> tuple[Pose, str]:
    """Pose of a lane's inner border in the direction of travel where traffic enters or leaves the road, and the contact point."""
    at_start = entering == (lane < 0)
    border = (abs(lane) - 1) * width
    pose = (road.start if at_start else road.end).shifted(math.copysign(border, lane))
    return (pose if lane < 0 else pose.turned(math.pi)), "start" if at_start else "end"
