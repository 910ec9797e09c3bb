"""Many runs at once, as seen by elements: services for conditions and actions, and actions in
execution.

Arrays (n,) have an entry for each run that is left; `RunRows` follow when others are taken out.
`runner.engine.storyboard.array_run` plays them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np

from runner.engine.compile.protocols import ElementState, Transition
from runner.engine.participants.rows import RunRows
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.expressions.columns import NotInArrays, NumberColumn

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from runner.engine.compile.protocols import Run, StoryboardElement
    from runner.engine.motion.on_roads import Roads
    from runner.engine.participants.entity import Entity
    from runner.engine.participants.rows import EntityRows
    from runner.engine.worlds.surroundings import Environment
    from schemas.expressions.values import Value

STANDBY, RUNNING, COMPLETE = 0, 1, 2
START, END, STOP, SKIP = 1, 2, 4, 8
STATES = {
    ElementState.STANDBY: STANDBY,
    ElementState.RUNNING: RUNNING,
    ElementState.COMPLETE: COMPLETE,
}
"""Numbers of states in arrays"""
TRANSITIONS = {
    Transition.START: START,
    Transition.END: END,
    Transition.STOP: STOP,
    Transition.SKIP: SKIP,
}
"""Bits of transitions in arrays"""
_Part = TypeVar("_Part", bound=RunRows)


class ElementRows(Protocol):
    """A storyboard element in many runs: numbers of states and bits of transitions (n,), see
    `StoryboardElement`."""

    state: NDArray[np.int8]
    seen_state: NDArray[np.int8]
    transitions: NDArray[np.int8]
    seen_transitions: NDArray[np.int8]


class ArrayDriver(Protocol):
    """Driver of the ego in many runs."""

    def begin(self, run: Any) -> None:
        """The runs begin."""
        ...

    def decide(self, run: Any, ego: EntityRows) -> FloatArray:
        """Speeds of the ego at the end of the coming step (n,), m/s."""
        ...

    def hand_over(self, rows: BoolArray, domains: Mapping[str, bool]) -> None:
        """Let it drive, or no longer drive, in control domains, in some runs (n,)."""
        ...

    def take(self, kept: BoolArray) -> None:
        """Keep some runs only."""
        ...


class ArrayRun(Protocol):
    """State and methods of many runs for conditions and actions.

    Attributes:
        n: number of runs that are left.
        sets: their parameter sets (n,).
        going: which of them are not over (n,).
        time, dt: s. step_index: steps done. initialising: as of `Run`.
        ego: one of the entities.
        driver: of the ego; None for what is scripted.
        single: what actions and positions of the interpreter see of one of the runs.
    """

    n: int
    sets: IntArray
    going: BoolArray
    doubtful: BoolArray
    time: float
    dt: float
    step_index: int
    initialising: bool
    roads: Roads
    environment: Environment
    ego: EntityRows
    driver: ArrayDriver | None
    single: Run

    @property
    def entities(self) -> Mapping[str, EntityRows]:
        """All entities by name."""
        ...

    def own(self, part: _Part) -> _Part:
        """Have a part follow when runs are taken out."""
        ...

    def late(self, check: Callable[[], None]) -> None:
        """Have something done once all storyboard elements are there."""
        ...

    def element(self, element: StoryboardElement) -> ElementRows:
        """A storyboard element in the runs."""
        ...

    def value(self, number: Any) -> Any:
        """A number of the scenario: as it is, or where it varies its values in the runs (n,)."""
        ...

    def leave(self, rows: BoolArray) -> None:
        """Have the interpreter play some runs: they end here without a result."""
        ...

    def contact(self, one: str, other: str) -> BoolArray:
        """Runs in which two entities touch now (n,)."""
        ...

    def relocated(self, actor: EntityRows, rows: BoolArray) -> None:
        """Show an entity where an action has put it at this time, in some runs (n,), not only after
        the coming step."""
        ...

    def one_by_one(
        self,
        actor: EntityRows,
        rows: BoolArray,
        others: Iterable[Entity],
        act: Callable[[Entity, int], object],
    ) -> None:
        """Do something with an entity in some runs as the interpreter does it; a run in which it is
        refused is left.

        Args:
            others: entities whose state is needed as well.
            act: called with the entity of the compiled scenario, as it is in a run, and the run's
                row.
        """
        ...

    def named(self, family: str, name: str) -> NamedValue:
        """A `parameter` or `variable` in the runs."""
        ...


class ArrayProcess(RunRows):
    """One action in execution for one actor, or for the simulation, in many runs.

    Actions make one for each actor (`PrivateAction.in_arrays`); by default it takes no time and
    does nothing.

    Attributes:
        active: runs in which it is in execution (n,).
    """

    def __init__(self, run: ArrayRun) -> None:
        self.active = np.zeros(run.n, bool)

    def start(self, rows: BoolArray) -> BoolArray:
        """Begin in some runs; those in which it takes time."""
        return np.zeros_like(rows)

    def step(self, dt: float) -> BoolArray:
        """Act on the interval from now to now + dt (s) where it is active; the runs in which it
        reaches its goal."""
        return np.zeros_like(self.active)

    def stop(self, rows: BoolArray) -> None:
        """Give back what is held, in some runs."""


class ArraySteps(RunRows):
    """Steps in arrays of what begins run by run and holds nothing."""

    def begin(self, row: int, running: Any) -> None:
        """Take in what begins in a run."""

    def step(self, rows: BoolArray, dt: float) -> BoolArray:
        """Act on the interval from now to now + dt (s) in some runs (n,); those in which the goal
        is reached."""
        raise NotImplementedError


class RunByRun(ArrayProcess):
    """An action that is executed run by run as in a single run, while all else of the runs is done
    in arrays.

    Its steps are arrays as well where the action has them (`PrivateAction.steps_in_arrays`).

    Args:
        action: a `PrivateAction` of the compiled scenario, with `run_by_run`.
        actor: of the action.
        run: the runs.
    """

    def __init__(self, action: Any, actor: EntityRows, run: ArrayRun) -> None:
        super().__init__(run)
        self._action, self._actor, self._run = action, actor, run
        self._claims = action.claims()
        self._steps: ArraySteps | None = action.steps_in_arrays(actor, run)
        self._running = np.full(run.n, None, object)

    def start(self, rows: BoolArray) -> BoolArray:
        """Begin; the runs in which it takes time."""
        run = self._run

        def begin(actor: Entity, row: int) -> None:
            own = self._action.at_set(int(run.sets[row]))
            run.doubtful[row] |= self._action.repaired
            if own.claims() != self._claims:
                raise NotInArrays("the control domains of an action vary between the runs")
            self._running[row] = running = own.start(actor, run.single)
            if self._steps is not None:
                self._steps.begin(row, running)

        self._running[rows] = None
        run.one_by_one(self._actor, rows, self._action.references(), begin)
        found: BoolArray = rows & np.not_equal(self._running, np.array(None, object)).astype(bool)
        return found

    def step(self, dt: float) -> BoolArray:
        """Act in each run in which it is in execution."""
        if self._steps is not None:
            return self._steps.step(self.active & self._run.going, dt)
        done = np.zeros_like(self.active)

        def act(actor: Entity, row: int) -> None:
            done[row] = self._running[row].step(dt)

        self._run.one_by_one(self._actor, self.active, self._action.references(), act)
        return done

    def stop(self, rows: BoolArray) -> None:
        """Give back what is held, in each run."""
        if self._steps is not None:  # it holds nothing
            return
        self._run.one_by_one(
            self._actor,
            rows,
            self._action.references(),
            lambda actor, row: self._running[row].stop(),
        )


def picked(element: Any, number: int) -> Any:
    """An action or its parts, with the numbers of one of the parameter sets for
    which it was read.
    """
    if isinstance(element, NumberColumn):
        return float(element.view(np.ndarray)[number])
    if isinstance(element, tuple):
        parts = [picked(part, number) for part in element]
        if all(new is old for new, old in zip(parts, element, strict=True)):
            return element
        return type(element)(*parts) if hasattr(element, "_fields") else tuple(parts)
    if not is_dataclass(element) or isinstance(element, type):
        return element
    changed = {
        field.name: new
        for field in fields(element)
        if field.init and (new := picked(old := getattr(element, field.name), number)) is not old
    }
    return replace(element, **changed) if changed else element


class NamedValue(RunRows):
    """A parameter or variable in many runs: the values that occur, and the index of the one it has
    in each.

    Args:
        values: in each run (n,).
    """

    def __init__(self, values: Sequence[Value]) -> None:
        self.values: list[Value] = []
        """all that have occurred, each once"""
        self._known: dict[Value, int] = {}
        self.index = np.zeros(len(values), np.int64)
        """of its value in each run (n,)"""
        self.put(np.arange(len(values)), values)

    def put(self, rows: IntArray, values: Iterable[Value]) -> None:
        """Give it a value in each of some runs (k,)."""
        for row, value in zip(rows, values, strict=True):
            place = self._known.setdefault(value, len(self.values))
            if place == len(self.values):
                self.values.append(value)
            self.index[row] = place
