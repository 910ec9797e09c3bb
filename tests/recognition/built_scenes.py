"""Recordings of straight-driving vehicles, made in memory, for the tests of grids and windows."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import NamedTuple

import numpy as np

from runner.engine.participants.declaration import BoundingBox
from runner.recording import COLUMNS, Recording, Track

STEP = 0.1


class Driver(NamedTuple):
    """A vehicle with constant velocity; x, y of its box's centre at time 0, m.
    It is there from `start` to `end`, s.
    """

    name: str
    x: float = 0.0
    y: float = 0.0
    h: float = 0.0
    speed: float = 0.0
    length: float = 4.0
    width: float = 2.0
    start: float = 0.0
    end: float = 4.0


def recording(
    drivers: Iterable[Driver], turn: float = 0.0, shift: tuple[float, float] = (0.0, 0.0)
) -> Recording:
    """Their recording, with the world turned (rad) about the origin and then shifted (m)."""
    return Recording([_track(driver, turn, shift) for driver in drivers], STEP, None)


def _track(driver: Driver, turn: float, shift: tuple[float, float]) -> Track:
    box = BoundingBox(1.3, 0.0, 0.7, driver.length, driver.width, 1.4)
    return Track(driver.name, "vehicle", "car", box, partial(_columns, driver, turn, shift))


def _columns(driver: Driver, turn: float, shift: tuple[float, float]) -> dict[str, np.ndarray]:
    time = np.arange(round(driver.start / STEP), round(driver.end / STEP) + 1) * STEP
    way = driver.speed * time - 1.3  # the reference point lies behind the centre
    x, y = driver.x + way * np.cos(driver.h), driver.y + way * np.sin(driver.h)
    columns = {name: np.zeros(len(time)) for name in COLUMNS}
    columns["time"] = time
    columns["x"] = x * np.cos(turn) - y * np.sin(turn) + shift[0]
    columns["y"] = x * np.sin(turn) + y * np.cos(turn) + shift[1]
    columns["h"] = np.full(len(time), driver.h + turn)
    columns["speed"] = np.full(len(time), driver.speed)
    return columns
