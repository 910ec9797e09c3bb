"""What CARLA's scenario_runner makes of the exported library, where there is one."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import runner
import xosc
from schemas.errors import Unsupported
from xosc.exports import carla
from xosc.exports.folder import Folder

LIBRARY = Path(xosc.__file__).parent / "library"
PYTHON, SOURCES = os.environ.get("XOSC_CARLA_PYTHON", ""), os.environ.get("XOSC_SCENARIO_RUNNER", "")
"""A Python that has `carla` (its wheel, no server) and what scenario_runner needs; the folder that has its `srunner`."""


def test_scenario_runner_reads_the_library_and_starts_everyone_where_we_do(tmp_path: Path) -> None:
    if not (PYTHON and SOURCES):
        pytest.skip("XOSC_CARLA_PYTHON and XOSC_SCENARIO_RUNNER name no scenario_runner")
    folder, exported = Folder(tmp_path), []
    for path in sorted(LIBRARY.glob("*.xosc")):
        if xosc.load(path).kind == "scenario":
            try:
                carla.export(path, "carla", folder)
                exported.append(path)
            except Unsupported:
                pass
    reader = Path(__file__).with_name("scenario_runner_reader.py")
    files = [str(tmp_path / path.name) for path in exported]
    answer = subprocess.run([PYTHON, str(reader), SOURCES, *files], capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr[-2000:]
    read = [json.loads(line) for line in answer.stdout.splitlines() if line.startswith("{")]
    assert [each["file"] for each in read] == [path.name for path in exported]
    assert not [each for each in read if "error" in each]
    for path, told in zip(exported, read, strict=True):
        result = runner.run(path, world="kinematic", sut="none", timestep=0.1, max_time=0.2)
        assert told["egos"] == ["hero"] and told["made"] > 1
        for name, start in told["starts"].items():
            columns = result.recording.tracks[result.ego if name == "hero" else name].columns
            here = [float(columns[each][0]) for each in ("x", "y", "h", "speed")]
            assert np.allclose(start[:2], here[:2], atol=0.05), (path.name, name)
            assert np.cos(start[2] - here[2]) > 0.999 and start[3] == pytest.approx(here[3])
    assert len(exported) > 20
