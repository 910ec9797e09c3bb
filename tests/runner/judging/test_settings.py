"""The settings of a run: one default each, verified in one place, the same for
Python and the command line.
"""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
import typer

import runner
from runner import RunSettings
from runner.exchange import exports
from runner.exchange.xosc_export import app as export_app
from runner.xosc_run import app
from schemas.common.errors import InvalidFile, UsageError
from tests.runner.files import scenario

CONSTRAINED = """<ParameterDeclaration name="Gap" parameterType="double" value="70">
  <ConstraintGroup><ValueConstraint rule="lessThan" value="60"/></ConstraintGroup>
</ParameterDeclaration>"""


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        ({"timestep": 0.0}, "time step must be from 0.001 s to 1 s"),
        ({"timestep": float("nan")}, "time step"),
        ({"max_time": -1.0}, "time limit must be from 0 s"),
        ({"max_time": float("inf")}, "time limit"),
        ({"world": "moon"}, "the world 'moon' is not one of sumo, kinematic"),
        ({"sut": "absent"}, "no system under test is called 'absent'"),
    ],
)
def test_a_wrong_setting_is_refused_where_it_is_made(
    wrong: dict[str, Any], complaint: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=complaint):
        RunSettings(**wrong)
    with pytest.raises(UsageError, match=complaint):
        runner.run(scenario(tmp_path), **wrong)


def test_changes_replace_settings(tmp_path: Path) -> None:
    quick = RunSettings(world="kinematic", timestep=0.1, max_time=0.5, sut="none")
    result = runner.run(scenario(tmp_path), quick, seed=3)
    assert result.settings == {"timestep": 0.1, "seed": 3, "world": "kinematic", "max_time": 0.5}
    assert (result.sut, result.end_time) == ("none", 0.5)
    with pytest.raises(UsageError, match="time_step"):
        runner.run(scenario(tmp_path), quick, time_step=0.1)  # type: ignore[call-arg]


def test_constraints_hold_in_python_too(tmp_path: Path) -> None:
    path = scenario(tmp_path, parameters={"Ego_Speed": 20.0, "Lead_Speed": 10.0})
    path.write_text(
        path.read_text().replace(
            "<ParameterDeclarations>", f"<ParameterDeclarations>{CONSTRAINED}", 1
        )
    )
    quick = RunSettings(world="kinematic", max_time=0.1, sut="none")
    with pytest.raises(InvalidFile, match="Gap = 70"):
        runner.run(path, quick)
    assert any(
        entry.kind == "constraint"
        for entry in runner.run(path, quick, enforce_constraints=False).events
    )


@pytest.mark.parametrize("command", [app, export_app])
def test_a_command_has_an_option_for_each_setting_with_its_default(command: typer.Typer) -> None:
    options = {each.name: each for each in typer.main.get_command(command).params}
    told = {each.name for each in fields(RunSettings)} - {
        "end_after_collision",
        "fail_if",
        "least",
        "road_path",
        "catalog_path",
    }
    assert {name: options[name].default for name in told} == {
        name: getattr(RunSettings, name) for name in told
    }
    assert options["end_after_collision"].default is None, "it depends on the system under test"
    assert ("fail_if" in options) == (command is app), "exports have no verdicts"


def test_public_names_are_listed_before_they_are_used() -> None:
    assert {"run", "RunSettings", "RunResult"} <= set(dir(runner))
    with pytest.raises(AttributeError, match="sprint"):
        runner.sprint
    assert exports.TARGETS
