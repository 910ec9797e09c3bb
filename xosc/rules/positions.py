"""Positions are on roads and lanes that exist; trajectories have the times and knots that they
need."""

from __future__ import annotations

from collections.abc import Iterator

from schemas.checks.document import CheckedDocument
from schemas.checks.registry import Finding, rule, unresolved
from schemas.common.xml import local_name

_ROAD_POSITIONS = ("LanePosition", "RoadPosition", "RelativeLanePosition", "RelativeRoadPosition")


@rule("asam.net:xosc:1.0.0:scenario_logic.invalid_elements_if_no_road_network", kinds=("scenario",))
def road_position_has_a_road_network(document: CheckedDocument) -> Iterator[Finding]:
    """Positions in road or lane coordinates need a road network (LogicFile)."""
    # One that can't be read is an error of its own, and its roads are not known.
    if document.elements("LogicFile"):
        return
    for element in document.elements(*_ROAD_POSITIONS):
        yield Finding(
            element, f"{local_name(element)} needs a road network, the scenario has no LogicFile"
        )


@rule("asam.net:xosc:1.1.0:positioning.geodetic_datum_defined", kinds=("scenario",), since=(1, 1))
def geo_position_has_a_geo_reference(document: CheckedDocument) -> Iterator[Finding]:
    """A GeoPosition needs a road network with a geoReference."""
    network = document.road_network
    if network is None or network.geo_reference:
        return
    for element in document.elements("GeoPosition"):
        yield Finding(
            element,
            f"a GeoPosition needs a geoReference, the road network {network.path.name} has none",
        )


@rule(
    "xosc.toolchain:xosc:1.0.0:reference_control.road_exists_in_road_network", kinds=("scenario",)
)
def road_exists(document: CheckedDocument) -> Iterator[Finding]:
    """A roadId must be the id of a road in the road network."""
    network = document.road_network
    return (
        unresolved(document, "road", network.roads, "roadId", where=f" in {network.path.name}")
        if network
        else iter(())
    )


ROAD_LENGTH_UID = "xosc.toolchain:xosc:1.0.0:positioning.position_is_on_the_road"

# Lengths in files are often rounded to centimetres, and positions at the end with them.
_TOLERANCE = 0.01


@rule(ROAD_LENGTH_UID, kinds=("scenario",))
def position_is_on_the_road(document: CheckedDocument) -> Iterator[Finding]:
    """The s coordinate of a position must be between 0 and the length of the road."""
    network = document.road_network
    for element in document.elements("LanePosition", "RoadPosition") if network else ():
        road = network.roads.get(document.value(element, "roadId") or "") if network else None
        s = document.number(element, "s")
        if road is not None and s is not None and not -_TOLERANCE <= s <= road.length + _TOLERANCE:
            yield Finding(
                element,
                f"s={s:g} is not on road {element.get('roadId')}, which is {road.length:g} m long",
            )


LANE_UID = "xosc.toolchain:xosc:1.0.0:reference_control.lane_exists_on_road"


@rule(LANE_UID, kinds=("scenario",))
def lane_exists(document: CheckedDocument) -> Iterator[Finding]:
    """The laneId of a LanePosition must be a lane of the road at that s coordinate; expressions may
    write it as -2.0.

    Where roads have temporary lanes it is one of these, unless the position names the permanent
    layer.
    """
    network = document.road_network
    for element in document.elements("LanePosition") if network else ():
        road = network.roads.get(document.value(element, "roadId") or "") if network else None
        lane, s = document.value(element, "laneId"), document.number(element, "s")
        # Beyond the road there are no lanes; `position_is_on_the_road` says so.
        if road is None or lane is None or s is None or not 0 <= s <= road.length:
            continue
        # Compared as text first: an id is one, and only expressions give it as a decimal number.
        lanes, number = (
            road.lanes(s, document.value(element, "layer")),
            document.number(element, "laneId"),
        )
        # + 0.0 makes lane 0 of -0.0.
        if lane.strip() not in lanes and (number is None or f"{number + 0.0:g}" not in lanes):
            known = ", ".join(sorted(lanes, key=_from_left))
            yield Finding(
                element,
                f"laneId: there is no lane {lane!r} at s={s:g} of road {element.get('roadId')}, "
                f"it has {known}",
            )


def _from_left(lane: str) -> float:
    try:
        return -float(lane)
    except ValueError:
        return 0.0


LANE_DISTANCE_UID = "xosc.toolchain:xosc:1.1.0:positioning.relative_lane_position_has_one_distance"


@rule(LANE_DISTANCE_UID, kinds=("scenario", "catalog"), since=(1, 1))
def relative_lane_position_has_one_distance(document: CheckedDocument) -> Iterator[Finding]:
    """A RelativeLanePosition must have one of the attributes ds and dsLane, and only one."""
    for element in document.elements("RelativeLanePosition"):
        given = [name for name in ("ds", "dsLane") if element.get(name) is not None]
        if len(given) != 1:
            yield Finding(
                element,
                f"{' and '.join(given) or 'neither ds nor dsLane'} given, one "
                "of the two is expected",
            )


TIMING_UID = "asam.net:xosc:1.0.0:routing.trajectory_timing_exists_if_requested"

_TIMES = {
    "Vertex": ("time",),
    "ControlPoint": ("time",),
    "Clothoid": ("startTime", "stopTime"),
    "ClothoidSpline": ("timeEnd",),
}


@rule(TIMING_UID)
def trajectory_has_times(document: CheckedDocument) -> Iterator[Finding]:
    """A trajectory that is followed with a timing reference shall have a time at each vertex,
    control point and clothoid."""
    for action in document.elements("FollowTrajectoryAction"):
        # Without Timing the actor keeps its own speed, and times of the trajectory have no meaning.
        if action.find("TimeReference/Timing") is None:
            continue
        # Not those of a trajectory in a catalogue: the entry may be followed without times
        # elsewhere.
        for part in action.iter(*_TIMES):
            missing = [name for name in _TIMES[local_name(part)] if part.get(name) is None]
            if missing:
                yield Finding(
                    part,
                    f"the {local_name(part)} has no {missing[0]}, which the "
                    "action's Timing asks for",
                )
                # One for each trajectory: it has either all times or none.
                break


@rule("xosc.toolchain:xosc:1.4.0:routing.motion_is_not_empty")
def motion_is_not_empty(document: CheckedDocument) -> Iterator[Finding]:
    """A Motion shall give a speed or an acceleration."""
    for element in document.elements("Motion", "MotionStart", "MotionEnd"):
        if not element.attrib:
            yield Finding(element, "speed_longitudinal or acceleration_longitudinal is expected")


@rule("xosc.toolchain:xosc:1.0.0:routing.nurbs_knots_fit_order")
def nurbs_knots_fit_order(document: CheckedDocument) -> Iterator[Finding]:
    """A Nurbs must have at least as many control points as its order, and one knot for each point
    and each order, ascending."""
    for element in document.elements("Nurbs"):
        order = document.number(element, "order")
        points, knots = len(element.findall("ControlPoint")), element.findall("Knot")
        if order is None:
            continue
        if points < order:
            yield Finding(element, f"{points} control points are fewer than the order {order:g}")
        elif len(knots) != points + order:
            yield Finding(
                element,
                f"{len(knots)} knots, but {points} control points of order {order:g} need "
                f"{points + order:g}",
            )
        values = [value for knot in knots if (value := document.number(knot, "value")) is not None]
        if values != sorted(values):
            yield Finding(element, "the knots must ascend")
