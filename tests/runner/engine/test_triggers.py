"""Triggers: edges, delays, groups, and the entities that trigger, with
conditions that play a script.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from runner.engine.compile.element import ByEntityCondition, Condition, EntityCondition
from runner.engine.participants.entity import Entity
from runner.engine.storyboard.triggers import TimedCondition, Trigger
from schemas.common.errors import InvalidFile
from tests.runner.scene import vehicle
from xosc.document.node import Node

STEP = 0.1


class Script(Condition):
    """True at the evaluations where the script says so; counts them."""

    def __init__(self, script: str) -> None:
        self.values = [letter == "1" for letter in script]
        self.asked = 0

    def evaluate(self, sim: Any) -> bool:
        self.asked += 1
        return self.values[round(sim.time / STEP)]

    def describe(self, sim: Any) -> str:
        return f"script at {sim.time:g} s"


def timed(script: str, edge: str = "none", delay: float = 0.0) -> TimedCondition:
    return TimedCondition("c", Script(script), edge, delay)


def play(trigger: Trigger, steps: int) -> str:
    """Outcome of the trigger at each step, as a script."""
    return "".join("1" if trigger.fires(at(step)) else "0" for step in range(steps))


def at(step: int) -> Any:
    return SimpleNamespace(time=step * STEP, step_index=step, changes=0, dt=STEP)


@pytest.mark.parametrize(
    ("edge", "outcome"),
    [
        ("none", "0110011"),
        ("rising", "0100010"),
        ("falling", "0001000"),
        ("risingOrFalling", "0101010"),
    ],
)
def test_edges(edge: str, outcome: str) -> None:
    assert play(Trigger([[timed("0110011", edge)]]), 7) == outcome


@pytest.mark.parametrize("edge", ["rising", "falling", "risingOrFalling"])
@pytest.mark.parametrize("script", ["1111", "0000"])
def test_the_first_evaluation_is_no_edge(edge: str, script: str) -> None:
    assert play(Trigger([[timed(script, edge)]]), 4) == "0000"


def test_a_delay_looks_back_and_sees_nothing_before_the_beginning() -> None:
    assert play(Trigger([[timed("1100111111", delay=0.3)]]), 10) == "0001100111"


def test_an_edge_is_seen_after_its_delay_for_one_step() -> None:
    assert play(Trigger([[timed("0011100000", "rising", 0.2)]]), 10) == "0000100000"


def test_a_delay_between_steps_is_served_at_the_next_one() -> None:
    assert play(Trigger([[timed("0011111111", delay=0.25)]]), 10) == "0000011111"


@given(
    st.lists(st.booleans(), min_size=1, max_size=30),
    st.sampled_from(["none", "rising", "falling", "risingOrFalling"]),
    st.integers(0, 6),
)
def test_edges_and_delays_are_those_of_the_definition(
    values: list[bool], edge: str, steps: int
) -> None:
    """Condition(t) = edge(expression)(t − delay), false before the first evaluation."""

    def edged(k: int) -> bool:
        if k < 0:
            return False
        if edge == "none":
            return values[k]
        rising = k > 0 and values[k] and not values[k - 1]
        falling = k > 0 and not values[k] and values[k - 1]
        return {"rising": rising, "falling": falling, "risingOrFalling": rising or falling}[edge]

    script = "".join("01"[value] for value in values)
    trigger = Trigger([[TimedCondition("c", Script(script), edge, steps * STEP)]])
    assert play(trigger, len(values)) == "".join("01"[edged(k - steps)] for k in range(len(values)))


def test_conditions_of_a_group_must_all_be_true_and_one_group_suffices() -> None:
    assert play(Trigger([[timed("0011"), timed("0101")]]), 4) == "0001"
    assert play(Trigger([[timed("0011")], [timed("0101")]]), 4) == "0111"


def test_an_edge_is_not_lost_while_another_condition_is_false() -> None:
    """The second condition is evaluated although the first is false: what comes
    at step 3 is no edge any more.
    """
    assert play(Trigger([[timed("0001"), timed("0111", "rising")]]), 4) == "0000"
    assert play(Trigger([[timed("0011"), timed("0001", "rising")]]), 4) == "0001"


def test_conditions_without_memory_are_evaluated_only_where_they_matter() -> None:
    idle, waiting = timed("0000"), timed("1111")
    play(Trigger([[idle, waiting]]), 4)
    assert (idle.condition.asked, waiting.condition.asked) == (4, 0)  # type: ignore[attr-defined]


def test_reset_forgets_edges_and_delays() -> None:
    trigger = Trigger([[timed("0111", "rising", 0.1)]])
    assert play(trigger, 2) == "00"
    trigger.reset()
    assert not trigger.fires(at(2))
    assert not trigger.fires(at(3))


class Holds(EntityCondition):
    """True for entities of these names."""

    def __init__(self, *names: str) -> None:
        self.names = names

    def holds(self, entity: Entity, sim: Any) -> bool:
        return entity.name in self.names

    def describe(self, entity: Entity, sim: Any) -> str:
        return f"{entity.name} it is"


def cars(*names: str) -> list[Entity]:
    return [vehicle(name) for name in names]


def by_entity(entities: Sequence[Entity], every: bool, *names: str) -> TimedCondition:
    return TimedCondition("", ByEntityCondition(list(entities), every, Holds(*names)), "none", 0.0)


def test_any_and_all_triggering_entities() -> None:
    members = cars("a", "b")
    assert Trigger([[by_entity(members, False, "b")]]).fires(at(0))
    assert not Trigger([[by_entity(members, True, "b")]]).fires(at(0))
    assert Trigger([[by_entity(members, True, "a", "b")]]).fires(at(0))
    assert not Trigger([[by_entity(members, False)]]).fires(at(0))


def test_entities_that_are_absent_do_not_trigger() -> None:
    members = cars("a", "b")
    members[1].active = False
    assert not Trigger([[by_entity(members, False, "b")]]).fires(at(0))
    assert not Trigger([[by_entity(members, True, "a", "b")]]).fires(at(0))


def test_those_who_triggered_are_kept_for_selecting_actors_and_named_in_the_reason() -> None:
    members = cars("a", "b", "c")
    trigger = Trigger(
        [
            [by_entity(members, False, "c"), timed("0")],
            [by_entity(members, False, "b", "a"), timed("1")],
        ]
    )
    assert trigger.fires(at(0))
    assert [entity.name for entity in trigger.triggering] == ["a", "b"]
    assert trigger.reason == "a it is; b it is and c: script at 0 s"


def test_the_reason_names_edge_and_delay() -> None:
    trigger = Trigger([[timed("011", "rising", 0.1)]])
    play(trigger, 3)
    assert trigger.reason == "c: script at 0.2 s (rising), 0.1 s ago"


# from XML -----------------------------------------------------------------------------------


class Scripts:
    """A context whose conditions are all scripts."""

    def timed_condition(self, node: Node) -> TimedCondition:
        return TimedCondition.from_xml(node, Script("1"))

    def repair(self, node: Node, rule: str, text: str, cause: str = "") -> None:
        assert (node.tag, cause) == ("ConditionGroup", "empty")


def read(xml: str) -> Trigger | None:
    return Trigger.from_xml(Node(etree.fromstring(xml), Path("test.xosc")), Scripts())


@pytest.mark.parametrize(
    "xml", ["<StartTrigger/>", "<StartTrigger><ConditionGroup/></StartTrigger>"]
)
def test_an_empty_trigger_is_none_at_all(xml: str) -> None:
    assert read(xml) is None
    assert Trigger.from_xml(None, Scripts()) is None  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "attributes", ['delay="-1"', 'delay="INF"', 'delay="soon"', 'delay="0" conditionEdge="sharp"']
)
def test_wrong_delays_and_edges_are_refused_with_the_line(attributes: str) -> None:
    with pytest.raises(InvalidFile) as refused:
        read(
            '<StartTrigger>\n<ConditionGroup>\n<Condition name="c" '
            f"{attributes}/>\n</ConditionGroup>\n</StartTrigger>"
        )
    assert refused.value.line == 3
