"""The adapter of osc-validation: what the suite asks a tool for, on a scenario of the house."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from benchmarks.osc_validation_tool import create_tool
from schemas.osi.traces import Trace
from tests.runner.files import car, place, scenario

pytest.importorskip("osi_utilities")
COMMAND = str(Path(sys.executable).with_name("xosc-run"))


def spec(path: Path, kind: str) -> object:
    from osi_utilities import ChannelSpecification

    return ChannelSpecification(path=path, message_type=kind)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["GroundTruth", "SensorView"])
def test_a_trace_has_the_steps_and_type_asked_for(tmp_path: Path, kind: str) -> None:
    path = scenario(tmp_path, entities=[car("Ego")], init=place("Ego", 100, 10))
    tool = create_tool(COMMAND)
    target = spec(tmp_path / "trace.mcap", kind)
    found = tool.run(path, tmp_path / "straight.xodr", target, log_path=tmp_path, rate=0.5)
    frames = list(Trace(Path(found.path)).frames())
    assert [frame.truth.timestamp.nanos for frame in frames] == [0, 500_000_000, 0, 500_000_000, 0]
    assert type(frames[0].message).__name__ == kind
    assert "passed" in (tmp_path / "xosc-run.log").read_text().lower()


@pytest.mark.slow
def test_a_refused_scenario_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "empty.xosc"
    path.write_text("<OpenSCENARIO/>")
    with pytest.raises(RuntimeError, match="exit code 3"):
        create_tool(COMMAND).run(path, path, spec(tmp_path / "trace.mcap", "SensorView"))


def test_other_types_and_missing_commands_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere"):
        create_tool(str(tmp_path / "nowhere"))
    with pytest.raises(ValueError, match="neither GroundTruth nor SensorView"):
        create_tool(COMMAND).run(tmp_path, tmp_path, spec(tmp_path / "t.mcap", "SensorData"))
