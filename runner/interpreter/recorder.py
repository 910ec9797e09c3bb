"""Writes down where everyone is, as a run goes on."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from runner.recording import COLUMNS, Recording, Track

if TYPE_CHECKING:
    import numpy as np

    from runner.interpreter.simulation import Simulation
    from runner.participants.entity import Entity

_TYPES: dict[str, Any] = {"road_id": object, "lane_id": "int64"}
Row = tuple[Any, ...]
"""Values of `COLUMNS` at one instant; a road id of None means: not looked up yet."""


def _arrays(rows: list[Row]) -> dict[str, np.ndarray]:
    import numpy as np

    columns = zip(COLUMNS, zip(*rows, strict=True), strict=True)
    return {name: np.array(values, dtype=_TYPES.get(name, "float64")) for name, values in columns}


class Recorder:
    """Writes down every present entity of a run, once a step."""

    def __init__(self, sim: Simulation) -> None:
        self._sim = sim
        self._rows: dict[Entity, list[Row]] = {}

    def record(self) -> None:
        """Write down the present state of everyone."""
        time = self._sim.time
        rows = self._rows
        for e in self._sim.entities.values():
            if not (e.active and e.placed):
                continue
            row: Row
            if e.on_lane and e.road is not None:
                row = (time, e.x, e.y, e.z, e.h, e.pitch, e.roll, e.speed, e.acceleration, e.road.id, e.lane, e.s, e.t, e.offset)
            else:
                row = (time, e.x, e.y, e.z, e.h, e.pitch, e.roll, e.speed, e.acceleration, None, 0, 0.0, 0.0, 0.0)
            if e in rows:
                rows[e].append(row)
            else:
                rows[e] = [row]

    def recording(self) -> Recording:
        """What was written down so far."""
        sim = self._sim
        tracks = [Track(e.name, e.kind, e.category, e.box, partial(_arrays, rows)) for e, rows in self._rows.items()]
        return Recording(tracks, sim.dt, sim.network)
