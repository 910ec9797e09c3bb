"""Writes down where everyone is, as a run goes on."""

from __future__ import annotations

from struct import Struct
from typing import TYPE_CHECKING

from runner.recording import COLUMNS, Recording, Track

if TYPE_CHECKING:
    import numpy as np

    from runner.participants.declaration import Declaration
    from runner.participants.entity import Entities, Entity
    from xodr.network import RoadNetwork

_FIELDS = [(name, "int64" if name == "lane_id" else "float64") for name in COLUMNS if name != "road_id"]
_pack = Struct("=" + "".join("q" if type_ == "int64" else "d" for _, type_ in _FIELDS)).pack
"""The numbers of `COLUMNS` at one instant as bytes: objects for each row would keep Python's garbage collector busy."""


class _Rows:
    """What is written down of one entity; a road id of None means: not looked up yet."""

    __slots__ = ("numbers", "roads")

    def __init__(self) -> None:
        self.numbers = bytearray()
        self.roads: list[str | None] = []

    def columns(self) -> dict[str, np.ndarray]:
        """One array for each of `COLUMNS`."""
        import numpy as np

        rows = np.frombuffer(bytes(self.numbers), dtype=_FIELDS)
        return {name: rows[name].copy() if name != "road_id" else np.array(self.roads, dtype=object) for name in COLUMNS}


def _track(declared: Declaration, rows: _Rows) -> Track:
    return Track(declared.name, declared.kind, declared.category, declared.box, rows.columns)


class Recorder:
    """Writes down every present entity of a run, once a step.

    Args:
        entities: everyone.
        timestep: time between rows, s.
        network: the roads.
    """

    def __init__(self, entities: Entities, timestep: float, network: RoadNetwork | None) -> None:
        self._entities, self._timestep, self._network = entities, timestep, network
        self._rows: dict[Entity, _Rows] = {}

    def record(self, time: float) -> None:
        """Write down the state of everyone at a time (s)."""
        rows = self._rows
        for e in self._entities.values():
            if not (e.active and e.placed):
                continue
            written = rows.get(e)
            if written is None:
                written = rows[e] = _Rows()
            if e.on_lane and e.road is not None:
                road, lane, s, t, offset = e.road.id, e.lane, e.s, e.t, e.offset
            else:
                road, lane, s, t, offset = None, 0, 0.0, 0.0, 0.0
            written.roads.append(road)
            written.numbers += _pack(time, e.x, e.y, e.z, e.h, e.pitch, e.roll, e.speed, e.acceleration, lane, s, t, offset)

    def recording(self) -> Recording:
        """What was written down so far."""
        tracks = [_track(entity.declared, rows) for entity, rows in self._rows.items()]
        return Recording(tracks, self._timestep, self._network)
