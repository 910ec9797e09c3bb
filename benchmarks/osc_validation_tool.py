"""Adapter of PMSFIT/osc-validation, a test suite of players that compares their OSI output.

    osc-validate --tool xosc-run --tool-wrapper-module benchmarks/osc_validation_tool.py
        [--toolpath .venv/bin/xosc-run]

The suite (https://github.com/PMSFIT/osc-validation, 0.2.0) asks a module for `create_tool`, and the
tool for a trace of each of its scenarios. Runs are those of the kinematic world, without a system
under test; verdicts are not asked for. Needs `asam-osi-utilities` and `osi-python` in the
environment of the suite, and nothing of this project there but the command.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

JUDGED = (0, 1, 6)
"""Exit codes of runs that ended: passed, failed, inconclusive"""
STEP = 0.05
"""Default time step, s"""


class XoscRun:
    """The command `xosc-run`.

    Args:
        tool_path: the executable; None for that on PATH.

    Raises:
        FileNotFoundError: there is none.
    """

    def __init__(self, tool_path: str | None = None) -> None:
        found = shutil.which(tool_path or "xosc-run")
        if found is None:
            raise FileNotFoundError(f"{tool_path or 'xosc-run'} is no executable")
        self.tool_path = Path(found)

    def get_version(self) -> list[str]:
        """Lines of the answer to --version."""
        return self._call("--version").stdout.splitlines()

    def run(
        self,
        osc_path: Path,
        odr_path: Path,
        osi_output_spec: Any,
        log_path: Path | None = None,
        rate: float | None = None,
    ) -> Any:
        """Play a scenario and return the specification of the trace of it.

        Args:
            osc_path: the scenario, which names its road network.
            odr_path: the road network.
            osi_output_spec: path and type of the trace: GroundTruth or SensorView.
            log_path: folder for the printed text.
            rate: time step, s.

        Raises:
            RuntimeError: the scenario was refused.
            ValueError: a trace of another type is asked for.
        """
        from osi_utilities import ChannelSpecification, MessageType, open_channel

        wanted = osi_output_spec.message_type or MessageType.SENSOR_VIEW
        if wanted not in (MessageType.GROUND_TRUTH, MessageType.SENSOR_VIEW):
            raise ValueError(f"{wanted} is neither GroundTruth nor SensorView")
        truth = Path(osi_output_spec.path).with_suffix(".truth.osi")
        told = self._call(
            str(osc_path),
            *("--sut", "none", "--world", "kinematic", "--timestep", str(rate or STEP)),
            *("--road-path", str(Path(odr_path).parent), "--osi", str(truth)),
        )
        if log_path is not None:
            (Path(log_path) / "xosc-run.log").write_text(told.stdout, encoding="utf-8")
        if told.returncode not in JUDGED:
            raise RuntimeError(f"exit code {told.returncode}: {told.stdout}")
        source = ChannelSpecification(path=truth, message_type=MessageType.GROUND_TRUTH)
        with open_channel(source) as truths:
            return _written(truths, osi_output_spec, wanted == MessageType.SENSOR_VIEW)

    def _call(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [str(self.tool_path), *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )


def _written(truths: Any, target: Any, viewed: bool) -> Any:
    """Write ground truth, or sensor views that hold it, as the target says."""
    from osi_utilities import open_channel_writer

    with open_channel_writer(target) as writer:
        for truth in truths:
            writer.write_message(_view(truth) if viewed else truth)
        return writer.get_channel_specification()


def _view(truth: Any) -> Any:
    """A SensorView of no sensor around a GroundTruth."""
    from osi3.osi_sensorview_pb2 import SensorView

    view = SensorView()
    view.version.CopyFrom(truth.version)
    view.timestamp.CopyFrom(truth.timestamp)
    view.host_vehicle_id.CopyFrom(truth.host_vehicle_id)
    view.sensor_id.value = truth.host_vehicle_id.value
    view.global_ground_truth.CopyFrom(truth)
    return view


def create_tool(toolpath: str | None = None) -> XoscRun:
    """The tool that the suite asks for."""
    return XoscRun(toolpath)
