"""Looks up the places of a whole recording on the roads of its site."""

from __future__ import annotations

import numpy as np

from runner.recording import Recording
from xodr import placing
from xodr.model import RoadPoint
from xodr.network import RoadNetwork

_SAMPLED = 500
"""Rows of vehicles that tell whether a recording is on the roads of a map."""


def place(recording: Recording, network: RoadNetwork) -> None:
    """Complete the road coordinates of every row that lacks them, of all tracks at once."""
    columns = [track.columns for track in recording.tracks.values()]
    missing = [np.flatnonzero(one["road_id"] == None) for one in columns]  # noqa: E711 - of each element
    ends = np.cumsum([len(rows) for rows in missing])
    if not len(ends) or not ends[-1]:
        return
    x, y, z, h = (
        np.concatenate([one[name][rows] for one, rows in zip(columns, missing, strict=True)]) for name in ("x", "y", "z", "h")
    )
    places = placing.place(network, x, y, z, h)
    names = {"road_id": "road_id", "lane_id": "lane_id", "s": "s", "t": "t", "lane_offset": "offset"}
    for one, rows, end in zip(columns, missing, ends.tolist(), strict=True):
        for column, name in names.items():
            one[column][rows] = getattr(places, name)[end - len(rows) : end]


def share_on_road(recording: Recording, network: RoadNetwork) -> float:
    """Share of the places of vehicles that are on a lane, by some of all; 1 where there is no vehicle."""
    columns = [track.columns for track in recording.tracks.values() if track.kind == "vehicle"]
    x, y, z, h = (np.concatenate([np.zeros(0), *(one[name] for one in columns)]) for name in ("x", "y", "z", "h"))
    if not len(x):
        return 1.0
    rows = np.linspace(0, len(x) - 1, _SAMPLED).astype(int)
    places = zip(*(values.tolist() for values in placing.place(network, x[rows], y[rows], z[rows], h[rows])), strict=True)
    return float(np.mean([network.on_road(RoadPoint(road, s, t, lane, offset)) for road, lane, s, t, offset in places]))
