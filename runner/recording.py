"""Who was where when, on which road: what a run writes down and what recordings of real traffic are read into."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runner.simulation import Simulation

Row = tuple[float, float, float, float, float, float, float, float, float, "str | None", int, float, float, float]
"""time, x, y, z, h, pitch, roll, speed, acceleration, road id (None: not looked up), lane id, s, t, lane offset"""


class Recorder:
    """Rows of every present entity, once a step."""

    def __init__(self, sim: Simulation) -> None:
        self._sim = sim
        self.rows: dict[str, list[Row]] = {}

    def record(self) -> None:
        """Write down the present state of everyone."""
        time = self._sim.time
        rows = self.rows
        for name, e in self._sim.entities.items():
            if not e.active:
                continue
            if e.on_lane and e.road is not None:
                place = (e.road.id, e.lane, e.s, e.t, e.offset)
            else:
                place = (None, 0, 0.0, 0.0, 0.0)
            row = (time, e.x, e.y, e.z, e.h, e.pitch, e.roll, e.speed, e.acceleration, *place)
            if name in rows:
                rows[name].append(row)
            else:
                rows[name] = [row]
