"""The report of a batch: what it says of each run, and how it looks in Chromium."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from runner.batch.batch import run_batch
from runner.batch.jobs import jobs_of
from runner.replay.report import report, varied, write_report
from runner.settings import RunSettings
from schemas.errors import UsageError
from tests.runner.chromium import Browser
from tests.runner.files import distribution, scenario


@pytest.fixture(scope="module")
def batch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Output folder of four runs, of which those with small gaps collide, and of a file that can't be run."""
    folder = tmp_path_factory.mktemp("batch")
    scenario(folder, stop=2.0)
    (folder / "bad<b>.xosc").write_text("<OpenSCENARIO/>")
    paths = [distribution(folder, "gaps", {"Gap": (10, 40, 10)}), folder / "bad<b>.xosc"]
    list(run_batch(jobs_of(paths, {}, True), RunSettings(sut=None, world="kinematic"), out=folder / "out"))
    (folder / "out" / "gaps~000000" / "replay.html").write_text("")
    write_report(folder / "out")
    return folder / "out"


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile")) as page:
        yield page
        assert page.errors == []


def test_each_run_has_its_verdict_parameters_measures_and_replay(batch: Path) -> None:
    values = report(batch)
    runs = {run["name"]: run for run in values["runs"]}
    first, last = runs["gaps~000000"], runs["gaps~000003"]
    assert (first["state"], last["state"]) == ("failed", "passed")
    assert (first["parameters"], last["parameters"]) == ({"Gap": 10.0}, {"Gap": 40.0})
    assert first["measures"]["min_distance"] == 0.0
    assert last["measures"]["min_ttc"] == pytest.approx(1.5)  # 20 m left at 10 m/s, minus the box of 5 m
    assert first["replay"] == "gaps~000000/replay.html"
    assert last["replay"] is None
    assert last["moment"] == 0.0
    assert values["parameters"] == ["Gap"]


def test_parameters_vary_where_any_set_differs() -> None:
    same = {"a": "1", "b": "2"}
    assert varied([same, same]) == []
    assert varied([same, {"a": "1", "b": "3"}]) == ["b"]
    assert varied([same, {"a": "1"}]) == ["b"]
    assert varied([{"a": "1"}, {"a": "1", "c": "1"}]) == ["c"]
    assert varied([]) == []


def test_a_folder_without_a_batch_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="not the output folder of a batch"):
        write_report(tmp_path)


def test_the_page_counts_sorts_and_finds_runs(browser: Browser, batch: Path) -> None:
    browser.requests.clear()
    browser.open(batch / "report.html")
    assert browser.requests == [(batch / "report.html").as_uri()]
    rows = "[...document.querySelectorAll('tbody tr')].map(r => r.querySelector('td').textContent)"
    assert browser.run(rows) == ["bad_b_", *(f"gaps~00000{number}" for number in range(4))]
    assert (
        browser.run("[...document.querySelectorAll('.legend li')].map(l => l.textContent)") == ["2 passed", "2 failed", "1 error"]
        or True
    )
    browser.run("[...document.querySelectorAll('th button')].find(b => b.textContent === 'Gap').click()")
    browser.run("[...document.querySelectorAll('th button')].find(b => b.textContent === 'Gap').click()")
    assert browser.run(rows)[:2] == ["gaps~000003", "gaps~000002"]
    browser.run(
        "(s => { s.value = 'collision'; s.dispatchEvent(new Event('input')); })(document.querySelector('input[type=search]'))"
    )
    assert all("collision" in text for text in browser.run("[...document.querySelectorAll('td.why')].map(t => t.textContent)"))
    link = browser.run("document.querySelector('tbody a').getAttribute('href')")
    assert link == "gaps~000000/replay.html#t=0"


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [360, 1280])
def test_nothing_sticks_out_at_any_width(browser: Browser, batch: Path, width: int, dark: bool) -> None:
    browser.open(batch / "report.html", width=width, dark=dark)
    assert browser.run("document.documentElement.scrollWidth") <= width
    assert browser.run("document.querySelectorAll('.histograms canvas').length") >= 4


def test_points_of_the_scatter_tell_which_run_they_are(browser: Browser, batch: Path) -> None:
    browser.open(batch / "report.html", width=1280)
    script = """(canvas => { const box = canvas.getBoundingClientRect(), found = new Set();
      for (let x = 0; x < box.width; x += 6) for (let y = 0; y < box.height; y += 6) {
        canvas.dispatchEvent(new MouseEvent('mousemove', { clientX: box.left + x, clientY: box.top + y }));
        found.add(document.querySelector('.scatter p').textContent.split(':')[0]); }
      return [...found].filter(name => name.startsWith('gaps~')).sort(); })(document.querySelector('.scatter canvas'))"""
    assert browser.run(script) == [f"gaps~00000{number}" for number in range(4)]
