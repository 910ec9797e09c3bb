"""Replays in three dimensions, drawn by software in a headless Chromium: each camera sees what it
should, and nothing fails.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from html import escape
from pathlib import Path

import pytest
from PIL import Image

import runner
from runner.view.replay.player import write_replay
from tests.runner.chromium import Browser
from tests.runner.files import car, place, scenario
from tests.runner.view.test_replay_page import BODIES

WIDTH, HEIGHT = 640, 700
HILL = """<elevationProfile><elevation s="0" a="5" b="0.06" c="0" d="0"/></elevationProfile>
<lateralProfile><superelevation s="0" a="0.04" b="0" c="0" d="0"/></lateralProfile>"""
BESIDE = """<objects><object id="1" type="building" s="150" t="-20" length="12" width="8" height="9"/>
<object id="2" type="tree" s="140" t="12"/><object id="3" type="crosswalk" s="125" t="0" length="4" width="8"/></objects>
<signals><signal id="1" s="135" t="-8" orientation="+" dynamic="no" type="274" zOffset="2"/>
<signal id="2" s="138" t="-8" orientation="+" dynamic="yes" type="1000001" zOffset="2.5"/></signals>"""


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile"), graphics=True) as page:
        yield page
        assert page.errors == []


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An ego, a lead and a pedestrian on a road that rises and is tilted, with things beside it."""
    folder = tmp_path_factory.mktemp("hill")
    others = f'<ScenarioObject name="Walker">{BODIES["Walker"]}</ScenarioObject>'
    bike = car("Bike").replace('vehicleCategory="car"', 'vehicleCategory="bicycle"')
    path = scenario(
        folder,
        "hill",
        entities=[car("Ego"), car("Lead"), bike, others],
        init=place("Ego", 100, 10)
        + place("Lead", 125, 10)
        + place("Bike", 115, 5, lane=-2)
        + place("Walker", 118, 1, lane=1),
        stories=" ",
        stop=2.0,
    )
    (road,) = folder.glob("**/*.xodr")
    text = road.read_text(encoding="utf-8")
    road.write_text(
        text.replace("<lanes>", f"{HILL}<lanes>").replace("</lanes>", f"</lanes>{BESIDE}"),
        encoding="utf-8",
    )
    write_replay([runner.run(path, sut=None, world="kinematic")], folder / "hill.html")
    return folder / "hill.html"


def colours(browser: Browser, folder: Path) -> dict[tuple[int, int, int], int]:
    """Colours of the view by number of pixels."""
    left, top, right, bottom = browser.run(
        "(r => [r.left, r.top + 50, r.right - 50, r.bottom])(stage.getBoundingClientRect())"
    )
    image = (
        Image.open(browser.picture(folder / "page.png"))
        .convert("RGB")
        .crop((left, top, right, bottom))
    )
    return {colour: count for count, colour in image.getcolors(1 << 20) or ()}  # type: ignore[misc]


def orange(found: dict[tuple[int, int, int], int]) -> int:
    """Pixels of the ego, in light and shade."""
    return sum(
        count for (r, g, b), count in found.items() if r > 120 and g < 0.45 * r and b < 0.25 * r
    )


@pytest.fixture
def view(
    browser: Browser, page: Path, tmp_path: Path
) -> Callable[..., dict[tuple[int, int, int], int]]:
    def opened(kind: str, *keys: str, dark: bool = False) -> dict[tuple[int, int, int], int]:
        browser.open(page, f"t=1&view={kind}", width=WIDTH, height=HEIGHT, dark=dark)
        browser.run(
            "globalThis.stage = document.querySelector('.stage'); "
            "stage.querySelectorAll('canvas').length"
        )
        browser.press("l")  # without names
        for key in keys:
            browser.press(key)
        return colours(browser, tmp_path)

    return opened


@pytest.mark.slow
def test_each_camera_shows_the_road_and_who_is_there(
    view: Callable[..., dict[tuple[int, int, int], int]],
) -> None:
    chase, driver, free = view("chase"), view("driver"), view("free")
    for found in (chase, driver, free):
        assert len(found) > 20, "light and shade of several things"
        assert max(found.values()) < 0.7 * sum(found.values()), "not one colour"
    assert orange(driver) < 20 < orange(free) < orange(chase), (
        "the driver does not see its own vehicle"
    )
    assert view("free", "e", "e", "w", "w") != free, "the free camera flies"
    assert view("chase", "+", "+") != chase
    assert view("chase", dark=True) != chase


@pytest.mark.slow
def test_shadows_are_off_until_they_are_wanted(
    browser: Browser, view: Callable[..., dict[tuple[int, int, int], int]], tmp_path: Path
) -> None:
    def light(found: dict[tuple[int, int, int], int]) -> int:
        return sum(sum(colour) * count for colour, count in found.items())

    without = view("chase")
    browser.run("document.querySelector('.choices input').click()")
    browser.settle()
    assert light(colours(browser, tmp_path)) < light(without)


@pytest.mark.slow
def test_keys_lead_there_and_back(browser: Browser, page: Path) -> None:
    browser.open(page, "t=1")
    shown = (
        "document.querySelector('.choices select').value + "
        "(document.querySelector('.choices').hidden ? ' hidden' : '')"
    )
    assert browser.run(shown) == "chase hidden"
    seen = []
    for key in ("v", "c", "c", "c", "v"):
        browser.press(key)
        seen.append(browser.run(shown))
    assert seen == ["chase", "driver", "free", "chase", "chase hidden"]
    assert browser.unnamed() == []


def test_a_notebook_s_frame_plays_without_reaching_the_page_around_it(
    browser: Browser, page: Path, tmp_path: Path
) -> None:
    """As `_repr_html_` embeds it: sandboxed, so that the page within has no
    origin and no address.
    """
    source = escape(page.read_text(encoding="utf-8"))
    frame = (
        '<iframe sandbox="allow-scripts" style="width:100%;height:600px" '
        f'srcdoc="{source}"></iframe>'
    )
    (tmp_path / "notebook.html").write_text(
        f"<title>notebook</title><div class=stage>{frame}</div>", encoding="utf-8"
    )
    browser.open(tmp_path / "notebook.html", width=WIDTH, height=HEIGHT)
    browser.run("globalThis.stage = document.querySelector('.stage'); 0")
    browser.settle()
    assert orange(colours(browser, tmp_path)) > 20, "the ego is drawn"
    assert browser.run("document.title") == "notebook"
    assert browser.errors == []
