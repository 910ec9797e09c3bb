"""The system under test `fmu`: an FMU drives the ego, by variables that a mapping file names, or by
OSI messages of OSMP."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from runner.systems.base import PEDAL, Control, Observation, Participant, Pose
from runner.systems.outside.fmi import Description, Instance, describe_fmu
from runner.systems.outside.learner import EGO, PARTICIPANT, STATE, ObservationArrays
from runner.systems.outside.osmp import (
    GROUND_TRUTH,
    REQUEST,
    SENSOR_DATA,
    UPDATE,
    VIEW,
    SensorViews,
    pose_of_request,
    pose_of_update,
)
from schemas.common.errors import InvalidFile, ToolchainError, UsageError
from schemas.common.storage import read_bytes

SYSTEMS = {
    "fmu": ("Fmu", "fmu:FILE, an FMU for co-simulation (FMI 2 and 3)"),
}
_CONTROLS = ("acceleration", "throttle", "brake", "steering")
_POSE = ("x", "y", "h", "speed")
_OUTPUTS = (*_CONTROLS, *_POSE, "active")
_INPUTS = ("time", "dt", "target_speed", "stop_distance", "signal_distance")
_NEAREST = 32
"""Others that a lead is sought among, the nearest"""
_OTHER = re.compile(r"others\[(\d{1,3})\]\Z")
_NUMBERS = ("Real", "Float32", "Float64", "Boolean", "Enumeration", "Integer")
_SIZED = re.compile(r"U?Int(8|16|32|64)\Z")


class VariableLink(NamedTuple):
    """Entry of a mapping: variable of the FMU, field of the observation or of the answer, and the
    change of units.

    Args:
        variable: name of the variable.
        field: name of the field.
        factor: by which the value is multiplied on its way.
        absent: value of an input for a lead or other that is not there.
    """

    variable: str
    field: str
    factor: float = 1.0
    absent: float = 0.0


class VariableMapping(NamedTuple):
    """Content of a mapping file."""

    inputs: tuple[VariableLink, ...] = ()
    outputs: tuple[VariableLink, ...] = ()
    parameters: tuple[tuple[str, Any], ...] = ()


@dataclass(slots=True)
class Fmu:
    """Gives an FMU the observation of each step, and returns its outputs at the end of the step.

    The mapping file is TOML:

        [inputs]      # variable of the FMU = field of the observation
        v_ego = "ego.speed"
        gap = { field = "lead.gap", absent = 250.0 }  # value without a lead, 0 by default
        v_set_kmh = { field = "target_speed", factor = 3.6 }  # change of units

        [outputs]     # field of the answer = variable of the FMU
        acceleration = "a_demand"
        steering = { variable = "wheel_deg", factor = 0.0174533 }

        [parameters]  # variable of the FMU = value
        time_gap = 1.8

    Fields of the observation are `time`, `dt`, `target_speed`; `signal_distance` to the next
    traffic light, `stop_distance` to the next line at which one forbids to go on (m, `absent`
    without one); of `ego`, `lead` and `others[0]` (nearest first) `x`, `y`, `h`, `vx`, `vy`, `ax`,
    `ay`, `length`, `width`, and the columns of `runner.systems.outside.learner` (`EGO`,
    `PARTICIPANT`); `gap` (m) between boxes of ego and lead or other, along the lane. The lead is
    the nearest participant ahead in the ego's way, of the 32 nearest. Fields of the answer are
    `acceleration` (m/s²) or `throttle` and `brake` (0 to 1, of 8 m/s² or what the `Performance`
    allows), and `steering` (rad); or the pose `x`, `y`, `h` with or without `speed`. Where `active`
    is named and 0, the ego drives as scripted.

    An FMU of OSMP gets `OSMPSensorViewIn` (and `OSMPGroundTruthInit`) and answers by
    `OSMPTrafficUpdateOut` or `OSMPMotionRequestOut`; it needs the extra `osi` and no mapping file.
    Empty messages leave the ego as scripted. Other inputs of OSMP stay empty. Each run has a new
    instance. A step covers the time since the one before, with the inputs of its beginning. Needs
    the extra `fmi`.

    Args:
        path: the FMU.
        mapping: the mapping file; FILE.toml beside FILE.fmu where there is one.
    """

    one_run = "an FMU may allow one instance a process"
    path: str = ""
    mapping: str = ""
    _described: Description = field(init=False, repr=False)
    _mapping: VariableMapping = field(init=False, repr=False)
    _instance: Instance | None = field(init=False, default=None, repr=False)
    _time: float = field(init=False, default=0.0, repr=False)
    _view: ObservationArrays | None = field(init=False, default=None, repr=False)
    _views: SensorViews | None = field(init=False, default=None, repr=False)
    _begun: bool = field(init=False, default=False, repr=False)

    def __post_init__(self) -> None:
        self._described, self._mapping = self.check(self.path, self.mapping)

    @staticmethod
    def check(path: str = "", mapping: str = "") -> tuple[Description, VariableMapping]:
        """Read FMU and mapping; arguments as of the class.

        Raises:
            UsageError: no file is named, nothing says what the ego does, or the policy in force
                loads no foreign code.
            InvalidFile: the FMU or the mapping is wrong.
            Unsupported: the FMU can't be run here.
        """
        if not path:
            raise UsageError("the system under test 'fmu' needs a file: fmu:FILE.fmu")
        described = describe_fmu(Path(path))
        file = Path(mapping) if mapping else Path(path).with_suffix(".toml")
        found = _read(file, described) if mapping or file.exists() else VariableMapping()
        # Sensor data need a model of a sensor: the runner has ground truth only.
        if described.has_binary(SENSOR_DATA) and not described.has_binary(VIEW):
            raise InvalidFile(
                f"this FMU takes {SENSOR_DATA}; {VIEW} is what it can be given", path=path
            )
        if not found.outputs and not any(map(described.has_binary, (UPDATE, REQUEST))):
            raise UsageError(
                f"nothing says what the ego does: {file} has no [outputs], and there is no "
                f"{UPDATE} or {REQUEST}",
                path=path,
            )
        return described, found

    @staticmethod
    def files(path: str = "", mapping: str = "") -> tuple[Path, ...]:
        """Files that decide what the system does; arguments as of the class."""
        both = Path(path), Path(mapping) if mapping else Path(path).with_suffix(".toml")
        return tuple(file for file in both if file.is_file())

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Load a new instance."""
        self.close()
        self._instance = Instance(self._described)
        places = self._named()
        # As many rows as the mapping names; a lead may be any of the nearest.
        numbers = [int(found[1]) + 1 for found in map(_OTHER.match, places) if found]
        self._view = (
            ObservationArrays(max([*numbers, _NEAREST * ("lead" in places)], default=0))
            if places
            else None
        )
        self._views = (
            SensorViews(self._described.has_binary(GROUND_TRUTH))
            if self._described.has_binary(VIEW)
            else None
        )
        self._begun = False

    def control(self, observation: Observation, dt: float) -> Control | Pose:
        """Step the FMU, and return the answer of its outputs."""
        instance = self._instance
        if instance is None:
            raise ToolchainError("the FMU has no instance: reset() comes first", path=self.path)
        if not self._begun:
            self._begin(instance, observation, dt)
        else:
            self._give(instance, observation, dt)
        end = observation.time + dt
        # Since its last step, not dt: the scenario may have had the ego meanwhile.
        instance.step(self._time, end - self._time)
        self._time = end
        return self._answer(instance, observation, end)

    def close(self) -> None:
        """Free the instance."""
        if self._instance is not None:
            instance, self._instance = self._instance, None
            instance.close()

    # inputs -------------------------------------------------------------------------------------

    def _begin(self, instance: Instance, observation: Observation, dt: float) -> None:
        """Initialise it with parameters and first inputs."""
        self._begun, self._time = True, observation.time
        # FMI: parameters before initialisation mode, first inputs within it.
        for name, value in self._mapping.parameters:
            instance.set(name, value)
        instance.begin(observation.time)
        if self._views is not None and self._described.has_binary(GROUND_TRUTH):
            instance.set_binary(GROUND_TRUTH, self._views.static(observation))
        self._give(instance, observation, dt)
        instance.begun()

    def _give(self, instance: Instance, observation: Observation, dt: float) -> None:
        if self._views is not None:
            instance.set_binary(VIEW, self._views.of(observation))
        if not self._mapping.inputs:
            return
        look = self._fields(observation, dt)
        for link in self._mapping.inputs:
            value = look(link.field)
            instance.set(link.variable, link.absent if value is None else value * link.factor)

    def _named(self) -> set[str]:
        """Participants with fields in the mapping: `ego`, `lead`, `others[n]`."""
        return {link.field.partition(".")[0] for link in self._mapping.inputs if "." in link.field}

    def _fields(self, observation: Observation, dt: float) -> Callable[[str], float | None]:
        """Return the function from the name of a field to its value in the observation; None for an
        absent lead or other."""
        ego = observation.ego
        rows = self._view.of(observation) if self._view is not None else {}
        near = self._view.nearest(observation) if self._view is not None else []

        def seat(name: str) -> tuple[Participant, dict[str, float]] | None:
            if name == "ego":
                return ego, dict(zip(EGO, rows["ego"].tolist(), strict=True))
            found = _OTHER.match(name)
            number = int(found[1]) if found else _lead(ego, near, rows["participants"].tolist())
            if number is None or number >= len(near):
                return None
            return near[number], dict(
                zip(PARTICIPANT, rows["participants"][number].tolist(), strict=True)
            )

        seats = {name: seat(name) for name in self._named()}

        def look(name: str) -> float | None:
            if name in _INPUTS:
                line, signal = observation.stop_line, next(iter(observation.signals), None)
                values: dict[str, float | None] = {
                    "time": observation.time,
                    "dt": dt,
                    "target_speed": observation.target_speed,
                    "stop_distance": line.distance if line is not None else None,
                    "signal_distance": signal.distance if signal is not None else None,
                }
                return values[name]
            whose, _, column = name.partition(".")
            found = seats[whose]
            if found is None:
                return None
            one, columns = found
            if column == "gap":
                return (
                    columns["ahead"]
                    - ego.box.x
                    - ego.box.length / 2
                    + one.box.x
                    - one.box.length / 2
                )
            if column in ("length", "width"):
                return float(getattr(one.box, column))
            return float(getattr(one, column)) if column in STATE else columns[column]

        return look

    # outputs ------------------------------------------------------------------------------------

    def _answer(self, instance: Instance, observation: Observation, time: float) -> Control | Pose:
        """Return the answer of the outputs at the end of a step; time in s."""
        if not self._mapping.outputs:
            ego = observation.ego
            if self._described.has_binary(UPDATE):
                pose = pose_of_update(instance.get_binary(UPDATE), ego, self.path)
            else:
                pose = pose_of_request(instance.get_binary(REQUEST), time, self.path)
            return pose or Control()
        values = {link.field: self._value(instance, link, time) for link in self._mapping.outputs}
        # An FMU that is not active leaves both domains to the scenario.
        if not values.get("active", 1.0):
            return Control()
        if "x" in values:
            return Pose(values["x"], values["y"], values["h"], values.get("speed"))
        limits, acceleration = observation.ego.performance, values.get("acceleration")
        if "throttle" in values or "brake" in values:
            drive = _share(values.get("throttle", 0.0)) * min(limits.max_acceleration, PEDAL)
            acceleration = drive - _share(values.get("brake", 0.0)) * min(
                limits.max_deceleration, PEDAL
            )
        return Control(acceleration, values.get("steering"))

    def _value(self, instance: Instance, link: VariableLink, time: float) -> float:
        value = float(instance.get(link.variable))
        if not math.isfinite(value):
            raise ToolchainError(
                f"the FMU gives {value} as {link.field} ({link.variable}) at {time:.2f} s",
                path=self.path,
            )
        return value * link.factor


def _share(value: float) -> float:
    return min(max(value, 0.0), 1.0)


def _lead(ego: Participant, near: list[Participant], rows: list[list[float]]) -> int | None:
    """Return the number of the nearest participant ahead in the ego's way; None without one."""
    found: list[tuple[float, int]] = []
    for number, (one, row) in enumerate(zip(near, rows, strict=False)):
        columns = dict(zip(PARTICIPANT, row, strict=True))
        if columns["ahead"] > 0.0 and abs(columns["left"]) <= (ego.box.width + one.box.width) / 2:
            found.append((columns["ahead"], number))
    return min(found)[1] if found else None


# mapping files
# --------------------------------------------------------------------------------------


def _read(path: Path, fmu: Description) -> VariableMapping:
    """Read the mapping file of an FMU."""
    try:
        content = tomllib.loads(read_bytes(path).decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InvalidFile(f"this is no TOML: {error}", path=path) from None
    tables = ("inputs", "outputs", "parameters")
    for name, table in content.items():
        if name not in tables or not isinstance(table, dict):
            raise InvalidFile(
                f"the tables [{'], ['.join(tables)}] are expected, not {name!r}", path=path
            )
    inputs = tuple(_links(content.get("inputs", {}), "field", fmu, path))
    outputs = tuple(_links(content.get("outputs", {}), "variable", fmu, path))
    fields = {link.field for link in outputs}
    if fields & {*_POSE} and (not {"x", "y", "h"} <= fields or fields & {*_CONTROLS}):
        raise InvalidFile(
            "[outputs] names a pose, which is x, y and h, with or without speed, and no pedals",
            path=path,
        )
    if "acceleration" in fields and fields & {"throttle", "brake"}:
        raise InvalidFile(
            "[outputs] names acceleration, and throttle or brake beside it", path=path
        )
    parameters = content.get("parameters", {})
    for name, value in parameters.items():
        variable = _variable(name, fmu, path, ("parameter",))
        if not isinstance(value, str if variable.type == "String" else bool | int | float):
            raise InvalidFile(
                f"the parameter {name!r} is of type {variable.type}, not {value!r}", path=path
            )
    return VariableMapping(inputs, outputs, tuple(parameters.items()))


def _links(
    table: dict[str, Any], named: str, fmu: Description, path: Path
) -> Iterator[VariableLink]:
    """Read [inputs], where `named` is `field`, or [outputs], where it is `variable`."""
    keys = {named, "factor", *(["absent"] if named == "field" else [])}
    for key, value in table.items():
        entry = {named: value} if isinstance(value, str) else value
        if (
            not isinstance(entry, dict)
            or not isinstance(entry.get(named), str)
            or not entry.keys() <= keys
        ):
            raise InvalidFile(
                f"{key!r} is a text, or {{ {', '.join(f'{key} = …' for key in sorted(keys))} }}",
                path=path,
            )
        numbers = {name: number for name, number in entry.items() if name != named}
        for name, number in numbers.items():
            if (
                isinstance(number, bool)
                or not isinstance(number, int | float)
                or not math.isfinite(number)
            ):
                raise InvalidFile(f"{key!r}: {name} is a number, not {number!r}", path=path)
        link = VariableLink(
            **{"variable": key, "field": entry[named]}
            if named == "field"
            else {"variable": entry[named], "field": key},
            **numbers,
        )
        variable = _variable(
            link.variable, fmu, path, ("input",) if named == "field" else ("output", "local")
        )
        if variable.type not in _NUMBERS and not _SIZED.match(variable.type):
            raise InvalidFile(
                f"the variable {link.variable!r} is of type {variable.type}, no number", path=path
            )
        known = _is_input(link.field) if named == "field" else link.field in _OUTPUTS
        if not known:
            there = (
                f"{', '.join(_INPUTS)}, and ego.…, lead.…, others[0].…"
                if named == "field"
                else ", ".join(_OUTPUTS)
            )
            raise InvalidFile(f"there is no field {link.field!r}; there are {there}", path=path)
        yield link


def _is_input(name: str) -> bool:
    whose, _, column = name.partition(".")
    if whose == "ego":
        return column in (*EGO, *STATE, "length", "width")
    if whose == "lead" or _OTHER.match(whose):
        return column in (*PARTICIPANT, *STATE, "gap")
    return name in _INPUTS


def _variable(name: str, fmu: Description, path: Path, causalities: tuple[str, ...]) -> Any:
    """Return a scalar variable of the FMU."""
    variable = fmu.variables.get(name)
    if variable is None:
        there = ", ".join(
            sorted(name for name, found in fmu.variables.items() if found.causality in causalities)[
                :20
            ]
        )
        raise InvalidFile(
            f"the FMU has no variable {name!r}; of causality {causalities[0]} there are "
            f"{there or 'none'}",
            path=path,
        )
    if variable.causality not in causalities:
        raise InvalidFile(
            f"the variable {name!r} is of causality {variable.causality}, not {causalities[0]}",
            path=path,
        )
    if variable.dimensions or variable.dimensionValueReferences:
        raise InvalidFile(f"the variable {name!r} is an array; a scalar is expected", path=path)
    return variable
