"""The page of a search, its files, and its sentences."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import runner
import schemas
from generation.estimation.probability import Probability
from generation.report.regression import Before, Tried, regression
from generation.report.report import chance, figure, headline, write_report
from runner.judging.settings import RunSettings
from tests.generation.report.searches import CUT_IN, EASY, HARD, WEAK, searched, settings, written
from tests.runner.chromium import Browser
from xosc.writing.tags import tags_of

SUT = "cas:brake=2"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report with all that can be in one."""
    generated = searched(SUT, np.array([HARD, WEAK, EASY]), drawn=200)
    folder = written(generated, SUT, tmp_path_factory.mktemp("found"))
    compared = regression(Before.of(folder, CUT_IN), CUT_IN, Tried.of(generated), settings(SUT))
    assert (
        write_report(CUT_IN, generated, settings(SUT), folder, compared) == folder / "report.html"
    )
    return folder


def data(folder: Path) -> dict:
    text = (folder / "report.html").read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    return json.loads(found[1])


@pytest.mark.slow
def test_counterexamples_are_files_that_fail_when_they_are_run(folder: Path) -> None:
    found = data(folder)["counterexamples"]
    tags = {tag.type: tag.value for tag in tags_of(folder / found[0]["file"])}
    assert tags["SimulatorCalls"] == data(folder)["runs"]["total"], "all ran; more were allowed"
    assert [each["names"][0] for each in found] == ["likeliest_failure", "nearest_failure"][
        : len(found)
    ]
    for each in found:
        assert each["reproduced"]
        assert not schemas.check(folder / each["file"])
        result = runner.run(folder / each["file"], sut=SUT, world="kinematic", timestep=0.1)
        assert not result.verdict.passed
        assert (folder / each["play"]).is_file()


@pytest.mark.slow
def test_each_region_has_replays_of_its_typical_and_likeliest_member(folder: Path) -> None:
    found = data(folder)["regions"]
    assert found
    for number, each in enumerate(found, start=1):
        assert list(each["files"]) == ["typical", "likeliest"]
        for name, member in each["files"].items():
            assert member["reproduced"] and (folder / member["play"]).is_file()
            assert (
                member["file"].startswith(f"cut_in_highway_region_{number}_{name}")
                or each["typical"] == each["likeliest"]
            )
            assert not schemas.check(folder / member["file"])
    assert json.loads((folder / "cut_in_highway_regions.json").read_text())["regions"] == found


@pytest.mark.slow
def test_drivers_are_those_of_the_cases(folder: Path) -> None:
    found = data(folder)
    assert found["drivers"][-1] == "full braking"
    assert found["cases"][0]["drivers"].count("survives") < len(found["drivers"])
    assert {end for each in found["cases"] for end in each["drivers"]} == {"survives", "collides"}


@pytest.mark.slow
def test_slices_show_runs_that_took_place(folder: Path) -> None:
    found = data(folder)
    assert found["runs"]["total"] == 203 == len(found["runs"]["values"])
    assert 20 <= sum(found["runs"]["fails"]) <= 183
    assert len(found["region"]["slices"]) == 3
    assert 0.5 < found["region"]["accuracy"] <= 1.0


@pytest.mark.slow
def test_the_same_search_gives_the_same_page(folder: Path) -> None:
    before = (folder / "report.html").read_bytes()
    generated = searched(SUT, np.array([HARD, WEAK, EASY]), drawn=200)
    compared = regression(Before.of(folder, CUT_IN), CUT_IN, Tried.of(generated), settings(SUT))
    write_report(CUT_IN, generated, settings(SUT), folder, compared)
    assert (folder / "report.html").read_bytes() == before


def test_a_search_without_failures_says_so(tmp_path: Path) -> None:
    generated = searched("cas:sensor_range=150", np.array([EASY]))
    write_report(CUT_IN, generated, settings("cas"), tmp_path)
    found = data(tmp_path)
    assert (found["counterexamples"], found["cases"], found["file"]) == ([], [], None)
    assert "0 failures" in found["region"]["reason"]
    assert found["headline"][0] == "cas has no collision in 1 run of cut_in_highway."
    assert found["films"] == []
    assert found["headline"][-3] == "1 of 1 run tested what the file describes."
    assert found["headline"][-2].startswith("No unguided draw was executed: nothing bounds")
    assert found["headline"][-1] == (
        "Bounds and intervals rest on draws of the density kde of 3,563 recorded manoeuvres, "
        "whose gate was not testable; careful is r157-cc or fsm."
    )


def test_the_headline_tells_probability_rates_and_bands() -> None:
    found, first, second, *rest = headline("cut_in_highway", "cas", searched(SUT, np.array([HARD])))
    assert found.startswith("cas collides in ") and found.endswith(".")
    assert first.replace("\N{NO-BREAK SPACE}", " ").startswith(
        "When traffic makes the manoeuvre of cut_in_highway, cas collides with a probability of "
        "0.20 % (95 %"
    )
    assert "collisions per hour of driving" in second and "per 1,000 km" in second
    assert any(each == "Impacts of the collisions: 100 % at 0 to 5 m/s." for each in rest)


def test_an_unstable_estimate_is_no_headline() -> None:
    generated = searched(SUT, np.array([HARD]))
    assert generated.estimate is not None
    chances = {
        name: each._replace(effective=9.0)
        for name, each in generated.estimate.probabilities.items()
    }
    unstable = replace(generated, estimate=generated.estimate._replace(probabilities=chances))
    said = " ".join(headline("cut_in_highway", "cas", unstable))
    assert "not known well enough for a headline: 9 effective failures are fewer than 50" in said
    assert "probability of 0" not in said and "per hour" not in said


def test_what_is_stated_is_not_called_traffic() -> None:
    found = searched(SUT, np.array([HARD]))
    stated = replace(found, gate=found.gate._replace(replayed=None))
    found, first, *_ = headline("ncap", "cas", stated)
    assert "; nothing recorded tells how plausible they are" in found
    assert first.startswith("Where ncap has values as stated (nothing is recorded), cas collides")


def test_numbers_are_short() -> None:
    assert [figure(each) for each in (0.0, 0.2, 1234.5, 0.00123, 1.23e-6)] == [
        "0",
        "0.20",
        "1,234",
        "0.0012",
        "1.2·10⁻⁶",
    ]
    assert (
        chance(Probability(0.0, 0.0, 0.0, 0.004))
        == "at most 0.40\N{NO-BREAK SPACE}% (no draw fails)"
    )


@pytest.mark.slow
def test_the_page_shows_all_of_it(folder: Path, tmp_path: Path) -> None:
    with Browser(tmp_path) as browser:
        for width, dark in ((1280, False), (390, True)):
            browser.open(folder / "report.html", width=width, dark=dark)
            titles = browser.run(
                "[...document.querySelectorAll('h2')].map(each => each.textContent)"
            )
            assert [each.partition(" ")[0] for each in titles] == [
                "Against",
                "How",
                "How",
                "Regions",
                "Where",
                "Counterexamples",
                "Reference",
                "What",
                "How",
            ]
            assert browser.run("document.querySelectorAll('figure svg circle').length") == 3 * 203
            films = "document.querySelectorAll('.headline .previews canvas').length"
            assert browser.run(films) == len(data(folder)["films"]) > 0
            assert browser.run("document.querySelectorAll('polyline.boundary').length") > 0
            assert browser.run("document.documentElement.scrollWidth") <= width
            cards = (
                "[...document.querySelectorAll('.wide')].filter(e => e.scrollWidth > e.clientWidth)"
            )
            assert width > 390 or browser.run(f"{cards}.length") == 0
        cases, driver = data(folder)["cases"], data(folder)["drivers"][0]
        name = re.sub(r"\W", "_", driver)
        browser.run(
            f"(box => {{ box.value = \"{name} = 'survives' and case > 0\";"
            " box.dispatchEvent(new Event('change')); })(document.querySelector('.question'))"
        )
        met = [each for each in cases if each["drivers"][0] == "survives" and each["number"] > 0]
        assert browser.text(".choices [role=status]") == f"{len(met)} of {len(cases)} cases"
        shown = (
            "[...document.querySelectorAll('.driver')].filter(e => e.closest('tr:not([hidden], "
            ".totals)') && e.tagName === 'TD')"
        )
        assert browser.run(f"{shown}.length") == len(met) * len(data(folder)["drivers"])
        assert browser.errors == []
        assert all(each.startswith(("file:", "about:")) for each in browser.requests)
    assert RunSettings().world == "sumo"
