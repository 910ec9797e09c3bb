"""Participants of data sets: their kinds, usual sizes, and where their reference point is.

Data sets give the centre (or the front) of a box; recordings the reference point of OpenSCENARIO, for vehicles the middle
of the rear axle on the ground. No data set says where the axle is: it is taken to be `REAR_AXLE` of the length behind the
centre, as in usual cars, whose wheelbase is about 0.6 of their length with equal overhangs. The box lies about the reference
point accordingly, so that putting it back gives exactly the recorded box, whatever the assumption.
"""

from __future__ import annotations

from typing import NamedTuple

from runner.participants.declaration import BoundingBox

REAR_AXLE = 0.3
"""Distance of the rear axle behind the centre of a vehicle, in lengths of it."""

_USUAL = {
    "car": (4.5, 1.8, 1.5),
    "van": (6.0, 2.1, 2.6),
    "truck": (8.0, 2.4, 3.5),
    "bus": (12.0, 2.5, 3.0),
    "trailer": (6.0, 2.2, 2.5),
    "tram": (30.0, 2.4, 3.5),
    "motorbike": (2.2, 0.9, 1.5),
    "bicycle": (1.8, 0.6, 1.8),
    "pedestrian": (0.5, 0.5, 1.8),
    "obstacle": (1.0, 1.0, 1.0),
}
"""Usual length, width and height of each category, m."""


class Participant(NamedTuple):
    """Who a track is of."""

    name: str
    kind: str
    category: str
    box: BoundingBox


def participant(name: str, category: str, length: float | None = None, width: float | None = None) -> Participant:
    """A participant of a category of `_USUAL`, with the usual size where none was recorded; m."""
    usual_length, usual_width, height = _USUAL[category]
    length = usual_length if length is None else length
    width = usual_width if width is None else width
    kind = {"pedestrian": "pedestrian", "obstacle": "miscellaneous"}.get(category, "vehicle")
    behind = REAR_AXLE * length if kind == "vehicle" else 0.0
    return Participant(name, kind, category, BoundingBox(behind, 0.0, height / 2, length, width, height))
