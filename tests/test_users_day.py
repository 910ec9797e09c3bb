"""A user's day: write, check, run, sweep, rank the worst, mend the controller, compare, search,
replay, hand over a table.
"""

from __future__ import annotations

import csv
import sys
from importlib import invalidate_caches
from pathlib import Path

import pytest

from tests.commands import Command
from tests.runner.chromium import Browser
from tests.runner.files import car, distribution, place, scenario

SYSTEM = """
from runner.systems import Control
from runner.systems.encounters import encounters

class Driver:
    def reset(self, ego, timestep, seed): pass

    def control(self, observation, dt):
        near = any(other.aside < 0.2 and other.time_to_collision < {limit} for other in encounters(observation))
        return Control(-9.0, reason="too near") if near else Control()
"""
"""A controller that brakes fully below a time to collision (s)"""
SETS = 12
PARAMETERS = {"Ego_speed_kph": 50.0, "Overlap": 100.0}


def write_system(limit: float) -> None:
    """Save the controller in the working folder, as an editor does between two
    calls of a command.
    """
    Path("day_driver.py").write_text(SYSTEM.format(limit=limit))
    sys.modules.pop("day_driver", None)
    invalidate_caches()


@pytest.mark.slow
def test_a_day_with_one_controller(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    init = place("Ego", 100, "${$Ego_speed_kph / 3.6}") + place("Lead", 160, 0)
    base = scenario(
        tmp_path,
        "stopped_car",
        entities=[car("Ego"), car("Lead")],
        init=init,
        stop=8.0,
        parameters=PARAMETERS,
    )
    sweep = distribution(
        tmp_path,
        "NCAP_AEB_C2C_CCRs_day",
        {"Ego_speed_kph": (25, 50, 5), "Overlap": (75, 100, 25)},
        "stopped_car",
    )
    write_system(0.5)
    how = ("--world", "kinematic", "--sut", "day_driver:Driver")
    assert command("xosc-check", base.name, sweep.name).code == 0
    first = command("xosc-run", base.name, *how)
    assert first.code == 1 and "collision with Lead" in first.out

    swept = command("xosc-run", sweep.name, *how, "--out", "v1", "--replay")
    assert swept.code == 1
    lines = swept.out.splitlines()
    worst = next(number for number, line in enumerate(lines) if line.startswith("worst 5 of "))
    speeds = [float(line.split("m/s")[0]) for line in lines[worst + 1 : worst + 6]]
    assert speeds == sorted(speeds, reverse=True) and speeds[0] > 8.0
    assert lines[-1] == "report: v1/report.html"
    assert command("xosc-run", sweep.name, *how, "--out", "v1").code == 2, (
        "nothing is overwritten unless asked to"
    )

    write_system(
        2.25
    )  # of another length: Python compares compiled files by size and whole seconds
    gate = ("--against", "v1", "--fail-if", "new-failure")
    mended = command("xosc-run", sweep.name, *how, "--out", "v2", "--replay", *gate)
    failed = swept.out.count("FAILED       NCAP")
    assert mended.code == 0 and f"since v1: 0 new, {failed} fixed, 0 still failing" in mended.out
    page = next(
        Path(line.split()[-1]) for line in mended.out.splitlines() if line.startswith("    fixed ")
    )
    assert page.name == "before-and-after.html" and page.is_file()

    search = (
        "--budget",
        "4",
        "--method",
        "draws",
        "--density",
        "uniform",
        "--free",
        "Ego_speed_kph=60..110",
        "--out",
        "found",
    )
    searched = command("xosc-generate", base.name, "--sut", "day_driver:Driver", *search)
    assert searched.code in (0, 1) and Path("found/report.html").is_file()
    assert str(Path("found/report.html")) in searched.out

    assert command("xosc-replay", "v1", "v2").out == "v2/history.html\n"
    assessed = command(
        "xosc-run",
        sweep.name,
        *how,
        "--out",
        "v2",
        "--replay",
        "--resume",
        "--assess",
        "euro-ncap-2023",
    )
    assert assessed.out.splitlines()[-2:] == [
        "assessment: v2/assessment.html",
        "assessment: v2/assessment.csv",
    ]
    rows = list(csv.DictReader(Path("v2/assessment.csv").read_text().splitlines()))
    assert {(row["test"], row["result"], row["system under test"]) for row in rows} == {
        ("CCRs", "met", "day_driver:Driver")
    }
    assert len(rows) == SETS and all(len(row["sha256"]) == 64 for row in rows)

    with Browser(tmp_path / "profile") as browser:
        for name in ("v1/report.html", "v2/history.html", "v2/assessment.html", str(page)):
            for width in (1400, 390):
                browser.open(tmp_path / name, width=width)
                assert browser.run("document.documentElement.scrollWidth") <= width, (name, width)
        assert browser.errors == []
