"""The demo: its recordings are small, read without complaint, its scenarios run, and what
`make demo` types can be typed.
"""

from __future__ import annotations

import shlex
import subprocess
from itertools import islice
from pathlib import Path

import pytest

import generation.loop
import runner
import xosc
from generation.loop.inputs import Inputs
from recognition.labels import Rules, label
from recognition.scenes import site_of
from runner.judging.settings import RunSettings

ROOT = Path(__file__).parents[3]
DEMO = Path(generation.loop.__file__).parent / "demo"
ADAS = RunSettings(sut="adas", world="kinematic")


def command() -> list[str]:
    planned = subprocess.run(
        ["make", "--dry-run", "demo"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    return shlex.split(next(line for line in planned.splitlines() if "xosc-loop" in line))


def test_recordings_of_both_formats_are_small_and_whole(tmp_path: Path) -> None:
    found = Inputs.of(DEMO)
    assert {source.format for source in found.recordings} == {"highD", "INTERACTION"}
    assert sum(path.stat().st_size for path in DEMO.rglob("*") if path.is_file()) < 800_000
    events = []
    for source in found.recordings:
        recording = source.load()
        assert source.report is not None and source.report.excluded == 0
        events += label(recording, site_of(source, recording, tmp_path), source.name, Rules())
    assert len({event.label for event in events}) >= 8


def test_each_scenario_has_sets_that_adas_survives_and_others_at_which_it_collides() -> None:
    found = Inputs.of(DEMO)
    assert len(found.scenarios) == 3
    for path in found.scenarios:
        runs = [
            runner.run(file, ADAS, parameters=dict(values))
            for file, values in islice(xosc.variations(path), 5)
        ]
        assert {bool(run.verdict.failures) for run in runs} == {True, False}, path
        assert not any(run.verdict.causes for run in runs if not run.verdict.failures), (
            "each tests something"
        )


def test_make_demo_runs_the_loop_on_them() -> None:
    program, folder, *options = command()
    assert program.endswith("xosc-loop")
    assert ROOT / folder == DEMO
    assert options[:2] == ["--out", "out/demo"]


@pytest.mark.study
def test_the_demo_shows_recognised_and_generated_scenarios(tmp_path: Path) -> None:
    _, folder, _, _, *options = command()
    done = subprocess.run(
        ["xosc-loop", folder, "--out", tmp_path / "demo", *options],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "demo" / "index.html").read_text(encoding="utf-8")
    assert '"state":"known"' in page
    assert '"verdict":"collision"' in page
