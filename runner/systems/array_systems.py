"""Any system under test in many runs at once: by its `control_batch`, or run by run where it has
none.

`control_batch(observations, dt)` gets `runner.systems.arrays.BatchObservation` and returns a
`BatchControl`. A system that carries something from step to step has `reset_batch(egos, timestep,
seeds)` too, which is called once before, for all runs; places in its arrays are
`observations.run`. A system without `control_batch` is asked run by run, each run with an instance
of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

from runner.systems import System, builder, class_name, find_system, is_foreign, system_name
from runner.systems.arrays import (
    Answers,
    ArraySystem,
    BatchObservation,
    BatchParticipants,
    checked,
)
from runner.systems.base import (
    RAISED,
    Control,
    Observation,
    Pose,
    SystemFailure,
    SystemUnderTestError,
    plain,
)
from schemas.common.array_types import IntArray
from schemas.common.errors import ToolchainError, Unsupported, blame

ONE_RUN = "one_run"
"""Attribute of systems that can't drive in several runs at once: the reason"""


class _Together(ArraySystem):
    """One instance that decides in all runs by its `control_batch`."""

    together = True

    def __init__(self, system: Any) -> None:
        self._system = system

    def reset(self, egos: BatchParticipants, timestep: float, seeds: IntArray) -> None:
        """Call its `reset_batch` where it has one."""
        begin = getattr(self._system, "reset_batch", None)
        if begin is not None:
            try:
                begin(egos, timestep, seeds)
            except RAISED as error:
                raise self._failed("reset_batch", error) from error

    def control(self, observations: BatchObservation, dt: float) -> Answers:
        """Return the system's answers, checked."""
        try:
            return checked(self._system.control_batch(observations, dt), len(observations.run))
        except RAISED as error:
            raise self._failed("control_batch", error) from error

    def close(self) -> None:
        """Call its `close` where it has one."""
        end = getattr(self._system, "close", None)
        if end is not None:
            try:
                end()
            except RAISED as error:
                raise self._failed("close", error) from error

    def _failed(self, method: str, error: BaseException) -> ToolchainError:
        if isinstance(error, ToolchainError) and type(error) is not ToolchainError:
            return error
        module = type(self._system).__module__
        told = str(error) if isinstance(error, SystemFailure) else blame(error, module)
        name = system_name(self._system)
        return SystemUnderTestError(f"{method} of the system under test {name} failed: {told}")


class _OneByOne(ArraySystem):
    """One instance for each run; after an error it is not asked again.

    Args:
        instances: new ones, as many as are asked for.
    """

    def __init__(self, instances: Iterator[Any]) -> None:
        self._instances = instances
        self._systems: dict[int, Any] = {}
        """By the numbers of their runs"""

    def reset(self, egos: BatchParticipants, timestep: float, seeds: IntArray) -> None:
        """Reset as many new instances as runs."""
        self.close()
        for run, (ego, seed) in enumerate(zip(egos.participants(), seeds.tolist(), strict=True)):
            self._systems[run] = system = next(self._instances)
            try:
                system.reset(ego, timestep, seed)
            # The run stays unanswered: the interpreter plays it, and names the error.
            except RAISED:
                self._end(run)

    def control(self, observations: BatchObservation, dt: float) -> Answers:
        """The answers of the instances."""
        seen = zip(observations.run.tolist(), observations.observations(), strict=True)
        return Answers.of([self._ask(run, observation, dt) for run, observation in seen])

    def _ask(self, run: int, observation: Observation, dt: float) -> Control | None:
        system = self._systems.get(run)
        if system is None:
            return None
        answer: Control | Pose | None = None
        with suppress(*RAISED):
            answer = plain(system.control(observation, dt))
        # Poses have no arrays: such runs are the interpreter's, too.
        if not isinstance(answer, Control):
            self._end(run)
            return None
        return answer

    def _end(self, run: int) -> None:
        end = getattr(self._systems.pop(run), "close", None)
        if end is not None:
            with suppress(*RAISED):  # of no consequence: runs in arrays keep nothing of it
                end()

    def close(self) -> None:
        """Call `close` of all instances that have one."""
        for run in list(self._systems):
            self._end(run)


def open_arrays(
    sut: str | System | None, in_process: bool = False, limit: float = 30.0
) -> ArraySystem | None:
    """The system under test for many runs; None for `none`.

    Args:
        sut: its name, with parameters as `cas:sensor_range=60`; or an instance, which has to have
            `control_batch`.
        in_process, limit: as of `runner.systems.open_system`.

    Raises:
        UsageError: no such system, or it can't be built.
        Unsupported: it drives one run a process, or is an instance without `control_batch`.
    """
    if isinstance(sut, str) and not in_process and is_foreign(sut):
        from runner.systems.isolation.boundary import isolated_arrays

        return isolated_arrays(class_name(sut), sut, limit)
    name, build = system_name(sut), _builder(sut)
    first = None if build is None else build()
    if build is None or first is None:
        return None
    _refuse(first, name)
    if decides_together(type(first)):
        return _Together(first)
    if not isinstance(sut, str):
        raise Unsupported(
            f"the system under test {name} is one instance without a control_batch of its own: "
            "many runs at once need its class by name"
        )
    return _OneByOne(_instances(first, build))


def _builder(sut: str | System | None) -> Callable[[], System | None] | None:
    if not isinstance(sut, str):
        return lambda: sut
    factory = find_system(sut)
    # A factory with arguments is a `partial` about its class.
    _refuse(getattr(factory, "func", factory), sut)  # before it opens what it needs
    return builder(sut)


def _refuse(system: object, name: str) -> None:
    """Refuse a system, or its class, that drives one run a process."""
    if reason := getattr(system, ONE_RUN, ""):
        raise Unsupported(f"the system under test {name} can't drive many runs at once: {reason}")


def _instances(first: System, build: Callable[[], System | None]) -> Iterator[System | None]:
    """New instances without end."""
    yield first
    while True:
        yield build()


def decides_together(kind: type) -> bool:
    """Whether a class has a `control_batch` that belongs to its `control`, and a `reset_batch` to
    its `reset`.

    A class that derives from one of ours and overrides `control` alone has none: it would decide
    by another law in arrays.
    """
    depth = {
        name: next((i for i, base in enumerate(kind.__mro__) if name in vars(base)), None)
        for name in ("control", "control_batch", "reset", "reset_batch")
    }
    decides, begins = depth["control_batch"], depth["reset_batch"]
    if decides is None or depth["control"] is None or decides > depth["control"]:
        return False
    return begins is None or depth["reset"] is None or begins <= depth["reset"]
