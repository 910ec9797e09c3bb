"""The few seconds around the worst moment of a run, small enough that a page shows many."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from runner.replay.scene.account import account
from runner.replay.scene.partner import main_partner
from runner.replay.scene.scene import extent, road_of, steps, track_of, union

if TYPE_CHECKING:
    from runner.interpreter.result import RunResult
    from runner.recording import Track

_BEFORE, _AFTER = 3.5, 1.0
"""How long before and after the worst moment it plays, s"""
_AROUND = 30.0
"""How far around the ego and the other one roads and participants are drawn, m"""
_SAMPLE = 0.1
"""Least time between samples, s"""


def preview(result: RunResult) -> dict[str, Any] | None:
    """What `page/play/preview.js` plays; None for runs in which the ego met nobody."""
    measures = result.criticality
    if measures is None or measures.conflict is None or result.ego is None:
        return None
    begin, end = max(0.0, measures.conflict - _BEFORE), min(result.end_time, measures.conflict + _AFTER)
    tracks = {name: _during(track, begin, end) for name, track in result.recording.tracks.items()}
    pair = [name for name in (result.ego, main_partner(measures)) if name in tracks and len(tracks[name].columns["time"])]
    area = union(extent([tracks[name]]) for name in pair).wider(_AROUND)
    origin = (round((area.west + area.east) / 2), round((area.south + area.north) / 2))
    dt = result.settings["timestep"]
    stride = max(1, round(_SAMPLE / dt))
    network = result.recording.network
    return {
        "steps": steps(),
        "road": road_of(network, area, origin) if network is not None else None,
        "sample": stride * dt,
        "from": begin,
        "to": end,
        "ego": result.ego,
        "pair": pair,
        "told": account(result)[0].text,
        "tracks": [
            track_of(track, dt, stride, origin)
            for track in tracks.values()
            if len(track.columns["time"]) and area.meets(extent([track]))
        ],
    }


def _during(track: Track, begin: float, end: float) -> Track:
    """A participant from one instant to another (s)."""
    time = track.columns["time"]
    rows = (time >= begin - 1e-6) & (time <= end + 1e-6)
    columns = {name: values[rows] for name, values in track.columns.items()}
    return replace(track, read=lambda: columns)
