"""`xosc-run --against`: what is new, fixed and still failing since an earlier batch, and the exit code for CI."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.commands import Command

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
    assert summary(answer.out)[0] == "since bad: 0 new, 2 fixed, 0 still failing"


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (
            ["--fail-if", "new-failure"],
            "--fail-if new-failure needs the earlier batch: --against BATCH",
        ),
        (["--against", "absent"], "not the output folder of a batch"),
        (["--against", "absent", "--dry-run"], "--against compares runs, and --dry-run has none"),
    ],
)
def test_what_can_not_be_compared_is_refused(
    command: Command, options: list[str], complaint: str
) -> None:
    answer = command("xosc-run", CUT_IN, *options)
    assert answer.code == 2 and complaint in answer.err
