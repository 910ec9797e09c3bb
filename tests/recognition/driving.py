"""Small synthetic recordings for the tests of labels: vehicles on straight
lines, or driven along the lanes of a map.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from recognition.labels import Label, LabelledEvent, Rules, label
from recognition.recordings.source import participant
from recognition.scenes import Site, site_at
from runner.recording import Recording, Track
from schemas.common.array_types import FloatArray
from xodr.builders import RoadMap
from xodr.graph.network import RoadNetwork

STEP = 0.1
USUAL = Rules()


def site(built: RoadMap, folder: Path) -> Site:
    """A map as a site of its own."""
    return site_at(built.write(folder / "site.xodr"))


def track(
    name: str,
    x: ArrayLike,
    y: ArrayLike,
    *,
    start: float = 0.0,
    heading: float | None = None,
    category: str = "car",
    length: float = 4.5,
    width: float = 1.8,
    missing: Sequence[int] = (),
) -> Track:
    """A track of reference points (n,), one every `STEP`; it heads where it
    moves unless a heading is given.
    """
    x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
    who = participant(name, category, length, width)
    time = start + STEP * np.arange(len(x))
    vx, vy = np.gradient(x, STEP), np.gradient(y, STEP)
    h = np.arctan2(vy, vx) if heading is None else np.full(len(x), heading)
    speed = vx * np.cos(h) + vy * np.sin(h)
    zero = np.zeros(len(x))
    columns = {
        "time": time, "x": x, "y": y, "z": zero, "h": h, "pitch": zero, "roll": zero,
        "speed": speed,
        "acceleration": np.gradient(speed, STEP), "road_id": np.full(len(x), None, object),
        "lane_id": np.zeros(len(x), np.int64),
        "s": zero, "t": zero, "lane_offset": zero,
    }  # fmt: skip
    kept = np.setdiff1d(np.arange(len(x)), missing)
    return Track(
        name,
        who.kind,
        category,
        who.box,
        lambda: {key: values[kept].copy() for key, values in columns.items()},
    )


def ahead(x: float, speed: float, seconds: float) -> FloatArray:
    """x of a vehicle with a constant speed, for so long."""
    return x + speed * STEP * np.arange(round(seconds / STEP) + 1)


def sideways(y: float, end: float, at: float, seconds: float, duration: float = 4.0) -> FloatArray:
    """y of a vehicle that moves smoothly from one y to another, half of it done
    at the time `at`.
    """
    share = np.clip((STEP * np.arange(round(seconds / STEP) + 1) - at) / duration + 0.5, 0.0, 1.0)
    return y + (end - y) * share**2 * (3.0 - 2.0 * share)


def route(
    network: RoadNetwork,
    start: tuple[str, int, float],
    speed: float,
    seconds: float,
    roads: Sequence[str] = (),
) -> tuple[FloatArray, FloatArray]:
    """x and y of a vehicle that keeps to the middle of its lane, through the
    roads named where ways part.

    Args:
        start: road, lane and s.
    """
    road, lane, s = start
    point, forward = network.lane_point(road, lane, s), network.roads[road].direction(lane) > 0

    def choose(here: object, direction: bool, links: Sequence) -> object:
        named = [link for link in links if link.road_id in roads]
        return named[0] if named else network.straightest(here, direction, links)

    places = []
    for _ in range(round(seconds / STEP) + 1):
        pose = network.pose(point)
        places.append((pose.x, pose.y))
        point, forward, left = network.travel(point, speed * STEP, forward, choose)
        if left > 0.0:
            break
    x, y = np.array(places).T
    return x, y


def labels(place: Site, *tracks: Track, config: Rules = USUAL) -> list[LabelledEvent]:
    """The events of a recording of these tracks."""
    return label(Recording(list(tracks), STEP, None), place, "test", config)


def of(events: list[LabelledEvent], ego: str) -> list[Label]:
    """Labels of one ego's events, in the order of time."""
    return [event.label for event in events if event.ego == ego]
