"""Looks up the places of a whole recording on the roads of its site."""

from __future__ import annotations

import numpy as np

from runner.recording import Recording
from xodr.lookup import placing
from xodr.network import RoadNetwork


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
