"""Many runs at once as elements see them: what a batch offers to conditions and actions, and actions in execution there.

Arrays (n,) have an entry for each run that is left; `RunRows` follow when others are taken out.
`runner.engine.storyboard.batch_run` is the batch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np

from runner.engine.compile.run import ElementState, Transition
from runner.engine.participants.rows import RunRows
from schemas.common.array_types import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from runner.engine.compile.run import Run, StoryboardElement
    from runner.engine.motion.on_roads import Roads
    from runner.engine.participants.entity import Entity
    from runner.engine.participants.rows import EntityRows
    from runner.engine.worlds.surroundings import Environment

STANDBY, RUNNING, COMPLETE = 0, 1, 2
START, END, STOP, SKIP = 1, 2, 4, 8
STATES = {ElementState.STANDBY: STANDBY, ElementState.RUNNING: RUNNING, ElementState.COMPLETE: COMPLETE}  # fmt: skip
"""Numbers of states in arrays"""
TRANSITIONS = {Transition.START: START, Transition.END: END, Transition.STOP: STOP, Transition.SKIP: SKIP}  # fmt: skip
"""Bits of transitions in arrays"""
_Part = TypeVar("_Part", bound=RunRows)


class ElementRows(Protocol):
    """A storyboard element in many runs: numbers of states and bits of transitions (n,), see `StoryboardElement`."""

    state: NDArray[np.int8]
    seen_state: NDArray[np.int8]
    transitions: NDArray[np.int8]
    seen_transitions: NDArray[np.int8]


class BatchDriver(Protocol):
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


class BatchRun(Protocol):
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
    driver: BatchDriver | None
    single: Run

    @property
    def entities(self) -> Mapping[str, EntityRows]:
        """Everyone by name."""
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

    def one_by_one(
        self,
        actor: EntityRows,
        rows: BoolArray,
        others: Iterable[Entity],
        act: Callable[[Entity], object],
    ) -> None:
        """Do something with an entity in some runs as the interpreter does it; a run in which it is refused is left.

        Args:
            others: entities whose state is needed as well.
            act: called with the entity of the compiled scenario, as it is in a run.
        """
        ...


class BatchProcess(RunRows):
    """One action in execution for one actor, or for the simulation, in many runs.

    Actions make one for each actor (`PrivateAction.in_arrays`); by default it takes no time and
    does nothing.

    Attributes:
        active: runs in which it is in execution (n,).
    """

    def __init__(self, run: BatchRun) -> None:
        self.active = np.zeros(run.n, bool)

    def start(self, rows: BoolArray) -> BoolArray:
        """Begin in some runs; those in which it takes time."""
        return np.zeros_like(rows)

    def step(self, dt: float) -> BoolArray:
        """Act on the interval from now to now + dt (s) where it is active; the runs in which it reaches its goal."""
        return np.zeros_like(self.active)

    def stop(self, rows: BoolArray) -> None:
        """Give back what is held, in some runs."""
