"""The report of a batch: what it says of each run, and how it looks in Chromium."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from runner.batch.batch import run_batch
from runner.batch.jobs import jobs_of
from runner.judging.settings import RunSettings
from runner.view.replay.player import keep_replay
from runner.view.report import report, varied, write_history, write_report
from schemas.common.errors import InvalidFile, UsageError
from tests.runner.chromium import Browser
from tests.runner.files import distribution, scenario


@pytest.fixture(scope="module")
def batch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Output folder of four runs, of which those with small gaps collide, and of
    a file that can't be run.
    """
    folder = tmp_path_factory.mktemp("batch")
    scenario(folder, stop=2.0)
    (folder / "bad<b>.xosc").write_text("<OpenSCENARIO/>")
    paths = [distribution(folder, "gaps", {"Gap": (10, 40, 10)}), folder / "bad<b>.xosc"]
    list(
        run_batch(
            jobs_of(paths, {}, True), RunSettings(sut=None, world="kinematic"), out=folder / "out"
        )
    )
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
    assert last["measures"]["min_ttc"] == pytest.approx(
        1.5
    )  # 20 m left at 10 m/s, minus the box of 5 m
    assert first["replay"] == "gaps~000000/replay.html"
    assert last["replay"] is None
    assert last["moment"] == 0.0
    assert values["parameters"] == ["Gap"]


def test_evidence_of_all_runs_and_the_work_are_counted(batch: Path) -> None:
    values = report(batch)
    evidence = {row["name"]: row for row in values["evidence"]}
    assert evidence["participants"]["runs"] == 4 and evidence["participants"]["below"] == 0
    assert evidence["seconds"]["worst"] == pytest.approx(2.0, abs=0.1)
    assert evidence["seconds"]["least"] == 0.1
    work = {row["name"]: (row["done"], row["planned"]) for row in values["work"]}
    assert work == {"files": (1, 2), "runs": (4, 5), "tested": (3, 5)}


def test_least_values_of_the_batch_are_those_of_its_page(tmp_path: Path) -> None:
    settings = RunSettings(sut=None, world="kinematic", least=("seconds=5",))
    jobs = jobs_of([scenario(tmp_path, stop=2.0)], {}, True)
    list(run_batch(jobs, settings, out=tmp_path / "out"))
    (row,) = (each for each in report(tmp_path / "out")["evidence"] if each["name"] == "seconds")
    assert (row["least"], row["below"]) == (5.0, 1)


def test_a_batch_without_its_work_has_a_page_all_the_same(batch: Path, tmp_path: Path) -> None:
    for name in ("batch.json", "runs.jsonl", "runs.parquet"):
        (tmp_path / name).write_bytes((batch / name).read_bytes())
    (tmp_path / "work.json").write_text('{"work": [{"name": 1}]}')
    assert report(tmp_path)["work"] == []


def test_the_page_shows_evidence_and_work(browser: Browser, batch: Path) -> None:
    browser.open(batch / "report.html")
    assert "Planned and done: files 1 of 2, runs 4 of 5, tested 3 of 5" in browser.text(
        "[aria-label=Evidence]"
    )
    count = browser.run("document.querySelectorAll('[aria-label=Evidence] tbody tr').length")
    assert count == len(report(batch)["evidence"])


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


DAMAGES: dict[str, tuple[Callable[[pa.Table], pa.Table], str]] = {
    "column gone": (lambda table: table.drop_columns(["end_time"]), "there is no column end_time"),
    "other type": (
        lambda table: table.set_column(0, "name", pa.array([[1]] * len(table))),
        r"the column name is of the type list<.*>, not string",
    ),
    "absent value": (
        lambda table: table.set_column(0, "name", pa.array([None] * len(table), pa.string())),
        "the column name has rows without a value",
    ),
    "other schema": (
        lambda table: table.rename_columns(["other", *table.column_names[1:]]),
        "there is no column name",
    ),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_table_of_runs_is_one_line_with_its_file(
    damage: str, batch: Path, tmp_path: Path
) -> None:
    change, told = DAMAGES[damage]
    for name in ("batch.json", "runs.jsonl"):
        (tmp_path / name).write_bytes((batch / name).read_bytes())
    pq.write_table(change(pq.read_table(batch / "runs.parquet")), tmp_path / "runs.parquet")
    with pytest.raises(InvalidFile, match=told) as caught:
        report(tmp_path)
    assert caught.value.path == str(tmp_path / "runs.parquet")


def test_damaged_settings_are_one_line_with_their_file(batch: Path, tmp_path: Path) -> None:
    (tmp_path / "batch.json").write_bytes(b"\xac{")
    with pytest.raises(InvalidFile, match="JSON") as caught:
        report(tmp_path)
    assert caught.value.path == str(tmp_path / "batch.json")


def test_the_page_counts_sorts_and_finds_runs(browser: Browser, batch: Path) -> None:
    browser.requests.clear()
    browser.open(batch / "report.html")
    assert browser.requests == [(batch / "report.html").as_uri()]
    rows = (
        "[...document.querySelectorAll('.runs tbody tr')].map(r => "
        "r.querySelector('td').textContent)"
    )
    assert browser.text(".verdict") == (
        "2 of 5 runs failed, 1 file could not be run, 1 run inconclusive"
    )
    failed, passed = ["gaps~000000", "gaps~000001"], ["gaps~000002", "gaps~000003"]
    assert browser.run(rows) == [*failed, "bad_b_", *passed]
    legend = browser.run("[...document.querySelectorAll('.legend li')].map(l => l.textContent)")
    assert legend == ["2 failed", "1 error", "1 inconclusive", "1 passed"]
    browser.run(
        "[...document.querySelectorAll('.runs th button')].find(b => b.textContent === "
        "'Gap').click()"
    )
    browser.run(
        "[...document.querySelectorAll('.runs th button')].find(b => b.textContent === "
        "'Gap').click()"
    )
    assert browser.run(rows)[:2] == ["gaps~000003", "gaps~000002"]


def choose(browser: Browser, selector: str, value: str) -> None:
    browser.run(
        f"(s => {{ s.value = {json.dumps(value)}; for (const kind of ['input', 'change']) "
        f"s.dispatchEvent(new Event(kind)); }})"
        f"(document.querySelector({json.dumps(selector)}))"
    )


def test_filters_act_on_table_groups_and_plots(browser: Browser, batch: Path) -> None:
    browser.open(batch / "report.html")
    seen = {
        "rows": "document.querySelectorAll('.runs tbody tr').length",
        "groups": "document.querySelectorAll('details.group').length",
        "histogram": "document.querySelector('.histograms p').textContent.split(' ')[0]",
        "scatter": "document.querySelector('.scatter > p').textContent.split(' ')[0]",
    }
    assert {name: browser.run(script) for name, script in seen.items()} == {
        "rows": 5, "groups": 2, "histogram": "4", "scatter": "4",
    }  # fmt: skip
    choose(browser, "input[type=search]", "collision")
    assert {name: browser.run(script) for name, script in seen.items()} == {
        "rows": 2, "groups": 1, "histogram": "2", "scatter": "2",
    }  # fmt: skip
    reasons = browser.run("[...document.querySelectorAll('.runs td.why')].map(t => t.textContent)")
    assert all("collision" in text for text in reasons)
    assert (
        browser.run("document.querySelector('.runs tbody a').getAttribute('href')")
        == "gaps~000000/replay.html#t=0"
    )
    choose(browser, "select[aria-label=Verdict]", "passed")
    assert browser.run(seen["rows"]) == 0


def test_a_question_filters_runs_and_says_what_it_does_not_understand(
    browser: Browser, batch: Path
) -> None:
    browser.open(batch / "report.html")
    count = "document.querySelectorAll('.runs tbody tr').length"
    box = "input.question"
    for question, left in [
        ("state = 'failed'", 2), ("Gap > 0 and verdict = 'passed'", 1), ("end_time is null", 1),
        ("", 5),
    ]:  # fmt: skip
        choose(browser, box, question)
        assert (browser.run(count), browser.text(".fault")) == (left, ""), question
    choose(browser, box, "state = 'failed'")
    choose(browser, box, "speed < 2")
    assert browser.run(count) == 2, "what is not understood leaves the rows as they are"
    assert browser.text(".fault").startswith(
        "position 1 (speed): there is no such column; columns: "
    )
    choose(browser, box, "")
    assert (browser.run(count), browser.text(".fault")) == (5, "")


ROOT = Path(__file__).parents[3]
_TABLE = {
    "name": ["a", "b'c", None, "US-101 x"],
    "speed": [1.5, None, -2.0, 30.0],
    "hit": [True, False, None, True],
}
_QUESTIONS = [
    "speed < 2", "not speed < 2", "speed >= 100 km/h", "speed between -2 and 1.5 or hit", "hit",
    "not hit", "hit = false",
    "name in ('a', \"b'c\")", "name not in ('a')", "name like 'US-101%'", "name like '_'",
    "not name like '%''%'", "name is null",
    "speed is not null and (name = 'a' or hit != true)", "speed > 1 AND NOT name = 'a'",
    "1.5 = speed", "speed not between 0 and 5",
    "not (speed > 0 or hit)", "speed <> 30",
]  # fmt: skip
_FAULTS = [
    "", "speed", "speed <", "sped < 2", "speed < 'a'", "hit < true", "name = 'a", "name like 2",
    "speed in 2", "(speed < 2",
    "speed < 2 name", "speed between 1", "speed ; 2", "is null", "name is 2",
]  # fmt: skip


def test_a_page_answers_as_the_command_does(browser: Browser, batch: Path) -> None:
    import pyarrow as pa

    from schemas.common.errors import UsageError
    from xosc.listing.questions import condition

    table = pa.table({**_TABLE, "row": list(range(4))})
    kinds = {"name": "text", "speed": "number", "hit": "truth", "row": "number"}
    rows = [{name: values[row] for name, values in _TABLE.items()} for row in range(4)]
    source = (ROOT / "runner" / "view" / "page" / "question.js").read_text(encoding="utf-8")
    browser.open(batch / "report.html")

    def asked(question: str) -> object:
        return browser.run(
            f"(() => {{ {source} const kinds = new Map(Object.entries({json.dumps(kinds)})); try {{"
            f" const met = condition({json.dumps(question)}, kinds, (row, name) => row[name]);"
            f" return {json.dumps(rows)}.flatMap((row, i) => met(row) === true ? [i] : []); }}"
            " catch (error) { return error.name + ' ' + error.message; } })()"
        )

    for question in _QUESTIONS:
        found = table.filter(condition(question, table.schema).expression)
        assert asked(question) == found["row"].to_pylist(), question
    for question in _FAULTS:
        with pytest.raises(UsageError) as refused:
            condition(question, table.schema)
        said, own = str(asked(question)), refused.value.message.removeprefix("condition, ")
        assert said.startswith("SyntaxError position"), (question, said)
        assert said.removeprefix("SyntaxError ").partition(";")[0] == own.partition(";")[0]


def test_a_grid_of_parameters_is_a_matrix(browser: Browser, batch: Path) -> None:
    browser.open(batch / "report.html")
    assert browser.run("[...document.querySelectorAll('.matrix thead th')].map(c => "
                       "c.textContent)") == [
        "Gap", "10", "20", "30", "40",
    ]  # fmt: skip
    cells = browser.run(
        "[...document.querySelectorAll('.matrix td')].map(c => [c.className, c.textContent])"
    )
    assert [kind for kind, _ in cells] == ["failed", "failed", "inconclusive", "passed"]
    assert [text for _, text in cells][:2] == ["✕ 10", "✕ 10"]
    label = browser.run("document.querySelector('.matrix td a').getAttribute('aria-label')")
    assert label.startswith("Gap 10: 1 of 1 failed, collision with ")


def test_an_earlier_batch_is_compared_with(browser: Browser, batch: Path, tmp_path: Path) -> None:
    later = [distribution(scenario(tmp_path, stop=2.0).parent, "gaps", {"Gap": (10, 50, 20)})]
    list(
        run_batch(
            jobs_of(later, {}, True),
            RunSettings(sut=None, world="kinematic"),
            out=tmp_path / "later",
        )
    )
    write_report(tmp_path / "later", batch)
    browser.open(tmp_path / "later" / "report.html")
    kinds = browser.run(
        "[...document.querySelectorAll('[aria-label=History] summary')].map(s => s.textContent)"
    )
    assert kinds == ["2does not pass, as before", "1is new", "3only in the earlier batch"]
    assert browser.text("[aria-label=History] h2") == "Since out"


def test_the_axes_of_a_matrix_of_three_parameters_are_chosen(
    browser: Browser, tmp_path: Path
) -> None:
    scenario(tmp_path, stop=2.0)
    sets = {"Gap": (10, 30, 10), "Ego_Speed": (15, 20, 5), "Lead_Speed": (5, 10, 5)}
    paths = [distribution(tmp_path, "gaps", sets)]
    list(
        run_batch(
            jobs_of(paths, {}, True), RunSettings(sut=None, world="kinematic"), out=tmp_path / "out"
        )
    )
    browser.open(write_report(tmp_path / "out"))
    heads = "[...document.querySelectorAll('.matrix thead th')].map(c => c.textContent)"
    cells = "[...document.querySelectorAll('.matrix td')].map(c => c.textContent)"
    assert browser.run(heads) == ["Gap →Ego_Speed ↓", "10", "20", "30"]
    assert browser.run(cells)[0] == "✕ 2/2", "of both values of the third parameter"
    choose(browser, "select[aria-label=Across]", "Ego_Speed")
    assert browser.run(heads) == ["Ego_Speed →Gap ↓", "15", "20"], "axes change places"
    choose(browser, ".group select[aria-label=Down]", "Lead_Speed")
    assert browser.run(heads)[0] == "Ego_Speed →Lead_Speed ↓"
    choose(browser, ".group select[aria-label=Gap]", "2")
    assert all("/" not in text for text in browser.run(cells)), (
        "one run a cell, with the gap of 30 m"
    )
    assert browser.unnamed() == [] and browser.errors == []


def test_failures_of_one_cause_are_folded(browser: Browser, tmp_path: Path) -> None:
    scenario(tmp_path, stop=3.0)
    paths = [distribution(tmp_path, "gaps", {"Gap": (10, 22, 3)})]
    settings = RunSettings(
        sut=None, world="kinematic", end_after_collision=False, fail_if=("end_time>1",)
    )
    list(run_batch(jobs_of(paths, {}, True), settings, out=tmp_path / "out"))
    browser.open(write_report(tmp_path / "out"))
    causes = browser.run("[...document.querySelectorAll('.cause summary')].map(s => s.textContent)")
    assert causes == ["5 runscollision with Lead at … s"]
    assert browser.run("document.querySelectorAll('.cause li').length") == 0
    browser.run("document.querySelector('.cause summary').click()")
    browser.settle()
    assert browser.run("document.querySelectorAll('.cause li').length") == 5


@pytest.mark.slow
def test_runs_that_changed_are_played_beside_what_they_were(
    browser: Browser, tmp_path: Path
) -> None:
    scenario(tmp_path, stop=2.0)
    paths = [distribution(tmp_path, "gaps", {"Gap": (10, 40, 15)})]
    for name, limits in (("first", ()), ("second", ("min_ttc<5",)), ("third", ("min_ttc<1",))):
        settings = RunSettings(sut=None, world="kinematic", fail_if=limits)
        also = [partial(keep_replay, out=tmp_path / name)]
        list(run_batch(jobs_of(paths, {}, True), settings, out=tmp_path / name, also=also))
    write_report(tmp_path / "second", tmp_path / "first")
    browser.open(tmp_path / "second" / "report.html")
    links = (
        "[...document.querySelectorAll('[aria-label=History] a')].filter(a => a.textContent === "
        "'before and after')"
    )
    pairs = browser.run(f"{links}.map(a => a.getAttribute('href'))")
    assert pairs == [
        f"{name}/before-and-after.html" for name in ("gaps~000002", "gaps~000000", "gaps~000001")
    ]
    browser.open(tmp_path / "second" / "gaps~000002" / "before-and-after.html")
    assert "before: gaps~000002" in browser.text("body") and "now: gaps~000002" in browser.text(
        "body"
    )
    path = write_history([tmp_path / name for name in ("first", "second", "third")])
    assert path == tmp_path / "third" / "history.html"
    browser.open(path)
    assert (
        browser.text(".verdict") == "third against second: 0 new failures, 1 fixed, 2 still failing"
    )
    states = (
        "[...document.querySelectorAll('.runs tbody tr')].map(r => "
        "[...r.querySelectorAll('.badge')].map(b => b.textContent))"
    )
    assert browser.run(states) == [
        ["passed", "failed", "passed"],
        ["failed"] * 3,
        ["failed"] * 3,
    ], "changes come first"
    choose(browser, "select[aria-label=Change]", "fixed")
    assert browser.run(states) == [["passed", "failed", "passed"]]
    href = browser.run("document.querySelector('.runs tbody a').getAttribute('href')")
    assert href.startswith("../first/gaps~00000") and (path.parent / href).is_file()
    assert browser.unnamed() == [] and browser.errors == []


def test_a_history_needs_different_batches(batch: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="given twice"):
        write_history([batch, batch])
    with pytest.raises(UsageError, match="not the output folder of a batch"):
        write_history([batch, tmp_path])


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [360, 1280])
def test_nothing_sticks_out_at_any_width(
    browser: Browser, batch: Path, width: int, dark: bool
) -> None:
    browser.open(batch / "report.html", width=width, dark=dark)
    assert browser.run("document.documentElement.scrollWidth") <= width
    assert browser.run("document.querySelectorAll('.histograms canvas').length") >= 4


def test_every_control_has_a_name(browser: Browser, batch: Path) -> None:
    browser.open(batch / "report.html")
    assert browser.unnamed() == []


def test_the_scatter_shows_runs_where_they_are_and_names_its_axes(
    browser: Browser, batch: Path
) -> None:
    """Runs in one place are one mark with their number; nobody is moved aside."""
    browser.open(batch / "report.html", width=1280)
    browser.run(
        "CanvasRenderingContext2D.prototype.fillText = new "
        "Proxy(CanvasRenderingContext2D.prototype.fillText,"
        " { apply(f, self, given) { (window.texts ??= []).push(given[0]); return Reflect.apply(f, "
        "self, given); } })"
    )
    choose(browser, ".scatter select[aria-label=Up]", "end")
    texts = browser.run("window.texts")
    assert "Gap" in texts
    assert "End (s)" in texts


def test_points_of_the_scatter_tell_which_run_they_are(browser: Browser, batch: Path) -> None:
    browser.open(batch / "report.html", width=1280)
    script = """(canvas => { const box = canvas.getBoundingClientRect(), found = new Set();
      for (let x = 0; x < box.width; x += 6) for (let y = 0; y < box.height; y += 6) {
        canvas.dispatchEvent(new MouseEvent('mousemove', { clientX: box.left + x, clientY: box.top + y }));
        found.add(document.querySelector('.scatter p').textContent.split(':')[0]); }
      return [...found].filter(name => name.startsWith('gaps~')).sort(); })(document.querySelector('.scatter canvas'))"""
    assert browser.run(script) == [f"gaps~00000{number}" for number in range(4)]


def test_the_worst_runs_are_unlike_each_other(
    batch: Path, browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    values = report(batch)
    (like, *_) = (run for run in values["runs"] if run["state"] == "failed")
    contacts = [
        ("hard", "front at 9 m/s", 9.0),
        ("like", "front at 8 m/s", 8.0),
        ("side", "side", 2.0),
    ]
    values["runs"] = [
        {
            **like,
            "name": name,
            "impact": told,
            "measures": {**like["measures"], "impact_speed": speed},
        }
        for name, told, speed in contacts
    ]
    values["parameters"] = [*values["parameters"], "Elsewhere"]
    monkeypatch.setattr("runner.view.report.report", lambda _: values)
    written = write_report(batch)
    browser.open(written)
    rows = "document.querySelectorAll('[aria-label^=Worst] tbody tr')"
    told = browser.run(f"[...{rows}].map(row => row.cells[0].textContent).join()")
    found = browser.run(f"[...{rows}].map(row => row.cells[0].firstChild.textContent)")
    monkeypatch.undo()
    write_report(batch)
    assert found == ["hard", "side", "like"]
    assert "=" in told and "Elsewhere" not in told, "the parameters of another scenario"


def test_rows_are_cards_on_a_narrow_screen(batch: Path, browser: Browser) -> None:
    browser.open(batch / "report.html", width=390)
    assert (
        browser.run("getComputedStyle(document.querySelector('.runs tbody tr')).display") == "grid"
    )
    assert browser.run("document.querySelector('.runs tbody td.name').dataset.title") == "run"
    assert browser.run("document.documentElement.scrollWidth") <= 390
