"""What a rule finds, how it becomes events, and which rule wins where several find something about one ego at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from recognition.labels.classes import Event, Label
from recognition.labels.scene.leads import ABSENT
from recognition.labels.scene.scene import Scene
from xodr.array_types import IntArray

PRECEDENCE = (
    Label.MERGING,
    Label.LEFT_TURN,
    Label.RIGHT_TURN,
    Label.STRAIGHT_CROSS,
    Label.ROUNDABOUT_ENTERING,
    Label.ROUNDABOUT_EXITING,
    Label.RAMP_ENTERING,
    Label.RAMP_EXITING,
    Label.LANE_CHANGE_LEFT,
    Label.LANE_CHANGE_RIGHT,
    Label.CUT_IN,
    Label.URBAN_CUT_IN,
    Label.CUT_OUT,
    Label.URBAN_CUT_OUT,
    Label.ROUNDABOUT_CIRCULATING,
    Label.CAR_FOLLOWING,
    Label.FREE_CRUISE,
)
"""Of two events of one ego less than a window apart the one whose class comes first here stays; of equal ones the earlier."""
_DIGITS = 6


class Hits(NamedTuple):
    """Events of one class: ego's row at t*, a row of the partner or ABSENT, and values of the tags, all equally long."""

    label: Label
    row: IntArray
    partner: IntArray
    tags: Mapping[str, NDArray]


def alone(label: Label, row: IntArray, **tags: NDArray) -> Hits:
    """Hits without partners."""
    return Hits(label, row, np.full(len(row), ABSENT, np.int64), tags)


def events(scene: Scene, name: str, found: Iterable[Hits]) -> list[Event]:
    """The events that stay, in the order of egos' names and time."""
    candidates = [
        (PRECEDENCE.index(hits.label), row, hits, index) for hits in found for index, row in enumerate(hits.row.tolist())
    ]
    taken: dict[int, list[float]] = {}
    kept: list[Event] = []
    for _, row, hits, index in sorted(candidates, key=lambda one: one[:2]):
        time, times = float(scene.time[row]), taken.setdefault(int(scene.track[row]), [])
        if all(abs(time - other) >= scene.rules.window for other in times):
            times.append(time)
            kept.append(_event(scene, name, hits, index))
    return sorted(kept, key=lambda event: (event.ego, event.time))


def _event(scene: Scene, name: str, hits: Hits, index: int) -> Event:
    row, partner = int(hits.row[index]), int(hits.partner[index])
    other = scene.names[scene.track[partner]] if partner != ABSENT else None
    tags = {key: _plain(values[index]) for key, values in hits.tags.items()}
    return Event(name, scene.names[scene.track[row]], round(float(scene.time[row]), _DIGITS), hits.label, other, tags)


def _plain(value: np.generic) -> bool | float:
    return bool(value) if isinstance(value, np.bool_) else round(float(value), _DIGITS)
