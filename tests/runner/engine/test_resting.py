"""Conditions and entities that are left alone while they can't change: the same
as when all are looked at in each step.
"""

from __future__ import annotations

import math
import re
from itertools import accumulate
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import runner
from runner.engine.compile import registry
from runner.engine.compile.element import AWAKE, UNDISTURBED, ByEntityCondition, Condition, Dormancy
from runner.engine.conditions.by_entity import StandStillCondition
from runner.engine.conditions.by_value import SimulationTimeCondition
from runner.engine.conditions.comparison import RULES, Comparison
from runner.engine.motion.on_roads import Roads
from runner.engine.storyboard.simulation import Simulation
from runner.engine.storyboard.triggers import EDGES, TimedCondition, Trigger, Watch
from tests.runner.scene import vehicle

STEP = 0.1
STEPS = 400
SCENARIOS = Path(__file__).parents[2] / "conformance" / "scenarios"


class Changing(Condition):
    """Another value from certain steps on; it knows of some changes when they come, others are
    announced as they happen.

    Args:
        first: the value at the beginning.
        at: steps at which it changes.
        foresight: whether it knows the steps.
    """

    def __init__(self, first: bool, at: frozenset[int], foresight: bool) -> None:
        self.first, self.at, self.foresight = first, at, foresight

    def evaluate(self, run: Any) -> bool:
        return self.first ^ (sum(step <= run.step_index for step in self.at) % 2 == 1)

    def dormant_until(self, run: Any) -> Dormancy:
        if not self.foresight:
            return UNDISTURBED
        return Dormancy(
            min((step * STEP - 1e-6 for step in self.at if step > run.step_index), default=math.inf)
        )

    def describe(self, run: Any) -> str:
        return f"{self.evaluate(run)} at {run.step_index}"


class Restless(Changing):
    """The same, looked at in each step."""

    def dormant_until(self, run: Any) -> Dormancy:
        return AWAKE


changing = st.builds(
    lambda kind, first, at, foresight, edge, delay: (
        kind,
        (first, at, foresight),
        edge,
        delay * STEP,
    ),
    st.sampled_from([Changing, Changing, Restless]),
    st.booleans(),
    st.frozensets(st.integers(1, STEPS), max_size=4),
    st.booleans(),
    st.sampled_from(EDGES),
    st.sampled_from([0, 0, 1, 7, 40]),
)
groups = st.lists(st.lists(changing, min_size=1, max_size=3), min_size=1, max_size=3)


def trigger_of(chosen: Any, plain: bool) -> Trigger:
    def timed(kind: Any, values: Any, edge: str, delay: float) -> TimedCondition:
        return TimedCondition("c", (Restless if plain else kind)(*values), edge, delay)

    return Trigger([[timed(*each) for each in group] for group in chosen])


class Foreseen(Changing):
    """One that knows up to when it is false, as a time or as a total
    displacement, which is 2 m a step.
    """

    def _next(self, run: Any) -> float:
        return min((step for step in self.at if step > run.step_index), default=math.inf)

    def dormant_until(self, run: Any) -> Dormancy:
        if self.evaluate(run):
            return AWAKE
        if self.foresight:
            return Dormancy(way=self._next(run) * 2.0 - 1e-6)
        return Dormancy(self._next(run) * STEP - 1e-6)


@pytest.mark.slow
@given(st.lists(groups, min_size=1, max_size=4), st.frozensets(st.integers(1, STEPS), max_size=2))
def test_watched_triggers_fire_when_they_would_if_all_were_looked_at(
    chosen: Any, rearmed: frozenset[int]
) -> None:
    announced = {
        step
        for each in chosen
        for group in each
        for kind, (_, at, ahead), _, _ in group
        if not ahead
        for step in at
    }
    foreseen = [
        [
            [(Foreseen if kind is Restless else kind, *rest) for kind, *rest in group]
            for group in each
        ]
        for each in chosen
    ]
    changes = list(accumulate(step in announced for step in range(STEPS + 1)))
    watch: Watch[Any] = Watch()
    watched = [SimpleNamespace(waits=True, trigger=trigger_of(each, False)) for each in foreseen]
    plain = [trigger_of(each, True) for each in chosen]
    for place, element in enumerate(watched):
        watch.add(place, element, element.trigger)
    for step in range(STEPS + 1):
        run: Any = SimpleNamespace(
            time=step * STEP,
            dt=STEP,
            step_index=step,
            changes=changes[step],
            displacement=SimpleNamespace(
                total=2.0 * step, reaches=lambda way, steps, step=step: way <= 2.0 * (step + steps)
            ),
        )
        for place, (element, trigger) in enumerate(zip(watched, plain, strict=True)):
            if step in rearmed:
                element.trigger.rearm()
                trigger.rearm()
                watch.add(place, element, element.trigger)
        assert [each.trigger for each in watch.due(run)] == [
            element.trigger
            for element, trigger in zip(watched, plain, strict=True)
            if trigger.fires(run)
        ]


def test_what_stays_false_is_not_looked_at() -> None:
    asked = []

    class Asked(Changing):
        def evaluate(self, run: Any) -> bool:
            asked.append(run.step_index)
            return super().evaluate(run)

    trigger = Trigger([[TimedCondition("", Asked(False, frozenset({300}), True), "rising", 0.0)]])
    watch: Watch[Any] = Watch()
    watch.add(0, SimpleNamespace(waits=True), trigger)
    runs: list[Any] = [
        SimpleNamespace(time=step * STEP, dt=STEP, step_index=step, changes=0)
        for step in range(STEPS)
    ]
    assert [run.step_index for run in runs if watch.due(run)] == [300]
    assert len(asked) < STEPS // 2


@given(st.sampled_from(sorted(RULES)), st.floats(0.0, 5.0), st.integers(1, 100))
def test_a_comparison_of_the_time_keeps_its_value_for_as_long_as_it_says(
    rule: str, value: float, begin: int
) -> None:
    condition = SimulationTimeCondition(Comparison(rule, value))

    def at(step: int) -> Any:
        return SimpleNamespace(time=round(step * 0.05, 9))

    until, before = condition.dormant_until(at(begin)).time, condition.evaluate(at(begin))
    assert all(
        condition.evaluate(at(step)) == before
        for step in range(begin, 200)
        if at(step).time < until
    )


@given(st.floats(0.0, 3.0), st.lists(st.booleans(), min_size=2, max_size=150), st.integers(0, 149))
def test_a_standstill_keeps_its_value_until_somebody_has_stood_as_long(
    duration: float, stands: list[bool], begin: int
) -> None:
    car = vehicle("a")
    condition = ByEntityCondition([car], False, StandStillCondition(duration))
    until, before = -math.inf, False
    for step, still in enumerate(stands):
        car.standstill = car.standstill + 0.05 if still else 0.0
        run: Any = SimpleNamespace(time=round(step * 0.05, 9), dt=0.05, step_index=step)
        if step == begin:
            until, before = condition.dormant_until(run).time, condition.evaluate(run)
        assert step < begin or run.time >= until or condition.evaluate(run) == before


def registered() -> list[str]:
    """Every action and condition that is registered, by the name of its conformance scenario."""
    registry.action.load()
    registry.condition.load()
    names = [*registry.action.classes, *registry.condition.classes]
    return sorted(re.sub(r"^(\w+)Action/(\w+)$", r"\1\2", name) for name in names)


def bytes_of(result: runner.RunResult) -> list[Any]:
    """The event log, and each column of the trajectories as bytes (zeros and
    negative ones are told apart).
    """
    table = result.recording.table()
    columns = [column.to_numpy() for column in table.columns]
    return [
        result.events,
        *(column.tolist() if column.dtype == object else column.tobytes() for column in columns),
    ]


@pytest.mark.parametrize("name", registered())
def test_runs_are_the_same_as_when_nothing_is_left_alone(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def played() -> list[Any]:
        return bytes_of(runner.run(SCENARIOS / f"{name}.xosc", sut="none", max_time=20.0))

    resting = played()
    monkeypatch.setattr(Watch, "_sleeps", lambda *_: False)
    monkeypatch.setattr(
        Simulation,
        "_stay",
        lambda self, entity: self._move(entity, entity.controls.target_speed, self.dt),
    )
    monkeypatch.setattr(Roads, "clearance", lambda *_: 0.0)
    assert resting == played()
