"""Script of a manoeuvre scenario as terms of its parameters, and its motion in many cases at once.

The script has initial states and changes of speed and lane, evaluated in arrays. The motion is on a
straight road: steps of `runner.engine` in arrays. All face increasing s; y is t, positive to the
left. Arrays have one entry for each case.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import xosc
from runner.engine.compile.compiler import Scenario
from runner.engine.motion.dynamics import EPSILON, RESERVE, read_constraints, tighter
from runner.engine.motion.speed_plans import plateau, shortest
from runner.engine.participants.declaration import BoundingBox, Performance
from runner.engine.participants.outlines import interval_gaps
from runner.judging.execution import prepare
from runner.judging.measures.relations import MotionRows, View
from runner.judging.settings import RunSettings
from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.errors import InvalidFile, Unsupported
from schemas.expressions import ExpressionError, is_expression, references
from xodr.model.road import Road
from xosc.document.node import Node

_RETURN, _GRAVITY = 3.5, 9.81
"""Value of `runner.systems.drivers`, m/s²"""
_SAME = 1e-9


@dataclass
class Body:
    """A participant in all cases.

    Attributes:
        x, y: reference point, m. h: heading, rad. speed, acceleration: along it. drift: speed to
            the left, m/s.
        target: speed that the scenario asks for at the end of the step, m/s.
    """

    actor: Actor
    x: FloatArray
    y: FloatArray
    h: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    target: FloatArray
    drift: FloatArray
    straight: bool = True
    """Whether everyone's heading is 0"""

    def take(self, rows: BoolArray) -> None:
        """Keep some cases only."""
        for name in ("x", "y", "h", "speed", "acceleration", "target", "drift"):
            setattr(self, name, getattr(self, name)[rows])

    def motion(self) -> MotionRows:
        """Rows for the measures, one for each case."""
        zero, one, road = _blank(len(self.x))
        found = MotionRows(
            self.actor.name,
            self.actor.box,
            zero,
            self.x,
            self.y,
            zero,
            self.h,
            self.speed,
            road,
            self.x,
            self.y,
        )
        if self.straight:
            found.__dict__["facing"] = one, zero  # need not be worked out
        return found

    def view(self, other: Body) -> View:
        """Return the view of another vehicle along and across the road, as `runner.judging.measures.relations` does on one road."""
        a, b = self.actor.box, other.actor.box
        x, y, there_x, there_y = self.x + a.x, self.y + a.y, other.x + b.x, other.y + b.y
        return View(
            interval_gaps(x - a.length / 2, x + a.length / 2, there_x - b.length / 2, there_x + b.length / 2),
            interval_gaps(y - a.width / 2, y + a.width / 2, there_y - b.width / 2, there_y + b.width / 2),
            self.speed, self.drift, other.speed, other.drift,
        )  # fmt: skip

    def move(self, speed: FloatArray, aside: FloatArray, dt: float) -> None:
        """Move along the lane at a speed (n,) over a slanting way that leads `aside` (n,) metres to the left."""
        way = speed * dt
        if aside.any():
            rest = way * way - aside * aside
            slanted = (aside != 0.0) & (way != 0.0)
            turn = np.arcsin(
                within(np.divide(aside, way, out=np.zeros_like(way), where=slanted), -1.0, 1.0)
            )
            self.x = self.x + np.sqrt(np.maximum(rest, 0.0))
            self.y = self.y + aside
            self.h, self.straight = np.where(slanted, turn, 0.0), False
        else:
            self.x = self.x + np.sqrt(way * way)
            self.h, self.straight = np.zeros_like(way), True
        self.drift = aside / dt
        self.acceleration = (speed - self.speed) / dt
        self.speed = speed


def driven(
    ego: Body, intervenes: BoolArray, wanted: FloatArray, returning: BoolArray, dt: float
) -> tuple[FloatArray, BoolArray]:
    """Speed of an ego at the end of a step, as `runner.systems.drivers.SystemDriver` has it, and where it goes on returning.

    Args:
        intervenes: where its system does (n,). wanted: accelerations that the system wants there
            (n,), m/s².
        returning: where the ego is on its way back to the scripted speed after an intervention
            (n,).
    """
    limits = ego.actor.performance
    bounded = within(
        wanted, -min(limits.max_deceleration, _GRAVITY), min(limits.max_acceleration, _GRAVITY)
    )
    braked = within(ego.speed + bounded * dt, 0.0, np.maximum(limits.max_speed, ego.speed))
    change = ego.target - ego.speed
    most = dt * np.where(
        change * ego.speed >= 0.0, min(_RETURN, limits.max_acceleration), limits.max_deceleration
    )
    back = ego.speed + within(change, -most, most)
    speed = np.where(intervenes, braked, np.where(returning, back, ego.target))
    return speed, intervenes | (returning & (np.abs(back - ego.target) >= _SAME))


def within(values: FloatArray, low: FloatArray | float, high: FloatArray | float) -> FloatArray:
    """Values no less than `low` and no more than `high`; np.clip takes twice the time for few."""
    found: FloatArray = np.minimum(np.maximum(values, low), high)
    return found


@lru_cache(maxsize=8)
def _blank(n: int) -> tuple[FloatArray, FloatArray, NDArray[np.object_]]:
    """Zeros and ones (n,), and no road for any of n cases."""
    return np.zeros(n), np.ones(n), np.full(n, None, object)


class Keeping:
    """A gap that an actor keeps behind another one, in all cases: `runner.engine.motion.dynamics.GapController` in arrays.

    Args:
        gap: of the boxes (n,), m.
        limits: of acceleration, braking and jerk, all finite.
    """

    def __init__(self, gap: FloatArray, limits: Performance) -> None:
        self._gap, self._limits, self._acceleration = gap, limits, np.zeros(len(gap))
        self._jerk = min(limits.max_acceleration_rate, limits.max_deceleration_rate)

    def take(self, rows: BoolArray) -> None:
        """Keep some cases only."""
        self._gap, self._acceleration = self._gap[rows], self._acceleration[rows]

    def step(self, body: Body, leader: Body, dt: float) -> None:
        """Ask for the speed at the end of the step."""
        box, other, limits = body.actor.box, leader.actor.box, self._limits
        boxes = box.x + box.length / 2 - (other.x - other.length / 2)
        error = leader.x - body.x - (self._gap + boxes)
        drive = np.where(error > 0.0, limits.max_acceleration, limits.max_deceleration)
        brake = np.where(error > 0.0, limits.max_deceleration, limits.max_acceleration)
        root = np.minimum(np.sqrt(0.4 * brake), self._jerk / np.maximum(drive, brake))
        wanted = (
            2.0
            * root
            * (_safe_closing(error, RESERVE * brake, root / 2.0) - (body.speed - leader.speed))
        )
        wanted = within(wanted, -limits.max_deceleration, limits.max_acceleration)
        wanted = np.maximum(wanted, self._acceleration - limits.max_deceleration_rate * dt)
        self._acceleration = np.minimum(
            wanted, self._acceleration + limits.max_acceleration_rate * dt
        )
        body.target = within(body.speed + self._acceleration * dt, 0.0, limits.max_speed)


def _safe_closing(gap: FloatArray, brake: FloatArray, slope: FloatArray) -> FloatArray:
    far, knee = np.abs(gap), brake / slope
    beyond = np.sqrt(np.maximum(2.0 * brake * far - knee * knee, 0.0))
    found: FloatArray = np.where(
        slope * slope * far <= brake, slope * gap, np.copysign(beyond, gap)
    )
    return found


@dataclass
class Changing:
    """An actor's change of speed and lane, and the settling after it, in all cases.

    Args:
        n: cases.
        shift: way to the left of the lane change, m.
        duration, speed, rest, final: of the change and of the settling (n,), s and m/s.
    """

    n: int
    shift: float
    duration: FloatArray
    speed: FloatArray
    rest: FloatArray
    final: FloatArray
    begun: BoolArray = field(init=False)
    done: FloatArray = field(init=False)
    """When conditions see that the change is complete (n,), s; infinite before"""

    def __post_init__(self) -> None:
        n = self.n
        self.begun, self.done = np.zeros(n, bool), np.full(n, np.inf)
        self._past, self._settling = np.zeros(n), np.full(n, np.nan)
        self._from, self._to = np.zeros(n), np.zeros(n)
        self._accelerating, self._crossing = np.zeros(n, bool), np.zeros(n, bool)
        self._offset = np.zeros(n)

    def take(self, rows: BoolArray) -> None:
        """Keep some cases only."""
        for name, values in vars(self).items():
            if isinstance(values, np.ndarray):
                setattr(self, name, values[rows])

    def begin(self, fires: BoolArray, body: Body, following: float) -> None:
        """Begin where the trigger fires; a change that takes no time is complete, which conditions see one step later."""
        fires = fires & ~self.begun
        if not fires.any():
            return
        self.begun = self.begun | fires
        self._from = np.where(fires, body.speed, self._from)
        self._to = np.where(fires, self.speed, self._to)
        self._accelerating |= fires & (self.speed != body.speed) & (self.duration > 0.0)
        body.target = np.where(fires & ~self._accelerating, self.speed, body.target)
        if self.shift:
            self._crossing |= fires
        self.done = np.where(fires & ~self._accelerating & ~self._crossing, following, self.done)

    def step(self, body: Body, time: float, dt: float) -> FloatArray:
        """Ask for the speed at the end of the step that ends at a time (s); the way to the left (n,) that is driven in it, m."""
        self._past = np.where(self.begun, self._past + dt, 0.0)
        extent = np.where(np.isnan(self._settling), self.duration, self.rest)
        past = np.where(np.isnan(self._settling), self._past, self._settling + dt)
        self._settling = np.where(np.isnan(self._settling), np.nan, self._settling + dt)
        wanted, over = self._wanted(past, extent)
        body.target = np.where(self._accelerating, wanted, body.target)
        self._accelerating = self._accelerating & ~over
        aside = self._sidestep(body, dt) if self.shift else np.zeros_like(past)
        complete = self.begun & np.isinf(self.done) & ~self._accelerating & ~self._crossing
        self.done = np.where(complete, time, self.done)
        return aside

    def _wanted(self, past: FloatArray, extent: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Speed (n,), m/s, after a time of a change or settling that takes another (n,), s, and where that is over (n,)."""
        progress = np.divide(past, extent, out=np.ones_like(past), where=extent > 0.0)
        over = progress >= 1.0 - EPSILON
        return np.where(over, self._to, self._from + (self._to - self._from) * progress), over

    def settle(self, time: float, body: Body) -> None:
        """Begin to settle where the change is complete."""
        starts = (self.done <= time + 1e-9) & np.isnan(self._settling)
        if not starts.any():
            return
        self._settling = np.where(starts, 0.0, self._settling)
        self._from = np.where(starts, body.speed, self._from)
        self._to = np.where(starts, self.final, self._to)
        lasting = (self.final != body.speed) & (self.rest > 0.0)
        self._accelerating = np.where(starts, lasting, self._accelerating)
        body.target = np.where(starts & ~lasting, self.final, body.target)

    def _sidestep(self, body: Body, dt: float) -> FloatArray:
        """Way to the left in this step, no longer than the way driven; the lane is reached when all of it is done."""
        progress = np.divide(
            self._past, self.duration, out=np.ones_like(self._past), where=self.duration > 0.0
        )
        over = progress >= 1.0 - EPSILON
        goal = np.where(
            over, self.shift, self.shift * 0.5 * (1.0 - np.cos(np.pi * np.minimum(progress, 1.0)))
        )
        reach = np.abs(body.speed) * dt
        offset = within(goal, self._offset - reach, self._offset + reach)
        aside = np.where(self._crossing, offset - self._offset, 0.0)
        self._offset = self._offset + aside
        self._crossing = self._crossing & ~(over & (offset == self.shift))
        return aside


@dataclass
class JerkChanging(Changing):
    """An actor's change of speed with a limited jerk, and the settling after it; without a change of lane.

    Args:
        jerk: of the change (n,), m/s³.
    """

    jerk: FloatArray = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._profile = np.zeros((self.n, len(_COLUMNS)))

    def begin(self, fires: BoolArray, body: Body, following: float) -> None:
        """Begin where the trigger fires; every change takes time, even one to the same speed."""
        fires = fires & ~self.begun
        if not fires.any():
            return
        super().begin(fires, body, following)
        self._accelerating |= fires
        self.done = np.where(fires, np.inf, self.done)
        planned = plan(body.speed, self.speed, self.duration, self.jerk, body.actor.performance)
        self._profile = np.where(fires[:, None], planned, self._profile)

    def _wanted(self, past: FloatArray, extent: FloatArray) -> tuple[FloatArray, BoolArray]:
        wanted, over = super()._wanted(past, extent)
        changing = np.isnan(self._settling)
        speed, ended = speeds(self._profile, past)
        return np.where(changing, speed, wanted), np.where(changing, ended, over)


_COLUMNS = ("start", "plateau", "entering", "leaving", "duration")


def plan(
    start: FloatArray,
    target: FloatArray,
    duration: FloatArray,
    jerk: FloatArray,
    limits: Performance,
) -> FloatArray:
    """The profiles (n, 5) from speeds to speeds (n,), m/s, with the columns of `_COLUMNS`.

    These are: speed at the start, m/s; acceleration between the ends, m/s²; times that the first
    part, the last part and the whole take, s.

    Args:
        duration: wanted (n,), s. jerk: greatest (n,), m/s³. limits: of the vehicle.
    """
    change = np.minimum(target, limits.max_speed) - start
    gains = change > 0.0
    up, down = (
        1.0 / np.minimum(jerk, limits.max_acceleration_rate),
        1.0 / np.minimum(jerk, limits.max_deceleration_rate),
    )
    entering, leaving = np.where(gains, up, down), np.where(gains, down, up)
    most = np.where(gains, limits.max_acceleration, limits.max_deceleration)
    lasts = np.maximum(duration, shortest(change, most, entering, leaving))
    top = plateau(change, lasts, entering, leaving)
    return np.stack([start, top, np.abs(top) * entering, np.abs(top) * leaving, lasts], axis=1)


def speeds(profile: FloatArray, past: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Speeds (n,), m/s, at times since the profiles (n, 5) began (n,), s, and where these have ended (n,)."""
    start, top, entering, leaving, lasts = profile.T
    held = lasts - entering - leaving
    into, after = within(past, 0.0, entering), within(past - entering - held, 0.0, leaving)
    between = within(past - entering, 0.0, held)
    risen = np.divide(into * into, 2.0 * entering, out=np.zeros_like(into), where=entering > 0.0)
    fallen = after - np.divide(
        after * after, 2.0 * leaving, out=np.zeros_like(after), where=leaving > 0.0
    )
    return start + top * (risen + between + fallen), past + EPSILON >= lasts


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
        Unsupported: the text is not arithmetic of numbers, or refers to something else.
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
        delay: time until it may begin, s. gap: from leader to follower at which it begins at the
            latest, m.
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
        leader: that vehicle. gap: of the boxes, m; a term of the parameters. limits: of what is
            done for it.
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
        speed: at the beginning, m/s. change: None where it keeps its speed and lane. following:
            None without a leader.
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
        rest, longest: the scene ends this long after the change of `last`, and at this time in any
            case, s.
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
        Unsupported: the file is not a manoeuvre scenario on a straight road.
        InvalidFile: it is malformed.
    """
    document, compiled = xosc.load(path), prepare(path, settings=settings).scenario
    root = document.node
    try:
        changes = dict(_changes(root))
        last, rest, longest = _ends(root)
        places = {
            each.get("entityRef"): each
            for each in root.need("Storyboard", "Init", "Actions").children("Private")
        }
        road, actors = _actors(compiled, places, changes)
    except (InvalidFile, KeyError, StopIteration, ValueError):
        raise Unsupported(
            "this is no manoeuvre scenario that can be played for many points at once", path=path
        ) from None
    lanes = {lane: _centre(road, lane) for lane in road.lane_ids(_PROBE) if lane < 0}
    return Script(actors, lanes, last, rest, longest, road.length, _numbers(root))


def _centre(road: Road, lane: int) -> float:
    return float(road.lane_t(_PROBE, lane))


def _numbers(root: Node) -> dict[str, float]:
    """Values of declared numbers, for parameters that are neither searched nor pinned."""
    declared = root.need("ParameterDeclarations").children()
    return {
        each.get("name"): float(each.get("value"))
        for each in declared
        if each.get("parameterType") == "double"
    }


def _actors(
    compiled: Scenario, places: dict[str, Node], changes: dict[str, Change]
) -> tuple[Road, tuple[Actor, ...]]:
    network = compiled.network
    if network is None or len(network.roads) != 1:
        raise ValueError("one road is needed")
    road = next(iter(network.roads.values()))
    if not road.line.straight:
        raise ValueError("a straight road is needed")
    where: dict[str, tuple[tuple[str, ...], int]] = {}
    for name in compiled.entities:
        position = places[name].need("PrivateAction", "TeleportAction", "Position").only()
        if (
            position.tag == "LanePosition"
            and int(position.get("laneId")) < 0
            and float(position.get("offset", "0")) == 0.0
        ):
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
    action = next(
        each
        for each in place.children("PrivateAction")
        if each.find("LongitudinalAction") is not None
    )
    return action.need(
        "LongitudinalAction", "SpeedAction", "SpeedActionTarget", "AbsoluteTargetSpeed"
    ).get("value")


def _following(place: Node, performance: Performance) -> Following | None:
    """The gap that an initial action keeps."""
    actions = [
        each.find("LongitudinalAction", "LongitudinalDistanceAction")
        for each in place.children("PrivateAction")
    ]
    for action in actions:
        if action is None:
            continue
        constraints = read_constraints(action.find("DynamicConstraints"))
        kind = tuple(
            action.get(each, "")
            for each in ("coordinateSystem", "displacement", "freespace", "continuous")
        )
        if constraints is None or kind != ("lane", "trailingReferencedEntity", "true", "true"):
            raise ValueError("another way to follow")
        return Following(
            action.get("entityRef"), action.get("distance"), tighter(constraints, performance)
        )
    return None


def _changes(root: Node) -> Iterator[tuple[str, Change]]:
    """The manoeuvres of all actors."""
    for story in root.need("Storyboard").children("Story"):
        for act in story.children("Act"):
            for group in act.children("ManeuverGroup"):
                (actor,) = (
                    each.get("entityRef") for each in group.need("Actors").children("EntityRef")
                )
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
        if (
            not same
            or target.get("entityRef") != actor
            or dynamics.get("dynamicsDimension") != "time"
        ):
            raise ValueError("another lane change")
    (group,) = change.need("StartTrigger").children("ConditionGroup")
    time, distance = group.children("Condition")
    condition = distance.need("ByEntityCondition", "EntityCondition", "RelativeDistanceCondition")
    follower = distance.need("ByEntityCondition", "TriggeringEntities", "EntityRef").get(
        "entityRef"
    )
    time.need("ByValueCondition", "SimulationTimeCondition")
    kind = tuple(
        condition.get(each)
        for each in ("relativeDistanceType", "coordinateSystem", "freespace", "rule")
    )
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
    action = next(
        each for each in _actions(event) if each.find("LongitudinalAction") is not None
    ).need("LongitudinalAction")
    if (profile := action.find("SpeedProfileAction")) is not None:
        (entry,) = profile.children("SpeedProfileEntry")
        limits = profile.need("DynamicConstraints")
        up, down = limits.get("maxAccelerationRate"), limits.get("maxDecelerationRate")
        others = [
            limits.get(name, "") for name in ("maxAcceleration", "maxDeceleration", "maxSpeed")
        ]
        if (
            up != down
            or any(others)
            or profile.get("followingMode") != "follow"
            or profile.has("entityRef")
        ):
            raise ValueError("another profile")
        return (entry.get("time"), entry.get("speed")), up
    speed = action.need("SpeedAction")
    dynamics = speed.need("SpeedActionDynamics")
    if (dynamics.get("dynamicsShape"), dynamics.get("dynamicsDimension")) != ("linear", "time"):
        raise ValueError("another change of speed")
    return (
        dynamics.get("value"),
        speed.need("SpeedActionTarget", "AbsoluteTargetSpeed").get("value"),
    ), None


def _ends(root: Node) -> tuple[str, str, str]:
    """The actor whose change ends the scene, how long after it, and the longest time."""
    groups = root.need("Storyboard", "StopTrigger").children("ConditionGroup")
    conditions = [each for group in groups for each in group.children("Condition")]
    state = next(
        each
        for each in conditions
        if each.find("ByValueCondition", "StoryboardElementStateCondition") is not None
    )
    time = next(
        each
        for each in conditions
        if each.find("ByValueCondition", "SimulationTimeCondition") is not None
    )
    name = state.need("ByValueCondition", "StoryboardElementStateCondition").get(
        "storyboardElementRef"
    )
    longest = time.need("ByValueCondition", "SimulationTimeCondition").get("value")
    return name.removesuffix(" changes"), state.get("delay"), longest
