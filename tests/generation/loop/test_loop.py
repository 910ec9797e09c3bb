"""The whole loop, from recordings and a scenario to the page, gone on with after an interruption,
and looked at in Chromium.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest

from generation.loop.findings import LoopStage, StageFinding
from generation.loop.loop import chosen, run_loop
from generation.loop.page import PAGE, write
from generation.search.settings import Ask, LoopSettings
from generation.space.logical.library import SCENARIOS
from runner.judging.settings import RunSettings
from schemas import check_many
from schemas.common.terminal.command_line import progress_bar
from schemas.common.terminal.files import expand
from tests.recognition.traffic import Car, write_highd
from tests.runner.chromium import Browser
from xosc.exports import standard
from xosc.exports.draft import Folder

SETTINGS = LoopSettings(
    RunSettings(timestep=0.1),
    None,
    rounds=2,
    budget=12,
    most=2,
    shown=2,
    method="draws",
    processes=1,
    ask=Ask(density="gaussian"),
)
BAR = partial(progress_bar, quiet=True)

pytestmark = pytest.mark.slow  # two whole loops


def go(folder: Path, out: Path, stop_at: str = "", processes: int = 1) -> list[tuple[str, bool]]:
    """Run the loop, interrupted when a stage is finished; the stages, and
    whether each was done now.
    """
    told = []

    def report(stage: LoopStage, found: StageFinding, seconds: float | None) -> None:
        told.append((stage.name, seconds is not None))
        if stage.name == stop_at:
            raise KeyboardInterrupt

    try:
        write(run_loop(folder, out, replace(SETTINGS, processes=processes), BAR, report), out)
    except KeyboardInterrupt:
        assert stop_at
    return told


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A car that follows another one for 15 s, and a logical scenario with its
    road and catalogues.
    """
    folder = tmp_path_factory.mktemp("mine")
    cars = [
        Car(1, 10.0, 21.0, 30.0, frames=375, lane=6),
        Car(2, 55.0, 21.0, 30.0, frames=375, lane=6),
    ]
    write_highd(folder / "recordings", cars)
    standard.export(SCENARIOS / "congestion_highway.xosc", "1.3", Folder(folder / "scenarios"))
    return folder


@pytest.fixture(scope="module")
def out(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The loop, interrupted and gone on with by two processes."""
    out = tmp_path_factory.mktemp("loop") / "out"
    begun = go(folder, out, stop_at="round_1_run")
    resumed = go(folder, out, processes=2)
    assert resumed[: len(begun)] == [(name, False) for name, _ in begun]
    assert all(now for _, now in resumed[len(begun) :])
    return out


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile")) as page:
        yield page
        assert page.errors == []


def data(out: Path) -> dict[str, Any]:
    text = (out / PAGE).read_text(encoding="utf-8")
    return json.loads(text.partition('id="data">')[2].partition("</script>")[0])


def test_recordings_become_classes_searches_cases_and_runs(out: Path) -> None:
    told = data(out)
    assert told["recordings"] == 1
    assert [each["title"] for each in told["classes"]] == [
        "highway free cruise",  # twice; the leader is followed once, however long
        "highway car following",
    ]
    assert {search["target"] for search in told["searches"]} >= {
        "highway_car_following",
        "congestion_highway",
    }
    assert [run["name"] for run in told["scenarios"]] == ["congestion_highway"]
    cases = [case for search in told["searches"] for case in search["cases"]]
    assert {case["state"] for case in cases} <= {"passed", "failed"}
    for case in cases:
        assert (case["state"] == "failed") == (case["verdict"] == "collision"), (
            "a run says what the search said"
        )
    assert told["checked"]["problems"] == []


def test_no_case_of_the_second_round_is_one_of_the_first(out: Path) -> None:
    seen: dict[str, list[list[float]]] = {}
    for search in data(out)["searches"]:
        for case in search["cases"]:
            values = list(case["theta"].values())
            assert values not in seen.setdefault(search["target"], [])
            seen[search["target"]].append(values)


def test_every_link_leads_to_a_file_in_the_folder(out: Path, browser: Browser) -> None:
    browser.open(out / PAGE)
    links = browser.run(
        "[...document.querySelectorAll('a')].map(a => a.getAttribute('href').split('#')[0])"
    )
    assert len(links) > 20
    for link in links:
        assert (out / unquote(link)).is_file(), link
        assert (out / unquote(link)).resolve().is_relative_to(out.resolve())


def test_every_written_file_is_sound(out: Path) -> None:
    assert [
        problem
        for _, found in check_many(expand([str(out / "round_1")]))
        for problem in found
        if problem.level == "error"
    ] == []


def test_the_same_folder_gives_the_same_page_in_one_go_and_by_one_process(
    folder: Path, out: Path, tmp_path: Path
) -> None:
    whole = tmp_path / "out"
    go(folder, whole)
    assert (whole / PAGE).read_bytes() == (out / PAGE).read_bytes()


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [360, 1280])
def test_nothing_sticks_out_of_the_page(
    out: Path, browser: Browser, width: int, dark: bool
) -> None:
    browser.requests.clear()
    browser.open(out / PAGE, width=width, dark=dark)
    browser.run("document.querySelectorAll('details').forEach(each => { each.open = true; })")
    browser.settle()
    assert browser.run("document.documentElement.scrollWidth") <= width
    assert [address for address in browser.requests if not address.startswith("file:")] == []
    browser.run(
        "document.querySelectorAll('dt').forEach(each => { each.textContent = "
        "'spline_based_trajectory_'.repeat(4); })"
    )
    assert (
        browser.run(
            "Math.min(...[...document.querySelectorAll('dd')].map(each => each.clientWidth))"
        )
        > width / 3
    ), "room is left"


def test_the_page_begins_with_what_a_careful_driver_would_have_avoided(
    out: Path, browser: Browser
) -> None:
    avoidable = [
        case
        for search in data(out)["searches"]
        for case in search["cases"]
        if case["avoidable"] and case["play"]
    ]
    browser.open(out / PAGE)
    assert browser.run("document.querySelectorAll('.previews canvas').length") == min(
        len(avoidable), 12
    )
    assert browser.run("document.querySelector('main > section').className") == "panel avoided"
    assert browser.text(".avoided h2").startswith(
        f"{len(avoidable)} collision" if avoidable else "No collision"
    )
    assert browser.unnamed() == []


def test_regions_of_failure_have_the_replay_of_their_likeliest_edge_case(
    out: Path, browser: Browser
) -> None:
    told = data(out)
    search = next(each for each in told["searches"] if each["cases"])
    first = search["cases"][0]
    first["play"] = "a.html#t=1"
    region = {
        "rule": "gap ≤ 5 m",
        "precision": 0.9,
        "recall": 0.8,
        "draws": 30,
        "drawn": 1,
        "low": 0.01,
        "high": 0.2,
    }
    search["regions"] = [region | {"severity": 4.0, "cases": [first["files"]["scenario"]]}]
    before, _, rest = (out / PAGE).read_text(encoding="utf-8").partition('id="data">')
    changed = out / "regions.html"
    changed.write_text(
        f'{before}id="data">{json.dumps(told)}</script>{rest.partition("</script>")[2]}',
        encoding="utf-8",
    )
    browser.open(changed)
    table = (
        "[...document.querySelectorAll('table')].find(each => "
        "each.textContent.includes('gap ≤ 5 m'))"
    )
    shown = browser.run(f"[...{table}.querySelectorAll('tbody td')].map(each => each.textContent)")
    assert shown[:-1] == ["gap ≤ 5 m", "0.90, 0.80", "1 of 30", "1.0 % to 20 %", "4.0", "1"]
    assert browser.run(f"{table}.querySelector('tbody a').getAttribute('href')") == "a.html#t=1"
    changed.unlink()


@pytest.mark.parametrize("width", [800, 1200])
def test_tables_show_all_columns(out: Path, browser: Browser, width: int) -> None:
    browser.open(out / PAGE, width=width)
    browser.run("document.querySelectorAll('details').forEach(each => { each.open = true; })")
    browser.settle()
    assert (
        browser.run(
            "[...document.querySelectorAll('.wide')].filter(each => each.scrollWidth > "
            "each.clientWidth).length"
        )
        == 0
    )


def test_a_replay_opens_by_keyboard(out: Path, browser: Browser) -> None:
    browser.open(out / PAGE)
    browser.run("document.querySelector('details.group > summary').focus()")
    if not browser.run("document.querySelector('details.group').open"):
        browser.press(" ")
    assert browser.run("document.querySelector('details.group').open")
    address = browser.run("document.querySelector('details.group a.play').getAttribute('href')")
    name, _, fragment = address.partition("#")
    browser.open(out / unquote(name), fragment)
    assert browser.text("main") != ""


def test_shown_scenarios_are_spread_over_confidence() -> None:
    rows = [{"class": "a", "file": f"{number}", "confidence": number / 10} for number in range(10)]
    assert [row["confidence"] for row in chosen(rows, 3)] == [0.9, 0.5, 0.0]
    assert len(chosen(rows, 20)) == 10
    assert [
        row["file"] for row in chosen([*rows, {"class": "b", "file": "x", "confidence": None}], 1)
    ] == ["9", "x"]
