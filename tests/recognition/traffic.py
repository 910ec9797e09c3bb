"""Writes small highD and INTERACTION recordings for the tests of `recognition`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

UPPER, LOWER = (8.0, 12.0, 16.0), (20.0, 24.0, 28.0)
_SURROUNDINGS = (
    "frontSightDistance", "backSightDistance", "dhw", "thw", "ttc", "precedingXVelocity", "precedingId", "followingId",
    "leftPrecedingId", "leftAlongsideId", "leftFollowingId", "rightPrecedingId", "rightAlongsideId", "rightFollowingId",
)  # fmt: skip


class Car(NamedTuple):
    """A vehicle of a highD recording with a constant velocity; x, y of its upper left corner at its first frame, image frame."""

    id: int
    x: float
    y: float
    vx: float
    vy: float = 0.0
    length: float = 4.0
    width: float = 2.0
    kind: str = "Car"
    first: int = 1
    frames: int = 10
    lane: int = 0


def highd_rows(cars: Iterable[Car], rate: float = 25.0) -> list[dict[str, object]]:
    """Rows of NN_tracks.csv."""
    zeros = dict.fromkeys(_SURROUNDINGS, 0)
    return [
        {
            "frame": car.first + k, "id": car.id, "x": car.x + car.vx * k / rate, "y": car.y + car.vy * k / rate,
            "width": car.length, "height": car.width, "xVelocity": car.vx, "yVelocity": car.vy, "xAcceleration": 0.0,
            "yAcceleration": 0.0, **zeros, "laneId": car.lane,
        }
        for car in cars
        for k in range(car.frames)
    ]  # fmt: skip


def write_highd(
    folder: Path,
    cars: Sequence[Car],
    *,
    name: str = "01",
    rate: float = 25.0,
    rows: Sequence[Mapping[str, object]] | None = None,
    upper: str = ";".join(map(str, UPPER)),
    lower: str = ";".join(map(str, LOWER)),
    speed_limit: float = -1.0,
) -> Path:
    """Write the three files of a recording; the path of its track file. `rows` replaces the rows of the cars."""
    folder.mkdir(parents=True, exist_ok=True)
    meta = [
        {
            "id": car.id, "width": car.length, "height": car.width, "initialFrame": car.first,
            "finalFrame": car.first + car.frames - 1, "numFrames": car.frames, "class": car.kind,
            "drivingDirection": 2 if car.vx > 0 else 1,
        }
        for car in cars
    ]  # fmt: skip
    recording = {
        "id": 1, "frameRate": rate, "locationId": 2, "speedLimit": speed_limit, "upperLaneMarkings": upper,
        "lowerLaneMarkings": lower,
    }  # fmt: skip
    write_csv(folder / f"{name}_tracksMeta.csv", meta)
    write_csv(folder / f"{name}_recordingMeta.csv", [recording])
    return write_csv(folder / f"{name}_tracks.csv", highd_rows(cars, rate) if rows is None else rows)


def interaction_rows(track: object, x: float, y: float, vx: float, vy: float, h: float, n: int = 20, **other: object) -> list:
    """Rows of a vehicle with a constant velocity."""
    return [
        {
            "track_id": track, "frame_id": k + 1, "timestamp_ms": 100 * (k + 1), "agent_type": "car",
            "x": x + 0.1 * vx * k, "y": y + 0.1 * vy * k, "vx": vx, "vy": vy, "psi_rad": h, "length": 4.0, "width": 2.0, **other,
        }
        for k in range(n)
    ]  # fmt: skip


def write_csv(path: Path, rows: Sequence[Mapping[str, object]]) -> Path:
    """Write rows below a header of their keys; None is blank."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [",".join(rows[0])] + [",".join("" if value is None else str(value) for value in row.values()) for row in rows]
    path.write_text("\n".join(lines) + "\n")
    return path
