"""Systems under test: observations, answers, and parameters.

A system under test drives one entity, the ego. Each step it is given an `Observation` and answers
with a `Control`, or with a `Pose` where it has a vehicle model of its own. What a `Control` leaves
as None stays as scripted. It never sees the storyboard.

The parameters of a system are the arguments of its class. What is given is checked against these:
their names, and the types that they are declared with or that their defaults have.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from runner.engine.participants.declaration import BoundingBox, Performance
from runner.engine.storyboard.driver import Pose as Pose
from schemas.common.errors import ToolchainError, UsageError, like_or_nearest

if TYPE_CHECKING:
    from collections.abc import Sequence

    from runner.engine.participants.entity import Entity
    from runner.engine.worlds.signals_ahead import SignalAhead, StopLine
    from runner.engine.worlds.surroundings import Environment
    from xodr.graph.network import RoadNetwork


PEDAL = 8.0
"""Most that a fully pressed pedal gives, m/s²; less where the vehicle's Performance is less"""


class Participant(NamedTuple):
    """A participant as it is at one instant.

    The pose is that of the OpenSCENARIO reference point (vehicles: rear axle centre on the ground)
    in the world frame of the road network: x, y, z in m; h mathematical, pitch, roll in rad. Where
    that is on the roads, `Observation.network.locate` says.

    Args:
        name: its name.
        kind: vehicle, pedestrian or miscellaneous.
        category: e.g. car, truck, bicycle.
        box: its bounding box about the reference point.
        speed, acceleration: along the own heading, signed, m/s and m/s².
        vx, vy, ax, ay: velocity (m/s) and acceleration (m/s²) over ground in the world frame.
        odometer: distance travelled, m.
        performance: its limits.
        front_axle: x of the front axle, m (0 where there is none).
        max_steering: greatest angle of the front wheels, rad (0 where it is not known).
        mass: kg (0 where it is not known).
        lights: state of each light that a LightStateAction has switched.
        overrides: controller inputs that OverrideControllerValueAction holds.

    Example:
        >>> import xosc_toolchain as xt
        >>> with xt.Session("xosc/library/simple_cut_in.xosc", world="kinematic") as session:
        ...     ego = session.observation.ego
        ...     ego.name, ego.kind, ego.category, round(ego.speed, 1)
        ('Ego', 'vehicle', 'car', 27.8)
    """

    name: str
    kind: str
    category: str
    box: BoundingBox
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    h: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    speed: float = 0.0
    acceleration: float = 0.0
    vx: float = 0.0
    vy: float = 0.0
    ax: float = 0.0
    ay: float = 0.0
    odometer: float = 0.0
    performance: Performance = Performance()
    front_axle: float = 0.0
    max_steering: float = 0.0
    mass: float = 0.0
    lights: Mapping[str, str] = MappingProxyType({})
    overrides: Mapping[str, float] = MappingProxyType({})


def seen(entity: Entity) -> Participant:
    """An entity as it is now."""
    e, declared = entity, entity.declared
    return Participant._make(  # asked for in each step of each run: by far faster than by names
        (
            e.name, declared.kind, declared.category, e.box,
            e.x, e.y, e.z, e.h, e.pitch, e.roll, e.speed, e.acceleration, e.vx, e.vy, e.ax, e.ay,
            e.odometer, declared.performance, declared.front_axle, declared.max_steering,
            declared.mass, e.lights, e.controls.overrides,
        )
    )  # fmt: skip


class Observation(NamedTuple):
    """Observation of a system under test at one instant.

    Args:
        time: simulation time, s.
        ego: the participant driven.
        others: every other participant that sensors can see.
        target_speed: speed that the scenario asks of the ego at the end of this step, m/s.
        network: the roads, or None.
        environment: what EnvironmentActions have set (weather, time of day, road condition).
        stop_line: nearest line at which a traffic light forbids to go on; None without one.
        signals: traffic lights on the ego's way within 300 m, the nearest first.

    Example:
        >>> import xosc_toolchain as xt
        >>> with xt.Session("xosc/library/simple_cut_in.xosc", world="kinematic") as session:
        ...     observation = session.observation
        ...     observation.time, observation.ego.name, [other.name for other in observation.others]
        (0.0, 'Ego', ['CutIn'])
    """

    time: float
    ego: Participant
    others: Sequence[Participant]
    target_speed: float
    network: RoadNetwork | None
    environment: Environment
    stop_line: StopLine | None = None
    signals: Sequence[SignalAhead] = ()


@dataclass(frozen=True, slots=True)
class Control:
    """Control by a system under test in this step; None leaves the domain to the scenario.

    Args:
        acceleration: along the heading, m/s².
        steering: angle of the front wheels, rad, positive to the left (kinematic bicycle).
        reason: why, for the event log, where the system intervenes.

    Example:
        >>> import xosc_toolchain as xt
        >>> xt.Control(acceleration=-4.0, reason="a pedestrian is near").acceleration
        -4.0
    """

    acceleration: float | None = None
    steering: float | None = None
    reason: str = ""


def plain(answer: object) -> Control | Pose:
    """Answer of a system under test with Python's own floats.

    Raises:
        TypeError: it is neither a Control nor a Pose, or holds something else than numbers and a
            text.
        ValueError: its numbers are not finite.
    """
    if not isinstance(answer, Control | Pose):
        raise TypeError(
            f"control() returned {answer!r}, a runner.systems.Control or Pose is expected"
        )
    try:
        finite = is_finite(answer)
    except TypeError:
        raise TypeError(f"control() returned {answer}, numbers are expected") from None
    if not finite:
        raise ValueError(f"control() returned {answer}, finite numbers are expected")
    if not isinstance(answer.reason, str):
        raise TypeError(f"control() returned {answer}, a text is expected as reason")
    if isinstance(answer, Pose):
        return Pose(
            float(answer.x), float(answer.y), float(answer.h), _float(answer.speed), answer.reason
        )
    # Most answers hold plain numbers already; numpy's would end up in results as JSON.
    if type(answer.acceleration) in _PLAIN and type(answer.steering) in _PLAIN:
        return answer
    return Control(_float(answer.acceleration), _float(answer.steering), answer.reason)


_PLAIN = (float, type(None))


def _float(value: float | None) -> float | None:
    return None if value is None else float(value)


def is_finite(answer: Control | Pose) -> bool:
    """Whether all numbers of a system's answer are finite."""
    values: tuple[float | None, ...]
    if isinstance(answer, Pose):
        values = (answer.x, answer.y, answer.h, answer.speed)
    else:
        values = (answer.acceleration, answer.steering)
    return all(value is None or math.isfinite(value) for value in values)


RAISED = (Exception, SystemExit)
"""Errors that a class of the user raises in this process; interruptions and limits of time pass
through"""


class SystemUnderTestError(ToolchainError):
    """Named failure of a system under test: no verdict on it, and no defect of the toolchain."""


class SystemFailure(Exception):
    """Failure of a system under test that runs in a process of its own, told in one line."""


class SystemUnderTest(Protocol):
    """A driver or driver assistance system: `control` is called once a step.

    One that holds something, as a connection, may have a method `close()`, which is called after
    the run.

    Example:
        >>> import xosc_toolchain as xt
        >>> class Brakes:
        ...     def reset(self, ego, timestep, seed):
        ...         pass
        ...
        ...     def control(self, observation, dt):
        ...         return xt.Control(acceleration=-3.0)
        >>> result = xt.run("xosc/library/simple_cut_in.xosc", sut=Brakes(), world="kinematic",
        ...                 max_time=1.0)
        >>> rows = result.trajectories.to_pylist()
        >>> [round(row["speed"], 1) for row in rows if row["entity"] == "Ego"][-1]
        24.8
    """

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Called once before the run."""
        ...

    def control(self, observation: Observation, dt: float) -> Control | Pose:
        """Decide for the coming dt (s)."""
        ...


class WorldDriven:
    """A system under test that is the world's own driver: the ego is handed to it, and there is
    nothing to control.

    See `runner.systems.drivers.WorldDriver` for how that combines with what the scenario scripts.
    """

    one_run = "the world drives the ego, and a process has one world"

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Called once before the run."""


SENSOR_RANGE = "sensor_range"
"""Parameter for the range (m) of a system's sensor, if it has one; failed verdicts mention it."""

SENSORS = ("reach", "field", "occlusion", "delay", "missed", "ghosts", "rain")
"""Parameters of sensor models (`runner.systems.encounters.SensorModel`), which systems with a true
class attribute `sensors` have besides their own"""

Value = float | int | bool | str
_BOOLEANS = {"true": True, "false": False}
FIRST = ""
"""Name of a value that is given without one: that of the first parameter"""
_ARGUMENTS = re.compile(r":(?=\w+=)")


def split(text: str, known: Collection[str] = ()) -> tuple[str, dict[str, str]]:
    """Split a text into the name of a system and the texts of its parameters.

    Args:
        known: names of systems, after which the first value may stand without a name: `fmu:ego.fmu`
            is its first parameter.

    Raises:
        UsageError: what follows the name is not of the form NAME=VALUE,NAME=VALUE.
    """
    name, colon, values = text.partition(":")
    if name not in known or not colon:
        name, *rest = _ARGUMENTS.split(text, maxsplit=1)
        values = rest[0] if rest else ""
    given: dict[str, str] = {}
    for number, pair in enumerate(values.split(",") if values else ()):
        parameter, equals, value = pair.partition("=")
        if equals and parameter.isidentifier():
            given[parameter] = value
        elif number == 0 and name in known and pair:
            given[FIRST] = pair
        else:
            raise UsageError(
                f"the system under test {text!r}: NAME=VALUE is expected, not {pair!r}"
            )
    return name, given


def arguments(
    factory: Callable[..., Any], given: Mapping[str, str], name: str, more: Sequence[str] = ()
) -> dict[str, Value]:
    """The arguments of a class of that name, from texts.

    Args:
        more: names of other parameters, for messages.

    Raises:
        UsageError: it has no such parameter, or a text is no value of its type.
    """
    declared = _declared(factory)
    values: dict[str, Value] = {}
    for parameter, text in given.items():
        if parameter == FIRST and declared:
            parameter = next(iter(declared))
        if parameter not in declared:
            there = (*declared, *more)
            raise UsageError(
                f"the system under test {name!r} has no parameter {parameter!r}; "
                f"{like_or_nearest(parameter, there)}"
            )
        values[parameter] = _value(
            text, _kind(declared[parameter]), f"the parameter {parameter} of {name!r}"
        )
    return values


def parameters_of(system: Any) -> dict[str, Value]:
    """Return the parameters of a system with their values; only numbers and texts.

    One that stands for a system in another process knows them as `remote_parameters`.
    """
    remote: dict[str, Value] | None = getattr(system, "remote_parameters", None)
    if remote is not None:
        return remote
    parameters = {name: _attribute(system, name) for name in _declared(type(system))}
    return {name: value for name, value in parameters.items() if isinstance(value, Value)}


def names_of(factory: Callable[..., Any]) -> tuple[str, ...]:
    """Names of the parameters of a class, those of its sensor model included."""
    return (*_declared(factory), *(SENSORS if getattr(factory, "sensors", False) else ()))


def _attribute(system: Any, name: str) -> Any:
    """An attribute; None where there is none, as where a property of the class raises an error."""
    try:
        return getattr(system, name, None)
    except RAISED:
        return None


def _declared(factory: Callable[..., Any]) -> dict[str, inspect.Parameter]:
    try:
        parameters = inspect.signature(factory).parameters.values()
    # Classes of extension modules may have no signature.
    except (TypeError, ValueError):
        return {}
    named = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return {parameter.name: parameter for parameter in parameters if parameter.kind in named}


def _kind(parameter: inspect.Parameter) -> str:
    """Name of a parameter's type: as declared, or that of its default."""
    # Under `from __future__ import annotations` types are texts.
    if parameter.annotation is not inspect.Parameter.empty:
        return str(getattr(parameter.annotation, "__name__", parameter.annotation))
    return (
        type(parameter.default).__name__
        if parameter.default is not inspect.Parameter.empty
        else "str"
    )


def _value(text: str, kind: str, what: str) -> Value:
    if kind == "bool":
        if text.lower() not in _BOOLEANS:
            raise UsageError(f"{what} is true or false, not {text!r}")
        return _BOOLEANS[text.lower()]
    if kind not in ("float", "int"):
        return text
    try:
        number = int(text) if kind == "int" else float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise UsageError(f"{what} is {'a whole' if kind == 'int' else 'a'} number, not {text!r}")
    return number
