"""Conditions by value: time, parameters, variables, storyboard elements, traffic signals."""

from __future__ import annotations

import functools
from typing import Any

import pytest

import xodr
import xosc
from runner.engine.compile.compiler import compile_scenario
from runner.engine.storyboard.simulation import Simulation
from runner.engine.worlds.base import KinematicWorld
from schemas.common.errors import InvalidFile
from tests.conformance.support import SCENARIOS, events
from tests.conformance.support import run as run_scenario

ROAD = SCENARIOS.parent / "roads" / "straight.xodr"
run = functools.partial(run_scenario, world="kinematic")


def when(element: str, event: str = "Fired", **parameters: Any) -> float | None:
    """When an event of an element's scenario starts with these parameters, None if never."""
    found = events(run(element, parameters=parameters), "startTransition", event)
    return found[0].time if found else None


@pytest.mark.parametrize(
    ("rule", "time"),
    [
        ("greaterThan", 2.01),
        ("greaterOrEqual", 2.0),
        ("equalTo", 2.0),
        ("lessThan", 0.0),
        ("notEqualTo", 0.0),
        ("lessOrEqual", 0.0),
    ],
)
def test_simulation_time_by_every_rule(rule: str, time: float) -> None:
    assert when("SimulationTimeCondition", Rule=rule) == pytest.approx(time)


def test_a_parameter_is_seen_as_soon_as_it_is_set() -> None:
    assert when("ParameterCondition") == pytest.approx(1.0, abs=0.011)
    assert when("ParameterCondition", Value=1) == 0.0
    assert when("ParameterCondition", Rule="greaterThan", Value=2) == pytest.approx(1.0, abs=0.011)


def test_a_value_that_is_not_of_the_parameter_s_type_is_refused() -> None:
    with pytest.raises(InvalidFile, match="ParameterCondition"):
        run("ParameterCondition", parameters={"Value": "many"})


def test_variables_are_compared_by_their_type() -> None:
    assert when("VariableCondition", "Text") == pytest.approx(1.0, abs=0.011)
    assert when("VariableCondition", "Number") == pytest.approx(1.0, abs=0.011)
    assert when("VariableCondition", "Number", Value=5) is None


@pytest.mark.parametrize(
    ("value", "rule", "expected", "true"),
    [
        (None, "notEqualTo", "10", False),
        ("11", "greaterThan", "10", True),
        ("9", "greaterThan", "10", False),
        ("10.0", "equalTo", "10", True),
        ("go", "equalTo", "go", True),
        ("go", "notEqualTo", "stop", True),
        ("go", "greaterThan", "10", False),
    ],
)
def test_user_defined_values_are_compared_as_numbers_where_they_are(
    value: str | None, rule: str, expected: str, true: bool
) -> None:
    document = xosc.resolve(
        xosc.load(SCENARIOS / "UserDefinedValueCondition.xosc"), {"Rule": rule, "Value": expected}
    )
    sim = Simulation(compile_scenario(document, xodr.load(ROAD)), KinematicWorld(), 0.1, 0)
    if value is not None:
        sim.user_values["signal"] = value
    trigger = sim.storyboard.acts[0].events[0].trigger
    assert trigger is not None
    assert trigger.fires(sim) is true


@pytest.mark.parametrize(("animation", "time"), [("true", 2.01), ("false", None)])
def test_time_of_day_moves_with_the_simulation_where_it_is_animated(
    animation: str, time: float | None
) -> None:
    assert when("TimeOfDayCondition", Animation=animation) == (time and pytest.approx(time))


def test_time_of_day_knows_time_zones() -> None:
    assert when("TimeOfDayCondition", Moment="2026-06-01T14:00:02+02:00") == pytest.approx(2.01)


def test_states_and_transitions_of_an_event() -> None:
    """The event brakes from 2 s to 7 s; others see what it did in the next step."""
    result = run("StoryboardElementStateCondition")
    started = {e.subject.split("::")[-1]: e.time for e in events(result, "startTransition")}
    assert started["StandbyState"] == 0.0
    assert started["RunningState"] == started["StartTransition"] == pytest.approx(2.01)
    assert started["CompleteState"] == started["EndTransition"] == pytest.approx(7.0, abs=0.011)
    assert not {"StopTransition", "SkipTransition"} & started.keys()


def test_an_event_can_start_in_the_step_of_its_act() -> None:
    assert when("StoryboardElementStateCondition", "ActStarted") == 0.0


@pytest.mark.parametrize(
    ("kind", "element"),
    [
        ("event", "Brake"),
        ("event", "Maneuver::Brake"),
        ("action", "Story::Act::Group::Maneuver::Brake::BrakeAction"),
    ],
)
def test_elements_are_named_by_name_or_path(kind: str, element: str) -> None:
    assert when(
        "StoryboardElementStateCondition", "StartTransition", Kind=kind, Element=element
    ) == pytest.approx(2.01)


@pytest.mark.parametrize(
    ("kind", "element"), [("event", "Nobody"), ("act", "Brake"), ("event", "Act::Brake")]
)
def test_elements_that_are_not_there_are_refused_at_the_line_of_the_condition(
    kind: str, element: str
) -> None:
    with pytest.raises(
        InvalidFile, match=r"StoryboardElementStateCondition\.xosc:\d+.*storyboardElementRef"
    ) as refused:
        run("StoryboardElementStateCondition", parameters={"Kind": kind, "Element": element})
    assert refused.value.line is not None


def test_a_signal_follows_the_phases_of_its_controller() -> None:
    """Main: 3 s green, 2 s red, and again."""
    assert when("TrafficSignalCondition", State="red") == pytest.approx(3.0)
    assert when("TrafficSignalCondition", State="green", Edge="none") == 0.0
    assert when("TrafficSignalCondition", State="green", Edge="rising") == pytest.approx(5.0)


def test_a_controller_with_a_delay_begins_later_as_if_it_had_always_run() -> None:
    """Side begins its green 1 s after Main; at 0 s it is in the last second of its red."""
    assert when("TrafficSignalControllerCondition", Phase="stop", Edge="none") == 0.0
    assert when("TrafficSignalControllerCondition", Phase="go") == pytest.approx(1.0)
    assert when("TrafficSignalControllerCondition", Phase="stop") == pytest.approx(4.0)
    assert when("TrafficSignalCondition", Signal="2", State="green") == pytest.approx(
        1.0
    )  # by its signal group


@pytest.mark.parametrize(("name", "value"), [("Controller", "Nobody"), ("Phase", "caution")])
def test_controllers_and_phases_that_are_not_declared_are_refused(name: str, value: str) -> None:
    with pytest.raises(InvalidFile, match=value):
        run("TrafficSignalControllerCondition", parameters={name: value})


def test_a_signal_that_the_road_network_does_not_have_is_refused() -> None:
    with pytest.raises(InvalidFile, match="not a signal of the road network"):
        run("TrafficSignalCondition", parameters={"Signal": "99"})
