"""One distribution file for each distribution of the standard, and runs of what they give."""

from __future__ import annotations

import json
import shutil
import statistics
from dataclasses import replace
from pathlib import Path

import pytest

import runner
import schemas
import xosc
from runner.batch.batch import run_batch
from runner.batch.jobs import jobs_of
from runner.view.rehearsal import rehearse_batch
from tests.conformance.support import SCENARIOS, at, track


def values(element: str, parameter: str = "Target") -> list[float]:
    """Values of a parameter over all variations of an element's file."""
    return [
        float(parameters[parameter])
        for _, parameters in xosc.variations(SCENARIOS / f"{element}.xosc")
    ]


def test_deterministic_distributions_list_their_values_in_order() -> None:
    assert values("DistributionSet") == [12, 18]
    assert values("DistributionRange") == [10, 12.5, 15, 17.5, 20]
    assert list(
        zip(
            values("ValueSetDistribution", "StartSpeed"),
            values("ValueSetDistribution"),
            strict=True,
        )
    ) == [
        (5, 15),
        (25, 5),
    ]


@pytest.mark.parametrize(
    "element",
    ["UniformDistribution", "NormalDistribution", "LogNormalDistribution", "PoissonDistribution"],
)
def test_stochastic_distributions_stay_within_their_range_and_repeat_by_seed(element: str) -> None:
    drawn = values(element)
    assert len(drawn) == 200
    assert all(5 <= value <= 30 for value in drawn)
    assert drawn == values(element)
    assert statistics.mean(drawn) == pytest.approx(
        {"UniformDistribution": 17.5, "PoissonDistribution": 12}.get(element, 15), abs=1.5
    )


def test_histograms_and_probability_sets_respect_their_weights() -> None:
    low = sum(value < 10 for value in values("Histogram"))
    assert 30 <= low <= 70
    assert 20 <= values("ProbabilityDistributionSet").count(10) <= 60


def test_the_variations_run() -> None:
    for scenario, parameters in xosc.variations(SCENARIOS / "DistributionSet.xosc"):
        result = runner.run(
            scenario, parameters=parameters, sut=None, world="kinematic", timestep=0.05, max_time=8
        )
        assert at(track(result, "Car"), 7.0, "speed") == float(parameters["Target"])


def copied(folder: Path) -> Path:
    """The file of a DistributionSet, with its scenario and road, in a folder."""
    shutil.copytree(SCENARIOS.parent / "roads", folder / "roads")
    (folder / "scenarios").mkdir()
    for name in ("DistributionSet", "SpeedAction"):
        shutil.copy(SCENARIOS / f"{name}.xosc", folder / "scenarios")
    return folder / "scenarios" / "DistributionSet.xosc"


def test_values_in_another_spelling_are_named_by_checks_and_remarks_of_their_runs(
    tmp_path: Path,
) -> None:
    variations = copied(tmp_path)
    for file, old, new in (("SpeedAction", 'parameterType="double" value="2',
        'parameterType="int" value="2'),
                           ("DistributionSet", 'value="18"', 'value="18.0"')):  # fmt: skip
        path = variations.with_name(f"{file}.xosc")
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new), encoding="utf-8")
    line = text[: text.index(old)].count("\n") + 1
    (problem,) = schemas.check(variations)
    assert problem.line == line and problem.rule.endswith("value_is_of_the_declared_type")
    settings = runner.RunSettings(sut=None, world="kinematic", max_time=1.0)
    sound, other = run_batch(jobs_of([variations], {}, True), settings)
    assert [each.exit_code for each in (sound, other)] == [0, 0]
    assert not [each for each in sound.remarks if "is meant" in each]
    (remark,) = [each for each in other.remarks if "is meant" in each]
    assert remark.startswith(
        f"{variations}:{line}: the value of the parameter Target: '18.0' is not of "
        "type int; 18 is meant"
    )
    sound, other = run_batch(jobs_of([variations], {}, True), replace(settings, strict=True))
    assert (sound.exit_code, other.exit_code) == (0, 3) and "18 is meant" in other.message


def test_faults_of_the_variations_are_remarks_of_their_runs(tmp_path: Path) -> None:
    variations, old = copied(tmp_path), "<DistributionSet>"
    text = variations.read_text(encoding="utf-8")
    assert old in text
    line = text[: text.index(old)].count("\n") + 1
    variations.write_text(text.replace(old, '<DistributionSet colour="red">'), encoding="utf-8")
    lenient = runner.RunSettings(sut=None, world="kinematic", max_time=1.0)
    outcomes = list(run_batch(jobs_of([variations], {}, True), lenient, out=tmp_path / "out"))
    assert len(outcomes) == 2
    for outcome in outcomes:
        assert (outcome.state, outcome.causes) == ("inconclusive", ["ignored"])
        remark = outcome.message
        assert remark.startswith(f"{variations}:{line}: ")
        assert (
            remark
            in json.loads((tmp_path / "out" / outcome.job.name / "result.json").read_text())[
                "remarks"
            ]
        )
    (rehearsed,) = rehearse_batch(jobs_of([variations], {}, True), lenient)
    assert remark in rehearsed.message
    strict = runner.RunSettings(sut=None, world="kinematic", strict=True)
    assert all(
        "valid_schema" in each.message
        for each in run_batch(jobs_of([variations], {}, True), strict)
    )
