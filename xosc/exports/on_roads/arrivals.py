"""Synchronised arrivals for versions without steady states and tolerances: both targets are moved back by them.

Who holds the final speed v for a distance d before its target has it where it is d before the target, d/v before the master
arrives. The master is v' · d/v away from its own target then, where v' is its speed when the action begins. What waits for
the end of the action waits for d/v longer.
"""

from __future__ import annotations

from collections.abc import Iterator

from xosc.document import Document
from xosc.exports.on_roads.geometry import Geometry
from xosc.names import meant
from xosc.node import Node

_STEADY = ("TargetDistanceSteadyState", "TargetTimeSteadyState")
_TOLERANCES = ("targetTolerance", "targetToleranceMaster")
_ENDED = ("endTransition", "completeState")
_UNKNOWN = "the version has no steady states, and where the master is when this one begins is known only when it runs"


def earlier(document: Document, geometry: Geometry) -> Iterator[str]:
    """Move targets back by steady states and tolerances, which are left out, in place; a remark for each action.

    Raises:
        Unsupported: it is not known by how much, or a position can't be moved back.
    """
    for action in document.node.iter("SynchronizeAction"):
        steady = next((state for tag in _STEADY for state in action.iter(tag)), None)
        if steady is None and not any(action.has(name) for name in _TOLERANCES):
            continue
        way, time = _held(action, steady, geometry) if steady is not None else (0.0, 0.0)
        master_way = time * abs(_speed(action, geometry) or 0.0)
        own, masters = (float(action.element.attrib.pop(name, "0")) for name in _TOLERANCES)
        _back(action.need("TargetPosition").only(), way + own, geometry)
        _back(action.need("TargetPositionMaster").only(), master_way + masters, geometry)
        if steady is not None:
            speed = action.need("FinalSpeed").only().element
            speed.text = None
            for child in list(speed):
                speed.remove(child)
            _wait(action, time, document.node)
        yield (
            f"{action.where}: SynchronizeAction: its targets are written {way + own:g} m and, for the master, "
            f"{master_way + masters:g} m earlier, where the steady state or the tolerance begins"
        )


def _wait(action: Node, time: float, scenario: Node) -> None:
    """Have conditions that wait for the end of an action wait for a time (s) longer, by which it now ends earlier, in place.

    Raises:
        Unsupported: what they wait for has other actions too.
    """
    around = set(action.element.iterancestors())
    for condition in scenario.iter("Condition") if time else ():
        for state in condition.iter("StoryboardElementStateCondition"):
            awaited = [each for each in meant(state, scenario) if each.element in around]
            if not awaited or state.get("state") not in _ENDED:
                continue
            if any(len(list(each.iter("Action"))) > 1 for each in awaited):
                raise state.unsupported(f"what it waits for would end {time:g} s earlier, but for its other actions")
            condition.element.set("delay", repr(condition.float("delay", 0.0) + time))


def _held(action: Node, steady: Node, geometry: Geometry) -> tuple[float, float]:
    """For how far (m) and how long (s) the final speed is held."""
    final = action.need("FinalSpeed").only()
    speed, relation = final.float("value"), final.get("speedTargetValueType", "")
    if relation:
        master = _speed(action, geometry)
        if master is None:
            raise steady.unsupported(_UNKNOWN)
        speed = master * speed if relation == "factor" else master + speed
    if steady.tag == "TargetTimeSteadyState":
        return max(speed, 0.0) * steady.float("time"), steady.float("time")
    distance = steady.float("distance")
    if distance and (speed <= 0.0 or _speed(action, geometry) is None):
        raise steady.unsupported(_UNKNOWN)
    return distance, distance / speed if distance else 0.0


def _speed(action: Node, geometry: Geometry) -> float | None:
    """The master's speed (m/s) when the action begins."""
    master = geometry.during(action, action.get("masterEntityRef"))
    return master.speed if master is not None else None


def _back(position: Node, distance: float, geometry: Geometry) -> None:
    """Move a position a distance (m) back on its trajectory, its route or its lane."""
    if not distance:
        return
    along, name, facing = position, "s", 1
    if position.tag == "RoutePosition":
        name = "pathS"
        along = next((each for each in position.iter() if each.has(name)), position)
    elif position.tag == "LanePosition":
        facing = geometry.direction(position.get("roadId"), position.int("laneId"))
    elif position.tag != "TrajectoryPosition":
        raise position.unsupported(f"the target would have to be {distance:g} m earlier, and {position.tag} has no way back")
    moved = along.float(name) - facing * distance
    if moved < 0.0:
        raise position.unsupported(f"the target would have to be {distance:g} m earlier, where its way has not begun yet")
    along.element.set(name, repr(moved))
