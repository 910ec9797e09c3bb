"""Draws for reviewers, their page in a headless Chromium, and the figures of their answers."""

from __future__ import annotations

import csv
import io
import json
import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.judging.draws import (
    BASELINE,
    BOTH,
    MODEL,
    RULES,
    Finding,
    Library,
    baseline,
    draw_findings,
    draw_hidden,
    draw_vehicles,
    find,
    read_findings,
    write_findings,
)
from benchmarks.judging.items import COLUMNS, write_items
from benchmarks.judging.kinematics import instants
from benchmarks.judging.report import (
    Answers,
    Event,
    bootstrap,
    interval,
    precision_cases,
    read_answers,
    recall_cases,
    report,
)
from recognition.catalogue.detect import ByRules, Moment
from runner.engine.participants.declaration import BoundingBox
from runner.recording import Recording, Track
from schemas.common.errors import InvalidFile
from tests.recognition import motorway
from tests.runner.chromium import Browser


class Model(ByRules):
    """A model that sees lane changes as the rules do, and enters ramps wherever
    they see another class.
    """

    sorted_by = "model"

    def moments(self, name: str) -> list[Moment]:
        """The rules' moments with other classes."""
        ours = super().moments(name)
        return [
            one if "lane change" in one.title else replace(one, title="ramp entering", partner=None)
            for one in ours
        ]


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("judging") / "recordings"
    motorway.write_motorway(folder)
    return folder


@pytest.fixture(scope="module")
def found(recordings: Path) -> list[Finding]:
    return find([recordings], Model())


@pytest.fixture(scope="module")
def drawn(recordings: Path, found: list[Finding]) -> Path:
    out = recordings.parent / "drawn"
    write_items(
        draw_findings(found, 1, 1), Library([recordings]), out, recordings.parent / "key.json"
    )
    return out


def key(drawn: Path) -> list[dict[str, Any]]:
    return json.loads((drawn.parent / "key.json").read_text())["items"]


def test_findings_are_of_rules_of_the_model_or_of_both(
    found: list[Finding], tmp_path: Path
) -> None:
    assert {one.title for one in found if one.source == BOTH} == {
        "left lane change",
        "right lane change",
    }
    assert {one.title for one in found if one.source == MODEL} == {"ramp entering"}
    assert {"highway cut in", "highway car following"} <= {
        one.title for one in found if one.source == RULES
    }
    write_findings(found, tmp_path / "findings.json")
    assert read_findings(tmp_path / "findings.json") == found


def test_unreadable_recordings_are_named_and_left_out(
    recordings: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    shutil.copytree(recordings, tmp_path / "all")
    tracks = next((tmp_path / "all").glob("*_tracks.csv"))
    tracks.write_text(tracks.read_text()[:5000])
    assert find([tmp_path / "all"], Model()) == []
    assert capsys.readouterr().err.startswith(f"left out: {tracks}")


def test_a_draw_has_every_source_and_class_and_weights_of_the_population(
    found: list[Finding],
) -> None:
    items = draw_findings(found, 9, 1)
    chosen = [item.finding for item in items if item.finding]
    assert {(one.source, one.title) for one in chosen} == {(one.source, one.title) for one in found}
    for source in (RULES, MODEL, BOTH):
        total = sum(item.weight for item in items if item.finding and item.finding.source == source)
        assert total == pytest.approx(sum(one.source == source for one in found))
    assert items == draw_findings(found, 9, 1)
    assert chosen != sorted(chosen, key=lambda one: one.source), "sources are mixed"


def test_vehicles_are_drawn_once_with_what_was_found_in_their_stretch(
    recordings: Path, found: list[Finding]
) -> None:
    library = Library([recordings])
    items = draw_vehicles(found, library, 3, 0)
    assert len({item.vehicle for item in items}) == len(items) == 3
    for item in items:
        expected = [one for one in found if one.vehicle == item.vehicle]
        own = {one for one in item.found if one.source != BASELINE}
        assert own <= {*expected} and all(
            one.end > item.start and one.start < item.end for one in own
        )
    assert draw_vehicles(found, library, 3, 1) != items


def moving(name: str, place: Callable[[float], tuple[float, float]]) -> Track:
    """A car whose centre is at a place (m) at each time (s) up to 20 s."""
    time = np.arange(0.0, 20.0, 0.1)
    x, y = np.array([place(each) for each in time.tolist()]).T
    vx, vy = np.gradient(x, time), np.gradient(y, time)
    speed = np.hypot(vx, vy)
    columns = {
        "time": time,
        "x": x,
        "y": y,
        "h": np.arctan2(vy, vx),
        "speed": speed,
        "acceleration": np.gradient(speed, time),
    }
    return Track(name, "vehicle", "car", BoundingBox(0.0, 0.0, 0.0, 4.5, 1.8, 1.5), lambda: columns)


def ways(**places: Callable[[float], tuple[float, float]]) -> dict[str, set[str]]:
    """Reasons for which vehicles of these ways are singled out."""
    recording = Recording([moving(name, place) for name, place in places.items()], 0.1, None)
    return {name: {one.reason for one in found} for name, found in instants(recording).items()}


def corner(time: float) -> tuple[float, float]:
    """A left turn of 90 degrees in 3 s, from 8 s on."""
    angle = min(max(time - 8.0, 0.0), 3.0) * math.pi / 6.0
    after = max(time - 11.0, 0.0)
    return 10.0 * min(time, 8.0) + 19.1 * math.sin(angle), 19.1 * (
        1.0 - math.cos(angle)
    ) + 10.0 * after


def beside(time: float) -> tuple[float, float]:
    """To the lane on the right, 3.5 m in 4 s from 6 s on, ahead of a vehicle at the same speed."""
    done = min(max(time - 6.0, 0.0), 4.0) / 4.0
    return 15.0 + 15.0 * time, 3.5 * (1.0 - done * done * (3.0 - 2.0 * done))


def test_kinematics_single_out_what_turns_shifts_brakes_meets_parts_and_crosses() -> None:
    straight = {"steady": lambda t: (15.0 * t, 0.0)}
    assert ways(**straight) == {"steady": set()}
    assert ways(turning=corner) == {"turning": {"turns", "shifts"}}, (
        "the beginning of a turn shifts it"
    )
    assert ways(**straight, changing=beside) == {"steady": {"meets"}, "changing": {"shifts"}}
    leaving = ways(**straight, leaving=lambda t: (beside(t)[0], 3.5 - beside(t)[1]))
    assert leaving == {"steady": {"parts"}, "leaving": {"shifts"}}
    assert ways(
        braking=lambda t: (30.0 * t - 2.0 * min(t, 7.0) ** 2 - 28.0 * max(t - 7.0, 0.0), 0.0)
    ) == {"braking": {"brakes"}}
    crossing = ways(**straight, crossing=lambda t: (150.0, 12.0 * (t - 11.5)))
    assert crossing == {"steady": {"crosses"}, "crossing": {"crosses", "meets", "parts"}}, (
        "the other one passes ahead of it"
    )
    late = ways(**straight, late=lambda t: (150.0, 12.0 * (t - 18.0)))
    assert late == {"steady": set(), "late": set()}


def test_stretches_that_are_singled_out_hold_their_moment(
    recordings: Path, found: list[Finding]
) -> None:
    library = Library([recordings])
    items = draw_vehicles(found, library, 10, 0, singled_out=True)
    (name,) = {item.recording for item in items}
    moments = library.instants(name)
    assert {item.vehicle for item in items} == {
        vehicle for vehicle, each in moments.items() if each
    }
    for item in items:
        assert any(item.start <= one.time <= item.end for one in moments[item.vehicle])
        assert item.end - item.start <= 10.0


def test_recordings_that_cannot_be_read_are_left_out_of_a_draw(
    recordings: Path, tmp_path: Path
) -> None:
    shutil.copytree(recordings, tmp_path / "all")
    tracks = next((tmp_path / "all").glob("*_tracks.csv"))
    tracks.write_text(tracks.read_text()[:5000])
    assert draw_vehicles([], Library([tmp_path / "all"]), 3, 0) == []


def test_the_plain_baseline_sees_lanes_and_headings_only(
    recordings: Path, found: list[Finding]
) -> None:
    library = Library([recordings])
    name = found[0].recording
    for vehicle in library.recording(name).tracks:
        plain = baseline(library, name, "", vehicle, 0.0, 1000.0)
        assert {one.title for one in plain} == {
            one.title
            for one in found
            if one.vehicle == vehicle and one.source == BOTH and "lane change" in one.title
        }
    assert {one.source for one in plain} <= {BASELINE}


def test_nothing_that_reviewers_see_tells_who_found_it(drawn: Path) -> None:
    items = key(drawn)
    assert {item["finding"]["source"] for item in items} == {RULES, MODEL, BOTH}
    for path in (*drawn.glob("*.txt"), drawn / "answers.csv"):
        assert not any(
            word in path.read_text() for word in ("rules", "model", "both", "trust", "confidence")
        )
    text = (drawn / "index.html").read_text()
    shown = json.loads(text[text.index('id="data">') + len('id="data">') : text.index("</script>")])
    assert {*shown["items"][0]} == {"title", "text"} and "weight" not in shown
    assert len([*drawn.glob("*.png")]) == len(items) == len(shown["films"])
    text = (drawn / "000.txt").read_text()
    assert (
        items[0]["finding"]["title"] in text.splitlines()[0]
        and "ego road" in text
        and "ahead" in text
    )


def test_keys_answer_and_the_table_holds_verdicts_and_events(drawn: Path, tmp_path: Path) -> None:
    page = tmp_path / "page" / "index.html"
    page.parent.mkdir()
    shutil.copy(drawn / "index.html", page)
    saved = "new Promise(done => { HTMLAnchorElement.prototype.click = () => {}; "
    saved += "URL.createObjectURL = blob => { blob.text().then(done); return '#'; }; "
    saved += "document.dispatchEvent(new KeyboardEvent('keydown', {key: 's'})); })"
    with Browser(tmp_path) as browser:
        browser.open(page)
        press = "document.dispatchEvent(new KeyboardEvent('keydown', {{key: '{}'}}))"
        for letter in ("r", "w", "m", "e", "u"):
            browser.run(press.format(letter))
        rows = [*csv.DictReader(io.StringIO(browser.run(saved)))]
        assert browser.errors == [] and browser.unnamed() == []
    assert tuple(rows[0]) == COLUMNS
    assert [(row["item"], row["answer"], row["class"]) for row in rows] == [
        ("0", "right", ""),
        ("1", "wrong", ""),
        ("2", "unclear", ""),
        ("2", "event", "left lane change"),
    ]
    about = key(drawn)[2]["finding"]["time"]
    assert abs(float(rows[3]["time"]) - about) < 15.0


def judged(source: str, title: str, time: float = 5.0) -> dict[str, Any]:
    return Finding("one", "a", "7", None, title, time, time - 0.75, time + 0.75, source).__dict__


def item(site: str, **more: Any) -> dict[str, Any]:
    return {
        "site": site,
        "set": "x",
        "weight": 1.0,
        "start": 0.0,
        "end": 20.0,
        "finding": None,
        "found": [],
        **more,
    }


def test_precision_counts_unclear_as_wrong_and_both_for_either_source() -> None:
    items = [
        item("a", finding=judged(BOTH, "left lane change")),
        item("b", finding=judged(RULES, "highway cut in")),
    ]
    cases = precision_cases(items, Answers({0: "right", 1: "unclear"}, {}))
    assert sorted((case.source, case.yes) for case in cases) == [
        ("both agree", True),
        ("model", True),
        ("rules", False),
        ("rules", True),
        ("rules alone", False),
    ]


def test_recall_wants_the_class_at_the_time() -> None:
    found = [judged(RULES, "left lane change"), judged(MODEL, "highway cut in")]
    answers = Answers(
        {0: "complete", 1: "complete"},
        {0: [Event("left lane change", 7.5), Event("highway cut in", 9.0)]},
    )
    cases = {
        (case.source, case.title): case.yes
        for case in recall_cases([item("a", found=found), item("b")], answers)
    }
    assert cases["rules", "left lane change"] and not cases["model", "left lane change"]
    assert not cases["model", "highway cut in"], "3.25 s after the window"


def test_intervals() -> None:
    assert interval(9, 10) == pytest.approx((0.596, 0.982), abs=1e-3)
    items = [item(site, finding=judged(RULES, "highway cut in")) for site in "aabb"]
    cases = precision_cases(
        items, Answers(dict(enumerate(("right", "right", "wrong", "wrong"))), {})
    )
    assert bootstrap([case for case in cases if case.source == "rules"]) == (0.0, 1.0), (
        "two sites differ in all"
    )


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("7,right,,,", r"answers.csv:2: item '7' is none of 0 to 1"),
        ("0,correct,,,", "answer 'correct' is none of right, wrong, unclear, event"),
        ("0,event,overtaking,3,", "class 'overtaking' is none of"),
        ("0,event,left lane change,soon,", "time 'soon' is no number"),
        ("0,,,,", "there is no answer"),
    ],
)
def test_answers_are_checked(tmp_path: Path, row: str, message: str) -> None:
    path = tmp_path / "answers.csv"
    path.write_text(f"{','.join(COLUMNS)}\n{row}\n")
    with pytest.raises(InvalidFile, match=message):
        read_answers(path, 2, True)


def test_two_reviewers_are_reported_side_by_side(drawn: Path, tmp_path: Path) -> None:
    count = len(key(drawn))
    for name, wrong in ("first", 0), ("second", 1):
        rows = [f"{number},{'wrong' if number == wrong else 'right'},,," for number in range(count)]
        (tmp_path / f"{name}.csv").write_text("\n".join([",".join(COLUMNS), *rows]) + "\n")
    text = report(drawn.parent / "key.json", [tmp_path / "first.csv", tmp_path / "second.csv"])
    assert "## precision, first" in text and "## precision, second" in text
    assert f"Of {count} items that both judged, they agree on {count - 2}" in text


def test_reviewers_may_have_to_say_the_class(
    recordings: Path, found: list[Finding], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    heads: list[str] = []
    monkeypatch.setattr("matplotlib.figure.Figure.suptitle", lambda _, text: heads.append(text))
    library = Library([recordings])
    items = draw_hidden(find([recordings], None), library, 3, 1)
    assert {item.finding.source for item in items if item.finding} == {RULES}
    assert len(items) == len({item.finding.title for item in items if item.finding}) > 3
    write_items(items, library, tmp_path / "hidden", tmp_path / "key.json")
    for number, item in enumerate(items):
        assert item.finding is not None
        text = (tmp_path / "hidden" / f"{number:03}.txt").read_text()
        assert "which event is this?" in text and item.finding.title not in text
        assert "which event" in heads[number] and item.finding.title not in heads[number]
        assert item.finding.title not in (tmp_path / "hidden" / "answers.csv").read_text()
    first = items[0].finding
    assert first is not None
    answers = tmp_path / "answers.csv"
    rows = [f"0,event,{first.title},1.0,", "0,complete,,,", "1,event,ramp exiting,1.0,"]
    answers.write_text(
        "\n".join((",".join(COLUMNS), *rows, "1,complete,,,", "2,unclear,,,")) + "\n"
    )
    assert "| rules | 1 of 3 |" in report(tmp_path / "key.json", [answers])
