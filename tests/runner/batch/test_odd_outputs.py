"""Files and folders with odd names, and outputs that can't be written: results
all the same, or one line.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.commands import Command
from tests.runner.files import scenario

QUICK = ("--world", "kinematic", "--quiet")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "out"),
    [
        ("Prüfung mit Leerzeichen", "Ergebnisse äöü ß"),
        ("n" * 240, "long"),
        ("n" * 249, "longer"),
        ("short", "/".join(["d" * 60] * 6)),
        ("100% #1 & 'one'", "a;b"),
        ("シナリオ", "結果"),
    ],
    ids=["umlauts", "long", "longest", "deep", "signs", "characters"],
)
@pytest.mark.filterwarnings("error")
def test_odd_names_have_results_and_replays_that_are_found_again(
    command: Command, tmp_path: Path, name: str, out: str
) -> None:
    path = scenario(tmp_path / "files", name, stop=0.3)
    folder = tmp_path / out
    assert command("xosc-run", path, *QUICK, "--out", folder, "--replay") == (0, "", "")
    (run,) = [each for each in folder.iterdir() if each.is_dir()]
    assert (run / "replay.html").is_file() and (folder / "report.html").is_file()
    assert command("xosc-replay", run, "--out", folder / "a picture.png", "--quiet") == (0, "", "")
    code, _, error = command("xosc-run", path, *QUICK, "--out", folder)
    assert code == 2 and "use --resume to go on with it" in error


@pytest.mark.parametrize(
    ("option", "file", "message"),
    [
        ("--junit", "taken/report.xml", "the report can't be written: "),
        ("--osi", "taken/run.osi", "the trace can't be written: "),
    ],
)
def test_what_can_t_be_written_is_one_line_with_the_reason(
    command: Command, tmp_path: Path, option: str, file: str, message: str
) -> None:
    (tmp_path / "taken").write_text("a file", "utf-8")
    path = scenario(tmp_path, stop=0.3)
    code, _, error = command("xosc-run", path, *QUICK, option, tmp_path / file)
    lines = [line for line in error.splitlines() if not line.startswith("ERROR")]
    assert code == 2 and len(lines) == 1 and message in lines[0]
