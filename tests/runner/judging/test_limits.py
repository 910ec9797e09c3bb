"""Limits by which runs fail, how a contact ends a run, and what a verdict says
of the system under test.
"""

from __future__ import annotations

import json
import math
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

import runner
import runner.systems
from runner import RunSettings
from runner.batch.arrays import play, structures
from runner.batch.outputs.folder import load_run
from runner.judging import verdict
from runner.judging.measures.measure import Facts, Limit
from schemas.common.errors import UsageError
from tests.commands import Command
from tests.runner.files import place, scenario

EXTREME = {"value": 0.5, "time": 2.0, "other": "Lead"}
FACTS = Facts(
    {"min_ttc": EXTREME, "pet": None, "rss_risk_ad_rss": 0.25, "rss_risk_r157": None},
    [("interventionStart", "Ego brakes at 1.00 s"), ("offRoad", "Ego has left the road at 3.00 s")],
    "timeout",
    12.0,
)
QUICK = RunSettings(world="kinematic", sut="none")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("min_ttc<1", "min_ttc<1: min_ttc is 0.50 s with Lead at 2.00 s"),
        (" min_ttc <= 0.5 ", "min_ttc <= 0.5: min_ttc is 0.50 s with Lead at 2.00 s"),
        ("min_ttc<0.5", ""),
        ("min_ttc>=0.5", "min_ttc>=0.5: min_ttc is 0.50 s with Lead at 2.00 s"),
        ("pet<1", ""),
        ("rss", "rss: RSS distances are violated in 25.0% of the time"),
        ("rss_risk_ad_rss>0.25", ""),
        (
            "rss_risk_ad_rss>0.2",
            "rss_risk_ad_rss>0.2: RSS distances are violated in 25.0% of the time",
        ),
        ("rss_risk_r157>0", ""),
        ("off-road", "off-road: Ego has left the road at 3.00 s"),
        ("road-end", ""),
        ("timeout", "timeout: the time limit came first, at 12.00 s"),
        ("end_time>10", "end_time>10: end_time is 12.00 s"),
    ],
)
def test_a_limit_says_why_a_run_fails(text: str, reason: str) -> None:
    assert Limit.parse(text).reason(FACTS) == reason


@pytest.mark.parametrize(
    "text",
    [
        "",
        "min_ttc",
        "inconclusive",
        "off-road<1",
        "min_tcc<1",
        "min_ttc<",
        "min_ttc<soon",
        "min_ttc<nan",
        "min_ttc=1",
        "1>2",
    ],
)
def test_what_is_no_limit_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="--fail-if"):
        RunSettings(fail_if=(text,))


def near(folder: Path) -> Path:
    """The ego follows somebody of its own speed 4 m behind."""
    return scenario(folder, init=place("Ego", 100, 20) + place("Lead", 109, 20), stop=2.0)


def test_a_run_fails_by_any_measure(tmp_path: Path) -> None:
    path = near(tmp_path)
    assert runner.run(path, QUICK).verdict.passed
    verdict = runner.run(
        path, QUICK, fail_if=("min_distance<5", "min_distance<0.1", "end_time>1")
    ).verdict
    assert not verdict.passed
    assert [reason.partition(":")[0] for reason in verdict.reasons] == [
        "min_distance<5",
        "end_time>1",
    ]


def test_a_limit_that_says_nothing_about_a_run_leaves_it_inconclusive(tmp_path: Path) -> None:
    path = near(tmp_path)
    assert runner.run(
        path, QUICK, fail_if=("min_ttc<1", "end_time>100")
    ).verdict.passed  # a lead is enough
    path = scenario(tmp_path, init=place("Ego", 100, 20) + place("Lead", 400, 20), stop=2.0)
    verdict = runner.run(path, QUICK, fail_if=("pet<1",)).verdict
    assert [cause.name for cause in verdict.causes] == ["undefined-limit"]
    assert "pet<1: the measure had a value in 0.0% of the time" in verdict.reasons[0]
    assert runner.run(path, QUICK, fail_if=("pet<1",), least=("limits=0",)).verdict.passed
    path.write_text(path.read_text().replace('"Ego"', '"Other"'))
    assert runner.run(path, QUICK).verdict.passed
    assert not runner.run(path, QUICK, fail_if=("min_ttc<1",)).verdict.passed


@pytest.mark.parametrize(
    "text",
    ["min_ttc<-1", "min_ttc<0", "rss_risk_r157>1", "max_collision_probability>2", "end_time>301"],
)
def test_a_limit_that_no_run_can_reach_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="no run"):
        runner.RunSettings(fail_if=(text,))


@pytest.fixture
def xosc_run(command: Command) -> Command:
    """The command in the kinematic world."""
    return partial(command, "xosc-run", "--world", "kinematic")


def test_the_command_fails_and_says_why_everywhere(xosc_run: Command, tmp_path: Path) -> None:
    path, out, junit = near(tmp_path), tmp_path / "out", tmp_path / "junit.xml"
    options = ["--sut", "none", "--out", out, "--junit", junit]
    answer = xosc_run(
        path, *options, "--fail-if", "min_distance<5", "--fail-if", "rss", "--fail-if", "pet<0.01"
    )
    assert answer.code == 1
    assert (
        "FAILED" in answer.out
        and "min_distance<5: min_distance is " in answer.out
        and "rss: RSS distances are " in answer.out
    )
    result = json.loads((out / "scenario" / "result.json").read_text())
    assert result["verdict"] == "failed"
    assert [reason.partition(":")[0] for reason in result["reasons"]] == ["min_distance<5", "rss"]
    assert etree.parse(junit).xpath("string(//failure/@message)").startswith("min_distance<5: ")
    assert xosc_run(path, "--fail-if", "min_distanc<5")[::2] == (
        2,
        "xosc-run: --fail-if 'min_distanc<5': did you mean 'min_distance'? "
        "a measure with a limit is expected, such as min_ttc<1 (of min_ttc, min_thw, "
        "max_drac, min_distance, max_jerk, pet, max_collision_probability, max_risk_field, rss_risk_ad_rss, "
        "rss_risk_r157, "
        "impact_speed, delta_v, fatality_risk, end_time), one of off-road, "
        "road-end, timeout, rss, a criterion, as KeepLaneTest or MaxVelocityTest=30, "
        "a formula, as 'stl: eventually (ttc < 1)', "
        "or with --against new-failure\n",
    )


def test_a_comparison_of_batches_is_no_limit_of_a_run() -> None:
    with pytest.raises(UsageError, match="new-failure compares batches"):
        runner.RunSettings(fail_if=("min_ttc<1", " new-failure"))


def test_leaving_the_road_is_said_once(xosc_run: Command, tmp_path: Path) -> None:
    aside = place("Ego", 100, 20).replace('laneId="-1"', 'laneId="-1" offset="-30"')
    path = scenario(tmp_path, init=aside + place("Lead", 300, 20), stop=0.5)
    assert xosc_run(path, "--sut", "none").code == 6
    answer = xosc_run(path, "--sut", "none", "--fail-if", "off-road")
    assert answer.code == 1
    assert answer.out.count("has left the road") == 1


# the end by a contact -----------------------------------------------------------------------


def test_a_run_in_python_ends_as_the_command_does(tmp_path: Path) -> None:
    assert runner.run(crash(tmp_path), world="kinematic").status == "collision"
    assert runner.run(crash(tmp_path), world="kinematic", sut="none").status == "completed"


def crash(folder: Path) -> Path:
    """The ego runs into somebody who appears 12 m ahead and stands, after about half a second."""
    return scenario(folder, init=place("Ego", 100, 20) + place("Lead", 115, 0), stop=5.0)


@pytest.mark.parametrize(
    ("options", "end", "status"),
    [
        ([], 1.0, "collision"),
        (["--continue-after-collision"], 5.0, "completed"),
        (["--sut", "none"], 5.0, "completed"),
        (["--sut", "none", "--end-after-collision"], 1.0, "collision"),
        (["--max-time", "1"], 0.0, "timeout"),
    ],
)
def test_a_contact_of_the_ego_ends_a_run(
    options: list[str], end: float, status: str, xosc_run: Command, tmp_path: Path
) -> None:
    assert xosc_run(crash(tmp_path), *options, "--out", tmp_path / "out").code == 1
    result = load_run(tmp_path / "out" / "scenario")
    (contact,) = [entry.time for entry in result.events if entry.kind == "collision"]
    assert result.status == status
    expected = {"collision": contact + end, "completed": end, "timeout": 1.0}[status]
    assert result.end_time == pytest.approx(expected)


def test_runs_from_python_end_as_those_of_the_command(tmp_path: Path) -> None:
    assert runner.run(crash(tmp_path), world="kinematic", end_after_collision=False).end_time == 5.0
    assert (
        runner.run(crash(tmp_path), world="kinematic", end_after_collision=True).status
        == "collision"
    )


def test_contacts_of_others_end_nothing(tmp_path: Path) -> None:
    path = crash(tmp_path)
    assert (
        runner.run(path, world="kinematic", sut="none", ego="Lead", end_after_collision=True).status
        == "collision"
    )
    far = scenario(tmp_path, "far", init=place("Ego", 10, 5) + place("Lead", 200, 0), stop=2.0)
    assert runner.run(far, world="kinematic", end_after_collision=True).status == "completed"


# systems with parameters --------------------------------------------------------------------


def test_a_system_is_given_parameters_and_the_verdict_says_what_it_could_see(
    xosc_run: Command, tmp_path: Path
) -> None:
    path = scenario(tmp_path, init=place("Ego", 100, 20) + place("Lead", 150, 0), stop=6.0)
    answer = xosc_run(path)
    assert answer.code == 1 and "; cas sees 10 m" in answer.out
    answer = xosc_run(path, "--sut", "cas:sensor_range=60,brake=7.5", "--out", tmp_path / "out")
    assert answer.code == 0 and "sees" not in answer.out
    result = load_run(tmp_path / "out" / "scenario")
    assert (result.sut, result.sut_parameters) == (
        "cas:sensor_range=60,brake=7.5",
        {"sensor_range": 60.0, "rss": "ad-rss", "brake": 7.5, "jerk": None},
    )


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("cas:range=60", "has no parameter 'range'; did you mean 'sensor_range'"),
        ("cas:sensor_range=far", "the parameter sensor_range of 'cas' is a number, not 'far'"),
        ("cas:sensor_range=nan", "is a number, not 'nan'"),
        ("cas:sensor_range=60,brake", "NAME=VALUE is expected, not 'brake'"),
        ("cas:rss=no-such-set", "no RSS parameter set is called 'no-such-set'"),
        ("sumo:sensor_range=60", "has no parameter 'sensor_range'; there are none"),
        (
            f"{__name__}:Configured:steps=2.5",
            "the parameter steps of .* is a whole number, not '2.5'",
        ),
        (f"{__name__}:Configured:alert=maybe", "is true or false, not 'maybe'"),
    ],
)
def test_parameters_are_checked_against_those_declared(
    name: str, complaint: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=complaint):
        runner.run(scenario(tmp_path, stop=0.1), world="kinematic", sut=name)


class Configured:
    """A system that is no dataclass."""

    def __init__(self, steps: int = 1, alert: bool = False, label="quiet") -> None:  # type: ignore[no-untyped-def]
        self.steps, self.alert, self.label = steps, alert, label

    def reset(self, ego: object, timestep: float, seed: int) -> None:
        """Nothing to do."""

    def control(self, observation: object, dt: float) -> runner.systems.Control:
        """Nothing."""
        return runner.systems.Control()


def test_a_class_of_any_module_is_given_parameters(tmp_path: Path) -> None:
    name = f"{__name__}:Configured:steps=3,alert=True,label=loud"
    result = runner.run(scenario(tmp_path, stop=0.1), world="kinematic", sut=name)
    assert result.sut_parameters == {"steps": 3, "alert": True, "label": "loud"}


@pytest.mark.parametrize(
    ("text", "values", "margins"),
    [
        ("min_ttc<2", [1.0, 2.0, 4.0, math.nan], [-0.5, 0.0, 1.0, math.inf]),
        ("min_ttc<=2", [2.0], [0.0]),
        ("max_drac>4", [6.0, 4.0, 1.0], [-0.5, 0.0, 0.75]),
        ("rss_risk_ad_rss>0", [0.2, 0.0], [-0.2, math.inf]),
    ],
)
def test_a_margin_is_the_signed_distance_to_a_limit(
    text: str, values: list[float], margins: list[float]
) -> None:
    limit = Limit.parse(text)
    found = limit.margins(np.array(values))
    np.testing.assert_allclose(found, margins, atol=1e-300)
    for value, margin in zip(values, found, strict=True):
        facts = FACTS._replace(criticality={limit.name: None if math.isnan(value) else value})
        assert limit.margin(facts) == margin
        if limit.name.startswith("rss"):  # a number of the whole run
            assert bool(limit.reason(facts)) == (margin <= 0.0)


def test_the_margin_of_an_event_says_whether_it_happened() -> None:
    assert Limit.parse("timeout").margin(FACTS._replace(status="timeout")) == -1.0
    assert Limit.parse("timeout").margin(FACTS._replace(status="completed")) == math.inf


# criteria and formulas ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("KeepLanesTest", "did you mean 'KeepLaneTest'"),
        ("MaxVelocityTest", "MaxVelocityTest=MAX_VELOCITY is expected"),
        ("MaxVelocityTest=fast", "MaxVelocityTest=MAX_VELOCITY is expected"),
        ("KeepLaneTest=3", "KeepLaneTest is expected"),
        ("stl: eventually (tcc < 1)", "there is no signal 'tcc'; did you mean 'ttc'"),
        ("stl: eventually (ttc <", "the formula is malformed: 1:17"),
        ("stl: eventually[3:0] (ttc < 1)", r"limits of time have to ascend, as \[0:3\]"),
        ("stl: 1 < 2", "it names no signal"),
        ("stl:", "it names no signal"),
    ],
)
def test_criteria_and_formulas_that_are_none_are_refused(text: str, reason: str) -> None:
    if text.startswith("stl"):
        pytest.importorskip("rtamt")
    with pytest.raises(UsageError, match=reason):
        Limit.parse(text)


@pytest.mark.parametrize(
    ("limit", "fails", "margin"),
    [
        ("MaxVelocityTest=25", False, 0.2),
        ("MaxVelocityTest=10", True, -1.0),
        ("stl: eventually (speed > 25)", False, 5.0),
        ("stl: always (speed > 15)", True, -5.0),
        ("stl: eventually (distance < 30 and speed > 15)", False, 0.75),
        ("stl: eventually[0:1] (distance < 100 and speed > 15)", True, -5.0),
    ],
)
def test_a_run_fails_by_a_criterion_or_a_formula_that_holds(
    tmp_path: Path, limit: str, fails: bool, margin: float
) -> None:
    if limit.startswith("stl"):
        pytest.importorskip("rtamt")
    # From 40 m behind, box to box 34.75 m, the ego comes 4 m nearer.
    path = scenario(tmp_path, init=place("Ego", 100, 20) + place("Lead", 140, 16), stop=1.0)
    result = runner.run(path, world="kinematic", sut="none", fail_if=(limit,))
    assert bool(result.verdict.failures) == fails
    assert all(reason.startswith(limit) for reason in result.verdict.failures)
    found = verdict.margin(result, [Limit.parse(limit)])
    assert found == pytest.approx(margin, abs=1e-6) or (margin == 0.75 and 0.0 < found < 4.0)
    assert (found <= 0.0) == fails


def test_formulas_have_the_margins_of_single_runs_in_arrays(tmp_path: Path) -> None:
    pytest.importorskip("rtamt")
    path = scenario(tmp_path, init=place("Ego", 100, 20) + place("Lead", 140, 12), stop=2.0)
    settings = runner.RunSettings(
        world="kinematic", fail_if=("stl: eventually (ttc < 3 and speed > 15)",)
    )
    (structure,) = structures(path, [{}] * 10, settings)
    (block,) = play(structure, settings)
    alone = verdict.margin(runner.run(path, settings), settings.limits)
    np.testing.assert_allclose(block.outcomes.margin, alone)
