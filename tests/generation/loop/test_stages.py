"""Stages of a loop are done once, and what they found is read back as it was."""

from __future__ import annotations

import json
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from generation.loop.findings import (
    CarefulDriver,
    CaseVerdict,
    Checked,
    DensitySource,
    EdgeCase,
    LabelledScenario,
    LoopResult,
    LoopStage,
    Measured,
    Ran,
    Recognised,
    RecognisedRun,
    Refused,
    Searched,
    SearchedRegion,
    SearchRange,
    ShownRun,
    StageFinding,
    closing,
    summary,
)
from generation.loop.runs import FinishedStages
from schemas.common.errors import UsageError

COUNT = LoopStage("count")
CASE = EdgeCase(
    "a.xosc", None, {"Gap": 5.0}, CaseVerdict.COLLISION, CarefulDriver.AVOIDS, -1.5, 0.25
)
RUN = ShownRun(
    "a",
    "failed",
    "completed",
    "collision with Lead at 2.00 s",
    3.0,
    {"min_ttc": None},
    "round_1/runs/a/replay.html#t=1",
)
REGION = SearchedRegion(
    rule="gap ≤ 5 m",
    precision=0.9,
    recall=0.8,
    failures=5,
    draws=30,
    drawn=1,
    low=0.01,
    high=0.2,
    severity=4.0,
    cases=["a.xosc"],
)
FINDINGS: list[tuple[StageFinding, str]] = [
    (Recognised(classes={"highway cut in": 2}, states={"known": 2}),
        "2 scenarios recognised: 2 known"),
    (Measured(kinds={"cut_in": 3}, failures={"b": "no such file"}),
        "manoeuvres measured: 3 cut_in"),
    (
        Searched(
            round=1, target="cut_in", title="highway cut in", scenario="cut_in_highway",
            prior=DensitySource(40, own=True),
            parameters=[SearchRange("Gap", 1.0, 9.0)], pinned={"Speed": "30"}, calls=20,
            failed_runs=1, run_error="no lane", draws=7, drawn=2,
            collisions=5, distinct=4, new=3, cases=[CASE], regions=[REGION], failed=[[5.0]],
            real=[[4.0]], tried=[[5.0]],
        ),
        "highway cut in: 7 unguided draws with 2 collisions, 20 sought runs (1 with errors or "
        "inconclusive, mostly: no lane) with 5 collisions (4 unlike each other, 3 new); "
        "1 edge case written: 1 foreseeable and preventable collision; "
        "density of 40 manoeuvres of these recordings",
    ),
    (
        Searched(round=1, target="x", title="x", scenario="x", prior=DensitySource(40, own=False),
            error="no box"),
        "x was not searched: no box",
    ),
    (Ran(files={"a.xosc": [RUN] * 5}),
        "5 runs: 0 passed, 5 failed, 0 inconclusive, 0 with errors; failed: a, a, a and 2 more"),
    (
        Ran(files={"a.xosc": [RUN]}, sampled={"a.xosc": 12}),
        ("1 run: 0 passed, 1 failed, 0 inconclusive, 0 with errors; failed: a; 11 parameter sets of 1 "
        "variation file left out (--sample)"),
    ),
    (
        RecognisedRun(runs={"a": [LabelledScenario("highway cut in", "cut_in/one.xosc")]}),
        "1 scenario recognised about the ego in 1 run of edge cases",
    ),
    (Checked(files=2, problems=["a.xosc:1: wrong"]),
        "2 files checked, 1 problem, the first: a.xosc:1: wrong"),
]  # fmt: skip


def stages(out: Path, told: list[tuple[str, bool]], **settings: Any) -> FinishedStages:
    return FinishedStages(
        out,
        {"sut": "cas", **settings},
        lambda stage, found, seconds: told.append((stage.name, seconds is not None)),
    )


@pytest.mark.parametrize(("found", "words"), FINDINGS, ids=lambda value: type(value).__name__)
def test_a_finished_stage_is_not_done_again(
    found: StageFinding, words: str, tmp_path: Path
) -> None:
    told: list[tuple[str, bool]] = []
    assert stages(tmp_path / "out", told).once(COUNT, type(found), lambda: found) is found
    assert (
        stages(tmp_path / "out", told).once(COUNT, type(found), lambda: pytest.fail("it was done"))
        == found
    )
    assert told == [("count", True), ("count", False)]
    assert summary(LoopStage("search", 2, "cut_in"), found) == f"round 2: {words}"


def test_a_stage_that_was_interrupted_is_done_again(tmp_path: Path) -> None:
    def interrupted() -> StageFinding:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stages(tmp_path / "out", []).once(COUNT, StageFinding, interrupted)
    assert stages(tmp_path / "out", []).once(
        COUNT, Measured, lambda: Measured(kinds={"a": 1})
    ).kinds == {"a": 1}


@pytest.mark.parametrize("finished", [True, False])
def test_a_stage_of_other_content_is_done_again_without_what_was_made_of_the_old(
    tmp_path: Path, finished: bool
) -> None:
    out, made = tmp_path / "out", tmp_path / "out" / "made"

    def work(name: str) -> Measured:
        made.mkdir(exist_ok=True)
        (made / name).touch()
        if not finished and name == "old":
            raise KeyboardInterrupt
        return Measured(kinds={name: 1})

    with nullcontext() if finished else pytest.raises(KeyboardInterrupt):
        stages(out, []).once(COUNT, Measured, lambda: work("old"), "old", (made,))
    again = stages(out, [])
    assert again.has(COUNT, "old") == finished
    assert not again.has(COUNT, "new")
    assert again.once(COUNT, Measured, lambda: work("new"), "new", (made,)).kinds == {"new": 1}
    assert [path.name for path in made.iterdir()] == ["new"]


def test_each_stage_of_each_round_has_a_file_of_its_own() -> None:
    names = [LoopStage("check"), LoopStage("run", 1), LoopStage("search", 2, "cut_in")]
    assert [each.name for each in names] == ["check", "round_1_run", "round_2_search_cut_in"]


def test_other_settings_need_another_folder(tmp_path: Path) -> None:
    stages(tmp_path / "out", [], budget="10")
    with pytest.raises(UsageError, match=r"other settings \(budget\)"):
        stages(tmp_path / "out", [], budget="20")


def test_a_folder_with_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(UsageError, match="something else"):
        stages(tmp_path, [])


def damaged() -> list[str]:
    """What is no JSON, no object, and an object that lacks a field, has one too
    many, and one of another type.
    """
    case = asdict(CASE)
    searched = asdict(FINDINGS[2][0])
    wrong = [
        {**searched, "title": None},
        {**searched, "calls": "many"},
        {**searched, "colour": "red"},
        {**searched, "cases": [{**case, "verdict": "beautiful"}]},
        {**searched, "cases": {"0": case}},
        {name: value for name, value in searched.items() if name != "prior"},
    ]
    return [
        "",
        "{",
        "[1]",
        json.dumps(searched),
        *(json.dumps({"of": "", "found": each}) for each in wrong),
    ]


@pytest.mark.parametrize("text", damaged())
def test_a_damaged_stage_is_named_and_done_again(
    tmp_path: Path, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    found = FINDINGS[2][0]
    assert isinstance(found, Searched)
    stages(tmp_path, []).once(COUNT, Searched, lambda: found)
    path = tmp_path / "stages" / "count.json"
    path.write_text(text)
    told: list[tuple[str, bool]] = []
    assert not stages(tmp_path, []).has(COUNT)
    assert stages(tmp_path, told).once(COUNT, Searched, lambda: found) == found
    assert told == [("count", True)]
    assert capsys.readouterr().err == f"{path}: damaged: count is done again\n"
    stages(tmp_path, []).once(COUNT, Searched, lambda: pytest.fail("it was done"))


def test_an_edited_finding_is_found_out(tmp_path: Path) -> None:
    stages(tmp_path, []).once(COUNT, Measured, lambda: Measured(kinds={"a": 1}))
    path = tmp_path / "stages" / "count.json"
    path.write_text(path.read_text().replace('"a": 1', '"a": 2'))
    assert stages(tmp_path, []).once(COUNT, Measured, lambda: Measured(kinds={"a": 1})).kinds == {
        "a": 1
    }


@pytest.mark.parametrize("editable", [False, True])
def test_a_stage_whose_files_are_damaged_or_missing_is_done_again(
    tmp_path: Path, editable: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    out, made, done = tmp_path, (tmp_path / "made", tmp_path / "table.txt"), []

    def work() -> Measured:
        done.append(None)
        (out / "made").mkdir(exist_ok=True)
        for path in (
            out / "made" / "a",
            out / "made" / "b",
            out / "made" / ".lock",
            out / "table.txt",
        ):
            path.write_text("sound")
        return Measured(kinds={})

    def again() -> tuple[int, str]:
        before = len(done)
        stages(out, []).once(COUNT, Measured, work, "x", made, editable)
        return len(done) - before, capsys.readouterr().err

    assert again() == (1, "") and again() == (0, "")
    (out / "made" / ".lock").write_text("another")
    assert again() == (0, "")
    (out / "made" / "b").unlink()
    word = "missing" if editable else "changed or missing"
    assert again() == (1, f"{out}/made/b: {word}: count is done again\n")
    (out / "made" / "a").write_text("edited")
    (out / "table.txt").write_text("edited")
    assert again() == (
        (0, "") if editable else (1, f"{out}/made/a (and 1 more): {word}: count is done again\n")
    )


def test_reasons_of_one_kind_are_told_in_one_line() -> None:
    refused = [
        Refused("a", "no values: try --free X"),
        Refused("b", "no road"),
        Refused("c", "no values: try --free Y"),
    ]
    found = LoopResult(
        {},
        0,
        Recognised(),
        [*refused, Refused("d", "no road")],
        [],
        Ran(),
        Ran(),
        Checked(files=1, problems=[]),
    )
    assert list(closing(found)) == [
        "not searched: a, c: no values: try --free X (that is of a; the page has the others)",
        "not searched: b, d: no road",
        "nothing was searched",
    ]
