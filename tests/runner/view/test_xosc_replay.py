"""The command `xosc-replay`, and `xosc-run --replay`: which files they write,
and what they refuse.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from PIL import Image

from runner.batch.batch import run_batch
from runner.batch.jobs import jobs_of
from runner.judging.settings import RunSettings
from tests.commands import Command
from tests.runner.files import distribution, scenario


@pytest.fixture(scope="module")
def batch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Output folder of three runs of 0.5 s."""
    folder = tmp_path_factory.mktemp("batch")
    scenario(folder, stop=0.5)
    path = distribution(folder, "gaps", {"Gap": (20, 40, 10)})
    out = folder / "out"
    assert (
        len(
            list(
                run_batch(
                    jobs_of([path], {}, True), RunSettings(sut=None, world="kinematic"), out=out
                )
            )
        )
        == 3
    )
    return out


@pytest.fixture
def run(batch: Path) -> Path:
    return batch / "gaps~000000"


def test_a_run_becomes_a_page_in_its_folder(command: Command, run: Path) -> None:
    assert command("xosc-replay", run) == (0, f"{run / 'replay.html'}\n", "")
    assert (run / "replay.html").read_text().startswith("<!DOCTYPE html>")
    assert command("xosc-replay", "--quiet", run) == (0, "", "")


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".html", ".png", ".gif"])
def test_two_runs_become_one_file_and_always_the_same(
    command: Command, batch: Path, run: Path, tmp_path: Path, suffix: str
) -> None:
    files = [tmp_path / f"{name}{suffix}" for name in ("first", "second")]
    for file in files:
        assert command("xosc-replay", run, batch / "gaps~000002", "--out", file)[0] == 0
    assert files[0].read_bytes() == files[1].read_bytes()


def test_an_animation_is_played_in_real_time(
    command: Command, batch: Path, run: Path, tmp_path: Path
) -> None:
    for name, runs in (("one.gif", [run]), ("two.gif", [run, batch / "gaps~000002"])):
        assert command("xosc-replay", *runs, "--out", tmp_path / name)[0] == 0
    one, two = (Image.open(tmp_path / name) for name in ("one.gif", "two.gif"))
    assert getattr(one, "n_frames", 1) == 6
    assert one.info["duration"] == 100
    assert two.size == (one.width, 2 * one.height)
    first = one.convert("RGB")
    one.seek(5)
    assert first.tobytes() != one.convert("RGB").tobytes()


def test_a_film_is_made_where_ffmpeg_is_and_refused_in_one_line_where_it_is_not(
    command: Command, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if shutil.which("ffmpeg") is not None:
        for name in ("one.mp4", "two.mp4"):
            assert command("xosc-replay", run, "--out", tmp_path / name)[0] == 0
        assert (tmp_path / "one.mp4").read_bytes() == (tmp_path / "two.mp4").read_bytes()
        assert b"ftyp" in (tmp_path / "one.mp4").read_bytes()[:32]
    monkeypatch.setenv("PATH", str(tmp_path))
    code, _, error = command("xosc-replay", run, "--out", tmp_path / "three.mp4")
    assert code == 2
    assert "needs ffmpeg" in error
    assert "Traceback" not in error


def test_batches_are_compared_by_name_only_as_batches(
    command: Command, batch: Path, run: Path
) -> None:
    assert command("xosc-replay", batch, "--against", batch)[0] == 0
    assert '"against":{"title":"out"' in (batch / "report.html").read_text()
    again = batch.parent / "again"
    scenario_file = batch.parent / "gaps.xosc"
    assert command(
        "xosc-run",
        scenario_file,
        "--world",
        "kinematic",
        "--out",
        again,
        "--replay",
        "--against",
        batch,
    )[0] in (0, 1)
    assert '"against":{"title":"out"' in (again / "report.html").read_text("utf-8")
    compared = command("xosc-run", scenario_file, "--world", "kinematic", "--against", batch)
    assert (
        "\nsince out (none, now cas): 0 new, " in compared.out
    )  # needs neither an output folder nor a page
    code, _, error = command("xosc-replay", run, "--against", batch)
    assert code == 2
    assert "--against compares whole batches" in error


def test_a_batch_becomes_a_report_with_a_replay_of_each_run(command: Command, batch: Path) -> None:
    assert command("xosc-replay", batch)[1] == f"{batch / 'report.html'}\n"
    assert len(list(batch.glob("*/replay.html"))) == 3
    before = (batch / "report.html").read_bytes()
    command("xosc-replay", batch)
    assert (batch / "report.html").read_bytes() == before


def test_xosc_run_writes_pages_and_a_report_into_its_output_folder(
    command: Command, tmp_path: Path
) -> None:
    path = scenario(tmp_path, stop=0.2)
    code, out, _ = command(
        "xosc-run", "--world", "kinematic", "--replay", "--out", tmp_path / "out", path
    )
    replay, report = tmp_path / "out" / "scenario" / "replay.html", tmp_path / "out" / "report.html"
    assert code == 0 and out.splitlines()[-2:] == [f"replay: {replay}", f"report: {report}"]
    from_folder = replay.parent / "again.html"
    command("xosc-replay", replay.parent, "--out", from_folder)
    assert replay.read_bytes() == from_folder.read_bytes()
    assert (tmp_path / "out" / "report.html").is_file()


def test_xosc_run_without_an_output_folder_writes_a_page_to_the_working_directory(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = scenario(tmp_path / "files", stop=0.2)
    monkeypatch.chdir(tmp_path)
    code, out, _ = command("xosc-run", "--world", "kinematic", "--replay", path)
    assert code == 0 and out.endswith("\nreplay: scenario.html\n")
    assert [file.name for file in tmp_path.glob("*.html")] == ["scenario.html"]


def test_wrong_usage_is_refused(command: Command, batch: Path, run: Path, tmp_path: Path) -> None:
    for arguments, complaint in (
        ([run, run, run], "one run or two, not 3"),
        ([run, run], "name the --out file"),
        ([run, "--out", tmp_path / "a.webm"], "a replay ends in .html, .png, .gif"),
        ([batch, "--out", tmp_path / "a.html"], "whole batch"),
        ([run, "--out", "/dev/null/a.html"], "/dev/null"),
    ):
        code, out, err = command("xosc-replay", *arguments)
        assert (code, out) == (2, "")
        assert complaint in err
        assert err.startswith("xosc-replay: ")


def test_damaged_and_absent_results_are_refused(command: Command, tmp_path: Path) -> None:
    code, _, err = command("xosc-replay", tmp_path / "absent")
    assert code == 3
    assert "absent/result.json: no such file" in err


def test_a_file_that_is_no_trace_is_told_what_is_expected(command: Command, tmp_path: Path) -> None:
    path = scenario(tmp_path)
    expected = (
        f"xosc-replay: {path}: a folder of results is expected, as xosc-run --out writes it, or "
        "an OSI trace\n"
    )
    assert command("xosc-replay", path) == (3, "", expected)
