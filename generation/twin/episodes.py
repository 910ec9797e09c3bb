"""A manoeuvre scenario at thousands of points at once: the twin of `generation.search.outcomes.Evaluator`.

It repeats the steps of `runner.engine.storyboard.simulation` on a straight road without traffic of
its own. How often its verdicts are SUMO's is measured by `python -m studies.generation twin`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from generation.search.outcomes import RISK_WINDOW, FullBraking, Outcomes
from generation.space.space import DIGITS, Space
from generation.twin.motion import (
    Body,
    Changing,
    JerkChanging,
    Keeping,
    Script,
    driven,
    read,
    value,
)
from runner.engine.motion.rss import RssParameters, parameter_set
from runner.engine.participants.declaration import BoundingBox, Performance
from runner.engine.participants.outlines import boxes_overlap
from runner.engine.worlds.signals_ahead import StopLine
from runner.judging.measures.criticality import lateral_violation, longitudinal_violation
from runner.judging.measures.relations import MotionRows
from runner.judging.settings import RunSettings
from runner.systems import System, load_system
from runner.systems.arrays import BatchObservation, BatchParticipants, BatchSystem
from runner.systems.batch_systems import open_batch
from runner.systems.kinds.aeb import EmergencyBraking
from runner.systems.kinds.cas import CollisionAvoidance
from runner.systems.kinds.idm import IntelligentDriver
from runner.systems.kinds.reference import ReferenceDriver
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import Unsupported

BLOCK = 16384
"""Points that are played at a time: what they need fits into the processor's cache"""
_SOON = 1e-6
"""Rounding of times, s"""
_SAME, _CHANGED = 1e-9, 1e-3
_NEAR = 1.5
"""Gaps of boxes along the road (m) from which turned ones are looked at: they reach out no further"""
_FULL = 0.85
"""Share of the cases at most that go on when those that are over are taken out"""


class Twin:
    """Plays a manoeuvre scenario at points of its parameter space.

    Args:
        scenario: the file.
        space: the parameters that are searched, and the values of the others.
        run: settings of the runs; those that name another ego, limits of verdicts or another road
            are refused.
        rss: the RSS parameter set of risk.

    Raises:
        Unsupported: the scenario, or a setting, is nothing that the twin can play.
        InvalidFile: the scenario is malformed.
    """

    def __init__(
        self, scenario: Path, space: Space, run: RunSettings | None = None, rss: str = "ad-rss"
    ) -> None:
        self._run, self._rss = run or RunSettings(), parameter_set(rss)
        if self._run.ego or self._run.fail_if or self._run.road:
            raise Unsupported(
                "the twin plays no other ego, limits of verdicts or road", path=scenario
            )
        self._script, self._space = read(scenario, self._run), space
        driver(self._run.sut, 0)

    def __call__(self, theta: FloatArray, sut: str | None = None) -> Outcomes:
        """The outcomes at points (n, d), in their order.

        Args:
            sut: name of the system under test, where another one than that of the settings is to
                drive.

        Raises:
            Unsupported: it can't be asked for many points at once.
        """
        system = self._run.sut if sut is None else sut
        blocks = [theta[start : start + BLOCK] for start in range(0, len(theta), BLOCK)]
        parts = [self._play(block, driver(system, len(block))) for block in blocks]
        columns = {
            name: np.concatenate([part[name] for part in parts])
            for name in (parts[0] if parts else ())
        }
        return Outcomes.of(len(theta), **columns)

    def together(self, suts: Sequence[str]) -> Callable[[FloatArray, str], Outcomes]:
        """The same, which plays the same few points with all of some systems at once when it is asked for one of them.

        The systems share the steps of everyone else, which are most of the time. The outcomes are
        those of each alone.
        """
        known: dict[str, Outcomes] = {}
        points = np.empty((0, 0))

        def driving(theta: FloatArray, sut: str) -> Outcomes:
            nonlocal points
            if sut not in suts or not 0 < len(theta) * len(suts) <= BLOCK:
                return self(theta, sut)
            if not np.array_equal(points, theta):
                n = len(theta)
                columns = self._play(
                    np.tile(theta, (len(suts), 1)), _Several([driver(each, n) for each in suts], n)
                )
                found = Outcomes.of(n * len(suts), **columns)
                known.update(
                    (each, found.take(np.arange(place * n, (place + 1) * n)))
                    for place, each in enumerate(suts)
                )
                points = theta.copy()
            return known[sut]

        return driving

    def _play(self, theta: FloatArray, who: DriverModel) -> dict[str, Any]:
        parameters: dict[str, FloatArray] = {
            name: np.full(len(theta), each) for name, each in self._script.literals.items()
        }
        parameters |= self._space.by_name(np.round(theta, DIGITS))  # as `Space.values` writes them
        return _Episodes(self._script, parameters, who, self._run.timestep, self._rss).play()


class _Part(Protocol):
    """Something that is known of each case."""

    def take(self, rows: BoolArray) -> None:
        """Keep some cases only."""
        ...


class _Episodes:
    """Cases side by side; those that are over are taken out."""

    def __init__(
        self,
        script: Script,
        parameters: Mapping[str, FloatArray],
        who: DriverModel,
        dt: float,
        rss: RssParameters,
    ) -> None:
        self._n = n = len(next(iter(parameters.values())))
        self._script, self._driver, self._dt, self._rss = script, who, dt, rss
        self._bodies = {each.name: _placed(each, script, parameters, n) for each in script.actors}
        self._ego = next(iter(self._bodies.values()))
        self._changes = {
            each.name: (each.change, _changing(each, script, parameters, n))
            for each in script.actors
            if each.change is not None
        }
        self._terms = {
            name: (value(change.delay, parameters, n), value(change.gap, parameters, n))
            for name, (change, _) in self._changes.items()
        }
        self._followers = {
            each.name: (
                each.following.leader,
                Keeping(value(each.following.gap, parameters, n), each.following.limits),
            )
            for each in script.actors
            if each.following is not None
        }
        self._rest, self._longest = (
            value(script.rest, parameters, n),
            value(script.longest, parameters, n),
        )
        self._rows, self._going = np.arange(n), np.ones(n, bool)
        self._returning = np.zeros(n, bool)
        self._found = _Found(n, dt)

    def play(self) -> dict[str, Any]:
        """Play all to their ends."""
        step, time = 0, 0.0
        self._observe(time)
        self._evaluate(time, step)
        while self._rows.size:
            before = {name: (body.speed, body.y) for name, body in self._bodies.items()}
            aside = {name: self._changes[name][1].step(self._bodies[name], round((step + 1) * self._dt, 9), self._dt)
                     for name in self._changes}  # fmt: skip
            for name, (leader, keeping) in self._followers.items():
                keeping.step(self._bodies[name], self._bodies[leader], self._dt)
            self._drive(aside)
            step += 1
            time = round(step * self._dt, 9)
            self._changed = np.zeros(self._rows.size, bool)
            for name, (speed, y) in before.items():
                body = self._bodies[name]
                self._changed |= (np.abs(body.speed - speed) > _CHANGED) | (
                    np.abs(body.y - y) > _CHANGED
                )
            self._observe(time)
            self._evaluate(time, step)
        found = self._found.columns
        return {**found, "min_ttc": np.where(found["collision"], 0.0, found["min_ttc"])}

    def _drive(self, aside: Mapping[str, FloatArray]) -> None:
        """Move everyone, the ego as its driver decides."""
        none = np.zeros(self._rows.size)
        speed = self._decided()
        for body in self._bodies.values():
            body.move(
                speed if body is self._ego else body.target,
                aside.get(body.actor.name, none),
                self._dt,
            )

    def _decided(self) -> FloatArray:
        """Speed of the ego at the end of the step."""
        ego, dt = self._ego, self._dt
        seen = Situation(
            self._motions[0],
            self._motions[1:],
            ego.speed,
            ego.acceleration,
            ego.target,
            self._changed,
        )
        intervenes, wanted = self._driver.control(seen, dt)
        speed, self._returning = driven(ego, intervenes, wanted, self._returning, dt)
        return speed

    def _observe(self, time: float) -> None:
        """Look at the state: measures of this instant."""
        self._motions = [body.motion() for body in self._bodies.values()]
        if time == 0.0:
            self._changed = np.zeros(self._rows.size, bool)
        self._touching = self._found.add(
            time, list(self._bodies.values()), self._motions, self._rss
        )

    def _evaluate(self, time: float, step: int) -> None:
        """Triggers, in the interpreter's order: the end, then the events."""
        over = self._touching | (time > self._longest)
        over |= self._changes[self._script.last][1].done + self._rest <= time + _SOON
        at_end = (
            reduce(np.maximum, [body.x for body in self._bodies.values()]) > self._script.length
        )
        if ((over | at_end) & self._going).any():
            self._end(over, at_end, time)
        following = round((step + 1) * self._dt, 9)
        for name, (change, state) in self._changes.items():
            body, (delay, gap) = self._bodies[name], self._terms[name]
            state.settle(time, body)
            state.begin(
                (time >= delay - _SOON) & (self._gap(change.follower, change.leader) <= gap),
                body,
                following,
            )

    def _gap(self, follower: str, leader: str) -> FloatArray:
        """Longitudinal gap of two boxes along the road (n,), m."""
        a, b = self._bodies[follower], self._bodies[leader]
        apart = np.abs(b.x + b.actor.box.x - a.x - a.actor.box.x)
        return np.maximum(apart - (a.actor.box.length + b.actor.box.length) / 2, 0.0)

    def _end(self, over: BoolArray, off: BoolArray, time: float) -> None:
        """Note what is over; it is taken out once it is many. Cases at the road's end are none that the twin can play."""
        ended = (over | off) & self._going
        self._found.end(self._rows, ended, off & ~over & ended, time)
        self._going &= ~ended
        if self._going.sum() <= _FULL * len(self._going):
            self._take(self._going)

    def _take(self, left: BoolArray) -> None:
        """Keep some cases only."""
        parts: list[_Part] = [
            *self._bodies.values(),
            *(state for _, state in self._changes.values()),
            self._driver,
            self._found,
        ]
        parts += [keeping for _, keeping in self._followers.values()]
        for each in parts:
            each.take(left)
        self._terms = {name: (delay[left], gap[left]) for name, (delay, gap) in self._terms.items()}
        self._rest, self._longest, self._returning = (
            self._rest[left],
            self._longest[left],
            self._returning[left],
        )
        self._rows, self._changed, self._going = (
            self._rows[left],
            self._changed[left],
            self._going[left],
        )
        self._motions = [body.motion() for body in self._bodies.values()]


def _placed(actor: Any, script: Script, parameters: Mapping[str, FloatArray], n: int) -> Body:
    x = np.sum([value(term, parameters, n) for term in actor.s], axis=0)
    speed = np.array(value(actor.speed, parameters, n))
    return Body(
        actor,
        x,
        np.full(n, script.lanes[actor.lane]),
        np.zeros(n),
        speed,
        np.zeros(n),
        speed.copy(),
        np.zeros(n),
    )


def _changing(actor: Any, script: Script, parameters: Mapping[str, FloatArray], n: int) -> Changing:
    change = actor.change
    terms = (
        np.array(value(term, parameters, n))
        for term in (change.duration, change.speed, change.rest, change.final)
    )
    shift = script.lanes[actor.lane + change.lanes] - script.lanes[actor.lane]
    if change.jerk is None:
        return Changing(n, shift, *terms)
    return JerkChanging(n, shift, *terms, jerk=np.array(value(change.jerk, parameters, n)))


class _Found:
    """Measured values: of active cases in `now`, of finished ones in `columns`."""

    def __init__(self, n: int, dt: float) -> None:
        self.now: dict[str, Any] = {
            "collision": np.zeros(n, bool), "min_ttc": np.full(n, np.inf), "max_drac": np.zeros(n),
            "clearance": np.full(n, np.inf), "conflict": np.zeros(n), "impact_speed": np.zeros(n),
            "risk": np.zeros(n), "r_risk": np.zeros(n),
        }  # fmt: skip
        self.columns: dict[str, Any] = {name: np.empty_like(values) for name, values in self.now.items()} | {
            "end_time": np.zeros(n), "status": np.full(n, "completed", object), "error": np.full(n, "", object),
        }  # fmt: skip
        self._risky, self._instants = np.zeros((n, round(RISK_WINDOW / dt)), bool), 0
        self._recent = np.zeros(n)
        """Risky instants of the window"""

    def add(
        self, time: float, bodies: list[Body], motions: list[MotionRows], rss: RssParameters
    ) -> BoolArray:
        """Measure an instant; return the mask of contacts of the ego (n,), the first of the bodies."""
        ego, *others = bodies
        now, count = self.now, len(ego.x)
        touching, risky = np.zeros(count, bool), np.zeros(count, bool)
        gap, closing, distance = np.full(count, np.inf), np.zeros(count), np.full(count, np.inf)
        for other, motion in zip(others, motions[1:], strict=True):
            view = ego.view(other)
            apart = np.hypot(view.ahead, view.aside)
            near = np.flatnonzero((np.abs(view.ahead) < _NEAR) & (np.abs(view.aside) < _NEAR))
            if near.size:
                hit = near[boxes_overlap(motions[0].at(near), motion.at(near))]
                speeds = np.hypot(
                    view.speed[hit] - view.other_speed[hit],
                    view.sideways[hit] - view.other_sideways[hit],
                )
                now["impact_speed"][hit], apart[hit], touching[hit] = speeds, 0.0, True
            distance = np.minimum(distance, apart)
            beside = lateral_violation(view, rss)
            if beside.any():
                risky |= longitudinal_violation(view, rss) & beside
            lead = (view.aside == 0.0) & (view.ahead > 0.0) & (view.ahead < gap)
            gap, closing = (
                np.where(lead, view.ahead, gap),
                np.where(lead, view.speed - view.other_speed, closing),
            )
        led = np.flatnonzero(np.isfinite(gap) & (closing > _CHANGED))
        now["min_ttc"][led] = np.minimum(now["min_ttc"][led], gap[led] / closing[led])
        now["max_drac"][led] = np.maximum(
            now["max_drac"][led], closing[led] ** 2 / (2.0 * gap[led])
        )
        place = self._instants % self._risky.shape[1]
        self._recent += risky
        self._recent -= self._risky[:, place]
        self._risky[:, place] = risky
        self._instants += 1
        now["r_risk"] += risky
        nearer = np.flatnonzero(distance < now["clearance"] - _SAME)
        now["clearance"][nearer], now["conflict"][nearer] = distance[nearer], time
        now["risk"][nearer] = self._recent[nearer] / self._risky.shape[1]
        now["collision"] |= touching
        return touching

    def take(self, left: BoolArray) -> None:
        """Keep some cases only."""
        self.now = {name: values[left] for name, values in self.now.items()}
        self._risky, self._recent = self._risky[left], self._recent[left]

    def end(self, rows: IntArray, ended: BoolArray, off: BoolArray, time: float) -> None:
        """Note what was measured of those that are over at a time.

        Args:
            rows: numbers of the cases (n,). ended: which of them are over. off: which of them are
                at the road's end.
        """
        cases = rows[ended]
        for name, values in self.now.items():
            self.columns[name][cases] = values[ended]
        self.columns["r_risk"][cases] /= self._instants
        self.columns["end_time"][cases] = time
        self.columns["status"][rows[off]] = "error"
        self.columns["error"][rows[off]] = (
            "somebody comes to the road's end, which the twin can't play"
        )


class Situation(NamedTuple):
    """Drivers' view of all cases.

    Attributes:
        ego, others: motions, a row for each case.
        speed, acceleration, target: of the ego, and what the scenario asks for (n,).
        changed: where anyone has begun to change speed or lane (n,).
    """

    ego: MotionRows
    others: Sequence[MotionRows]
    speed: FloatArray
    acceleration: FloatArray
    target: FloatArray
    changed: BoolArray

    def at(self, rows: IntArray) -> Situation:
        """The view of some cases."""
        others = [other.at(rows) for other in self.others]
        speed, acceleration, target = self.speed[rows], self.acceleration[rows], self.target[rows]
        return Situation(self.ego.at(rows), others, speed, acceleration, target, self.changed[rows])

    def observed(self, run: IntArray) -> BatchObservation:
        """Observations of a system under test in the cases, which are runs by these numbers (n,)."""
        n = len(run)
        nothing, none = np.zeros(n), np.full(n, None, object)
        line: Any = StopLine(np.full(n, "", object), np.full(n, np.inf))  # type: ignore[arg-type]
        ego = _participants([self.ego], self.acceleration).row(0)
        others = _participants(self.others, nothing)
        return BatchObservation(run, nothing, ego, others, self.target, none, none, line, none)


def _participants(motions: Sequence[MotionRows], acceleration: FloatArray) -> BatchParticipants:
    """Vehicles as a system under test sees them (p, n), with the acceleration (n,) of each."""
    shape = len(motions), len(acceleration)

    def same(values: Sequence[Any], kind: Any = float) -> Any:
        return np.broadcast_to(np.array(values, kind)[:, None], shape)

    def rows(values: list[FloatArray]) -> FloatArray:
        return np.array(values) if values else np.zeros(shape)

    zero, nothing = np.zeros(shape), same([{}] * shape[0], object)
    cos, sin = (rows([each.facing[axis] for each in motions]) for axis in (0, 1))
    speed, pulled = rows([each.speed for each in motions]), np.broadcast_to(acceleration, shape)
    box: Any = BoundingBox(*map(same, zip(*(each.box for each in motions), strict=True)))
    unlimited: Any = np.full(shape, np.inf)
    found = BatchParticipants(
        name=same([each.name for each in motions], object),
        kind=same([each.kind for each in motions], object),
        category=same([each.category for each in motions], object),
        box=box,
        **{name: rows([getattr(each, name) for each in motions]) for name in ("x", "y", "z", "h")},
        **dict.fromkeys(("pitch", "roll", "odometer", "front_axle", "max_steering", "mass"), zero),
        speed=speed,
        acceleration=pulled,
        vx=speed * cos,
        vy=speed * sin,
        ax=pulled * cos,
        ay=pulled * sin,
        performance=Performance(*[unlimited] * 5),
        lights=nothing,
        overrides=nothing,
        present=np.ones(shape, bool),
    )
    found.__dict__["facing"] = cos, sin  # need not be worked out
    return found


class DriverModel(Protocol):
    """A system under test in n cases."""

    def control(self, seen: Situation, dt: float) -> tuple[BoolArray, FloatArray]:
        """Return a mask of interventions (n,), and accelerations (n,), m/s²."""
        ...

    def take(self, rows: BoolArray) -> None:
        """Keep some cases only."""
        ...


class _Memory:
    """Memory of each case: the arrays among the attributes."""

    def take(self, rows: BoolArray) -> None:
        """Keep some cases only."""
        for name, values in vars(self).items():
            if isinstance(values, np.ndarray):
                setattr(self, name, values[rows])


class _Scripted(_Memory):
    """No system: the ego does what is scripted."""

    def control(self, seen: Situation, dt: float) -> tuple[BoolArray, FloatArray]:
        """Nowhere."""
        return np.zeros(len(seen.speed), bool), np.zeros(len(seen.speed))


class _Several:
    """Systems side by side, each in n cases: those of the first, of the second, and so on."""

    def __init__(self, parts: Sequence[DriverModel], n: int) -> None:
        self._parts, self._whose = parts, np.repeat(np.arange(len(parts)), n)

    def control(self, seen: Situation, dt: float) -> tuple[BoolArray, FloatArray]:
        """Decide as each system does in its cases."""
        intervenes, wanted = np.zeros(len(seen.speed), bool), np.zeros(len(seen.speed))
        for number, part in enumerate(self._parts):
            rows = np.flatnonzero(self._whose == number)
            if rows.size:
                intervenes[rows], wanted[rows] = part.control(seen.at(rows), dt)
        return intervenes, wanted

    def take(self, rows: BoolArray) -> None:
        """Keep some cases only."""
        for number, part in enumerate(self._parts):
            part.take(rows[self._whose == number])
        self._whose = self._whose[rows]


class _Asked(_Memory):
    """A system that decides in many runs at once; they keep their numbers."""

    def __init__(self, system: BatchSystem, n: int) -> None:
        self._system, self._run, self._all = system, np.arange(n), n
        self._begun = False

    def control(self, seen: Situation, dt: float) -> tuple[BoolArray, FloatArray]:
        """As the system decides."""
        observed = seen.observed(self._run)
        if not self._begun:
            self._system.reset(observed.ego, dt, np.arange(self._all))  # no law reads the egos
            self._begun = True
        answers = self._system.control(observed, dt)
        return answers.accelerates, answers.acceleration


class _Bound(_Memory):
    def __init__(self, system: FullBraking, n: int) -> None:
        self._system, self._begun = system, np.zeros(n, bool)

    def control(self, seen: Situation, dt: float) -> tuple[BoolArray, FloatArray]:
        """From the instant on at which anyone begins to manoeuvre, with full braking."""
        self._begun = self._begun | seen.changed
        return self._begun.copy(), np.full(len(seen.speed), -self._system.brake)


_ASKED = (CollisionAvoidance, EmergencyBraking, IntelligentDriver, ReferenceDriver)
"""Systems that decide by what is known of the cases: the acceleration of the ego alone, no lights"""


def driver(system: str | System | None, n: int) -> DriverModel:
    """A system under test in n cases.

    Raises:
        Unsupported: it can't be asked for many cases at once.
        UsageError: there is no such system.
    """
    found = load_system(system)
    if found is None:
        return _Scripted()
    if isinstance(found, FullBraking):
        return _Bound(found, n)
    asked = open_batch(found) if isinstance(found, _ASKED) else None
    if asked is None:
        raise Unsupported(
            f"the system under test {system!r} can't be asked for many points at once"
        )
    return _Asked(asked, n)
