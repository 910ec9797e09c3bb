"""Verdicts and measures of many runs that were played at once.

A failure counts once the interpreter has played it again. Evidence is counted as in `rows`; runs
with rare kinds of evidence stay open, for the interpreter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from runner.engine.conditions.by_value import SimulationTimeCondition
from runner.engine.participants.boxes import Spot
from runner.engine.participants.entity import JUMP
from runner.engine.participants.rows import RunRows
from runner.judging.evidence.continuity import (
    ALOFT,
    APPROACH,
    NEVER,
    PredictedContact,
    above_road,
    displaced_boxes,
    next_contact,
)
from runner.judging.evidence.progress import mishap_events, scene_events, without_effect
from runner.judging.evidence.rows import causes_of
from runner.judging.measures.criticality import criticality
from runner.judging.measures.relations import MotionRows
from runner.judging.measures.runs import RunMeasures, measure_runs
from runner.judging.result import FAILED, INCONCLUSIVE, PASSED
from runner.systems.drivers import scripted_at_start
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from xodr.model import PERMANENT

if TYPE_CHECKING:
    from collections.abc import Mapping

    from runner.engine.compile.compiler import Scenario
    from runner.engine.motion.rss import RssParameters
    from runner.engine.participants.rows import EntityRows
    from runner.engine.storyboard.batch_run import BatchSimulation
    from runner.judging.measures.criticality import Criticality

_TOLERANCE = 1.01
_SUSTAINED = 0.5
_SHORTEST = 0.1
_LEAST_SHARE = 0.1
"""As in `continuity` and `rows`"""
_MEASURED = 64
"""Runs that are measured at once: arrays of them fit into caches"""
_SEGMENT = 64
"""Steps whose instants are kept in one array"""
OPEN = "open"
"""Outcome of a run that the interpreter has to play"""
_FRAME = ("x", "y", "z", "h", "speed", "s", "t")


@dataclass(eq=False)
class BatchOutcomes:
    """Outcomes of many runs; arrays (n,).

    Attributes:
        outcome: `passed`, `failed`, `inconclusive` or `open`.
        status: `completed`, `timeout` or `collision`.
        end_time: s.
        contact: time (s) of the ego's first contact; infinite without one.
        partner: name of the participant touched; empty without one.
        names: of all participants, the ego's first.
        segments: instants of all runs, a stretch of time after the other.
        roads: ids of roads by key.
        steps: number of instants of each run.
    """

    outcome: Any
    status: Any
    end_time: FloatArray
    contact: FloatArray
    partner: Any
    names: tuple[str, ...]
    segments: list[Segment] = field(repr=False)
    steps: IntArray
    declared: dict[str, Any] = field(repr=False)
    roads: dict[int, str] = field(repr=False)
    network: Any = field(repr=False)
    dt: float

    def motion(self, name: str, run: int, instants: slice = slice(None)) -> MotionRows:
        """Motion of a participant in a run, at all or some of its instants."""
        count = int(self.steps[run])
        rows = np.arange(count)[instants]
        values, roads = self._kept(name, run, run + 1, count)
        columns = dict(zip(_FRAME, values[:, 0, rows], strict=True))
        time = np.round(rows * self.dt, 9)
        keys, inverse = np.unique(roads[0, rows], return_inverse=True)
        road = np.array([*map(self.roads.get, keys.tolist()), None], object)[inverse]
        hint = None
        for row in np.flatnonzero(keys[inverse] == 0) if self.network is not None else ():
            x, y, z, h = (float(columns[axis][row]) for axis in "xyzh")
            hint = self.network.locate(x, y, z, h, hint)
            road[row], columns["s"][row], columns["t"][row] = hint.road_id, hint.s, hint.t
        who = self.declared[name]
        about: dict[str, Any] = {"kind": who.kind, "category": who.category, "mass": who.mass}
        return MotionRows(name, who.box, time, road=road, **about, **columns)

    def measured(self, parameters: RssParameters, window: float = 1.0) -> RunMeasures:
        """Measures of all runs; of one that is `open` they say nothing.

        Args:
            window: as of `measure_runs`, s.
        """
        sizes = np.maximum(self.steps, 1)
        codes = {road: code for code, road in enumerate(dict.fromkeys(self.roads.values()))}
        parts = []
        for first in range(0, len(sizes), _MEASURED):
            last = min(first + _MEASURED, len(sizes))
            some = sizes[first:last]
            ego, *others = (self._rows(name, first, last, some, codes) for name in self.names)
            parts.append(measure_runs(ego, others, some, parameters, window, self.dt))
        return RunMeasures.joined(parts)

    def _kept(self, name: str, first: int, last: int, steps: int) -> tuple[FloatArray, IntArray]:
        """Values (7, k, steps) and keys of roads (k, steps) of a participant in the runs of a
        range, as far as it lasts."""
        number = self.names.index(name)
        shape = last - first, steps
        values, roads = np.zeros((len(_FRAME), *shape)), np.zeros(shape, np.int64)
        for part in self.segments:
            low, high = np.searchsorted(part.at, [first, last])
            until = min(part.first + part.count, steps)
            if low == high or until <= part.first:
                continue
            rows: Any = part.at[low:high] - first
            if high - low == last - first:
                rows = slice(None)
            there, kept = slice(part.first, until), slice(until - part.first)
            values[:, rows, there] = part.values[number][:, kept, low:high].transpose(0, 2, 1)
            roads[rows, there] = part.roads[number][kept, low:high].T
        return values, roads

    def _rows(
        self, name: str, first: int, last: int, sizes: IntArray, codes: Mapping[str, int]
    ) -> MotionRows:
        """Rows of a participant in the runs of a range, one after the other, with codes of roads
        for their ids."""
        steps = np.arange(int(sizes.max()))
        values, roads = self._kept(name, first, last, len(steps))
        there = steps < sizes[:, None]
        columns = {name: part[there] for name, part in zip(_FRAME, values, strict=True)}
        keys, inverse = np.unique(roads[there], return_inverse=True)
        known = [codes.get(self.roads.get(key, ""), -1) for key in keys.tolist()]
        road: Any = np.array(known)[inverse]
        number, hint = np.broadcast_to(steps, there.shape)[there], None
        for row in np.flatnonzero(road < 0) if self.network is not None else ():
            hint = None if number[row] == 0 else hint
            x, y, z, h = (float(columns[axis][row]) for axis in "xyzh")
            hint = self.network.locate(x, y, z, h, hint)
            road[row], columns["s"][row], columns["t"][row] = codes[hint.road_id], hint.s, hint.t
        time = np.round(number * self.dt, 9)
        return MotionRows(name, self.declared[name].box, time, road=road, **columns)

    def criticality(self, run: int) -> Criticality:
        """Measures of a run."""
        ego, *others = (self.motion(name, run) for name in self.names)
        return criticality(ego, others)


@dataclass(eq=False)
class Segment:
    """Instants of the same runs, at most `_SEGMENT` of them.

    Args:
        first: step of the first one.
        at: numbers of the runs, ascending (k,).
        participants: number of them.

    Attributes:
        count: instants that it has.
        values: of each participant: x, y, z, h, speed, s, t (7, `_SEGMENT`, k).
        roads: keys of roads of each participant (`_SEGMENT`, k).
    """

    first: int
    at: IntArray
    participants: int
    count: int = 0
    values: list[FloatArray] = field(init=False)
    roads: list[IntArray] = field(init=False)

    def __post_init__(self) -> None:
        shape = _SEGMENT, len(self.at)
        everyone = range(self.participants)
        self.values = [np.empty((len(_FRAME), *shape)) for _ in everyone]
        self.roads = [np.empty(shape, np.int64) for _ in everyone]

    def put(self, number: int, rows: EntityRows, step: int, some: Any = slice(None)) -> None:
        """Keep where a participant is at an instant, in all or some of the runs."""
        place = step - self.first
        for values, name in zip(self.values[number], _FRAME, strict=True):
            values[place, some] = getattr(rows, name)[some]
        self.roads[number][place, some] = rows.road_key[some]


class _Seen(RunRows):
    """Facts that evidence is counted from, in the runs that are left (n,).

    Attributes:
        moved: where the ego has moved.
        beyond: where someone was faster than its Performance allows.
        doubt: where the interpreter has to judge.
        speed: of the ego at the last instant, without a sign, m/s.
        faster, slower: steps up to now in which the ego's acceleration, its deceleration, was
            beyond its Performance.
    """

    def __init__(self, n: int) -> None:
        self.moved, self.beyond, self.doubt = (np.zeros(n, bool) for _ in range(3))
        self.speed = np.zeros(n)
        self.faster, self.slower = np.zeros(n, np.int64), np.zeros(n, np.int64)


class BatchJudge:
    """Keeps what runs do, and judges them at their ends: an observer of `BatchSimulation`.

    Args:
        scenario: the compiled scenario.
        sets: of the runs, ascending (n,).
        system: whether a system under test drives the ego.
        reserve: least reserve at the end of a run, as `runner.judging.evidence.rows` has it.
    """

    def __init__(
        self, scenario: Scenario, sets: IntArray, system: bool, reserve: float = 1.0
    ) -> None:
        self._reserve = reserve
        self._scenario, self._sets, self._system = scenario, sets, system
        n = len(sets)
        board: Any = scenario
        self._events = scene_events(board)
        self._mishap = bool(mishap_events(board))
        """whether events wait for a contact, and for nothing else"""
        self._segments: list[Segment] = []
        self._outcome = np.full(n, OPEN, object)
        self._status = np.full(n, "", object)
        self._steps, self._contact = np.zeros(n, np.int64), np.full(n, math.inf)
        self._partner = np.full(n, "", object)
        self._static = self._static_cause()
        self._seen = _Seen(n)
        """of the runs that are left"""

    def _static_cause(self) -> bool:
        """Whether each run is inconclusive by the files alone."""
        scenario: Any = self._scenario
        return bool(
            [*causes_of(scenario.remarks), *scenario.violations, *without_effect(scenario)]
        ) or any(displaced_boxes(scenario.entities.values()))

    def _at(self, run: BatchSimulation) -> IntArray:
        found: IntArray = np.searchsorted(self._sets, run.sets)
        return found

    def step(self, run: BatchSimulation) -> None:
        """Keep an instant, and look at what evidence is counted from."""
        ego, *others = _everyone(run)
        part = self._segments[-1] if self._segments else None
        if part is None or part.count == _SEGMENT or len(part.at) != run.n:
            part = Segment(run.step_index, self._at(run), 1 + len(others))
            self._segments.append(part)
        for number, entity in enumerate((ego, *others)):
            part.put(number, entity, run.step_index)
        part.count += 1
        self._look(run, others)

    def _look(self, run: BatchSimulation, others: list[EntityRows]) -> None:
        """Look at what evidence is counted from."""
        ego, seen = run.ego, self._seen
        limits = ego.declared.performance
        speed = np.abs(ego.speed)
        if not run.step_index:
            run.own(seen)
            for entity in (ego, *others):
                seen.doubt |= _aloft(run, entity)
        seen.moved |= speed > 0.0
        for entity in (ego, *others):
            most = _TOLERANCE * entity.declared.performance.max_speed
            fast = (speed if entity is ego else np.abs(entity.speed)) > most
            if fast.any():
                seen.beyond |= fast & run.going
        if run.step_index:
            self._look_for_jumps(run, [ego, *others])
            change = (speed - seen.speed) / run.dt
            steps = round(_SUSTAINED / run.dt)
            over = (
                change > _TOLERANCE * limits.max_acceleration - 1e-9,
                -change > _TOLERANCE * limits.max_deceleration - 1e-9,
            )
            for count, side in zip((seen.faster, seen.slower), over, strict=True):
                count += side
                count *= side
                long = count >= steps
                if steps > 0 and long.any():
                    seen.doubt |= long & run.going
        seen.speed = speed
        on = ego.on_lane & (ego.edge_right <= ego.t) & (ego.t <= ego.edge_left)
        off = run.going & ~on
        if off.any():
            for row in np.flatnonzero(off & ~seen.doubt):
                off[row] = run.roads.is_off_road(ego.load(row))
            seen.doubt |= off
        seen.doubt |= run.going & ego.at_road_end

    def _look_for_jumps(self, run: BatchSimulation, everyone: list[EntityRows]) -> None:
        """Leave runs to the interpreter in which someone was put elsewhere within the step."""
        part = self._segments[-1]
        for number, entity in enumerate(everyone):
            now = part.values[number][:2, part.count - 1]
            if part.count > 1:
                before = part.values[number][:2, part.count - 2]
            else:
                earlier = self._segments[-2]
                kept = np.searchsorted(earlier.at, part.at)
                before = earlier.values[number][:2, earlier.count - 1][:, kept]
            along, aside = now - before
            far = np.abs(along) + np.abs(aside) > JUMP  # never less than the way
            if far.any():
                way = np.hypot(along, aside) - np.abs(entity.speed) * run.dt
                self._seen.doubt |= far & (way > JUMP) & run.going

    def correct(self, run: BatchSimulation, put: Mapping[str, BoolArray]) -> None:
        """Show entities where actions have put them at the last instant."""
        part = self._segments[-1]
        for number, entity in enumerate(_everyone(run)):
            if entity.name in put:
                x, y, z = part.values[number][:3, part.count - 1]
                way = np.linalg.norm([entity.x - x, entity.y - y, entity.z - z], axis=0)
                self._seen.doubt |= put[entity.name] & (way > JUMP) & (run.step_index > 0)
                part.put(number, entity, run.step_index, put[entity.name])

    def end(self, run: BatchSimulation, ended: BoolArray) -> None:
        """Judge runs that are over (n,)."""
        rows, seen = np.flatnonzero(ended), self._seen
        at = self._segments[-1].at[rows]
        contact, finished = run.first_contact[rows], run.finished[rows]
        failed = contact < math.inf
        self._steps[at], self._contact[at] = run.step_index + 1, contact
        names = np.array([*run.entities, ""], object)
        self._partner[at] = names[np.where(failed, run.partner[rows], -1)]
        ends_early = failed & (run.steps_after_contact is not None)
        self._status[at] = np.where(
            finished, "completed", np.where(ends_early, "collision", "timeout")
        )
        started, every = np.zeros(len(rows), bool), np.ones(len(rows), bool)
        begun = np.zeros(len(rows), bool)
        for event in run.events:
            begun |= event.started[rows]
            if event.event in self._events:
                started |= event.started[rows]
                every &= event.started[rows]
        lacking = np.full(len(rows), self._static)
        doubt = seen.doubt[rows] | run.doubtful[rows] | seen.beyond[rows]
        out_of_time = self._are_out_of_time(run, rows, finished) & ~(finished & every)
        if self._events:
            lacking |= ~started
            doubt |= started & out_of_time
        else:
            doubt |= out_of_time
        if run.time < _SHORTEST or run.step_index == 0:
            doubt[:] = True
        driver: Any = run.driver
        if driver is not None:
            seconds = max(_SHORTEST, _LEAST_SHARE * run.time)
            doubt |= driver.commanded[rows] * run.dt < seconds
        if self._system and not scripted_at_start(self._scenario, run.ego.entity):
            lacking |= ~seen.moved[rows]
        waits = self._mishap & self._are_out_of_time(run, rows, finished) & ~begun
        for place in np.flatnonzero(~(failed | doubt | lacking)):
            next_one = _contact_to_come(run, rows[place])
            lacking[place] = next_one.reserve < self._reserve or (
                waits[place] and next_one.after <= APPROACH
            )
        outcome = np.where(doubt, OPEN, np.where(lacking, INCONCLUSIVE, PASSED))
        self._outcome[at] = np.where(failed, FAILED, outcome)

    def _are_out_of_time(
        self, run: BatchSimulation, rows: IntArray, finished: BoolArray
    ) -> BoolArray:
        """Whether a limit of time ended runs (k,), as `progress.out_of_time` says."""
        trigger = self._scenario.storyboard.stop_trigger
        if trigger is None:
            return np.ones(len(rows), bool)
        by_time = np.array(
            [
                all(isinstance(timed.condition, SimulationTimeCondition) for timed in group)
                for group in trigger.groups
            ]
        )
        return ~finished | by_time[run.fired[rows]]

    def outcomes(self, run: BatchSimulation) -> BatchOutcomes:
        """Outcomes of the runs, once all are over."""
        everyone = _everyone(run)
        return BatchOutcomes(
            self._outcome,
            self._status,
            np.round(np.maximum(self._steps - 1, 0) * run.dt, 9),
            self._contact,
            self._partner,
            tuple(entity.name for entity in everyone),
            self._segments,
            self._steps,
            {entity.name: entity.declared for entity in everyone},
            _road_names(run),
            run.roads.network,
            run.dt,
        )


def _aloft(run: BatchSimulation, entity: EntityRows) -> BoolArray:
    """Runs (n,) in which a participant is far above or below the road."""
    found, network = np.zeros(run.n, bool), run.roads.network
    if network is None or entity.declared.kind == "miscellaneous":
        return found
    # Where it moves by one formula along its lane, the road is at height 0.
    for row in np.flatnonzero(~entity.gliding | (np.abs(entity.z) > ALOFT)):
        pose = (float(getattr(entity, name)[row]) for name in "xyzh")
        found[row] = abs(above_road(network, *pose)) > ALOFT
    return found


def _everyone(run: BatchSimulation) -> list[EntityRows]:
    """All participants, the ego first."""
    return [run.ego, *(entity for entity in run.entities.values() if entity is not run.ego)]


def _contact_to_come(run: BatchSimulation, row: Any) -> PredictedContact:
    """First contact of the ego after the end of a run, as `continuity.contact_at_end` says."""
    own = _spot(run.ego, row)
    found = [
        next_contact(own, _spot(entity, row), entity.name)
        for entity in run.entities.values()
        if entity is not run.ego
    ]
    return min(found, default=NEVER)


def _road_names(run: BatchSimulation) -> dict[int, str]:
    network = run.roads.network
    roads = network.roads.values() if network is not None else ()
    layers = [layer for road in roads for layer in (road, road.on(PERMANENT))]
    return {id(road): road.id for road in layers}


def _spot(rows: EntityRows, row: int) -> tuple[Spot, float]:
    x, y, z, h = (float(getattr(rows, name)[row]) for name in "xyzh")
    return Spot(x, y, z, h, rows.box), float(rows.speed[row])
