"""Verdicts and measures of many runs that were played at once.

A failure counts once the interpreter has played it again. Evidence is counted as in `rows`; runs
with rare kinds of evidence stay open, for the interpreter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
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
    SUSTAINED,
    TOLERANCE,
    PredictedContact,
    above_road,
    displaced_boxes,
    next_contact,
)
from runner.judging.evidence.progress import mishap_events, scene_events, without_effect
from runner.judging.evidence.rows import ROWS, causes_of
from runner.judging.measures.criticality import criticality
from runner.judging.measures.measure import EVENTS, Facts
from runner.judging.measures.relations import MotionRows
from runner.judging.measures.runs import ArrayMeasures, Measuring, RunMeasures
from runner.judging.measures.segments import ENDLESS, FRAME, SEGMENT, Segment
from runner.judging.result import FAILED, INCONCLUSIVE, PASSED
from runner.systems.drivers import scripted_at_start
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from xodr.model import PERMANENT

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from runner.engine.compile.compiler import Scenario
    from runner.engine.participants.rows import EntityRows
    from runner.engine.storyboard.array_run import ArraySimulation
    from runner.judging.measures.criticality import Criticality
    from runner.judging.measures.measure import Limit

OPEN = "open"
"""Outcome of a run that the interpreter has to play"""


@dataclass(eq=False)
class ArrayOutcomes:
    """Outcomes of many runs; arrays (n,).

    Attributes:
        outcome: `passed`, `failed`, `inconclusive` or `open`.
        status: `completed`, `timeout` or `collision`.
        end_time: s.
        contact: time (s) of the ego's first contact; infinite without one.
        partner: name of the participant touched; empty without one.
        measures: of the runs, where they were asked for; of one that is `open` they say nothing.
        names: of all participants, the ego's first.
        margin: least signed distance to limits (`runner.judging.measures.measure.Limit.margins`);
            infinite without limits.
        segments: instants of all runs, a stretch of time after the other, where they are kept.
        roads: ids of roads by key.
        steps: number of instants of each run.
    """

    outcome: Any
    status: Any
    end_time: FloatArray
    contact: FloatArray
    partner: Any
    measures: RunMeasures | None
    names: tuple[str, ...]
    segments: list[Segment] = field(repr=False)
    steps: IntArray
    declared: dict[str, Any] = field(repr=False)
    roads: dict[int, str] = field(repr=False)
    network: Any = field(repr=False)
    dt: float
    margin: FloatArray

    def motion(self, name: str, run: int, instants: slice = slice(None)) -> MotionRows:
        """Motion of a participant in a run, at all or some of its instants."""
        count = int(self.steps[run])
        rows = np.arange(count)[instants]
        values, roads = self._kept(self.names.index(name), run, count)
        columns = dict(zip(FRAME, values[:, rows], strict=True))
        time = np.round(rows * self.dt, 9)
        keys, inverse = np.unique(roads[rows], return_inverse=True)
        road = np.array([*map(self.roads.get, keys.tolist()), None], object)[inverse]
        hint = None
        # Key 0 stands for no road: as in recordings, the nearest one counts then.
        for row in np.flatnonzero(keys[inverse] == 0) if self.network is not None else ():
            x, y, z, h = (float(columns[axis][row]) for axis in "xyzh")
            hint = self.network.locate(x, y, z, h, hint)
            road[row], columns["s"][row], columns["t"][row] = hint.road_id, hint.s, hint.t
        who = self.declared[name]
        about: dict[str, Any] = {"kind": who.kind, "category": who.category, "mass": who.mass}
        return MotionRows(name, who.box, time, road=road, **about, **columns)

    def _kept(self, number: int, run: int, steps: int) -> tuple[FloatArray, IntArray]:
        """Values (7, steps) and keys of roads (steps,) of a participant in a run."""
        values, roads = np.zeros((len(FRAME), steps)), np.zeros(steps, np.int64)
        for part in self.segments:
            column = int(np.searchsorted(part.at, run))
            if part.first >= steps or column == len(part.at) or part.at[column] != run:
                continue
            there = slice(part.first, min(part.first + part.count, steps))
            kept = slice(there.stop - part.first)
            values[:, there] = part.values[number, :, kept, column]
            roads[there] = part.roads[number, kept, column]
        return values, roads

    def criticality(self, run: int) -> Criticality:
        """Measures of a run."""
        ego, *others = (self.motion(name, run) for name in self.names)
        return criticality(ego, others)


class _EvidenceArrays(RunRows):
    """Facts that evidence is counted from, in the runs that are left (n,).

    Attributes:
        moved: where the ego has moved.
        beyond: where someone was faster than its Performance allows.
        hasty: where the ego changed its speed faster than its Performance allows, and for so long
            that the run is inconclusive.
        doubt: where the interpreter has to judge.
        speed: of the ego at the last instant, without a sign, m/s.
        faster, slower: steps up to now in which the ego's acceleration, its deceleration, was
            beyond its Performance.
    """

    def __init__(self, n: int) -> None:
        self.moved, self.beyond, self.hasty, self.doubt = (np.zeros(n, bool) for _ in range(4))
        self.speed = np.zeros(n)
        self.faster, self.slower = np.zeros(n, np.int64), np.zeros(n, np.int64)


class ArrayJudge:
    """Records runs, and judges them at their ends: an observer of `ArraySimulation`.

    Args:
        scenario: the compiled scenario.
        sets: of the runs, ascending (n,).
        system: whether a system under test drives the ego.
        reserve: least reserve at the end of a run, as `runner.judging.evidence.rows` has it.
        measuring: choice of measures; None for none.
        keeps: whether the instants of all runs are kept: for comparisons, and measures that are
            taken run by run, as they need much memory.
        limits: by which runs fail. defined: least share of time in which their measures have to be
            defined.
    """

    def __init__(
        self,
        scenario: Scenario,
        sets: IntArray,
        system: bool,
        reserve: float = 1.0,
        measuring: Measuring | None = None,
        keeps: bool = False,
        limits: Sequence[Limit] = (),
        defined: float = 0.0,
    ) -> None:
        self._limits, self._defined = limits, defined
        self._measuring, self._keeps = measuring, keeps
        self._measures: ArrayMeasures | None = None
        self._part: Segment | None = None
        self._spare: list[tuple[FloatArray, IntArray]] = []
        """memory of segments that are measured"""
        self._last: tuple[IntArray, FloatArray]
        """runs (k,) of the segment before, and x, y of everyone at its end (p, 2, k)"""
        self._reserve = reserve
        self._scenario, self._sets, self._system = scenario, sets, system
        n = len(sets)
        board: Any = scenario
        # The functions of `progress` read the storyboard alone, which a scenario has as well.
        self._events = scene_events(board)
        self._mishap = bool(mishap_events(board))
        """whether events wait for a contact, and for nothing else"""
        self._segments: list[Segment] = []
        self._outcome = np.full(n, OPEN, object)
        self._status = np.full(n, "", object)
        self._steps, self._contact = np.zeros(n, np.int64), np.full(n, math.inf)
        self._partner = np.full(n, "", object)
        self._static = self._static_cause()
        self._seen = _EvidenceArrays(n)
        """of the runs that are left"""

    def _static_cause(self) -> bool:
        """Whether each run is inconclusive by the files alone."""
        scenario: Any = self._scenario
        return bool(
            [*causes_of(scenario.remarks), *scenario.violations, *without_effect(scenario)]
        ) or any(displaced_boxes(scenario.entities.values()))

    def _at(self, run: ArraySimulation) -> IntArray:
        found: IntArray = np.searchsorted(self._sets, run.sets)
        return found

    def step(self, run: ArraySimulation) -> None:
        """Keep an instant, and update the facts that evidence is counted from."""
        everyone = _everyone(run)
        part = self._part
        # A segment is of one set of runs: where some ended, another begins, so that it has no gaps.
        if part is None or part.count == SEGMENT or len(part.at) != run.n:
            self._close(run)
            part = self._part = self._segment(run, len(everyone))
        place, part.count = part.count, part.count + 1
        for number, entity in enumerate(everyone):
            self._put(part, place, number, entity)
        self._look(run, everyone[1:])

    def _segment(self, run: ArraySimulation, participants: int) -> Segment:
        n = len(self._sets)
        # Memory is used again: fresh arrays of this size cost page faults in each segment.
        if self._spare:
            values, roads = self._spare.pop()
        else:
            size = participants * SEGMENT * (run.n if self._keeps else n)
            values, roads = np.empty(size * len(FRAME)), np.empty(size, np.int64)
        shape = participants, len(FRAME), SEGMENT, run.n
        count = math.prod(shape)
        return Segment(
            run.step_index,
            self._at(run),
            values[:count].reshape(shape),
            roads[: count // len(FRAME)].reshape(participants, SEGMENT, run.n),
        )

    @staticmethod
    def _put(
        part: Segment, place: int, number: int, rows: EntityRows, some: Any = slice(None)
    ) -> None:
        """Keep where a participant is at an instant, in all or some of the runs."""
        for values, name in zip(part.values[number], FRAME, strict=True):
            values[place, some] = getattr(rows, name)[some]
        part.roads[number, place, some] = rows.road_key[some]

    def _close(self, run: ArraySimulation) -> None:
        """End the present segment: it is measured, or kept."""
        part = self._part
        if part is None:
            return
        # A jump at a segment's first instant shows only against the last one before it.
        self._last = part.at, part.values[:, :2, part.count - 1].copy()
        if self._keeps:
            self._segments.append(part)
            # Measuring writes codes of roads and places into a segment: the kept one stays as it
            # is.
            part = replace(part, values=part.values.copy(), roads=part.roads.copy())
        if self._measuring is None:
            if not self._keeps:
                self._spare.append(_memory(part))
            return
        if self._measures is None:
            boxes = [entity.box for entity in _everyone(run)]
            self._measures = ArrayMeasures(
                len(self._sets), boxes, _road_names(run), run.roads.network, self._measuring, run.dt
            )
        # The length of runs that go on is not known yet: all instants of theirs count.
        going = np.zeros(len(self._sets), bool)
        going[self._at(run)[run.going]] = True
        sizes = np.where(going & (self._steps == 0), ENDLESS, self._steps)
        for measured in self._measures.add(part, sizes):
            if not self._keeps:
                self._spare.append(_memory(measured))

    def _look(self, run: ArraySimulation, others: list[EntityRows]) -> None:
        """Update the facts that evidence is counted from."""
        ego, seen = run.ego, self._seen
        limits = ego.declared.performance
        speed = np.abs(ego.speed)
        if not run.step_index:
            run.own(seen)
            for entity in (ego, *others):
                seen.doubt |= _aloft(run, entity)
        seen.moved |= speed > 0.0
        for entity in (ego, *others):
            most = TOLERANCE * entity.declared.performance.max_speed
            fast = (speed if entity is ego else np.abs(entity.speed)) > most
            if fast.any():
                seen.beyond |= fast & run.going
        if run.step_index:
            self._look_for_jumps(run, [ego, *others])
            change = (speed - seen.speed) / run.dt
            steps = round(SUSTAINED / run.dt)
            over = (
                change > TOLERANCE * limits.max_acceleration,
                -change > TOLERANCE * limits.max_deceleration,
            )
            # Steps in a row: one within the limit begins the count anew.
            for count, side in zip((seen.faster, seen.slower), over, strict=True):
                count += side
                count *= side
                long = count >= steps
                if steps > 0 and long.any():
                    seen.hasty |= long & run.going
        seen.speed = speed
        on = ego.on_lane & (ego.edge_right <= ego.t) & (ego.t <= ego.edge_left)
        # The edges of its lane decide most rows; a place beside it may be on
        # another, overlapping road.
        off = run.going & ~on
        if off.any():
            for row in np.flatnonzero(off & ~seen.doubt):
                off[row] = run.roads.is_off_road(ego.load(row))
            seen.doubt |= off
        seen.doubt |= run.going & ego.at_road_end

    def _look_for_jumps(self, run: ArraySimulation, everyone: list[EntityRows]) -> None:
        """Leave runs with a jump of a participant within the step to the interpreter."""
        part = self._part
        assert part is not None
        places = part.values[:, :2]
        for number, entity in enumerate(everyone):
            now = places[number, :, part.count - 1]
            if part.count > 1:
                before = places[number, :, part.count - 2]
            else:
                at, last = self._last
                before = last[number][:, np.searchsorted(at, part.at)]
            along, aside = now - before
            far = np.abs(along) + np.abs(aside) > JUMP  # never less than the way
            if far.any():
                way = np.hypot(along, aside) - np.abs(entity.speed) * run.dt
                self._seen.doubt |= far & (way > JUMP) & run.going

    def correct(self, run: ArraySimulation, put: Mapping[str, BoolArray]) -> None:
        """Show entities where actions have put them at the last instant."""
        part = self._part
        assert part is not None
        for number, entity in enumerate(_everyone(run)):
            if entity.name in put:
                x, y, z = part.values[number, :3, part.count - 1]
                way = np.linalg.norm([entity.x - x, entity.y - y, entity.z - z], axis=0)
                self._seen.doubt |= put[entity.name] & (way > JUMP) & (run.step_index > 0)
                self._put(part, part.count - 1, number, entity, put[entity.name])

    def end(self, run: ArraySimulation, ended: BoolArray) -> None:
        """Judge runs that are over (n,)."""
        rows, seen = np.flatnonzero(ended), self._seen
        assert self._part is not None
        at = self._part.at[rows]
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
        lacking = seen.hasty[rows] | self._static
        doubt = seen.doubt[rows] | run.doubtful[rows] | seen.beyond[rows]
        # A stop by time leaves nothing waiting where every event has started.
        out_of_time = self._are_out_of_time(run, rows, finished) & ~(finished & every)
        if self._events:
            lacking |= ~started
            doubt |= started & out_of_time
        else:
            doubt |= out_of_time
        # As the rows `seconds` and `start` have it: such runs are rare, and left open.
        if run.time < ROWS["seconds"].least or run.step_index == 0:
            doubt[:] = True
        driver: Any = run.driver
        if driver is not None:
            # The ego is there all the time, of which the share is.
            shortest, share = ROWS["command_seconds"].least, ROWS["command_share"].least
            seconds = max(shortest, share * run.time)
            doubt |= driver.commanded[rows] * run.dt < seconds
        if self._system and not scripted_at_start(self._scenario, run.ego.entity):
            lacking |= ~seen.moved[rows]
        # Where events wait for a contact alone, a limit of time may cut off what they wait for.
        waits = self._mishap & self._are_out_of_time(run, rows, finished) & ~begun
        asked = ~(failed | doubt | lacking)
        # Reserves are worked out run by run: only for those that nothing else has decided.
        if self._reserve <= 0.0:  # no reserve is less
            asked &= waits
        for place in np.flatnonzero(asked):
            next_one = _contact_to_come(run, rows[place])
            lacking[place] = next_one.reserve < self._reserve or (
                waits[place] and next_one.after <= APPROACH
            )
        # Doubt comes before lack: the single run that it asks for knows more, and decides either.
        outcome = np.where(doubt, OPEN, np.where(lacking, INCONCLUSIVE, PASSED))
        # A contact fails a run whatever its evidence, as in `Verdict.outcome`.
        self._outcome[at] = np.where(failed, FAILED, outcome)

    def _are_out_of_time(
        self, run: ArraySimulation, rows: IntArray, finished: BoolArray
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

    def outcomes(self, run: ArraySimulation) -> ArrayOutcomes:
        """Outcomes of the runs, once all are over."""
        everyone = _everyone(run)
        self._close(run)
        self._part = None
        measured = self._measures
        outcomes = ArrayOutcomes(
            self._outcome,
            self._status,
            np.round(np.maximum(self._steps - 1, 0) * run.dt, 9),
            self._contact,
            self._partner,
            None if measured is None else measured.result(self._steps),
            tuple(entity.name for entity in everyone),
            self._segments,
            self._steps,
            {entity.name: entity.declared for entity in everyone},
            _road_names(run),
            run.roads.network,
            run.dt,
            np.full(len(self._sets), math.inf),
        )
        if self._limits:
            self._apply_limits(outcomes)
        return outcomes

    def _apply_limits(self, outcomes: ArrayOutcomes) -> None:
        """Fail runs by limits that they do not keep; those without a value are inconclusive."""
        shares = np.ones(len(self._sets))
        for limit in self._limits:
            margin, defined = _margins(limit, outcomes)
            np.minimum(outcomes.margin, margin, out=outcomes.margin)
            np.minimum(shares, defined, out=shares)
        known = outcomes.outcome != OPEN
        outcomes.outcome[known & (outcomes.outcome == PASSED) & (shares < self._defined)] = (
            INCONCLUSIVE
        )
        outcomes.outcome[known & (outcomes.margin <= 0.0)] = FAILED


_LED, _PRESENT = ("min_ttc", "max_drac"), "min_distance"
MEASURED = (*_LED, _PRESENT, "end_time", *(name for name in EVENTS if name != "rss"))
"""Limits of what is measured while runs are played; others need the instants of runs, which are
kept for them"""


def _margins(limit: Limit, outcomes: ArrayOutcomes) -> tuple[FloatArray, FloatArray]:
    """Signed distances of runs to a limit (n,), and the shares of time in which it was defined."""
    n, measured = len(outcomes.steps), outcomes.measures
    every = np.ones(n)
    if limit.name not in MEASURED:
        return _margins_one_by_one(limit, outcomes)
    if limit.name == "end_time":
        return limit.margins(outcomes.end_time), every
    if not limit.comparison:
        # Runs in which the ego leaves the road, or reaches its end, are left to the interpreter.
        happened = (outcomes.status == "timeout") & (limit.name == "timeout")
        roads = not limit.needs_road or outcomes.network is not None
        return np.where(happened, -1.0, math.inf), every * roads
    assert measured is not None
    values = getattr(measured, limit.name)
    nothing = 0.0 if limit.name == "max_drac" else math.inf  # no lead, or none that comes nearer
    share = measured.led if limit.name in _LED else measured.present
    return limit.margins(np.where(values == nothing, math.nan, values)), share


def _margins_one_by_one(limit: Limit, outcomes: ArrayOutcomes) -> tuple[FloatArray, FloatArray]:
    """`_margins` by the measures of each run."""
    n = len(outcomes.steps)
    margin, share = np.full(n, math.inf), np.ones(n)
    for row in np.flatnonzero(outcomes.outcome != OPEN):
        seen = outcomes.criticality(int(row))
        end = outcomes.status[row], float(outcomes.end_time[row])
        facts = Facts(seen.summary, (), *end, seen=seen)
        margin[row], share[row] = limit.margin(facts), limit.defined(seen)
    return margin, share


def _aloft(run: ArraySimulation, entity: EntityRows) -> BoolArray:
    """Runs (n,) in which a participant is far above or below the road."""
    found, network = np.zeros(run.n, bool), run.roads.network
    if network is None or entity.declared.kind == "miscellaneous":
        return found
    # Where it moves by one formula along its lane, the road is at height 0.
    for row in np.flatnonzero(~entity.gliding | (np.abs(entity.z) > ALOFT)):
        pose = (float(getattr(entity, name)[row]) for name in "xyzh")
        found[row] = abs(above_road(network, *pose)) > ALOFT
    return found


def _memory(part: Segment) -> tuple[FloatArray, IntArray]:
    """The arrays that a segment's are parts of."""
    values: Any = part.values.base
    roads: Any = part.roads.base
    return values, roads


def _everyone(run: ArraySimulation) -> list[EntityRows]:
    """All participants, the ego first."""
    return [run.ego, *(entity for entity in run.entities.values() if entity is not run.ego)]


def _contact_to_come(run: ArraySimulation, row: Any) -> PredictedContact:
    """First contact of the ego after the end of a run, as `continuity.contact_at_end` says."""
    own = _spot(run.ego, row)
    found = [
        next_contact(own, _spot(entity, row), entity.name)
        for entity in run.entities.values()
        if entity is not run.ego
    ]
    return min(found, default=NEVER)


def _road_names(run: ArraySimulation) -> dict[int, str]:
    network = run.roads.network
    roads = network.roads.values() if network is not None else ()
    layers = [layer for road in roads for layer in (road, road.on(PERMANENT))]
    return {id(road): road.id for road in layers}


def _spot(rows: EntityRows, row: int) -> tuple[Spot, float]:
    x, y, z, h = (float(getattr(rows, name)[row]) for name in "xyzh")
    return Spot(x, y, z, h, rows.box), float(rows.speed[row])
