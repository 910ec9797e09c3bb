"""The page of a catalogue in a headless Chromium, its films, and the exposure beside the index."""

from __future__ import annotations

import csv
import json
import re
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from recognition.catalogue import exposure, pipeline
from recognition.catalogue.detect import ByRules
from recognition.catalogue.exposure import Mileage, exposure_of, interval, rates
from recognition.catalogue.recordings import CatalogueSettings
from recognition.labels.classes import Rules
from schemas.common.terminal.command_line import progress_bar
from tests.recognition import motorway
from tests.recognition.built_scenes import Driver, recording
from tests.runner.chromium import Browser


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    recordings, out = tmp_path_factory.mktemp("recordings"), tmp_path_factory.mktemp("catalogue")
    motorway.write_motorway(recordings)
    pipeline.build(
        [recordings], out, CatalogueSettings(), ByRules, partial(progress_bar, quiet=True)
    )
    return out


def data(made: Path) -> dict:
    text = (made / "index.html").read_text(encoding="utf-8")
    return json.loads(re.search(r'id="data">(.*?)</script>', text)[1])


def rows(made: Path) -> list[dict]:
    return json.loads((made / "index.json").read_text())["scenarios"]


@pytest.mark.parametrize(
    ("count", "low", "high"), [(0, 0.0, 3.6889), (1, 0.0253, 5.5716), (10, 4.7954, 18.3904)]
)
def test_intervals_are_exact(count: int, low: float, high: float) -> None:
    """Values of Garwood's table."""
    assert interval(count) == pytest.approx((low, high), abs=1e-4)


def test_rates_cover_every_class_at_every_site_and_all_together() -> None:
    events = [{"site": "a", "class": "cut in"}] * 3 + [{"site": "b", "class": "cut out"}]
    found = rates(
        events,
        [
            ("a", Mileage(2, 3600.0, 5e4)),
            ("a", Mileage(1, 3600.0, 5e4)),
            ("b", Mileage(1, 1800.0, 0.0)),
        ],
    )
    table = {(row["site"], row["class"]): row for row in found}
    assert table.keys() == {
        (site, title) for site in ("a", "b", "all") for title in ("cut in", "cut out", "all")
    }
    cut_in = table["a", "cut in"]
    assert (
        cut_in["events"],
        cut_in["vehicles"],
        cut_in["vehicle_hours"],
        cut_in["vehicle_km"],
    ) == (3, 3, 2.0, 100.0)
    assert (cut_in["per_hour"], cut_in["per_1000_km"]) == (1.5, 30.0)
    assert (
        cut_in["per_hour_low"] == pytest.approx(0.6187 / 2.0, abs=1e-4)
        and cut_in["per_hour_low"] < 1.5 < cut_in["per_hour_high"]
    )
    assert table["a", "cut out"]["per_hour_high"] == pytest.approx(3.6889 / 2.0, abs=1e-4)
    assert table["b", "cut out"]["per_1000_km"] is None, "nothing moved there"
    assert table["all", "all"]["events"] == 4 and table["all", "all"]["vehicle_hours"] == 2.5


def test_exposure_is_that_of_motor_vehicles_that_move() -> None:
    found = exposure_of(
        recording([Driver("moving", speed=10.0), Driver("parked", x=50.0)]), Rules()
    )
    assert found.vehicles == 1 and found[1:4] == pytest.approx((4.0, 40.0, 1.0))


def test_exposure_is_beside_the_index(made: Path) -> None:
    found = pq.read_table(made / "exposure.parquet").to_pylist()
    assert [*found[0]] == [*exposure.COLUMNS]
    with (made / "exposure.csv").open(newline="") as file:
        assert [row["class"] for row in csv.DictReader(file)] == [row["class"] for row in found]
    total = found[-1]
    assert total["events"] == len(rows(made))
    driven = sum(
        abs(np.sum([drive.velocity(frame / 25.0)[0] / 25.0 for frame in range(drive.frames)]))
        for drive in motorway.DRIVES
    )
    assert total["vehicle_km"] == pytest.approx(driven / 1e3, rel=0.02)


def test_films_show_what_was_recorded(made: Path) -> None:
    found, told = data(made), rows(made)
    row = next(
        i
        for i, each in enumerate(told)
        if each["class"] == "highway cut in" and each["vehicle"] == motorway.EGO
    )
    x, _, start, paired, ego, cutter, *_ = found["films"][row]
    assert paired == 1 and ego[:2] == [40, 20], "decimetres of a car"
    steps = np.array(ego[3:]).reshape(-1, 3)
    assert np.abs(steps[1:, 0]).mean() == pytest.approx(10 * 30.0 * found["step"], rel=0.02), (
        "30 m/s"
    )
    at_event = ego[2] + round(-start / found["step"])
    assert abs(steps[: at_event + 1, 0].sum()) < 20, "the ego is at the origin at the event"
    assert abs(np.array(cutter[3:]).reshape(-1, 3)[1:, 1].sum()) > 25, "the partner changes lane"
    assert found["roads"] and all(len(line) >= 4 for line in found["roads"][0]) and np.isfinite(x)


@pytest.mark.slow
def test_the_page_filters_plays_and_links_to_files_that_are_there(
    made: Path, tmp_path: Path
) -> None:
    told = rows(made)
    with Browser(tmp_path) as browser:
        for width in (1400, 390):
            browser.open(made / "index.html", width=width, dark=width < 600)
            assert browser.run("document.documentElement.scrollWidth") <= width
            assert browser.run("document.querySelectorAll('.card').length") == len(told)
        browser.run("document.querySelector('.counts tbody button').click()")
        first = sorted({row["class"] for row in told})[0]
        count = sum(row["class"] == first for row in told)
        assert browser.text("#count").startswith(f"{count} scenario")
        assert browser.run(
            "[...document.querySelectorAll('.card h3')].every(each => each.textContent.startsWith('"
            + first
            + "'))"
        )
        browser.run("document.querySelector('.counts tbody button').click()")
        browser.run(
            '(box => { box.value = "partial or ego_speed > 0 and file is not null";'
            " box.dispatchEvent(new Event('change')); })(document.querySelector('.question'))"
        )
        moving = sum(bool(row["partial"]) or (row["ego_speed"] or 0) > 0 for row in told)
        assert browser.text("#count").startswith(f"{moving} scenario")
        assert browser.text(".fault") == ""
        browser.run(
            "(box => { box.value = ''; box.dispatchEvent(new Event('change')); })"
            "(document.querySelector('.question'))"
        )
        links = browser.run(
            "[...document.querySelectorAll('.links a')].map(each => "
            "decodeURI(each.getAttribute('href')))"
        )
        assert links and all((made / link).is_file() for link in links)
        film = "document.querySelector('.card canvas')"
        browser.run(f"{film}.scrollIntoView()")  # out of view, it would stop when the page notices
        browser.run(f"{film}.dispatchEvent(new Event('pointerenter'))")
        script = f"""new Promise(done => {{
            const before = {film}.toDataURL();
            const changed = () => {film}.toDataURL() !== before;
            const look = left => changed() || !left ? done(left) : requestAnimationFrame(() => look(left - 1));
            look(300);
        }})"""
        assert browser.run(script) > 0, "the film plays"
        assert browser.unnamed() == [] and browser.errors == []
        assert all(address.startswith(("file:", "about:")) for address in browser.requests)
