"""Who was where when, on which road: what a run writes down and what recordings of real traffic are read into."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    import pyarrow as pa

    from runner.participants.declaration import BoundingBox
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

_PLACE = ("road_id", "lane_id", "s", "t", "lane_offset")


@dataclass(eq=False)
class Track:
    """One participant of a recording.

    Args:
        name: its name.
        kind: vehicle, pedestrian or miscellaneous.
        category: e.g. car, truck, bicycle.
        box: its bounding box about the reference point, m.
        read: gives one array for each of `COLUMNS`, in ascending time; called once, when they are asked for.
    """

    name: str
    kind: str
    category: str
    box: BoundingBox
    read: Callable[[], dict[str, np.ndarray]]

    @cached_property
    def columns(self) -> dict[str, np.ndarray]:
        """One array for each of `COLUMNS`; a road id of None means that the place on the road was not looked up yet."""
        return self.read()

    def locate(self, network: RoadNetwork) -> None:
        """Look up the places on the road that are missing."""
        columns = self.columns
        x, y, z, h = (columns[name] for name in ("x", "y", "z", "h"))
        hint: RoadPoint | None = None
        for i, road_id in enumerate(columns["road_id"]):
            if road_id is None:
                hint = network.locate(float(x[i]), float(y[i]), float(z[i]), float(h[i]), hint)
                place = (hint.road_id, hint.lane_id, hint.s, hint.t, hint.offset)
                for name, value in zip(_PLACE, place, strict=True):
                    columns[name][i] = value


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
        if not self._located and self.network is not None:
            for track in self.tracks.values():
                track.locate(self.network)
        self._located = True
        return self

    def table(self) -> pa.Table:
        """Long form, sorted by time, then by the participants' order; `entity` after `time`, then the other columns."""
        import numpy as np
        import pyarrow as pa

        self.locate()
        tracks = list(self.tracks.values())
        if not tracks:
            return pa.table({name: pa.array([], arrow_type(name)) for name in ("time", "entity", *COLUMNS[1:])})
        time = np.concatenate([track.columns["time"] for track in tracks])
        order = np.argsort(time, kind="stable")
        names = np.repeat(np.arange(len(tracks)), [len(track.columns["time"]) for track in tracks])[order]
        entity = pa.DictionaryArray.from_arrays(names.astype(np.int32), [track.name for track in tracks]).cast(pa.string())
        table = {"time": pa.array(time[order]), "entity": entity}
        for name in COLUMNS[1:]:
            joined = np.concatenate([track.columns[name] for track in tracks])[order]
            table[name] = pa.array(joined, arrow_type(name))
        return pa.table(table)


def arrow_type(name: str) -> pa.DataType:
    """The type of a column of the long form."""
    import pyarrow as pa

    return {"entity": pa.string(), "road_id": pa.string(), "lane_id": pa.int64()}.get(name, pa.float64())
