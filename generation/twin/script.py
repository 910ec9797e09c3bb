"""Script of a manoeuvre scenario as terms of its parameters: initial states, changes of speed and lane, evaluated in arrays."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import xosc
from runner.interpreter.compiler import Scenario
from runner.interpreter.execution import prepare
from runner.motion.dynamics import read_constraints, tighter
from runner.participants.declaration import BoundingBox, Performance
from runner.settings import RunSettings
from schemas.common.array_types import FloatArray
from schemas.common.errors import InvalidFile, Unsupported
from schemas.expressions import ExpressionError, is_expression, references
from xodr.road import Road
from xosc.node import Node

_OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "min": np.minimum, "max": np.maximum, "abs": np.abs, "sign": np.sign, "sqrt": np.sqrt, "pow": np.power,
}  # fmt: skip


def value(text: str, parameters: Mapping[str, FloatArray], n: int) -> FloatArray:
    """The values (n,) of a literal, a reference or an expression.

    Args:
        parameters: values (n,) by name.

    Raises:
        Unsupported: it is no arithmetic of numbers, or refers to something else.
    """
    body = text[2:-1] if is_expression(text) else text
    try:
        unknown = references(text) - parameters.keys()
        found = _value(ast.parse(body.replace("$", "").strip(), mode="eval").body, parameters)
    except (ExpressionError, SyntaxError, KeyError):
        raise Unsupported(f"{text!r} can't be worked out for many points at once") from None
    if unknown:
        raise Unsupported(f"{text!r} refers to {min(unknown)}, which is no number")
    return np.broadcast_to(np.asarray(found, np.float64), (n,))


def _value(node: ast.expr, parameters: Mapping[str, FloatArray]) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.Name(id=name):
            return parameters[name]
        case ast.UnaryOp(op=sign, operand=operand):
            return _OPERATORS[type(sign)](_value(operand, parameters))
        case ast.BinOp(left=left, op=sign, right=right):
            return _OPERATORS[type(sign)](_value(left, parameters), _value(right, parameters))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return _FUNCTIONS[name](*(_value(each, parameters) for each in arguments))
        case _:
            raise KeyError(node)


_PROBE = 50.0
"""Station (s, m) at which a road's lanes are read"""


@dataclass(frozen=True)
class Change:
    """A change of speed and lane, and the settling after it; terms of the parameters.

    Attributes:
        delay: time until it may begin, s. gap: from leader to follower at which it begins at the latest, m.
        duration: s. speed: at its end, m/s. lanes: to the left; 0 for none.
        rest: duration of the settling, s. final: speed after it, m/s.
        jerk: at which the acceleration of the change builds up and ends, m/s³; None where it jumps.
    """

    follower: str
    leader: str
    delay: str
    gap: str
    duration: str
    speed: str
    lanes: int
    rest: str
    final: str
    jerk: str | None = None


@dataclass(frozen=True)
class Following:
    """Constant gap behind another vehicle from the start on.

    Attributes:
        leader: that vehicle. gap: of the boxes, m; a term of the parameters. limits: of what is done for it.
    """

    leader: str
    gap: str
    limits: Performance


@dataclass(frozen=True)
class Actor:
    """A participant.

    Attributes:
        box, performance: of its vehicle.
        s: terms that add up to where it begins along the road, m. lane: where it begins.
        speed: at the beginning, m/s. change: None where it keeps its speed and lane. following: None without a leader.
    """

    name: str
    box: BoundingBox
    performance: Performance
    s: tuple[str, ...]
    lane: int
    speed: str
    change: Change | None
    following: Following | None = None


@dataclass(frozen=True)
class Script:
    """A manoeuvre scenario on a straight road.

    Attributes:
        actors: in the order of the file's entities, the ego first.
        lanes: t of the lanes' centres, m, by id.
        rest, longest: the scene ends this long after the change of `last`, and at this time in any case, s.
        last: name of the actor whose change ends the scene.
        length: of the road, m.
        literals: values of all declared numbers.
    """

    actors: tuple[Actor, ...]
    lanes: dict[int, float]
    last: str
    rest: str
    longest: str
    length: float
    literals: dict[str, float] = field(default_factory=dict)


def read(path: Path, settings: RunSettings | None = None) -> Script:
    """The script of a scenario, read as settings of runs say.

    Raises:
        Unsupported: it is no manoeuvre scenario on a straight road.
        InvalidFile: it is malformed.
    """
    document, compiled = xosc.load(path), prepare(path, settings=settings).scenario
    root = document.node
    try:
        changes = dict(_changes(root))
        last, rest, longest = _ends(root)
        places = {each.get("entityRef"): each for each in root.need("Storyboard", "Init", "Actions").children("Private")}
        road, actors = _actors(compiled, places, changes)
    except (InvalidFile, KeyError, StopIteration, ValueError):
        raise Unsupported("this is no manoeuvre scenario that can be played for many points at once", path=path) from None
    lanes = {lane: _centre(road, lane) for lane in road.lane_ids(_PROBE) if lane < 0}
    return Script(actors, lanes, last, rest, longest, road.length, _numbers(root))


def _centre(road: Road, lane: int) -> float:
    return float(road.lane_t(_PROBE, lane))


def _numbers(root: Node) -> dict[str, float]:
    """Values of declared numbers, for parameters that are neither searched nor pinned."""
    declared = root.need("ParameterDeclarations").children()
    return {each.get("name"): float(each.get("value")) for each in declared if each.get("parameterType") == "double"}


def _actors(compiled: Scenario, places: dict[str, Node], changes: dict[str, Change]) -> tuple[Road, tuple[Actor, ...]]:
    network = compiled.network
    if network is None or len(network.roads) != 1:
        raise ValueError("one road is needed")
    road = next(iter(network.roads.values()))
    if not road.line.straight:
        raise ValueError("a straight road is needed")
    where: dict[str, tuple[tuple[str, ...], int]] = {}
    for name in compiled.entities:
        position = places[name].need("PrivateAction", "TeleportAction", "Position").only()
        if position.tag == "LanePosition" and int(position.get("laneId")) < 0 and float(position.get("offset", "0")) == 0.0:
            where[name] = (position.get("s"),), int(position.get("laneId"))
        elif position.tag == "RelativeLanePosition" and float(position.get("offset", "0")) == 0.0:
            terms, lane = where[position.get("entityRef")]
            where[name] = (*terms, position.get("ds")), lane + int(position.get("dLane"))
        else:
            raise ValueError(position.tag)
    return road, tuple(
        Actor(
            name, each.box, each.declared.performance, *where[name], _speed(places[name]), changes.get(name),
            _following(places[name], each.declared.performance),
        )
        for name, each in compiled.entities.items()
    )  # fmt: skip


def _speed(place: Node) -> str:
    """The initial speed."""
    action = next(each for each in place.children("PrivateAction") if each.find("LongitudinalAction") is not None)
    return action.need("LongitudinalAction", "SpeedAction", "SpeedActionTarget", "AbsoluteTargetSpeed").get("value")


def _following(place: Node, performance: Performance) -> Following | None:
    """The gap that an initial action keeps."""
    actions = [each.find("LongitudinalAction", "LongitudinalDistanceAction") for each in place.children("PrivateAction")]
    for action in actions:
        if action is None:
            continue
        constraints = read_constraints(action.find("DynamicConstraints"))
        kind = tuple(action.get(each, "") for each in ("coordinateSystem", "displacement", "freespace", "continuous"))
        if constraints is None or kind != ("lane", "trailingReferencedEntity", "true", "true"):
            raise ValueError("another way to follow")
        return Following(action.get("entityRef"), action.get("distance"), tighter(constraints, performance))
    return None


def _changes(root: Node) -> Iterator[tuple[str, Change]]:
    """The manoeuvres of all actors."""
    for story in root.need("Storyboard").children("Story"):
        for act in story.children("Act"):
            for group in act.children("ManeuverGroup"):
                (actor,) = (each.get("entityRef") for each in group.need("Actors").children("EntityRef"))
                (maneuver,) = group.children("Maneuver")
                change, settle = maneuver.children("Event")
                yield actor, _change(actor, change, settle)


def _change(actor: str, change: Node, settle: Node) -> Change:
    speed, jerk = _over_time(change)
    lanes = [each for each in _actions(change) if each.find("LateralAction") is not None]
    aside = lanes[0].need("LateralAction", "LaneChangeAction") if lanes else None
    target = aside.need("LaneChangeTarget", "RelativeTargetLane") if aside is not None else None
    if aside is not None and target is not None:
        dynamics = aside.need("LaneChangeActionDynamics")
        same = dynamics.get("value") == speed[0] and dynamics.get("dynamicsShape") == "sinusoidal"
        if not same or target.get("entityRef") != actor or dynamics.get("dynamicsDimension") != "time":
            raise ValueError("another lane change")
    (group,) = change.need("StartTrigger").children("ConditionGroup")
    time, distance = group.children("Condition")
    condition = distance.need("ByEntityCondition", "EntityCondition", "RelativeDistanceCondition")
    follower = distance.need("ByEntityCondition", "TriggeringEntities", "EntityRef").get("entityRef")
    time.need("ByValueCondition", "SimulationTimeCondition")
    kind = tuple(condition.get(each) for each in ("relativeDistanceType", "coordinateSystem", "freespace", "rule"))
    if kind != ("longitudinal", "lane", "true", "lessOrEqual"):
        raise ValueError("another distance")
    rest, sudden = _over_time(settle)
    if sudden is not None or (jerk is not None and aside is not None):
        raise ValueError("another use of jerk")
    lanes_left = int(target.get("value")) if target is not None else 0
    return Change(
        follower, condition.get("entityRef"), time.get("delay"), condition.get("value"), *speed, lanes_left, *rest, jerk
    )  # fmt: skip


def _actions(event: Node) -> list[Node]:
    return [each.need("PrivateAction") for each in event.children("Action")]


def _over_time(event: Node) -> tuple[tuple[str, str], str | None]:
    """Duration and target of an event's change of speed, and its jerk; None where the change is linear."""
    action = next(each for each in _actions(event) if each.find("LongitudinalAction") is not None).need("LongitudinalAction")
    if (profile := action.find("SpeedProfileAction")) is not None:
        (entry,) = profile.children("SpeedProfileEntry")
        limits = profile.need("DynamicConstraints")
        up, down = limits.get("maxAccelerationRate"), limits.get("maxDecelerationRate")
        others = [limits.get(name, "") for name in ("maxAcceleration", "maxDeceleration", "maxSpeed")]
        if up != down or any(others) or profile.get("followingMode") != "follow" or profile.has("entityRef"):
            raise ValueError("another profile")
        return (entry.get("time"), entry.get("speed")), up
    speed = action.need("SpeedAction")
    dynamics = speed.need("SpeedActionDynamics")
    if (dynamics.get("dynamicsShape"), dynamics.get("dynamicsDimension")) != ("linear", "time"):
        raise ValueError("another change of speed")
    return (dynamics.get("value"), speed.need("SpeedActionTarget", "AbsoluteTargetSpeed").get("value")), None


def _ends(root: Node) -> tuple[str, str, str]:
    """The actor whose change ends the scene, how long after it, and the longest time."""
    groups = root.need("Storyboard", "StopTrigger").children("ConditionGroup")
    conditions = [each for group in groups for each in group.children("Condition")]
    state = next(each for each in conditions if each.find("ByValueCondition", "StoryboardElementStateCondition") is not None)
    time = next(each for each in conditions if each.find("ByValueCondition", "SimulationTimeCondition") is not None)
    name = state.need("ByValueCondition", "StoryboardElementStateCondition").get("storyboardElementRef")
    longest = time.need("ByValueCondition", "SimulationTimeCondition").get("value")
    return name.removesuffix(" changes"), state.get("delay"), longest
