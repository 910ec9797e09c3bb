"""Lane changes as scenario_runner reads them: as many lanes to the left of the actor itself, over a distance.

Those that can't be said so are the way that their actor takes in a run (`xosc.exports.carla.driven`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from schemas.errors import Unsupported
from schemas.xml import parse
from xosc.document import Document
from xosc.exports.carla.dialect import ASIDE
from xosc.exports.carla.driven import follow_on
from xosc.exports.omissions import leave_out
from xosc.exports.on_roads.geometry import Geometry
from xosc.exports.on_roads.starts import Start, State, actors, beside
from xosc.node import Node


def change_lanes(document: Document, state: State, network: Path | None, geometry: Geometry | None) -> Iterator[str]:
    """Make the changes, in place; remarks on those that are approximations.

    Args:
        state: how entities are when an action begins.
        network: the file of the roads; None where there are none.
        geometry: the scenario on its roads; None refuses what only a run tells.

    Raises:
        Unsupported: something can't be said, named with file and line.
    """
    left_hand = network is not None and any(road.get("rule") == "LHT" for road in parse(network).getroot().iter("road"))
    for action in reversed(list(document.node.iter("LaneChangeAction"))):
        try:
            yield from _change(action, document.node, state, left_hand, geometry)
        except Unsupported as error:
            if geometry is None:
                raise
            yield follow_on(action, document.node, geometry, error)


def _change(action: Node, scenario: Node, state: State, left_hand: bool, geometry: Geometry | None) -> Iterator[str]:
    doing = actors(action)
    if len(doing) != 1:
        raise action.unsupported("scenario_runner changes lanes of one entity, which Init places")
    if abs(action.float("targetLaneOffset", 0.0)) > ASIDE:
        raise action.unsupported("scenario_runner has no offset here")
    now, target = state(action, doing[0]) or Start(), action.need("LaneChangeTarget").only()
    steps = target.int("value")
    if target.get("entityRef", None) != doing[0]:
        steps = _steps(target, now, state(action, target.get("entityRef", "")), left_hand)
        if not steps:
            leave_out(action, scenario)
            yield f"{action.where}: LaneChangeAction: left out, its actor is on that lane"
            return
    yield from _over_distance(action, doing[0], now, geometry)
    target.element.tag = "RelativeTargetLane"
    target.element.attrib.update({"entityRef": doing[0], "value": str(steps)})


def _steps(target: Node, now: Start, other: Start | None, left_hand: bool) -> int:
    """How many lanes to its own left an entity changes that is on a known lane, as is the one that the target may name."""
    unknown = "scenario_runner counts lanes from the actor's own, which is known only when it runs"
    if now.road is None or (target.tag != "AbsoluteTargetLane" and (other is None or other.road != now.road)):
        raise target.unsupported(unknown)
    facing = 1 if (now.lane < 0) != left_hand else -1
    if target.tag == "AbsoluteTargetLane" or other is None:
        lane = target.int("value")
    else:
        lane = beside(other.lane, facing * target.int("value")) if target.int("value") else other.lane
    if lane * now.lane <= 0:
        raise target.unsupported("scenario_runner changes to other lanes of the same direction only")
    return facing * (lane - now.lane)


def _over_distance(action: Node, actor: str, now: Start, geometry: Geometry | None) -> Iterator[str]:
    """A time as the distance that the speed makes of it, a rate as the one that the change takes in a run."""
    dynamics = action.need("LaneChangeActionDynamics")
    dimension, value = dynamics.get("dynamicsDimension"), dynamics.float("value")
    if dimension == "distance":
        return
    if dimension == "time" and now.speed:
        distance = value * now.speed
        yield f"{dynamics.where}: {dynamics.tag}: the time is written as the {distance:g} m that {now.speed:g} m/s make of it"
    else:
        driven = _driven(action, actor, geometry) if geometry is not None else 0.0
        if not driven:
            raise dynamics.unsupported("scenario_runner changes lanes over a distance, which is not known here")
        distance = driven
        yield (
            f"{dynamics.where}: {dynamics.tag}: the {dimension} is written as the {distance:g} m that it takes in a run "
            "without a system under test"
        )
    dynamics.element.attrib.update({"dynamicsDimension": "distance", "value": repr(distance)})


def _driven(action: Node, actor: str, geometry: Geometry) -> float:
    """How far (m) the actor drives along the road while an action goes on to its end in a run; 0 where it doesn't."""
    begin, end = geometry.begins(action), geometry.ends(action)
    places = geometry.driven(actor, begin, end) if begin is not None and end is not None else []
    return sum(math.dist(a[:3], b[:3]) for a, b in pairwise(places))
