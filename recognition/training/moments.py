"""Which moments of a recording train and test: events of the rules, and a regular stride, where mostly nothing happens."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from recognition.labels import Event, Rules, label, passing
from recognition.sites import Site
from recognition.trfe.samples import BACKGROUND
from runner.recording import Recording
from xodr.array_types import FloatArray

STRIDE = 1.0
"""Time between two moments of one vehicle, s"""
_MANY = 1000


class Moment(NamedTuple):
    """A labelled moment about an ego; the label is a class, or `BACKGROUND`."""

    recording: str
    ego: str
    time: float
    label: int


def events_and_background(recording: Recording, site: Site, name: str, rules: Rules) -> tuple[list[Event], list[Moment]]:
    """The rules' events of a recording; and moments at the stride, of the class that a rule finds there, or of none.

    A rule for something that lasts (cruising, following, circulating) finds few events of it, far apart; at the stride all of it
    counts. Moments less than a window from an event, but not at it, are left out: they are neither one nor the other. So are
    moments on a way through a junction at which no rule finds anything (`recognition.labels.passing`).
    """
    events = label(recording, site, name, rules)
    lasting = label(recording, site, name, replace(rules, spacing=STRIDE, ring_spacing=STRIDE, most_windows=_MANY))
    ways = passing(recording, site, rules)
    times: dict[str, list[tuple[float, int]]] = {}
    for event in (*lasting, *events):
        times.setdefault(event.ego, []).append((event.time, int(event.label)))
    found = []
    for track in recording.tracks.values():
        if track.kind == "vehicle":
            own = times.get(track.name, [])
            labelled = zip(*_labelled(regular(track.columns["time"], rules.window), own, rules.window), strict=True)
            passages = ways.get(track.name, [])
            found += [
                Moment(name, track.name, at, which)
                for at, which in labelled
                if which != BACKGROUND or not any(start <= at <= end for start, end in passages)
            ]
    return events, found


def regular(time: FloatArray, window: float, stride: float = STRIDE) -> FloatArray:
    """Moments of a track at the stride, whose windows it covers, s."""
    return np.arange(time[0] + 0.5 * window, time[-1] - 0.5 * window, stride)


def _labelled(regular: FloatArray, own: Sequence[tuple[float, int]], window: float) -> tuple[list[float], list[int]]:
    """Moments with their labels: of the event nearest within half a stride, or the background, a window away from all."""
    if not own:
        return regular.tolist(), [BACKGROUND] * len(regular)
    times, labels = (np.array(values) for values in zip(*own, strict=True))
    apart = np.abs(regular[:, None] - times)
    nearest = apart.argmin(axis=1) if len(regular) else np.zeros(0, np.int64)
    least = apart.min(axis=1, initial=np.inf)
    chosen = np.where(least <= 0.5 * STRIDE, labels[nearest], BACKGROUND)
    kept = (least <= 0.5 * STRIDE) | (least >= window)
    return regular[kept].tolist(), chosen[kept].tolist()
