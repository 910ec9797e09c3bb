"""Bad files end in a run or in one clear line with the right exit code: a sample of mutants, and named attacks."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.guarded import Result, run_mutants
from tests.mutation import OWN_SCENARIOS, sources

SCENARIO = Path(__file__).parent / "conformance" / "scenarios" / "SpeedAction.xosc"
ROADS = SCENARIO.parents[1] / "roads"


@pytest.mark.parametrize("first", [0, 30, 60])
def test_mutants_end_in_a_run_or_in_a_clear_refusal(tmp_path: Path, first: int) -> None:
    results: list[Result] = list(run_mutants(sources(OWN_SCENARIOS), 7, range(first, first + 30), tmp_path))
    assert len(results) == 30
    assert not [result for result in results if result.is_defect]


def command(path: Path) -> subprocess.CompletedProcess[str]:
    """`xosc-run` on a file, as a user calls it."""
    words = [sys.executable, "-m", "runner.cli", str(path), "--world", "kinematic", "--max-time", "1", "--quiet"]
    return subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)


BOMB = '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><OpenSCENARIO>&b;</OpenSCENARIO>'
EXTERNAL = '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]><OpenSCENARIO>&a;</OpenSCENARIO>'


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (BOMB, "document type"),
        (EXTERNAL, "document type"),
        ("", "empty"),
        ("<OpenSCENARIO>", "OpenSCENARIO"),
        ("\x00\x01\x02 not xml", "not"),
        ('<?xml version="1.0"?><OpenDRIVE/>', "OpenDRIVE"),
    ],
)
def test_attacks_and_rubbish_are_refused_in_one_line(tmp_path: Path, text: str, complaint: str) -> None:
    path = tmp_path / "bad.xosc"
    path.write_text(text, encoding="utf-8")
    done = command(path)
    assert done.returncode == 3
    assert "Traceback" not in done.stderr
    (line,) = done.stderr.strip().splitlines()
    assert str(path) in line
    assert complaint.lower() in line.lower()


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ('value="../roads/straight.xodr"', 'value="nowhere.xodr"', "nowhere.xodr"),
        ('name="StartSpeed" parameterType="double" value="10"', 'name="StartSpeed" parameterType="double" value="$Target"', ""),
        ('name="Target" parameterType="double" value="20"', 'name="Target" parameterType="double" value="NaN"', "Target"),
        ('laneId="-1" s="300"', 'laneId="-9" s="300"', "-9"),
        ('entityRef="Car"', 'entityRef="Nobody"', "Nobody"),
    ],
)
def test_faults_are_named_with_their_line(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    text = SCENARIO.read_text(encoding="utf-8").replace("../roads/", f"{ROADS}/")
    old, new = (part.replace("../roads/", f"{ROADS}/") for part in (old, new))
    assert old in text
    path = tmp_path / "faulty.xosc"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    done = command(path)
    if not complaint:
        assert done.returncode == 0  # a default that refers to another parameter is no fault
        return
    assert done.returncode == 3
    assert f"{path}:" in done.stderr
    assert complaint in done.stderr
    assert "Traceback" not in done.stderr


def test_a_road_with_a_number_that_is_none_is_refused_where_it_stands(tmp_path: Path) -> None:
    road = tmp_path / "road.xodr"
    road.write_text(
        (ROADS / "straight.xodr").read_text(encoding="utf-8").replace('x="0" y="0"', 'x="NaN" y="0"'), encoding="utf-8"
    )
    scenario = tmp_path / "scenario.xosc"
    scenario.write_text(SCENARIO.read_text(encoding="utf-8").replace("../roads/straight.xodr", str(road)), encoding="utf-8")
    done = command(scenario)
    assert done.returncode == 3
    assert f"{road}:" in done.stderr
