"""Many runs of one compiled scenario at once, kinematically: `Simulation` in arrays.

An element plays in arrays if its class says so beside what it does in one run (`in_arrays`); none
is named here. What is rare in a run (crossing a road's border, say) is a step of the interpreter's
classes; a run in which something happens that has no counterpart here is left (`leave`), to be
played by the interpreter.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterable, Mapping
from itertools import combinations
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np

from runner.engine.compile.array_protocols import ArrayDriver, ArrayProcess, NamedValue
from runner.engine.motion.on_roads import Roads
from runner.engine.participants.boxes import (
    first_touch,
    first_touch_arrays,
    may_have_touched,
    overlap_arrays,
)
from runner.engine.participants.rows import EntityRows, LastLoaded, RunRows
from runner.engine.storyboard.array_elements import (
    ArrayAct,
    ArrayActionElement,
    ArrayElement,
    ArrayEvent,
    ArrayGroup,
    ArrayTrigger,
)
from runner.engine.storyboard.collision import jumped_arrays
from runner.engine.storyboard.storyboard import Act, Event, ManeuverGroup, ordered_init
from runner.engine.worlds.surroundings import Environment
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import ToolchainError
from schemas.common.remarks import Remarks
from schemas.expressions.columns import NotInArrays, NumberColumn

if TYPE_CHECKING:
    from runner.engine.compile.compiler import Scenario
    from runner.engine.compile.protocols import StoryboardElement
    from runner.engine.motion.placement import Placement
    from runner.engine.participants.entity import Entities, Entity
    from runner.engine.storyboard.story_elements import Element

_STANDSTILL = 1e-3
"""m/s below which an entity stands still, as in `Simulation`"""
_SHARE = 0.85
"""Share of runs at most that go on when those that are over are taken out"""
_Part = TypeVar("_Part", bound=RunRows)


class ArrayObserver(Protocol):
    """Observer of many runs."""

    def step(self, run: ArraySimulation) -> None:
        """An instant of the runs that are `going`."""
        ...

    def correct(self, run: ArraySimulation, put: Mapping[str, BoolArray]) -> None:
        """Replace the places of the last instant by those of now, in some runs (n,)."""
        ...

    def end(self, run: ArraySimulation, ended: BoolArray) -> None:
        """Note that some of the runs (n,) are over."""
        ...


class Single:
    """View of one of many runs, for actions and positions of the interpreter."""

    def __init__(self, run: ArraySimulation, seed: int) -> None:
        self._run = run
        self.roads, self.random, self.remarks = run.roads, random.Random(seed), Remarks()
        self.put: list[str] = []
        """names of entities that actions have put somewhere"""

    @property
    def entities(self) -> Entities:
        """All entities by name, in the state of the run whose entity was loaded last."""
        # Only the entity at work is loaded for a row; actions that look at others need all of that
        # row.
        loaded = self._run.loaded
        name, row = loaded.name, loaded.row
        for other in self._run.entities.values():
            if other.name != name:
                other.load(row)
        loaded.name = name
        return self._run.scenario.entities

    @property
    def time(self) -> float:
        """Simulation time, s."""
        return self._run.time

    @property
    def dt(self) -> float:
        """Time step, s."""
        return self._run.dt

    @property
    def initialising(self) -> bool:
        """Whether the initial actions and the events of time 0 are starting."""
        return self._run.initialising

    @property
    def environment(self) -> Environment:
        """Weather, time of day and road condition."""
        return self._run.environment

    def place(self, entity: Entity, placement: Placement) -> None:
        """Put an entity somewhere, at its present speed; from there it follows its lane, or goes
        straight ahead."""
        self.roads.place(entity, placement)
        self.relocated(entity)

    def relocated(self, entity: Entity) -> None:
        """Show an entity where an action has put it at this time, not only after
        the coming step.
        """
        self.put.append(entity.name)

    def note(self, kind: str, subject: str, text: str = "") -> None:
        """Do nothing: many runs have no event log."""

    def wake(self) -> None:
        """Do nothing: conditions of many runs never sleep."""


class ArraySimulation(RunRows):
    """n runs of a compiled scenario.

    Args:
        scenario: compiled once for all sets; numbers that vary are columns.
        sets: the sets to be played (n,), as indices into these columns.
        timestep: s.
        seed: of everything random in a run.
        ego: name of the ego.
        driver: of the ego; None for what is scripted.
        steps: most steps of a run.
        steps_after_contact: steps that are played on after the ego's first contact; None for all.
        observer: of each instant, and of the ends of runs.

    Attributes:
        sets: of the runs that are still here (n,); those that are over are taken out.
        going: which of these are not over (n,).
        finished: which the stop trigger has ended (n,).

    Raises:
        NotInArrays: something of the scenario plays in single runs only.
    """

    def __init__(
        self,
        scenario: Scenario,
        sets: IntArray,
        timestep: float,
        seed: int,
        ego: str,
        driver: ArrayDriver | None,
        steps: int,
        steps_after_contact: int | None,
        observer: ArrayObserver,
    ) -> None:
        # Numbers that vary are columns in the compiled scenario; the state of its entities is that
        # of one run at a time (`EntityRows.load` and `store`).
        scenario.reset()
        self.scenario, self.sets, self.dt = scenario, sets, timestep
        self.n = n = len(sets)
        self.roads = Roads(scenario.network)
        self.environment = Environment()
        self.time, self.step_index, self.initialising = 0.0, 0, True
        self.single: Any = Single(self, seed)
        self.loaded = LastLoaded()
        self.elements: dict[Element, ArrayElement] = {}
        self.changed: dict[ArrayElement, None] = {}
        self._published: list[ArrayElement] = []
        self._parts: list[RunRows] = []
        self._values: dict[int, tuple[NumberColumn, FloatArray]] = {}
        self._named: dict[tuple[str, str], NamedValue] = {}
        self._put: dict[str, BoolArray] = {}
        """runs (n,) in which an action has put an entity somewhere since the last instant, by its
        name"""
        self._processes: list[
            tuple[ArrayProcess, ArrayActionElement, EntityRows | None, tuple[str, ...]]
        ] = []
        self._numbers: dict[ArrayProcess, int] = {}
        self._order: dict[ArrayProcess, ArrayActionElement] = {}
        """processes in the order in which they act, with their elements"""
        self.going, self.finished = np.ones(n, bool), np.zeros(n, bool)
        self.fired = np.zeros(n, np.int64)
        """index of the group of conditions by which the stop trigger has ended a run"""
        self._last = np.full(n, steps, np.int64)
        self.steps_after_contact = steps_after_contact
        self.doubtful = np.zeros(n, bool)
        """where the interpreter has to judge the run"""
        self.first_contact = np.full(n, math.inf)
        self.partner = np.full(n, -1, np.int64)
        """index of the entity of the ego's first contact"""
        self.entities = {
            name: EntityRows(entity, n, self.roads.lane_motion, self.loaded)
            for name, entity in scenario.entities.items()
        }
        self._parts += self.entities.values()
        self.ego = self.entities[ego]
        self.driver, self._observer = driver, observer
        self.ego.driver = driver
        self._pairs = list(combinations(self.entities.values(), 2))
        self.touching: dict[tuple[str, str], BoolArray] = {}
        self._overlapping: dict[tuple[str, str], BoolArray] = {}
        """who touches at the end of the last step; `touching` has contacts within it too"""
        self._later: list[Callable[[], None]] = []
        self._check()
        self._build()

    def _check(self) -> None:
        scenario = self.scenario
        if scenario.observers or scenario.signals.controllers:
            raise NotInArrays(
                "signals and conditions that watch each step play in single runs only"
            )
        if scenario.storyboard.ends_with_stories:
            raise NotInArrays("files for CARLA play in single runs only")
        for entity in scenario.entities.values():
            if entity.controls.trailer is not None or entity.controls.tractor is not None:
                raise NotInArrays(f"{entity.name}: trailers move in single runs only")
            if any(isinstance(limit, NumberColumn) for limit in entity.declared.performance):
                raise NotInArrays(f"{entity.name}: its Performance varies")

    def _build(self) -> None:
        board = self.scenario.storyboard
        self._stories = [self._element(story, None) for story in board.stories]
        acts = [act for act in self.elements.values() if isinstance(act, ArrayAct)]
        self._acts = acts
        self.events = [
            element for element in self.elements.values() if isinstance(element, ArrayEvent)
        ]
        self._groups = [
            element for element in self.elements.values() if isinstance(element, ArrayGroup)
        ]
        self._init = [
            ArrayActionElement(element, None, self, [self.entities[actor.name]] if actor else [])
            for actor, element in ordered_init(board.init)
        ]
        self._stop = (
            ArrayTrigger(board.stop_trigger, self, "StopTrigger")
            if board.stop_trigger is not None
            else None
        )
        for check in self._later:
            check()

    def _element(self, element: Element, parent: ArrayElement | None) -> ArrayElement:
        if isinstance(element, Event):
            assert parent is not None
            return ArrayEvent(element, parent, self)
        if isinstance(element, ManeuverGroup):
            assert parent is not None
            found: ArrayElement = ArrayGroup(element, parent, self)
        elif isinstance(element, Act):
            assert parent is not None
            found = ArrayAct(element, parent, self)
        else:
            found = ArrayElement(element, parent, self)
        for child in element.children:
            self._element(child, found)
        return found

    # for elements ---------------------------------------------------------------------------

    def own(self, part: _Part) -> _Part:
        """Have a part follow when runs are taken out."""
        self._parts.append(part)
        return part

    def late(self, check: Callable[[], None]) -> None:
        """Have something done once all elements are there."""
        self._later.append(check)

    def value(self, number: Any) -> Any:
        """A number of the scenario: as it is, or where it varies its values in the runs (n,)."""
        if not isinstance(number, NumberColumn):
            return number
        # By identity: columns are arrays, and comparing or hashing them would look at all values.
        # The column is kept beside its values, so that its id is not given to another one.
        known = self._values.get(id(number))
        if known is None:
            known = self._values[id(number)] = (number, number.view(np.ndarray)[self.sets])
        return known[1]

    def named(self, family: str, name: str) -> NamedValue:
        """A `parameter` or `variable` in the runs."""
        known = self._named.get((family, name))
        if known is None:
            scenario = self.scenario
            table = scenario.parameters if family == "parameter" else scenario.variables
            value = self.value(table[name])
            values = value.tolist() if isinstance(value, np.ndarray) else [value] * self.n
            known = self._named[family, name] = self.own(NamedValue(values))
        return known

    def leave(self, rows: BoolArray) -> None:
        """Have the interpreter play some runs: they end here without a result."""
        self.going &= ~rows

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
        needed = [self.entities[other.name] for other in others if other.name != actor.name]
        # Entities of the compiled scenario serve as the working copy of one row after the other.
        for row in np.flatnonzero(rows & self.going):
            for partner in needed:
                partner.load(row)
            entity = actor.load(row)
            try:
                act(entity, int(row))
            # The interpreter repeats this run from its beginning and gives the message, with file
            # and line.
            except ToolchainError:
                self.going[row] = False
                continue
            # A remark with a cause makes a run inconclusive: only a single run can give that
            # verdict.
            if any(remark.cause for remark in self.single.remarks.found):
                self.doubtful[row] = True
            self.single.remarks = Remarks()
            actor.store(row, entity)
            for name in self.single.put:
                self._put.setdefault(name, np.zeros(self.n, bool))[row] = True
            self.single.put.clear()

    def relocated(self, actor: EntityRows, rows: BoolArray) -> None:
        """Show an entity where an action has put it at this time, in some runs (n,), not only after
        the coming step."""
        self._put[actor.name] = self._put.get(actor.name, np.zeros(self.n, bool)) | rows

    def element(self, element: StoryboardElement) -> ArrayElement:
        """A storyboard element in the runs."""
        return self.elements[element]  # type: ignore[index]

    # processes ------------------------------------------------------------------------------

    def add_process(
        self,
        process: ArrayProcess,
        element: ArrayActionElement,
        actor: EntityRows | None,
        domains: tuple[str, ...],
    ) -> None:
        """Take an action in, for one of its actors."""
        self._numbers[process] = len(self._processes)
        self._processes.append((process, element, actor, domains))
        self.own(process)
        if actor is not None:
            for domain in domains:
                actor.owners.setdefault(domain, np.full(self.n, -1, np.int64))

    def begin_process(self, process: ArrayProcess, rows: BoolArray) -> None:
        """Have a process act in some runs: after all that have begun before, as in a single run."""
        # Removed and appended, so that the order of the dict is the order in which actions began.
        if not process.active.any():
            self._order.pop(process, None)
            self._order[process] = self._processes[self._numbers[process]][1]
        process.active |= rows

    def take_over(self, actor: EntityRows, domain: str, rows: BoolArray) -> None:
        """End whatever owns a control domain of an entity, in some runs."""
        owners = actor.owners[domain]
        # -1: owned by none.
        for number in np.unique(owners[rows]):
            if number >= 0:
                process, element, _, _ = self._processes[number]
                element.override(process, rows & (owners == number))

    def give(
        self, process: ArrayProcess, actor: EntityRows, domains: tuple[str, ...], rows: BoolArray
    ) -> None:
        """Make a process the owner of control domains."""
        for domain in domains:
            actor.owners[domain][rows] = self._numbers[process]

    def release(self, process: ArrayProcess, rows: BoolArray) -> None:
        """End a process in some runs."""
        number = self._numbers[process]
        _, _, actor, domains = self._processes[number]
        if actor is not None:
            for domain in domains:
                owners = actor.owners[domain]
                owners[rows & (owners == number)] = -1
        process.active &= ~rows
        process.stop(rows)

    # the runs -------------------------------------------------------------------------------

    def play(self) -> None:
        """Play all to their ends."""
        if self.driver is not None:
            self.driver.begin(self)
        self._begin()
        self._end()
        while self.n:
            self._tick()
            self._end()

    def _begin(self) -> None:
        everyone = np.ones(self.n, bool)
        for element in self._init:
            element.execute(everyone & self.going)
        for story in self._stories:
            story.start(everyone)
        for entity in self.entities.values():
            # An entity that appears later would need present and absent rows in every expression.
            if not entity.placed[self.going].all():
                raise NotInArrays(f"{entity.name}: it appears in the course of a run")
        self._contacts()
        self._set_velocities()
        self._evaluate()
        self._set_velocities()
        self.initialising = False
        self._put = {}
        self._observer.step(self)

    def _set_velocities(self) -> None:
        for e in self.entities.values():
            e.acceleration[:] = 0.0
            e.vx, e.vy = e.speed * np.cos(e.h), e.speed * np.sin(e.h)

    def _tick(self) -> None:
        dt = self.dt
        for process, element in tuple(self._order.items()):
            if process.active.any():
                done = process.step(dt) & process.active & self.going
                if done.any():
                    element.finished(process, done)
            else:
                del self._order[process]
        driven = self.ego if self.driver is not None else None
        if self.driver is not None:  # first: it observes everyone as they are now (`Simulation`)
            self._move(self.ego, self.driver.decide(self, self.ego))
        for entity in self.entities.values():
            if entity is not driven:
                self._move(entity, entity.target_speed)
        self.step_index += 1
        self.time = round(self.step_index * dt, 9)
        self._contacts()
        self._observer.step(self)
        self._evaluate()
        if self._put:  # they are where an action has put them at this time, as at time 0
            self._observer.correct(self, self._put)
            self._put = {}

    def _move(self, e: EntityRows, speed: FloatArray) -> None:
        move(self.roads, e, speed, self.dt, self.going)

    def _contacts(self) -> None:
        """Find who touches now, or has touched within the step (`Contacts`)."""
        # The same bounds as in `Contacts`, as masks: squares along x and y, then boxes, then the
        # way within the step for pairs that were apart before.
        for a, b in self._pairs:
            pair = a.name, b.name
            way = (np.abs(b.vx - a.vx) + np.abs(b.vy - a.vy)) * self.dt  # not less than it is
            reach = a.reach + b.reach + _STANDSTILL + way
            rows = np.flatnonzero(
                (np.abs(b.x - a.x) <= reach) & (np.abs(b.y - a.y) <= reach) & self.going
            )
            before = self._overlapping.get(pair)
            overlapping = self._overlapping[pair] = np.zeros(self.n, bool)
            touching = self.touching[pair] = np.zeros(self.n, bool)
            if not rows.size:
                continue
            since = np.full(self.n, math.inf)
            overlapping[rows] = overlap_arrays(a, b, rows)
            since[overlapping] = self.time
            apart = rows[~overlapping[rows]]
            if before is not None and apart.size:
                apart = apart[~before[apart]]
                apart = apart[may_have_touched(a, b, self.dt, apart)]
                since[apart] = self._touched_within(a, b, apart)
            np.less(since, math.inf, out=touching)
            if self.ego in (a, b) and touching.any():
                other = b if a is self.ego else a
                first = touching & (self.first_contact == math.inf) & self.going
                self.first_contact[first] = since[first]
                self.partner[first] = list(self.entities).index(other.name)
                # Searches need only the ego's first contact: runs end soon after it.
                if self.steps_after_contact is not None:
                    # The interpreter sees contacts of time 0 after the first step.
                    last = max(self.step_index, 1) + self.steps_after_contact
                    self._last[first] = np.minimum(self._last[first], last)

    def _touched_within(self, a: EntityRows, b: EntityRows, rows: IntArray) -> FloatArray:
        """Times (s) of contacts in some runs (k,) that began and ended within the last step;
        infinite for none."""
        share = first_touch_arrays(a, b, self.dt, rows)
        for place in np.flatnonzero(np.isnan(share)):
            found = first_touch(a.load(rows[place]), b.load(rows[place]), self.dt)
            share[place] = math.inf if found is None else found
        jump = jumped_arrays(a, self.dt, rows) | jumped_arrays(b, self.dt, rows)
        return np.where(jump, math.inf, self.time - (1.0 - share) * self.dt)

    def contact(self, one: str, other: str) -> BoolArray:
        """Runs in which two entities touch now (n,)."""
        found = self.touching.get((one, other))
        return self.touching[other, one] if found is None else found

    def _evaluate(self) -> None:
        for element in dict.fromkeys((*self._published, *self.changed)):
            element.publish()
        self._published, self.changed = [*self.changed], {}
        for group in self._groups:
            group.restart()
        rows = self.going
        if self._stop is not None:
            fired = self._stop.fires(rows)
            if fired.any():
                self.fired[fired] = self._stop.fired[fired]
                self.finished |= fired
                rows = rows & ~fired
        for act in self._acts:
            act.evaluate(rows)
        due = []
        # All triggers are evaluated before the first event starts, as in `Storyboard.evaluate`.
        for event in self.events:
            waiting = rows & event.waits
            if waiting.any():
                fired = waiting if event.trigger is None else event.trigger.fires(waiting)
                if fired.any():
                    due.append((event, fired))
        for event, fired in due:
            fired = fired & event.waits
            if fired.any():
                event.begin(fired)

    def _end(self) -> None:
        """End runs, and take those out that are over once they are many."""
        ended = self.going & (self.finished | (self.step_index >= self._last))
        if ended.any():
            self._observer.end(self, ended)
            self.going &= ~ended
        # Taking rows out copies every array, so it is done when enough of them are over.
        if self.going.sum() <= _SHARE * self.n:
            self.take(self.going.copy())

    def take(self, kept: BoolArray) -> None:
        """Keep some runs only."""
        super().take(kept)
        for part in self._parts:
            part.take(kept)
        if self.driver is not None:
            self.driver.take(kept)
        for held in (self.touching, self._overlapping):
            for pair, values in held.items():
                held[pair] = values[kept]
        self._values.clear()
        self.n = len(self.sets)


def move(roads: Roads, e: EntityRows, speed: FloatArray, dt: float, going: BoolArray) -> None:
    """Move an entity in the runs (n,) that are `going` at speeds (n,) for a step, dt (s)."""
    x, y, h, waiting = e.x, e.y, e.h, e.at_road_end.copy()
    speed = roads.advance_arrays(e, speed, dt, going)
    if e.at_road_end.any():
        ended = e.at_road_end & ~(waiting & (speed != 0.0))
        e.road_end = np.where(
            e.at_road_end, np.where(waiting & (speed == 0.0), e.road_end + dt, 0.0), e.road_end
        )
        e.at_road_end = ended
    vx, vy = (e.x - x) / dt, (e.y - y) / dt
    e.ax, e.ay = (vx - e.vx) / dt, (vy - e.vy) / dt
    e.vx, e.vy, e.turn = vx, vy, e.h - h
    e.acceleration = (speed - e.speed) / dt
    e.speed = speed.copy()  # it may be the array of target speeds, which actions write to
    way = np.abs(speed)
    still = way < _STANDSTILL
    e.odometer = e.odometer + way * dt
    e.standstill = (e.standstill + dt) * still
