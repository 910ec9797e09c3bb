"""Participants of recordings as entries of vehicle, pedestrian and object catalogues, with their recorded dimensions."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

from runner.participants.declaration import BoundingBox
from runner.recording import Track
from xosc import maneuvers

_KINDS = {"vehicle": "Vehicle", "pedestrian": "Pedestrian", "miscellaneous": "MiscObject"}
_BUILDERS = {"Vehicle": maneuvers.vehicle, "Pedestrian": maneuvers.pedestrian, "MiscObject": maneuvers.obstacle}


class _Limits(NamedTuple):
    """Of a category of vehicles: greatest speed (m/s), acceleration and deceleration (m/s²)."""

    max_speed: float
    max_acceleration: float
    max_deceleration: float


_CAR = _Limits(70.0, 10.0, 10.0)
_LIMITS = {
    "van": _Limits(50.0, 6.0, 10.0),
    "truck": _Limits(35.0, 5.0, 10.0),
    "bus": _Limits(35.0, 5.0, 10.0),
    "tram": _Limits(25.0, 3.0, 5.0),
    "motorbike": _Limits(80.0, 10.0, 10.0),
    "bicycle": _Limits(20.0, 5.0, 8.0),
}
"""No data set has these: usual values, `_CAR` for every other vehicle. They are a little more than the limits of smoothed motion
(`recognition.datasets.smoothing.limits`): runs that may not exceed those would be late."""


class Entry(NamedTuple):
    """An entry of a catalogue: its kind (as in `maneuvers.CATALOG_KINDS`), name and content."""

    kind: str
    name: str
    built: Any


def entry(track: Track) -> Entry:
    """The entry for a participant. Its name has the dimensions (to 1 cm), so that entries of one name are alike."""
    return _entry(track.kind, track.category, track.box)


@lru_cache(maxsize=4096)
def _entry(group: str, category: str, recorded: BoundingBox) -> Entry:
    box = BoundingBox(*(round(value, 2) + 0.0 for value in recorded))
    kind = _KINDS[group]
    name = f"{category}_{box.length:.2f}x{box.width:.2f}x{box.height:.2f}"
    about = (box.x, box.y, round(box.z - box.height / 2, 2) + 0.0)
    name += "".join(f"_{axis}{value:.2f}" for axis, value in zip("xyz", about, strict=True) if value)
    limits = _LIMITS.get(category, _CAR)._asdict() if kind == "Vehicle" else {}
    built = _BUILDERS[kind](name, box.length, box.width, box.height, category=category, **limits)
    centre = built.boundingbox.center
    centre.x, centre.y, centre.z = box.x, box.y, box.z
    return Entry(kind, name, built)
