"""SUMO's own window: refused where there is no display; with a virtual one it plays the run."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import traci

import runner
from runner.view.replay.sumo_gui import need_display, show
from schemas.common.errors import UsageError
from tests.runner.files import scenario


@pytest.fixture
def display(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A virtual display."""
    if shutil.which("Xvfb") is None:
        pytest.skip("no Xvfb is installed (Debian: apt-get install xvfb)")
    reading, writing = os.pipe()
    command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", "1280x800x24"]
    with subprocess.Popen(
        command, pass_fds=[writing], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as server:
        os.close(writing)
        with os.fdopen(reading) as file:
            monkeypatch.setenv("DISPLAY", f":{file.readline().strip()}")
        yield
        server.terminate()


def test_no_display_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(UsageError, match="--gui needs a display"):
        need_display()


def test_a_run_is_played_to_its_end(
    display: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = runner.run(scenario(tmp_path, stop=0.5), sut=None, world="kinematic", timestep=0.1)
    step, present = traci.simulationStep, []
    monkeypatch.setattr(
        traci, "simulationStep", lambda: (step(), present.append(len(traci.vehicle.getIDList())))
    )
    show(result, stay=False)
    assert present == [2] * 6
