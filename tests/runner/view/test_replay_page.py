"""Replay pages in a headless Chromium: they play, obey the keyboard, need no network, and no text
of a scenario breaks them.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from PIL import Image, ImageChops

import runner
from runner.judging.result import RunResult
from runner.view.replay.player import replay_page, write_replay
from tests.runner.chromium import Browser
from tests.runner.files import car, place, scenario, speed_action, story

EVIL = (
    "</script><script>document.title='broken'</script><!--<img src=http://x.invalid/ "
    "onerror=alert(1)>&quot;\u2028'\"`"
)
BODIES = {
    "Walker": '<Pedestrian name="p" mass="80" pedestrianCategory="pedestrian"><BoundingBox><Center '
    'x="0" y="0" z="0.9"/>'
    '<Dimensions width="0.6" length="0.5" height="1.8"/></BoundingBox></Pedestrian>',
    "Cone": '<MiscObject name="m" mass="1" miscObjectCategory="obstacle"><BoundingBox><Center x="0" '
    'y="0" z="0.5"/>'
    '<Dimensions width="0.5" length="0.5" height="1"/></BoundingBox></MiscObject>',
}


def street(folder: Path, gap: float, sut: str | None = None) -> RunResult:
    """An ego that comes up to a lead with a name that would break a careless
    page, a bicycle, a pedestrian and a cone.
    """
    escaped = EVIL.translate({ord(c): f"&#{ord(c)};" for c in "<>&\"'"})
    others = [
        f'<ScenarioObject name="{name}">{body}</ScenarioObject>' for name, body in BODIES.items()
    ]
    entities = [
        car("Ego"),
        car(escaped),
        car("Bike").replace('vehicleCategory="car"', 'vehicleCategory="bicycle"'),
        *others,
    ]
    init = place("Ego", 100, 20) + place(escaped, 100 + gap, 10) + place("Bike", 110, 5, lane=-2)
    init += place("Walker", 120, 1, lane=-3) + place("Cone", 130, 0, lane=-3)
    path = scenario(
        folder,
        "street",
        entities=entities,
        init=init,
        stories=story("Ego", [(0.5, speed_action(15))]),
        stop=4.0,
    )
    return runner.run(path, sut=sut, world="kinematic")


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile")) as page:
        yield page
        assert page.errors == []


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> list[RunResult]:
    folder = tmp_path_factory.mktemp("street")
    return [street(folder / "one", 15.0), street(folder / "two", 40.0)]


@pytest.fixture(scope="module")
def one(results: list[RunResult], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "one.html"
    write_replay(results[:1], path)
    return path


def time(browser: Browser) -> float:
    return float(browser.text("#clock").split("/")[0])


# what is written ----------------------------------------------------------------------------


def test_the_same_runs_give_the_same_bytes(
    results: list[RunResult], one: Path, tmp_path: Path
) -> None:
    again = street(tmp_path, 15.0)
    assert replay_page([again]) == one.read_text(encoding="utf-8")


def test_no_text_of_a_scenario_ends_the_script(one: Path) -> None:
    text = one.read_text(encoding="utf-8")
    assert text.count("</script>") == 2
    assert "<img" not in text
    (data,) = re.findall(
        r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL
    )
    assert EVIL in [track["name"] for track in json.loads(data)["runs"][0]["tracks"]]


# what is seen -------------------------------------------------------------------------------


def test_a_page_loads_nothing_and_shows_every_participant_by_name(
    browser: Browser, one: Path
) -> None:
    browser.requests.clear()
    browser.open(one)
    assert browser.requests == [one.as_uri()]
    assert browser.run("document.title") == "street – replay"
    assert browser.run(
        "[...document.querySelectorAll('.who tbody button')].map(b => b.textContent)"
    ) == [
        "Ego",
        EVIL,
        "Bike",
        "Walker",
        "Cone",
    ]
    assert browser.run("document.querySelectorAll('img, iframe').length") == 0
    assert "pedestrian" in browser.text(".who tbody")
    assert "bicycle" in browser.text(".who tbody")
    assert browser.text(".badge") == "failed"


def test_evidence_of_the_run_is_a_table(
    browser: Browser, one: Path, results: list[RunResult]
) -> None:
    browser.open(one)
    evidence = results[0].verdict.evidence
    rows = "document.querySelectorAll('.evidence tbody tr').length"
    assert browser.run(rows) == len(evidence)
    enough = sum(each.enough for each in evidence)
    told = f"Evidence: {enough} of {len(evidence)} enough"
    assert browser.text(".evidence summary").startswith(told)


def test_speeds_and_curves_are_those_of_the_run(
    browser: Browser, one: Path, results: list[RunResult]
) -> None:
    browser.open(one, "t=1.0")
    row = round(1.0 / 0.05)
    speed = results[0].recording.tracks["Ego"].columns["speed"][row]
    assert browser.text(".who tbody .number") == f"{speed:.1f} m/s"
    measures = results[0].criticality
    assert measures is not None
    labels = browser.run("[...document.querySelectorAll('.chart h3')].map(h => h.firstChild.data)")
    values = browser.run(
        "[...document.querySelectorAll('.chart .now')].map(now => now.textContent)"
    )
    charts = dict(zip(labels, values, strict=True))
    assert charts["Ego speed"].strip() == f"{speed:.2f} m/s"
    assert float(charts["Time to collision"].split()[0]) == pytest.approx(
        measures.ttc.value[row], abs=0.02
    )
    assert float(charts["RSS margin"].split()[0]) == pytest.approx(
        measures.margin["ad-rss"].value[row], abs=0.02
    )


def test_the_timeline_shows_triggers_and_collisions_and_leads_to_them(
    browser: Browser, one: Path
) -> None:
    browser.open(one)
    bars = browser.run(
        "[...document.querySelectorAll('.bar')].map(b => b.getAttribute('aria-label'))"
    )
    assert any(bar.startswith("event0, 0.50 s") and "time" in bar for bar in bars)
    (collision,) = {bar for bar in bars if bar.startswith("Ego – ") or " – Ego, " in bar}
    browser.run("document.querySelector('.bar.collision').click()")
    browser.settle()
    assert time(browser) == pytest.approx(float(re.findall(r"([\d.]+) s to", collision)[-1]))
    assert browser.text(".told span").startswith("collision: ")
    assert "touches" in browser.text(".log .current")


def test_keys_play_step_zoom_and_jump(browser: Browser, one: Path) -> None:
    browser.open(one)
    assert time(browser) == 0.0
    browser.press("ArrowRight")
    assert time(browser) == pytest.approx(0.05)
    browser.press("ArrowRight", shift=True)
    assert time(browser) == pytest.approx(1.05)
    browser.press("ArrowLeft")
    assert time(browser) == pytest.approx(1.0)
    browser.press("End")
    assert time(browser) == pytest.approx(4.0)
    browser.press("Home")
    for _ in range(3):
        browser.press(".")
    assert browser.run("document.querySelector('select[aria-label=Speed]').value") == "10"
    browser.press(" ")
    while time(browser) < 4.0:
        browser.settle()
    browser.settle()
    assert browser.text(".play") == "Play"


def test_events_are_ticks_that_keys_lead_to_and_the_address_follows(
    browser: Browser, one: Path
) -> None:
    browser.open(one)
    places = browser.run("[...document.querySelectorAll('.ticks i')].map(i => i.className)")
    assert "collision" in places
    browser.press("n")
    assert time(browser) == pytest.approx(0.5)
    assert "event0" in browser.text("[aria-live=polite]")
    browser.run("new Promise(done => setTimeout(done, 1200))")
    assert browser.run("location.hash") == "#t=0.50"
    browser.press("n")
    assert time(browser) > 0.5
    browser.press("p")
    assert time(browser) == pytest.approx(0.5)


def test_ego_and_partner_stay_in_sight_with_what_is_between_them(
    browser: Browser, one: Path
) -> None:
    """The road is drawn around both, whatever the width; nobody is cut off."""
    for width in (360, 1400):
        browser.open(one, "t=0", width=width)
        assert browser.run("document.querySelector('select[aria-label=Follow]').value") == "both"
        first = browser.run("document.querySelector('canvas').toDataURL()")
        browser.press("f")
        assert browser.run("document.querySelector('canvas').toDataURL()") != first
        browser.press("b")
        assert browser.run("document.querySelector('canvas').toDataURL()") == first


def test_everybody_can_be_kept_in_sight(browser: Browser, one: Path) -> None:
    pictures = set()
    browser.open(one)
    for key in ("b", "f", "0", "a"):
        browser.press(key)
        pictures.add(browser.run("document.querySelector('canvas').toDataURL()"))
    assert len(pictures) == 4
    assert browser.run("document.querySelector('select[aria-label=Follow]').value") == "all"


def test_each_participant_has_a_row_that_unfolds(browser: Browser, one: Path) -> None:
    browser.open(one)
    names = "[...document.querySelectorAll('.unfold')].map(b => b.textContent)"
    assert browser.run(names)[:3] == ["the run", "Ego", EVIL]
    ego = "document.querySelectorAll('.unfold')[1]"
    inner = f"document.getElementById({ego}.getAttribute('aria-controls'))"
    assert (
        browser.run(f"{ego}.getAttribute('aria-expanded')"),
        browser.run(f"{inner}.hidden"),
    ) == ("false", True)
    browser.run(f"{ego}.click()")
    assert (
        browser.run(f"{ego}.getAttribute('aria-expanded')"),
        browser.run(f"{inner}.hidden"),
    ) == ("true", False)
    assert "event0" in browser.run(f"{inner}.textContent")


def test_the_top_says_what_happened_and_leads_back(
    browser: Browser, results: list[RunResult], tmp_path: Path
) -> None:
    write_replay(results[:1], tmp_path / "one.html", "../report.html")
    browser.open(tmp_path / "one.html")
    assert browser.text(".account li").startswith(f"Ego hit {EVIL} with its front at ")
    assert browser.run("document.querySelector('nav a').getAttribute('href')") == "../report.html"
    browser.run("document.querySelector('.account button').click()")
    browser.settle()
    assert browser.text(".told span").startswith("collision: ")


def test_zoom_and_follow_change_the_picture(browser: Browser, one: Path, tmp_path: Path) -> None:
    browser.open(one, "t=1")
    browser.press("f")
    before = browser.run("document.querySelector('canvas').toDataURL()")
    browser.press("+")
    zoomed = browser.run("document.querySelector('canvas').toDataURL()")
    browser.run("document.querySelectorAll('.who tbody button')[3].click()")
    browser.settle()
    followed = browser.run("document.querySelector('canvas').toDataURL()")
    assert len({before, zoomed, followed}) == 3
    assert browser.run("document.querySelector('select[aria-label=Follow]').value") == "=Walker"
    browser.press("f")
    browser.press("-")
    assert browser.run("document.querySelector('canvas').toDataURL()") == before


def test_the_mouse_moves_zooms_and_picks(browser: Browser, one: Path) -> None:
    browser.open(one, "t=0")
    canvas = "document.querySelector('canvas')"
    rectangle = (
        f"(r => [r.left + r.width / 2, r.top + r.height / 2])({canvas}.getBoundingClientRect())"
    )
    x, y = browser.run(rectangle)
    pictures = [browser.run(f"{canvas}.toDataURL()")]
    browser.wheel(x, y, -300)
    pictures.append(browser.run(f"{canvas}.toDataURL()"))
    browser.drag(x, y, 60, 20)
    pictures.append(browser.run(f"{canvas}.toDataURL()"))
    assert len(set(pictures)) == 3
    browser.open(one, "t=0")
    browser.press("f")
    scale = browser.run(f"Math.min(Math.max({canvas}.clientWidth / 120, 6), 12)")
    browser.drag(
        x + 16.5 * scale, y
    )  # the middle of the lead's box is 16.5 m ahead of the ego's rear axle
    assert browser.run("document.querySelector('select[aria-label=Follow]').value") == f"={EVIL}"


def test_two_runs_are_side_by_side_and_say_what_differs(
    browser: Browser, results: list[RunResult], tmp_path: Path
) -> None:
    write_replay(results, tmp_path / "two.html")
    browser.open(tmp_path / "two.html", "t=3", width=1280)
    tops = browser.run(
        "[...document.querySelectorAll('.stage')].map(s => s.getBoundingClientRect().top)"
    )
    assert len(tops) == 2
    assert (
        tops[0]
        < tops[1]
        < browser.run("document.querySelector('.controls').getBoundingClientRect().top")
    )
    assert "The egos" in browser.text(".differs") or "Both egos" in browser.text(".differs")
    assert "Time to collision" in browser.text(".differs table")
    assert browser.run("document.querySelectorAll('.chart').length") == 7
    assert browser.run("document.querySelector('.chart .extremes').children.length") == 2
    assert browser.run("[...document.querySelectorAll('.badge')].map(b => b.textContent)") == [
        "failed",
        "passed",
    ]
    browser.open(tmp_path / "two.html", "t=3", width=390)
    tops = browser.run(
        "[...document.querySelectorAll('.stage')].map(s => s.getBoundingClientRect().top)"
    )
    assert tops[0] < tops[1]
    wide = browser.run(
        "[...document.querySelectorAll('.differs thead tr > *')].map(cell => cell.clientWidth)"
    )
    assert max(wide) - min(wide) < 10, "no column is squeezed"


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [360, 800, 1440])
def test_nothing_sticks_out_at_any_width_in_either_mode(
    browser: Browser, one: Path, tmp_path: Path, width: int, dark: bool
) -> None:
    browser.open(one, "t=1", width=width, dark=dark)
    assert browser.run("document.documentElement.scrollWidth") <= width
    picture = Image.open(browser.picture(tmp_path / "page.png")).convert("L")
    corner, brightest = picture.getpixel((2, 2)), picture.getextrema()
    assert isinstance(corner, int | float)
    assert (corner < 40) == dark
    assert brightest[1] - brightest[0] > 150  # type: ignore[operator]


def test_dark_and_light_differ_where_the_road_is(
    browser: Browser, one: Path, tmp_path: Path
) -> None:
    pictures = []
    for dark in (False, True):
        browser.open(one, "t=1", dark=dark)
        pictures.append(Image.open(browser.picture(tmp_path / f"{dark}.png")).convert("RGB"))
    assert ImageChops.difference(*pictures).getbbox() is not None


def test_every_control_has_a_name(
    browser: Browser, one: Path, results: list[RunResult], tmp_path: Path
) -> None:
    browser.open(one)
    assert browser.unnamed() == []
    write_replay(results, tmp_path / "two.html")
    browser.open(tmp_path / "two.html")
    assert browser.unnamed() == []


def test_the_map_stays_in_sight_beside_what_is_read(browser: Browser, one: Path) -> None:
    for width in (1400, 400):
        browser.open(one, width=width)
        browser.run("window.scrollTo(0, 1e6)")
        browser.settle()
        stage, controls = browser.run(
            "['.stage', '.controls'].map(s => "
            "document.querySelector(s).getBoundingClientRect()).map(r => [r.top, r.bottom])"
        )
        assert stage[0] >= 0.0
        assert controls[1] <= 900.0


def test_without_webgl_the_page_says_so_and_stays_as_it_is(browser: Browser, one: Path) -> None:
    browser.open(one, "t=1")
    browser.run(
        "HTMLCanvasElement.prototype.getContext = (get => function (kind, ...more) { "
        "return kind === 'webgl2' ? null : get.call(this, kind, ...more); "
        "})(HTMLCanvasElement.prototype.getContext)"
    )
    before = browser.run("document.querySelector('canvas').toDataURL()")
    browser.press("v")
    assert "WebGL" in browser.text(".note")
    assert (
        browser.run("document.querySelector('.looks [aria-pressed]').getAttribute('aria-pressed')")
        == "false"
    )
    assert browser.run("document.querySelector('canvas').toDataURL()") == before


def test_the_event_log_is_one_tab_stop_and_a_key_lists_the_keys(
    browser: Browser, one: Path
) -> None:
    browser.open(one)
    lines = "[...document.querySelectorAll('.log button')]"
    assert browser.run(f"{lines}.length") > 3
    browser.run(f"{lines}.find(line => line.tabIndex === 0).focus()")
    for key, at in (("ArrowDown", 1), ("End", -1), ("ArrowUp", -2), ("Home", 0)):
        browser.press(key)
        assert browser.run(f"{lines}.at({at}) === document.activeElement"), key
        assert browser.run(f"{lines}.filter(line => line.tabIndex === 0).length") == 1
    assert time(browser) == 0.0, "the keys of the log do not move the clock"
    browser.press("?")
    assert browser.run("document.querySelector('dialog').open")
    assert "free camera" in browser.text("dialog")
    browser.press("?")
    assert not browser.run("document.querySelector('dialog').open")


def test_a_run_without_ego_road_or_anybody_can_be_played(browser: Browser, tmp_path: Path) -> None:
    result = runner.run(
        scenario(tmp_path, "empty", entities=[car("A")], init=" ", stories=" ", stop=0.2),
        world="kinematic",
    )
    result.recording.network = None
    result.ego = None
    write_replay([result], tmp_path / "empty.html")
    browser.open(tmp_path / "empty.html")
    browser.press("End")
    assert time(browser) == pytest.approx(0.2)
    assert "no ego" in browser.text(".column")
    assert browser.run("document.querySelector('select[aria-label=Follow]').value") == "all"
