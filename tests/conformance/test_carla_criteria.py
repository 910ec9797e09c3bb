"""Criteria in stop triggers, as CARLA's scenario_runner reads them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from lxml import etree

import runner
from runner.batch.batch import execute
from runner.batch.jobs import Job
from runner.batch.outputs.folder import load_run
from runner.batch.outputs.report import write_junit
from runner.judging.settings import RunSettings
from schemas.common.errors import InvalidFile
from tests.conformance.support import changed

SCENARIO = Path(__file__).parent / "carla" / "criteria.xosc"


def run(scenario: Path = SCENARIO, **parameters: Any) -> runner.RunResult:
    """Run the scenario with these parameters."""
    return runner.run(
        scenario, sut=None, timestep=0.05, max_time=20.0, world="kinematic", parameters=parameters
    )


def remarks(result: runner.RunResult) -> tuple[str, ...]:
    """All remarks but the first, which says that the scenario is written for CARLA."""
    assert "criteria.xosc:3" in result.remarks[0] or "changed.xosc:3" in result.remarks[0]
    return result.remarks[1:]


def results(result: runner.RunResult) -> dict[str, str]:
    """The state of each criterion."""
    return {each.name: each.state for each in result.verdict.criteria}


def test_criteria_are_judged_when_the_run_is_over() -> None:
    result = run()
    assert result.verdict.passed and not result.verdict.reasons and not remarks(result)
    collision, distance = result.verdict.criteria
    found = (collision.name, collision.entity, collision.passed, collision.reason)
    assert found == ("CollisionTest", "hero", True, "no collision")
    assert distance.value == pytest.approx(10.0 * result.end_time) and distance.unit == "m"


def test_a_failed_criterion_fails_the_run_with_its_reason() -> None:
    result = run(Value="500")
    assert not result.verdict.passed
    assert result.verdict.reasons == (
        f"DrivenDistanceTest of hero: drove {10 * result.end_time:.1f} m, not more than 500 m",
    )


def test_a_collision_is_a_failure_of_the_run_and_of_its_criterion() -> None:
    result = run(Other="150")
    assert results(result) == {"CollisionTest": "failed", "DrivenDistanceTest": "passed"}
    assert (
        result.verdict.reasons[0].startswith("collision with adversary")
        and "CollisionTest of hero: hit" in result.verdict.reasons[1]
    )


def test_criteria_are_no_conditions_and_the_run_ends_with_its_stories() -> None:
    result = run(Value="1")
    assert result.status == "completed" and result.end_time == pytest.approx(8.0, abs=0.1)


@pytest.mark.parametrize(
    ("criterion", "value", "state"),
    [
        ("KeepLaneTest", "", "passed"),
        ("OnSideWalkTest", "", "passed"),
        ("MaxVelocityTest", "9", "failed"),
        ("MaxVelocityTest", "11", "passed"),
        ("AverageVelocityTest", "9", "passed"),
        ("EndofRoadTest", "", "passed"),
        ("OffRoadTest", "3", "passed"),
        ("WrongLaneTest", "", "passed"),
        ("RunningStopTest", "", "passed"),
        ("RunningRedLightTest", "", "passed"),
        ("ActorBlockedTest", "0.1, 60", "passed"),
        ("ReachedRegionTest", "120 130 -5 0", "passed"),
        ("ReachedRegionTest", "320 330 -5 0", "failed"),
    ],
)
def test_every_criterion_by_its_name_and_values(criterion: str, value: str, state: str) -> None:
    result = run(Criterion=f"criteria_{criterion}", Value=value)
    assert result.verdict.criteria[1].state == state
    assert result.verdict.passed is (state == "passed")


def test_a_value_can_be_given_by_the_name_of_its_parameter(tmp_path: Path) -> None:
    result = run(
        changed(SCENARIO, tmp_path, ("distance_success", "max_time")),
        Criterion="criteria_ActorBlockedTest",
        Value="60",
    )
    assert results(result)["ActorBlockedTest"] == "not judged"
    assert [cause.text for cause in result.verdict.causes] == [
        "not judged: ActorBlockedTest of hero: the scenario gives no value for min_speed"
    ]


def test_an_empty_value_of_a_named_parameter_is_0() -> None:
    assert "more than 0 m" in run(Value="").verdict.criteria[1].reason


def test_without_any_value_a_criterion_that_needs_one_is_not_judged(tmp_path: Path) -> None:
    result = run(changed(SCENARIO, tmp_path, ("distance_success", "")), Value="")
    assert not result.verdict.passed and results(result)["DrivenDistanceTest"] == "not judged"
    assert "not judged: DrivenDistanceTest of hero" in result.verdict.causes[0].text


def test_a_criterion_of_an_unknown_name_is_no_pass() -> None:
    result = run(Criterion="criteria_PolitenessTest")
    assert not result.verdict.passed and results(result)["PolitenessTest"] == "not judged"
    assert result.verdict.causes[0].text.startswith(
        "not judged: PolitenessTest: there is no criterion of this name; criteria: "
        "ActorBlockedTest,"
    )


COLLISION = (
    '<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef='
    '"hero"/></TriggeringEntities><EntityCondition><CollisionCondition><ByType type="vehicle"/>'
    "</CollisionCondition></EntityCondition></ByEntityCondition>"
)


@pytest.mark.parametrize(
    ("name", "state"), [("PolitenessTest", "not judged"), ("KeepLaneTest", "passed")]
)
def test_a_collision_condition_with_the_name_of_a_criterion_is_one(
    tmp_path: Path, name: str, state: str
) -> None:
    inside = '<ParameterCondition parameterRef="distance_success" value="$Value" rule="lessThan"/>'
    text = f"<ByValueCondition>{inside}</ByValueCondition>"
    path = changed(SCENARIO, tmp_path, (inside, inside))
    content = re.sub(r">\s+<", "><", path.read_text(encoding="utf-8"))
    assert text in content
    path.write_text(content.replace(text, COLLISION), encoding="utf-8")
    result = run(path, Criterion=f"criteria_{name}")
    assert results(result)[name] == state
    assert run(SCENARIO).end_time == result.end_time


def test_a_value_for_a_criterion_without_parameters_is_a_remark() -> None:
    assert remarks(run(Criterion="criteria_KeepLaneTest")) == (
        "KeepLaneTest: KeepLaneTest has no parameters: value='50' is not used",
    )


@pytest.mark.parametrize("value", ["far", "50, 60", "NaN", "inf"])
def test_values_that_are_none_are_refused(value: str) -> None:
    with pytest.raises(
        InvalidFile,
        match=r"criteria.xosc:1\d\d: ParameterCondition: value='.*DrivenDistanceTest takes "
        r"distance_success",
    ):
        run(Value=value)


def test_a_delay_leaves_the_beginning_out() -> None:
    assert run(Delay="5").verdict.criteria[1].value == pytest.approx(10.0 * (run().end_time - 5.0))
    assert results(run(Delay="15"))["DrivenDistanceTest"] == "not judged"


def test_a_condition_that_is_called_like_a_criterion_and_is_none_stays_a_condition(
    tmp_path: Path,
) -> None:
    inside = '<ParameterCondition parameterRef="distance_success" value="$Value" rule="lessThan"/>'
    result = run(
        changed(
            SCENARIO, tmp_path, (inside, '<SimulationTimeCondition value="3" rule="greaterThan"/>')
        )
    )
    assert result.status == "completed" and result.end_time == pytest.approx(3.05, abs=0.06)
    assert results(result) == {"CollisionTest": "passed"}


def test_without_an_ego_criteria_are_not_judged(tmp_path: Path) -> None:
    result = run(changed(SCENARIO, tmp_path, ("ego_vehicle", "simulation")), Ego="somebody")
    assert {each.reason for each in result.verdict.criteria} == {"the scenario has no ego"}
    assert [cause.name for cause in result.verdict.causes].count("not-judged") == 2


def test_results_are_in_the_files_of_a_run(tmp_path: Path) -> None:
    settings = RunSettings(sut="none", world="kinematic", max_time=20.0)
    outcome = execute(Job("run", SCENARIO, SCENARIO, {"Value": "500"}), settings, tmp_path)
    assert load_run(tmp_path / "run").verdict.criteria[1].state == "failed"
    write_junit([outcome], tmp_path / "junit.xml")
    found = {
        each.get("name"): each.get("value")
        for each in etree.parse(tmp_path / "junit.xml").iter("property")
    }
    assert found["criteria_CollisionTest hero"] == "passed: no collision"
    assert found["criteria_DrivenDistanceTest hero"].startswith("failed: drove")
