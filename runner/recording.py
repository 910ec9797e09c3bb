"""Who was where when, on which road: what a run writes down and what recordings of real traffic are read into."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    import pyarrow as pa

    from runner.entities import BoundingBox, Entity
    from runner.simulation import Simulation
    from xodr.model import RoadPoint
    from xodr.network import RoadNetwork

COLUMNS = (
    "time",
    "x",
    "y",
    "z",
    "h",
    "pitch",
    "roll",
    "speed",
    "acceleration",
    "road_id",
    "lane_id",
    "s",
    "t",
    "lane_offset",
)
"""Columns of a track: s; m in the world frame of the road network (reference point); rad, mathematical; m/s and m/s²
along the heading; OpenDRIVE road coordinates (lane_offset is t minus the t of the lane's centre)."""

_ROAD = COLUMNS.index("road_id")
Row = tuple[Any, ...]
"""Values of `COLUMNS` at one instant; a road id of None means: not looked up yet."""


@dataclass(eq=False)
class Track:
    """One participant of a recording.

    Args:
        name: its name.
        kind: vehicle, pedestrian or miscellaneous.
        category: e.g. car, truck, bicycle.
        box: its bounding box about the reference point, m.
        rows: values of `COLUMNS`, in ascending time.
    """

    name: str
    kind: str
    category: str
    box: BoundingBox
    rows: list[Row]

    @cached_property
    def columns(self) -> dict[str, np.ndarray]:
        """The rows as one array a column."""
        import numpy as np

        values = list(zip(*self.rows, strict=True)) or [()] * len(COLUMNS)
        kinds = {"road_id": object, "lane_id": np.int64}
        return {name: np.array(column, dtype=kinds.get(name, np.float64)) for name, column in zip(COLUMNS, values, strict=True)}


class Recording:
    """Tracks of all participants on one road network.

    Args:
        tracks: one for each participant.
        timestep: time between rows, s.
        network: the roads, for looking up road coordinates that the run had no need of.
    """

    def __init__(self, tracks: list[Track], timestep: float, network: RoadNetwork | None) -> None:
        self.tracks = {track.name: track for track in tracks}
        self.timestep = timestep
        self.network = network
        self._located = False

    def locate(self) -> Recording:
        """Complete the road coordinates of every row (done once, on demand)."""
        if not self._located:
            self._located = True
            if self.network is not None:
                for track in self.tracks.values():
                    track.rows = _located(track.rows, self.network)
                    track.__dict__.pop("columns", None)
        return self

    def table(self) -> pa.Table:
        """Long form, sorted by time, then by the participants' order; `entity` after `time`, then the other columns."""
        import numpy as np
        import pyarrow as pa

        self.locate()
        tracks = [track for track in self.tracks.values() if track.rows]
        if not tracks:
            return pa.table({name: pa.array([], _arrow_type(name)) for name in ("time", "entity", *COLUMNS[1:])})
        time = np.concatenate([track.columns["time"] for track in tracks])
        order = np.argsort(time, kind="stable")
        names = np.repeat(np.arange(len(tracks)), [len(track.rows) for track in tracks])[order]
        entity = pa.DictionaryArray.from_arrays(names.astype(np.int32), [track.name for track in tracks]).cast(pa.string())
        table = {"time": pa.array(time[order]), "entity": entity}
        for name in COLUMNS[1:]:
            joined = np.concatenate([track.columns[name] for track in tracks])[order]
            table[name] = pa.array(joined, _arrow_type(name))
        return pa.table(table)


def _arrow_type(name: str) -> pa.DataType:
    import pyarrow as pa

    return {"entity": pa.string(), "road_id": pa.string(), "lane_id": pa.int64()}.get(name, pa.float64())


def _located(rows: list[Row], network: RoadNetwork) -> list[Row]:
    hint: RoadPoint | None = None
    done = []
    for row in rows:
        if row[_ROAD] is None:
            hint = network.locate(row[1], row[2], row[3], row[4], hint)
            row = (*row[:_ROAD], hint.road_id, hint.lane_id, hint.s, hint.t, hint.offset)
        done.append(row)
    return done


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
        tracks = [Track(e.name, e.kind, e.category, e.box, rows) for e, rows in self._rows.items()]
        return Recording(tracks, sim.dt, sim.network)
