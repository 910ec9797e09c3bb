"""Writes down where everyone is, as a run goes on."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from runner.recording import COLUMNS, Recording, Track

if TYPE_CHECKING:
    import numpy as np

    from runner.participants.declaration import Declaration
    from runner.participants.entity import Entities, Entity
    from xodr.network import RoadNetwork

_TYPES: dict[str, Any] = {"road_id": object, "lane_id": "int64"}
Row = tuple[Any, ...]
"""Values of `COLUMNS` at one instant; a road id of None means: not looked up yet."""


def _arrays(rows: list[Row]) -> dict[str, np.ndarray]:
    import numpy as np

    columns = zip(COLUMNS, zip(*rows, strict=True), strict=True)
    return {name: np.array(values, dtype=_TYPES.get(name, "float64")) for name, values in columns}


def _track(declared: Declaration, rows: list[Row]) -> Track:
    return Track(declared.name, declared.kind, declared.category, declared.box, partial(_arrays, rows))


class Recorder:
    """Writes down every present entity of a run, once a step.

    Args:
        entities: everyone.
        timestep: time between rows, s.
        network: the roads.
    """

    def __init__(self, entities: Entities, timestep: float, network: RoadNetwork | None) -> None:
        self._entities, self._timestep, self._network = entities, timestep, network
        self._rows: dict[Entity, list[Row]] = {}

    def record(self, time: float) -> None:
        """Write down the state of everyone at a time (s)."""
        rows = self._rows
        for e in self._entities.values():
            if not (e.active and e.placed):
                continue
            row: Row
            if e.on_lane and e.road is not None:
                row = (time, e.x, e.y, e.z, e.h, e.pitch, e.roll, e.speed, e.acceleration, e.road.id, e.lane, e.s, e.t, e.offset)
            else:
                row = (time, e.x, e.y, e.z, e.h, e.pitch, e.roll, e.speed, e.acceleration, None, 0, 0.0, 0.0, 0.0)
            written = rows.get(e)
            if written is None:
                rows[e] = [row]
            else:
                written.append(row)

    def recording(self) -> Recording:
        """What was written down so far."""
        tracks = [_track(entity.declared, rows) for entity, rows in self._rows.items()]
        return Recording(tracks, self._timestep, self._network)
