"""What is not looked at because nobody can have come near: the same answers as
when everything is looked at in each step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import xodr
from runner.engine.compile.element import ByEntityCondition, EntityCondition
from runner.engine.conditions.comparison import RULES, Comparison
from runner.engine.conditions.distance import (
    DistanceMeasure,
    DistanceTarget,
    ReachPositionCondition,
    RelativeDistanceCondition,
)
from runner.engine.motion.on_roads import Roads
from runner.engine.motion.placement import Placement
from runner.engine.motion.spacing import longitudinal
from runner.engine.participants.boxes import gap, plane_gap
from runner.engine.participants.entity import Displacement, Entities, Entity, Separation
from tests.runner.movement import Move, move, moves
from tests.runner.scene import vehicle

Steps = list[tuple[Move, ...]]


def three() -> list[Entity]:
    return [vehicle(name, x=x, placed=True) for name, x in (("a", 0.0), ("b", 12.0), ("c", 60.0))]


@given(moves(3))
def test_two_come_nearer_by_twice_the_displacement_at_most(steps: Steps) -> None:
    members = three()
    run: Any = SimpleNamespace(
        entities=Entities({each.name: each for each in members}), step_index=0
    )
    bound = Displacement(run)
    first = bound.total
    begin = [(a, b, math.dist((a.x, a.y), (b.x, b.y))) for a in members for b in members]
    for step in steps:
        for member, by in zip(members, step, strict=True):
            move(member, by)
        before = bound.total
        run.step_index += 1
        assert bound.total >= before
        for a, b, distance in begin:
            if a.active and b.active:
                assert (
                    distance - math.dist((a.x, a.y), (b.x, b.y))
                    <= 2.0 * (bound.total - first) + 1e-9
                )


@given(moves(3), st.floats(0.0, 30.0))
def test_a_separation_exceeds_what_the_gap_exceeds(steps: Steps, distance: float) -> None:
    a, b, _ = three()
    separation = Separation(a, b)
    for step in steps:
        for member, by in zip((a, b), step, strict=False):
            move(member, by)
        if abs(plane_gap(a, b) - distance) > 1e-9:
            assert separation.exceeds(distance) == (plane_gap(a, b) > distance)


def compare(
    steps: Steps,
    condition: EntityCondition,
    members: Sequence[Entity],
    every: bool,
    plain: Any,
    roads: Any = None,
) -> None:
    """Evaluate over all steps for the first two of them, against the plain way."""
    more = [vehicle(name, x=500.0, placed=True) for name in "defg"]  # a few are never left alone
    everyone = Entities({each.name: each for each in (*members, *more)})
    sim: Any = SimpleNamespace(entities=everyone, step_index=0, roads=roads)
    sim.displacement = Displacement(sim)
    entities = list(members[:2])
    watched, asleep = ByEntityCondition(entities, every, condition), -math.inf
    for step in steps:
        for member, by in zip(members, step, strict=True):
            move(member, by)
        sim.step_index += 1
        held = [entity for entity in entities if entity.active and plain(entity)]
        value = len(held) == 2 if every else bool(held)
        if sim.displacement.total < asleep:
            assert not value
            continue
        assert watched.evaluate(sim) == value
        assert list(watched.triggering) == held
        until = watched.dormant_until(sim)
        asleep = until.way if until.time == math.inf and not until.undisturbed else -math.inf


@pytest.mark.slow
@pytest.mark.parametrize("rule", RULES)
@given(moves(3), st.floats(0.0, 50.0), st.booleans(), st.booleans())
def test_a_distance_condition_sleeps_through_nothing(
    rule: str, steps: Steps, value: float, freespace: bool, every: bool
) -> None:
    members = three()
    other, comparison = members[2], Comparison(rule, value, "m")
    condition = RelativeDistanceCondition(
        DistanceTarget(other, None),
        DistanceMeasure("euclidean", "entity", freespace, "undefined"),
        comparison,
    )

    def plain(entity: Entity) -> bool:
        distance = (
            gap(entity, other) if freespace else math.dist((entity.x, entity.y), (other.x, other.y))
        )
        return other.active and comparison.holds(distance)

    compare(steps, condition, members, every, plain)


STRAIGHT = Path(__file__).parents[2] / "conformance" / "roads" / "straight.xodr"


@pytest.mark.slow
@pytest.mark.parametrize("rule", ["lessThan", "greaterThan"])
@given(moves(3), st.floats(0.0, 50.0), st.booleans())
def test_a_distance_along_a_straight_road_sleeps_through_nothing(
    rule: str, steps: Steps, value: float, freespace: bool
) -> None:
    members, roads = three(), Roads(xodr.load(STRAIGHT))
    assert roads.plain
    other, comparison, measure = (
        members[2],
        Comparison(rule, value, "m"),
        DistanceMeasure("longitudinal", "road", freespace, "undefined"),
    )
    condition = RelativeDistanceCondition(DistanceTarget(other, None), measure, comparison)

    def plain(entity: Entity) -> bool:
        distance = longitudinal(Roads(roads.network), entity, other, "road", freespace)
        return other.active and comparison.holds(None if distance is None else abs(distance))

    compare(steps, condition, members, False, plain, roads)


@pytest.mark.parametrize("road", ["curve", "opposed", "crossing"])
def test_distances_along_other_roads_are_measured_in_each_step(road: str) -> None:
    assert not Roads(xodr.load(STRAIGHT.with_name(f"{road}.xodr"))).plain


@given(moves(3), st.floats(0.0, 50.0), st.booleans())
def test_reaching_a_position_is_slept_through_by_nobody(
    steps: Steps, tolerance: float, every: bool
) -> None:
    members = three()
    position: Any = SimpleNamespace(fixed=Placement(30.0, 0.0, 0.0, 0.0))

    def plain(entity: Entity) -> bool:
        return math.hypot(30.0 - entity.x, entity.y) < tolerance + 1e-6

    compare(
        steps,
        ReachPositionCondition(DistanceTarget(None, position), tolerance),
        members,
        every,
        plain,
    )
