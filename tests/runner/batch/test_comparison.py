"""`xosc-run --against`: what is new, fixed and still failing since an earlier
batch, and the exit code for CI.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from runner.batch.batch import BatchComparison, EarlierRun, counterparts_of, identity
from runner.batch.jobs import Job, Outcome
from runner.batch.outputs.terminal import OutcomeTable
from tests.commands import Command
from tests.runner.files import place, scenario

CUT_IN = Path(__file__).parents[3] / "xosc" / "library" / "simple_cut_in_variation.xosc"
OPTIONS = ("--world", "kinematic", "--only")


def summary(out: str) -> list[str]:
    lines = out.splitlines()
    return lines[next(i for i, line in enumerate(lines) if line.startswith("since ")) :]


@pytest.fixture
def before(command: Command, tmp_path: Path) -> Path:
    """A batch of six runs in which one fails, by a limit."""
    out = tmp_path / "before"
    answer = command("xosc-run", CUT_IN, *OPTIONS, "0-5", "--out", out, "--sut", "adas")
    assert answer.code == 1 and "1 failed, 5 passed" in answer.out
    return out


@pytest.mark.slow
def test_only_new_failures_fail_the_command(command: Command, before: Path, tmp_path: Path) -> None:
    call = ("xosc-run", CUT_IN, *OPTIONS, "0-5", "--against", before)
    same = command(*call, "--sut", "adas", "--fail-if", "new-failure")
    assert same.code == 0
    assert summary(same.out)[0] == "since before: 0 new, 0 fixed, 1 still failing"
    assert (
        "CutIn_Gap_m=5, CutIn_LaneChangeTime_s=4 (before: failed)  collision with CutIn"
        in summary(same.out)[1]
    )
    assert command(*call, "--sut", "adas").code == 1  # without the limit every failure counts
    worse = command(
        *call, "--sut", "none", "--fail-if", "new-failure", "--out", tmp_path / "after", "--replay"
    )
    assert worse.code == 1
    new = [line for line in summary(worse.out) if line.startswith("    new ")]
    assert len(new) == 5 and all("(before: passed)" in line for line in new)
    page = Path(new[0].split()[-1])
    assert page.is_file() and page.name == "before-and-after.html"
    assert worse.out.splitlines()[-1] == f"report: {tmp_path / 'after' / 'report.html'}"


def test_a_run_that_the_earlier_batch_does_not_have_is_new(command: Command, before: Path) -> None:
    call = (
        "xosc-run",
        CUT_IN,
        *OPTIONS,
        "5,7",
        "--against",
        before,
        "--fail-if",
        "new-failure",
        "--sut",
        "none",
    )
    answer = command(*call)
    assert answer.code == 1
    assert any(
        line.startswith("    new ") and "(before: not in it)" in line
        for line in summary(answer.out)
    )


def test_what_is_fixed_is_named(command: Command, tmp_path: Path) -> None:
    bad = tmp_path / "bad"
    command("xosc-run", CUT_IN, *OPTIONS, "2,3", "--out", bad, "--sut", "none")
    answer = command(
        "xosc-run",
        CUT_IN,
        *OPTIONS,
        "2,3",
        "--against",
        bad,
        "--sut",
        "adas",
        "--fail-if",
        "new-failure",
    )
    assert answer.code == 0
    sentence = "since bad (none, now adas): 0 new, 2 fixed, 0 still failing"
    assert summary(answer.out)[0] == sentence
    quiet = command("xosc-run", CUT_IN, *OPTIONS, "2,3", "--against", bad, "--sut", "adas", "-q")
    assert quiet.out.splitlines() == [sentence], "and nothing else"


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (
            ["--fail-if", "new-failure"],
            "--fail-if new-failure needs the earlier batch: --against BATCH",
        ),
        (["--against", "absent"], "absent: there is no such folder"),
        (["--against", str(Path(CUT_IN).parent)], "not the output folder of a batch"),
        (["--against", "absent", "--dry-run"], "--against compares runs, and --dry-run has none"),
    ],
)
def test_what_can_not_be_compared_is_refused(
    command: Command, options: list[str], complaint: str
) -> None:
    answer = command("xosc-run", CUT_IN, *options)
    assert answer.code == 2 and complaint in answer.err


def test_a_file_of_one_name_in_another_folder_hides_no_new_failure(
    command: Command, tmp_path: Path
) -> None:
    safe = place("Ego", 100, 10) + place("Lead", 200, 20)
    bad, good = scenario(tmp_path / "b", "cut_in", stop=6.0), tmp_path / "a" / "cut_in.xosc"
    scenario(tmp_path / "a", "cut_in", init=safe, stop=6.0)
    options = ("--world", "kinematic", "--sut", "none")
    assert command("xosc-run", bad, good, *options, "--out", tmp_path / "before").code == 1
    against = ("--against", tmp_path / "before", "--fail-if", "new-failure")
    assert command("xosc-run", bad, good, *options, *against).code == 0
    scenario(tmp_path / "a", "cut_in", stop=6.0)
    answer = command("xosc-run", bad, good, *options, *against)
    assert answer.code == 1 and "1 new, 0 fixed, 1 still failing" in answer.out


@pytest.mark.parametrize("file", ["cut_in.xosc", "straight.xodr"])
def test_a_failure_of_a_file_that_has_changed_is_new(
    command: Command, tmp_path: Path, file: str
) -> None:
    bad, before = scenario(tmp_path, "cut_in", stop=6.0), tmp_path / "before"
    options = ("--world", "kinematic", "--sut", "none")
    against = ("--against", before, "--fail-if", "new-failure", "--replay", "--out")
    assert command("xosc-run", bad, *options, "--out", before).code == 1
    assert command("xosc-run", bad, *options, *against, tmp_path / "same").code == 0
    assert changes(tmp_path / "same") == [False]
    (tmp_path / file).write_text((tmp_path / file).read_text() + "<!-- another -->")
    answer = command("xosc-run", bad, *options, *against, tmp_path / "changed")
    assert answer.code == 1 and "1 new, 0 fixed, 0 still failing" in answer.out
    assert "(before: failed, of files that have changed)" in answer.out
    assert changes(tmp_path / "changed") == [True]


def changes(out: Path) -> list[bool]:
    """Whether the page says, of each run, that its files have changed."""
    return [run["before"]["changed"] for run in data_of(out / "report.html")["runs"]]


def test_files_of_batches_are_matched_by_path_below_their_root_then_by_a_single_name() -> None:
    assert counterparts_of(["/n/a/x", "/n/b/x"], ["/o/b/x", "/o/a/x"]) == {
        "/n/a/x": "/o/a/x",
        "/n/b/x": "/o/b/x",
    }
    assert counterparts_of(["/n/a/x", "/n/b/x"], ["/n/b/x"]) == {"/n/b/x": "/n/b/x"}
    assert counterparts_of(["/n/x.xosc", "/n/y.xosc"], ["/o/deep/x.xosc"]) == {
        "/n/x.xosc": "/o/deep/x.xosc"
    }


def test_a_failure_after_an_error_is_new() -> None:
    job = Job("x", Path("/n/x"), Path("/n/x"))
    before = {identity("/n/x", {}, None): EarlierRun("error", "1")}
    earlier = BatchComparison("before", before, lambda job: "1")
    failed, broken = Outcome(job, "failed", 1), Outcome(job, "error", 3)
    earlier.add(failed)
    earlier.add(broken)
    assert (earlier.new, earlier.still) == ([failed], [broken]) and not earlier.known(failed)


@pytest.mark.parametrize(("now", "harder"), [(6.5, True), (4.04, False), (None, False)])
def test_a_harder_impact_of_what_failed_before_is_named(
    now: float | None, harder: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    job = Job("x", Path("/n/x"), Path("/n/x"))
    before = {identity("/n/x", {}, None): EarlierRun("failed", "1", 4.0)}
    earlier = BatchComparison("before", before, lambda job: "1")
    earlier.add(Outcome(job, "failed", 1, impact=None if now is None else {"speed": now}))
    OutcomeTable(verbose=False, quiet=False).compare(earlier, None)
    first, line = capsys.readouterr().out.splitlines()
    worse = " (1 with a harder impact)"
    assert first == f"since before: 0 new, 0 fixed, 1 still failing{worse if harder else ''}"
    assert ("(before: failed at 4.0 m/s, now 6.5 m/s)" in line) == harder


def test_an_empty_name_is_wrong_usage(command: Command) -> None:
    answer = command("xosc-run", "")
    assert answer.code == 2 and "an empty name" in answer.err


def data_of(page: Path) -> Any:
    text = page.read_text(encoding="utf-8").partition('id="data">')[2].partition("</script>")[0]
    return json.loads(text)
