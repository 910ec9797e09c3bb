"""Verdicts and measures of many runs that were played at once.

A failure counts once the interpreter has played it again. Evidence is counted as in `rows`; runs with
rare kinds of evidence stay open, for the interpreter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from runner.engine.conditions.by_value import SimulationTimeCondition
from runner.engine.participants.boxes import Spot
from runner.judging.evidence.continuity import displaced_boxes, next_contact
from runner.judging.evidence.progress import scene_events, without_effect
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
"""As in `continuity` and `rows`"""
_MEASURED = 256
"""Runs that are measured at once: arrays of them fit into caches"""
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
        motions: of each participant by name: x, y, z, h, speed, s, t (7, steps, n), as far as they
            are known, and the key of the road at each instant (steps, n); the ego's first.
        roads: ids of roads by key.
        steps: number of instants of each run.
    """

    outcome: Any
    status: Any
    end_time: FloatArray
    contact: FloatArray
    partner: Any
    motions: dict[str, tuple[FloatArray, Any]] = field(repr=False)
    steps: IntArray
    declared: dict[str, Any] = field(repr=False)
    roads: dict[int, str] = field(repr=False)
    network: Any = field(repr=False)
    dt: float

    def motion(self, name: str, run: int, instants: slice = slice(None)) -> MotionRows:
        """Motion of a participant in a run, at all or some of its instants."""
        rows = np.arange(int(self.steps[run]))[instants]
        values, roads = self.motions[name]
        columns = dict(zip(_FRAME, values[:, rows, run], strict=True))
        time = np.round(rows * self.dt, 9)
        keys, inverse = np.unique(roads[rows, run], return_inverse=True)
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
            chosen = slice(first, first + _MEASURED)
            ego, *others = (self._rows(name, chosen, sizes[chosen], codes) for name in self.motions)
            parts.append(measure_runs(ego, others, sizes[chosen], parameters, window, self.dt))
        return RunMeasures.joined(parts)

    def _rows(
        self, name: str, chosen: slice, sizes: IntArray, codes: Mapping[str, int]
    ) -> MotionRows:
        """Rows of a participant in some runs, one after the other, with codes of roads for their ids."""
        values, roads = self.motions[name]
        steps = np.arange(int(sizes.max()))
        there = steps < sizes[:, None]
        parts = values[:, : len(steps), chosen]
        columns = {name: part.T[there] for name, part in zip(_FRAME, parts, strict=True)}
        keys, inverse = np.unique(roads[: len(steps), chosen].T[there], return_inverse=True)
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
        ego, *others = (self.motion(name, run) for name in self.motions)
        return criticality(ego, others)


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
        self._frames: list[tuple[IntArray, list[tuple[FloatArray, IntArray]]]] = []
        self._outcome = np.full(n, OPEN, object)
        self._status = np.full(n, "", object)
        self._steps, self._contact = np.zeros(n, np.int64), np.full(n, math.inf)
        self._partner = np.full(n, "", object)
        self._static = self._static_cause()
        self._counts = np.zeros((2, n), np.int64)
        self._beyond, self._moved = np.zeros(n, bool), np.zeros(n, bool)
        self._doubt = np.zeros(n, bool)
        self._speed = np.zeros(n)

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
        at, ego = self._at(run), run.ego
        others = [entity for entity in run.entities.values() if entity is not ego]
        self._frames.append((at, [_frame(entity) for entity in (ego, *others)]))
        self._moved[at] |= ego.speed != 0.0
        limits = ego.declared.performance
        for entity in (ego, *others):
            fast = np.abs(entity.speed) > _TOLERANCE * entity.declared.performance.max_speed
            self._beyond[at] |= fast & run.going
        speed = np.abs(ego.speed)
        if run.step_index:
            change = (speed - self._speed[at]) / run.dt
            steps = round(_SUSTAINED / run.dt)
            for side, (rate, limit) in enumerate(
                ((change, limits.max_acceleration), (-change, limits.max_deceleration))
            ):
                over = rate > _TOLERANCE * limit - 1e-9
                self._counts[side, at] = np.where(over, self._counts[side, at] + 1, 0)
                self._doubt[at] |= (self._counts[side, at] >= steps) & run.going & (steps > 0)
        self._speed[at] = speed
        on = ego.on_lane & (ego.edge_right <= ego.t) & (ego.t <= ego.edge_left)
        off = run.going & ~on
        for row in np.flatnonzero(off & ~self._doubt[at]):
            off[row] = run.roads.is_off_road(ego.load(row))
        self._doubt[at] |= off | (run.going & ego.at_road_end)

    def correct(self, run: BatchSimulation, put: Mapping[str, BoolArray]) -> None:
        """Show entities where actions have put them at the last instant."""
        everyone = [run.ego, *(entity for entity in run.entities.values() if entity is not run.ego)]
        _, frames = self._frames[-1]
        for entity, (values, roads) in zip(everyone, frames, strict=True):
            if entity.name in put:
                rows = put[entity.name]
                now, there = _frame(entity)
                values[:, rows], roads[rows] = now[:, rows], there[rows]

    def end(self, run: BatchSimulation, ended: BoolArray) -> None:
        """Judge runs that are over (n,)."""
        at, rows = self._at(run), np.flatnonzero(ended)
        started = np.zeros(run.n, bool)
        every = np.ones(run.n, bool)
        for event in run.events:
            if event.event in self._events:
                started |= event.started
                every &= event.started
        driver: Any = run.driver
        names = list(run.entities)
        for row in rows:
            number = at[row]
            finished = bool(run.finished[row])
            contact = float(run.first_contact[row])
            self._steps[number] = run.step_index + 1
            self._contact[number] = contact
            if contact < math.inf:
                self._partner[number] = names[run.partner[row]]
            ends_early = run.steps_after_contact is not None and contact < math.inf
            self._status[number] = (
                "completed" if finished else "collision" if ends_early else "timeout"
            )
            if contact < math.inf:
                self._outcome[number] = FAILED
                continue
            doubt = self._doubt[number] or run.doubtful[row] or self._beyond[number]
            if self._events and not started[row]:
                pass
            elif self._is_out_of_time(run, row, finished):
                doubt = doubt or not (finished and every[row])
            doubt = doubt or run.time < _SHORTEST or run.step_index == 0
            if driver is not None:
                doubt = doubt or driver.commanded[row] * run.dt < _SHORTEST
            scripted = not self._system or scripted_at_start(self._scenario, run.ego.entity)
            if doubt:
                continue
            lacking = self._static or (bool(self._events) and not started[row])
            lacking = lacking or not (scripted or self._moved[number])
            lacking = lacking or self._open_end(run, row)
            self._outcome[number] = INCONCLUSIVE if lacking else PASSED

    def _is_out_of_time(self, run: BatchSimulation, row: Any, finished: bool) -> bool:
        """Whether a limit of time ended a run, as `progress.out_of_time` says."""
        trigger = self._scenario.storyboard.stop_trigger
        if not finished or trigger is None:
            return True
        group = trigger.groups[int(run.fired[row])]
        return all(isinstance(timed.condition, SimulationTimeCondition) for timed in group)

    def _open_end(self, run: BatchSimulation, row: Any) -> bool:
        """Whether a run ended so shortly before a contact of the ego that no brake avoids it."""
        if self._reserve <= 0.0:
            return False
        own = _spot(run.ego, row)
        found = [
            next_contact(own, _spot(entity, row), entity.name)
            for entity in run.entities.values()
            if entity is not run.ego
        ]
        return bool(found) and min(found).reserve < self._reserve

    def outcomes(self, run: BatchSimulation) -> BatchOutcomes:
        """Outcomes of the runs, once all are over."""
        n, steps = len(self._sets), len(self._frames)
        everyone = [run.ego, *(entity for entity in run.entities.values() if entity is not run.ego)]
        motions = {
            entity.name: (np.zeros((len(_FRAME), steps, n)), np.zeros((steps, n), np.int64))
            for entity in everyone
        }
        for step, (at, frames) in enumerate(self._frames):
            for entity, (values, roads) in zip(everyone, frames, strict=True):
                motions[entity.name][0][:, step, at] = values
                motions[entity.name][1][step, at] = roads
        return BatchOutcomes(
            self._outcome,
            self._status,
            np.round(np.maximum(self._steps - 1, 0) * run.dt, 9),
            self._contact,
            self._partner,
            motions,
            self._steps,
            {entity.name: entity.declared for entity in everyone},
            _road_names(run),
            run.roads.network,
            run.dt,
        )


def _frame(rows: EntityRows) -> tuple[FloatArray, IntArray]:
    return np.array([getattr(rows, name) for name in _FRAME]), rows.road_key.copy()


def _road_names(run: BatchSimulation) -> dict[int, str]:
    network = run.roads.network
    roads = network.roads.values() if network is not None else ()
    layers = [layer for road in roads for layer in (road, road.on(PERMANENT))]
    return {id(road): road.id for road in layers}


def _spot(rows: EntityRows, row: int) -> tuple[Spot, float]:
    x, y, z, h = (float(getattr(rows, name)[row]) for name in "xyzh")
    return Spot(x, y, z, h, rows.box), float(rows.speed[row])
