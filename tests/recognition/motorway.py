"""A highD recording in which most happens that catalogues have to show, for the
tests of `recognition.catalogue`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from tests.recognition.traffic import Car, highd_rows, write_highd

RATE, FRAMES = 25.0, 300
EGO, CUTTER, OTHER_EGO, OTHER_CUTTER, LATE, STOPPING, FAR = "1", "2", "3", "4", "5", "6", "7"
"""An ego and who cuts in before it to the right; the same to the left on the other carriageway; a
truck that is there from 4 s to 8 s; one that brakes and stands; one that hardly moves."""


class Drive(NamedTuple):
    """A vehicle: lane centre and x of its box's centre at its first frame (image frame), velocity
    at a time (s) since then.
    """

    id: int
    x: float
    y: float
    velocity: Callable[[float], tuple[float, float]]
    first: int = 1
    frames: int = FRAMES
    length: float = 4.0
    kind: str = "Car"


def change(time: float, begin: float = 4.0, end: float = 8.0, way: float = 4.0) -> float:
    """Lateral speed of a change of lane."""
    return way / (end - begin) if begin <= time < end else 0.0


DRIVES = [
    Drive(1, 2.0, 26.0, lambda t: (30.0, 0.0)),
    Drive(2, 62.0, 22.0, lambda t: (27.0, change(t))),
    Drive(3, 392.0, 14.0, lambda t: (-28.0, 0.0)),
    Drive(4, 352.0, 10.0, lambda t: (-28.0, change(t))),
    Drive(5, 190.0, 26.0, lambda t: (22.0, 0.0), first=101, frames=101, length=12.0, kind="Truck"),
    Drive(6, 140.0, 22.0, lambda t: (max(24.0 - 4.0 * t, 0.0), 0.0)),
    Drive(7, 390.0, 22.0, lambda t: (1.0, 0.0), frames=50),
]


def write_motorway(folder: Path, name: str = "01", **recording: object) -> Path:
    """Write the recording; its track file."""
    cars, rows = [], []
    for drive in DRIVES:
        x, y = drive.x, drive.y
        shape = Car(drive.id, 0.0, 0.0, 1.0, length=drive.length, kind=drive.kind, frames=1)
        cars.append(
            shape._replace(vx=drive.velocity(0.0)[0], first=drive.first, frames=drive.frames)
        )
        (row,) = highd_rows([shape])
        for frame in range(drive.frames):
            vx, vy = drive.velocity(frame / RATE)
            place = {"x": x - drive.length / 2, "y": y - 1.0, "xVelocity": vx, "yVelocity": vy}
            rows.append(row | place | {"frame": drive.first + frame})
            x, y = x + vx / RATE, y + vy / RATE
    return write_highd(folder, cars, name=name, rows=rows, **recording)
