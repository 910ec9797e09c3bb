"""The benchmark of players, with a stand-in for esmini's binary."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from benchmarks.players import Costs, NotPlayed, main, spent, steps_of
from tests.runner.files import scenario

STAND_IN = """#!{python}
import sys
asked = dict(zip(sys.argv, sys.argv[1:]))
assert {{"--headless", "--disable_log", "--osc"}} <= set(sys.argv), sys.argv
if "refused" in asked["--osc"]:
    sys.exit("no such road")
if "--csv_logger" in asked:
    with open(asked["--csv_logger"], "w") as log:
        log.write("Version: 2\\nIndex [-] , TimeStamp [s]\\n")
        log.writelines(f"{{row}}, {{row * float(asked['--fixed_timestep'])}}, Ego\\n" for row in range(501))
"""


@pytest.fixture
def stand_in(tmp_path: Path) -> Path:
    """A program that takes esmini's options, refuses files by their names and logs 500 steps."""
    path = tmp_path / "esmini"
    path.write_text(STAND_IN.format(python=sys.executable), encoding="utf-8")
    path.chmod(0o755)
    return path


def test_a_step_is_the_time_without_loading_by_the_steps() -> None:
    assert Costs(1.5, 0.5, 1000).step == pytest.approx(1000.0)
    assert Costs(0.4, 0.5, 1000).step == 0.0  # noise


def test_steps_are_counted_in_the_log_of_the_other_player(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("Version\nIndex [-], Time\n0, 0.00\n1, 0.01\n2, 0.02\n", encoding="utf-8")
    assert steps_of(log) == 2
    log.write_text("Version\n", encoding="utf-8")
    with pytest.raises(NotPlayed, match="no step"):
        steps_of(log)


def test_a_process_that_fails_is_not_played() -> None:
    with pytest.raises(NotPlayed, match="exit code 3: lost"):
        spent([sys.executable, "-c", "print('lost'); raise SystemExit(3)"])


@pytest.mark.slow
def test_files_are_played_on_both_and_those_refused_are_named(
    stand_in: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "files"
    folder.mkdir()
    for name in ("refused", "simple"):
        scenario(folder, name, stop=1.0)
    main([str(folder), "--esmini", str(stand_in), "--repeat", "1", "--world", "kinematic"])
    _, line, total, left, refused = capsys.readouterr().out.splitlines()
    assert line.split()[:3] == ["simple", "100", "500"] and total.startswith("1 files")
    assert left == "left out: 1" and refused.strip() == "refused.xosc: exit code 1: no such road"
