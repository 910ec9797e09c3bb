"""EnvironmentAction, actions on parameters, variables and monitors, and user-defined actions."""

from __future__ import annotations

import functools
from itertools import pairwise
from pathlib import Path

import pytest

from schemas.common.errors import InvalidFile
from tests.conformance.support import SCENARIOS, events
from tests.conformance.support import run as run_scenario

run = functools.partial(run_scenario, world="kinematic")


def edited(tmp_path: Path, element: str, old: str, new: str) -> Path:
    """The scenario of an element with one text replaced."""
    text = (SCENARIOS / f"{element}.xosc").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / f"{element}.xosc"
    path.write_text(
        text.replace(old, new).replace("../roads/", f"{SCENARIOS.parent}/roads/"), encoding="utf-8"
    )
    return path


def test_the_time_of_day_runs_on_from_what_the_environment_sets() -> None:
    result = run("EnvironmentAction")
    assert events(result, "environment")[0].text == "friction 0.5"
    assert events(result, "startTransition", "Seven")[0].time == pytest.approx(3.0, abs=0.011)


def test_a_time_of_day_without_animation_stands_still(tmp_path: Path) -> None:
    path = edited(tmp_path, "EnvironmentAction", 'animation="true"', 'animation="false"')
    assert not events(run(str(path.with_suffix(""))), "startTransition", "Seven")


def test_friction_limits_what_a_system_under_test_can_brake() -> None:
    result = run("EnvironmentAction", sut="tests.conformance.test_environment_and_values:FullBrake")
    speeds = [row["speed"] for row in result.trajectories.to_pylist()]
    hardest = max((before - after) / 0.01 for before, after in pairwise(speeds[120:]))
    assert hardest == pytest.approx(0.5 * 9.81, rel=1e-6)


class FullBrake:
    """Brakes harder than any road allows."""

    def reset(self, ego: object, timestep: float, seed: int) -> None:
        """Nothing to prepare."""

    def control(self, observation: object, dt: float) -> object:
        """Full braking."""
        from runner.systems import Control

        return Control(acceleration=-50.0, reason="test")


@pytest.mark.parametrize(
    "bad", ['frictionScaleFactor="-1"', 'frictionScaleFactor="NaN"', 'frictionScaleFactor="INF"']
)
def test_an_impossible_friction_is_refused_with_its_line(tmp_path: Path, bad: str) -> None:
    path = edited(tmp_path, "EnvironmentAction", 'frictionScaleFactor="0.5"', bad)
    with pytest.raises(InvalidFile, match="RoadCondition") as refused:
        run(str(path.with_suffix("")))
    assert refused.value.line is not None


@pytest.mark.parametrize("element", ["ParameterSetAction", "VariableSetAction"])
def test_a_value_that_is_set_is_seen_by_conditions(element: str) -> None:
    assert events(run(element), "startTransition", "Seen")[0].time == pytest.approx(1.0, abs=0.011)


@pytest.mark.parametrize("element", ["ParameterModifyAction", "VariableModifyAction"])
def test_values_are_added_to_and_multiplied(element: str) -> None:
    result = run(element)
    kind = element.removesuffix("ModifyAction").lower()
    assert [e.text for e in events(result, kind)] in (
        ["set to 5.0", "set to 10.0"],
        ["set to 5", "set to 10"],
    )
    assert events(result, "startTransition", "Seen")[0].time == pytest.approx(2.0, abs=0.011)


@pytest.mark.parametrize(
    ("element", "old", "new", "message"),
    [
        (
            "VariableSetAction",
            'variableRef="Watched">',
            'variableRef="Other">',
            "not a variable that the scenario declares",
        ),
        ("VariableSetAction", 'SetAction value="7"', 'SetAction value="many"', "not a number"),
        (
            "ParameterModifyAction",
            'parameterType="double"',
            'parameterType="string"',
            "only numbers can be modified",
        ),
        ("SetMonitorAction", 'monitorRef="Kept"', 'monitorRef="Lost"', "not a monitor"),
    ],
)
def test_references_and_types_are_checked_before_the_run(
    tmp_path: Path, element: str, old: str, new: str, message: str
) -> None:
    path = edited(tmp_path, element, old, new)
    with pytest.raises(InvalidFile, match=message):
        run(str(path.with_suffix("")))


@pytest.mark.parametrize("operand", ["1e10", "-1"])
def test_a_number_that_leaves_its_type_ends_the_run_with_a_clear_line(
    tmp_path: Path, operand: str
) -> None:
    path = edited(
        tmp_path,
        "VariableModifyAction",
        'MultiplyByValue value="2"',
        f'MultiplyByValue value="{operand}"',
    )
    path.write_text(
        path.read_text().replace('variableType="int"', 'variableType="unsignedInt"'),
        encoding="utf-8",
    )
    with pytest.raises(InvalidFile, match="variable Watched would become"):
        run(str(path.with_suffix("")))


def test_a_monitor_is_set_and_written_down() -> None:
    entry = events(run("SetMonitorAction"), "monitor")[0]
    assert (entry.time, entry.subject, entry.text) == (2.0, "Kept", "set to true")


def test_a_custom_command_reaches_the_event_log_with_its_content() -> None:
    entry = events(run("CustomCommandAction"), "userDefined")[0]
    assert (entry.time, entry.subject, entry.text) == (2.0, "mark", "reached")
