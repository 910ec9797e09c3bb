"""SUMO's traffic on a network, as positions over time."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from recognition.recorder.demand import Departure, write_routes
from schemas.errors import ToolchainError
from xodr.array_types import FloatArray, IntArray
from xodr.sumo_net import SumoNet, sumo_home

STEPS = 10
"""SUMO's time steps a second."""
_SUBLANE = 4.0
"""Width of the strips in which SUMO's drivers look for leaders, m: whole lanes. Drivers can be anywhere across them all the same;
with narrower strips they swerve where the number of lanes changes, and squeeze past each other."""
_SLOWEST = 1.0
"""SUMO may take this many times as long as the traffic that it simulates."""


class Fronts(NamedTuple):
    """Middles of front bumpers, in the order of vehicles and time.

    Attributes:
        vehicle: number of its departure. step: time in steps.
        x, y: m. h: SUMO's heading, rad.
    """

    vehicle: IntArray
    step: IntArray
    x: FloatArray
    y: FloatArray
    h: FloatArray


def simulate(departing: Sequence[Departure], net: SumoNet, begin: float, end: float, seed: int) -> Fronts:
    """Where everybody is from `begin` to `end`, s.

    Raises:
        ToolchainError: SUMO fails.
    """
    with TemporaryDirectory(prefix="xosc-recorder-") as folder:
        write_routes(departing, net, Path(folder) / "routes.xml")
        arguments = [
            str(sumo_home() / "bin" / "sumo"), f"--net-file={net.path}", "--route-files=routes.xml",
            "--fcd-output=fronts.parquet", "--fcd-output.attributes=id,x,y,angle", "--fcd-output.skip-empty",
            f"--device.fcd.begin={begin:.2f}", f"--end={end:.2f}", f"--seed={seed}",
            f"--step-length={1 / STEPS}", f"--lateral-resolution={_SUBLANE}", "--time-to-teleport=-1", "--collision.action=none",
            "--no-step-log", "--no-warnings", "--xml-validation=never",
        ]  # fmt: skip
        try:
            done = subprocess.run(
                arguments, cwd=folder, env={**os.environ, "SUMO_HOME": str(sumo_home())}, stdin=subprocess.DEVNULL,
                capture_output=True, timeout=60.0 + _SLOWEST * end, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            raise ToolchainError(f"SUMO has not simulated {end:.0f} s of traffic in {60.0 + _SLOWEST * end:.0f} s") from None
        if done.returncode != 0:
            raise ToolchainError(f"SUMO fails: {done.stderr.decode(errors='replace').strip()[-500:]}")
        return _read(Path(folder) / "fronts.parquet")


def _read(path: Path) -> Fronts:
    import pyarrow.parquet as pq

    table = pq.read_table(path)
    vehicle = table["vehicle_id"].to_numpy().astype(np.int64)
    step = np.round(table["timestep_time"].to_numpy() * STEPS).astype(np.int64)
    order = np.lexsort((step, vehicle))
    x, y, angle = (table[f"vehicle_{name}"].to_numpy()[order] for name in ("x", "y", "angle"))
    return Fronts(vehicle[order], step[order], x, y, np.radians(90.0 - angle))
