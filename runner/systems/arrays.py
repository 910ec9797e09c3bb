"""Observations and controls of many runs at once: arrays over runs, for `control_batch` of a system
under test.

Shapes: n runs, p participants beside the ego. What belongs to a run is (n,); what belongs to the
other participants of a run is (p, n): row k holds participant k of each run, the same one at all
instants, so that `others.x - ego.x` has one distance for each pair. Where `present` is False,
sensors
see no such participant: numbers are 0 and texts empty. Units and frames are those of
`runner.systems.base.Observation`, field by field. Arrays may be views that can't be written to.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from runner.engine.participants.declaration import BoundingBox, Performance
from runner.engine.worlds.signals_ahead import StopLine
from runner.systems.base import Control, Observation, Participant
from schemas.common.array_types import BoolArray, FloatArray, IntArray

ObjectArray = NDArray[np.object_]
_ABSENT = Participant(
    "",
    "",
    "",
    BoundingBox(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    performance=Performance(0.0, 0.0, 0.0, 0.0, 0.0),
)


@dataclass(frozen=True, eq=False)
class BatchParticipants:
    """Participants of n runs at one instant: the fields of `Participant`, each as an array.

    Those of the egos are (n,), those of the other participants (p, n).

    Args:
        name, kind, category: texts.
        box, performance: tuples of arrays, as `box.length`, m.
        x, y, z, h, pitch, roll, speed, acceleration, vx, vy, ax, ay, odometer: as in `Participant`.
        front_axle, max_steering, mass: as in `Participant`.
        lights, overrides: mappings.
        present: where there is a participant that sensors can see; False where an array is padded.
    """

    name: ObjectArray
    kind: ObjectArray
    category: ObjectArray
    box: BoundingBox
    x: FloatArray
    y: FloatArray
    z: FloatArray
    h: FloatArray
    pitch: FloatArray
    roll: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    vx: FloatArray
    vy: FloatArray
    ax: FloatArray
    ay: FloatArray
    odometer: FloatArray
    performance: Performance
    front_axle: FloatArray
    max_steering: FloatArray
    mass: FloatArray
    lights: ObjectArray
    overrides: ObjectArray
    present: BoolArray

    @cached_property
    def facing(self) -> tuple[FloatArray, FloatArray]:
        """Cosine and sine of the heading."""
        return np.cos(self.h), np.sin(self.h)

    def participants(self) -> list[Participant | None]:
        """All participants, the last axis the fastest; None where one is absent."""
        columns = []
        for name in Participant._fields:
            values: Any = getattr(self, name)
            if name in _TUPLES:
                parts = zip(*(column.ravel().tolist() for column in values), strict=True)
                columns.append(list(map(_TUPLES[name]._make, parts)))
            else:  # objects stay as they are
                flat = values.ravel()
                columns.append(list(flat) if name in _OBJECTS else flat.tolist())
        everyone = map(Participant._make, zip(*columns, strict=True))
        present = self.present.ravel().tolist()
        return [
            participant if there else None
            for participant, there in zip(everyone, present, strict=True)
        ]

    def take(self, runs: Any) -> BatchParticipants:
        """The same of some of the runs: their places (m,), or a mask (n,)."""
        return BatchParticipants(*(_taken(getattr(self, name), (..., runs)) for name in _FIELDS))

    def row(self, number: int) -> BatchParticipants:
        """The participant of that number in each run (n,), of arrays (p, n)."""
        return BatchParticipants(*(_taken(getattr(self, name), number) for name in _FIELDS))


_FIELDS = tuple(field.name for field in fields(BatchParticipants))


def _taken(values: Any, at: Any) -> Any:
    if isinstance(values, tuple):
        return type(values)(*(column[at] for column in values))
    return values[at]


class BatchObservation(NamedTuple):
    """Observations of a system under test in n runs, each at an instant of its own run.

    Args:
        run: number of each run (n,), ascending: the place of its state in arrays that
            `reset_batch` makes. Runs that are over, or in which the scenario has the ego, are
            absent.
        time: simulation time (n,), s.
        ego: the participants driven, (n,).
        others: the other participants that sensors can see, (p, n).
        target_speed: speed that the scenario asks of the ego at the end of this step (n,), m/s.
        network: roads or None, objects (n,).
        environment: `Environment` objects (n,).
        stop_line: a tuple of arrays (n,): `distance` (m) is infinite and `signal` empty where no
            light forbids to go on.
        signals: for each run the sequence of `Observation.signals`, objects (n,).

    Example:
        >>> import xosc_toolchain as xt
        >>> from runner.systems.arrays import stack
        >>> with xt.Session("xosc/library/simple_cut_in.xosc", world="kinematic") as session:
        ...     observations = stack([session.observation] * 3)
        >>> observations.ego.x.shape, observations.others.x.shape
        ((3,), (1, 3))
        >>> observations.target_speed.round(1)
        array([27.8, 27.8, 27.8])
    """

    run: IntArray
    time: FloatArray
    ego: BatchParticipants
    others: BatchParticipants
    target_speed: FloatArray
    network: ObjectArray
    environment: ObjectArray
    stop_line: StopLine
    signals: ObjectArray

    def observation(self, place: int) -> Observation:
        """The observation of the run at a place, 0 to n − 1."""
        return self.take([place]).observations()[0]

    def observations(self) -> list[Observation]:
        """The observations of all runs, in their order."""
        n, stop = len(self.run), self.stop_line
        lines: Any = zip(stop.signal, np.asarray(stop.distance).tolist(), strict=True)
        others = self.others.participants()
        rows = [others[first : first + n] for first in range(0, len(others), n)]
        seen = zip(*rows, strict=True) if rows else [()] * n
        return [
            Observation(
                time,
                ego,
                [other for other in around if other is not None],
                target,
                network,
                environment,
                StopLine(signal, distance) if distance < np.inf else None,
                signals,
            )
            for time, ego, around, target, network, environment, (signal, distance), signals in zip(
                self.time.tolist(),
                self.ego.participants(),
                seen,
                self.target_speed.tolist(),
                self.network,
                self.environment,
                lines,
                self.signals,
                strict=True,
            )
        ]

    def take(self, places: Any) -> BatchObservation:
        """The observations of some of the runs: their places (m,), or a mask (n,)."""
        parts: Any = (
            column.take(places)
            if isinstance(column, BatchParticipants)
            else _taken(column, (..., places))
            for column in self
        )
        return BatchObservation(*parts)


def stack(observations: Sequence[Observation]) -> BatchObservation:
    """The observations of as many runs, which are numbered from 0 on.

    Raises:
        ValueError: there is none.
    """
    if not observations:
        raise ValueError("no observations to stack")
    n, p = len(observations), max(len(observation.others) for observation in observations)
    others = [
        observation.others[place] if place < len(observation.others) else None
        for place in range(p)
        for observation in observations
    ]
    lines = [observation.stop_line or StopLine("", np.inf) for observation in observations]
    distances: Any = np.array([line.distance for line in lines], float)
    signals: Any = objects([line.signal for line in lines])
    return BatchObservation(
        np.arange(n),
        np.array([observation.time for observation in observations], float),
        stack_participants([observation.ego for observation in observations]),
        stack_participants(others, (p, n)),
        np.array([observation.target_speed for observation in observations], float),
        objects([observation.network for observation in observations]),
        objects([observation.environment for observation in observations]),
        StopLine(signals, distances),
        objects([observation.signals for observation in observations]),
    )


def stack_participants(
    participants: Sequence[Participant | None], shape: tuple[int, ...] | None = None
) -> BatchParticipants:
    """Participants as arrays of a shape, (n,) where none is given; None where one is absent."""
    shape = shape or (len(participants),)
    everyone = [_ABSENT if participant is None else participant for participant in participants]
    # `zip` of nobody gives no columns at all.
    columns = list(zip(*everyone, strict=True)) or [()] * len(Participant._fields)
    values: dict[str, Any] = {}
    for name, column in zip(Participant._fields, columns, strict=True):
        if name in _TUPLES:
            parts = np.array(column, float).reshape(-1, len(_TUPLES[name]._fields)).T
            values[name] = _TUPLES[name](*(part.reshape(shape).copy() for part in parts))
        elif name in _OBJECTS:
            values[name] = objects(column).reshape(shape)
        else:
            values[name] = np.array(column, float).reshape(shape)
    present = np.array([participant is not None for participant in participants], bool).reshape(
        shape
    )
    return BatchParticipants(**values, present=present)


_TUPLES: dict[str, Any] = {"box": BoundingBox, "performance": Performance}
_OBJECTS = ("name", "kind", "category", "lights", "overrides")


def objects(values: Sequence[Any]) -> ObjectArray:
    """An array (n,) of objects, which are kept as they are, sequences as well."""
    # `np.array` would make a second axis of sequences of equal length.
    return np.fromiter(values, dtype=object, count=len(values))


@dataclass(frozen=True, slots=True)
class BatchControl:
    """Controls of n runs in this step, as `Control` is that of one; arrays have no reasons.

    Args:
        acceleration: along the heading (n,), m/s²; None leaves it to the scenario in all runs.
        accelerates: where the acceleration counts (n,); elsewhere it is left to the scenario. None:
            everywhere.
        steering: angle of the front wheels (n,), rad, positive to the left; None as above.
        steers: where the steering counts (n,); None: everywhere.

    Example:
        >>> import numpy as np
        >>> from runner.systems.arrays import BatchControl
        >>> control = BatchControl(np.array([-4.0, 0.0]), accelerates=np.array([True, False]))
        >>> [control.control(place).acceleration for place in (0, 1)]
        [-4.0, None]
    """

    acceleration: FloatArray | None = None
    accelerates: BoolArray | None = None
    steering: FloatArray | None = None
    steers: BoolArray | None = None

    def control(self, place: int) -> Control:
        """The control of the run at a place, 0 to n − 1."""
        return Control(
            _at(self.acceleration, self.accelerates, place), _at(self.steering, self.steers, place)
        )


def _at(values: FloatArray | None, mask: BoolArray | None, place: int) -> float | None:
    if values is None or (mask is not None and not mask[place]):
        return None
    return float(values[place])


class Answers(NamedTuple):
    """Checked answers of a system under test in n runs.

    Args:
        acceleration, accelerates, steering, steers: as of `BatchControl`, each an array (n,).
        unanswered: runs (n,) without a usable control: an error of the system there, a `Pose`, a
            number that is not finite. The interpreter is to play them alone, and names the reason.
    """

    acceleration: FloatArray
    accelerates: BoolArray
    steering: FloatArray
    steers: BoolArray
    unanswered: BoolArray

    @classmethod
    def of(cls, controls: Sequence[Control | None]) -> Answers:
        """The answers of as many runs; None where there is none."""
        left = [Control() if control is None else control for control in controls]
        acceleration, accelerates = _column([control.acceleration for control in left])
        steering, steers = _column([control.steering for control in left])
        unanswered = np.array([control is None for control in controls], bool)
        return cls(acceleration, accelerates, steering, steers, unanswered)


def _column(values: Sequence[float | None]) -> tuple[FloatArray, BoolArray]:
    numbers = np.array([0.0 if value is None else value for value in values], float)
    return numbers, np.array([value is not None for value in values], bool)


def checked(control: object, n: int) -> Answers:
    """The answers in n runs of a system's `control_batch`.

    Raises:
        TypeError: it is no BatchControl, or holds something else than arrays of numbers.
        ValueError: their shapes are not (n,), or a number that counts is not finite.
    """
    if not isinstance(control, BatchControl):
        raise TypeError(
            f"control_batch() returned {control!r}, a "
            "runner.systems.arrays.BatchControl is expected"
        )
    acceleration, accelerates = _checked(
        "acceleration", control.acceleration, control.accelerates, n
    )
    steering, steers = _checked("steering", control.steering, control.steers, n)
    return Answers(acceleration, accelerates, steering, steers, np.zeros(n, bool))


def _checked(what: str, values: Any, mask: Any, n: int) -> tuple[FloatArray, BoolArray]:
    if values is None:
        return np.zeros(n), np.zeros(n, bool)
    numbers = np.asarray(values)
    counts = np.ones(n, bool) if mask is None else np.asarray(mask)
    # Kind `b` is left out: truths are no accelerations.
    if numbers.dtype.kind not in "fiu" or counts.dtype != np.bool_:
        raise TypeError(f"control_batch() returned {what} of other types than numbers and truths")
    if numbers.shape != (n,) or counts.shape != (n,):
        shape = numbers.shape if numbers.shape != (n,) else counts.shape
        raise ValueError(f"control_batch() returned {what} of shape {shape}, ({n},) is expected")
    if not (np.isfinite(numbers) | ~counts).all():
        place = int(np.flatnonzero(counts & ~np.isfinite(numbers))[0])
        raise ValueError(
            f"control_batch() returned {what} {numbers[place]} at place {place}, finite numbers "
            "are expected"
        )
    return np.where(counts, numbers, 0.0), counts


class ArraySystem(ABC):
    """A system under test in many runs at once.

    Example:
        >>> import numpy as np
        >>> import xosc_toolchain as xt
        >>> from runner.systems.arrays import stack
        >>> from runner.systems.array_systems import open_arrays
        >>> with xt.Session("xosc/library/simple_cut_in.xosc", world="kinematic") as session:
        ...     observations = stack([session.observation] * 3)
        >>> system = open_arrays("cas")
        >>> system.reset(observations.ego, timestep=0.05, seeds=np.arange(3))
        >>> system.control(observations, 0.05).accelerates
        array([False, False, False])
    """

    together = False
    """Whether it decides in all runs by one call, not run by run"""

    @abstractmethod
    def reset(self, egos: BatchParticipants, timestep: float, seeds: IntArray) -> None:
        """Begin N runs, with their egos (N,) and seeds (N,); timestep in s."""

    @abstractmethod
    def control(self, observations: BatchObservation, dt: float) -> Answers:
        """Decide for the coming dt (s) in the runs that are observed.

        Raises:
            SystemUnderTestError: `control_batch` raises an error, or returns something else than
                finite numbers of the right shapes.
        """

    def close(self) -> None:
        """End the runs."""
        return
