"""Writes small recordings of all formats for the tests of `recognition`, and reads them."""

from __future__ import annotations

import io
import math
import tarfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from recognition import recordings as datasets
from runner.recording import Recording

UPPER, LOWER = (8.0, 12.0, 16.0), (20.0, 24.0, 28.0)
_SURROUNDINGS = (
    "frontSightDistance", "backSightDistance", "dhw", "thw", "ttc", "precedingXVelocity",
    "precedingId", "followingId", "leftPrecedingId", "leftAlongsideId", "leftFollowingId",
    "rightPrecedingId", "rightAlongsideId", "rightFollowingId",
)  # fmt: skip


class Car(NamedTuple):
    """A vehicle of a highD recording with a constant velocity; x, y of its upper left corner at its
    first frame, image frame.
    """

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
            "frame": car.first + k, "id": car.id, "x": car.x + car.vx * k / rate,
            "y": car.y + car.vy * k / rate,
            "width": car.length, "height": car.width, "xVelocity": car.vx, "yVelocity": car.vy,
            "xAcceleration": 0.0,
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
    **more: object,
) -> Path:
    """Write the three files of a recording; the path of its track file. `rows`
    replaces the rows of the cars.
    """
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
        "id": 1, "frameRate": rate, "locationId": 2, "speedLimit": speed_limit,
        "upperLaneMarkings": upper,
        "lowerLaneMarkings": lower, **more,
    }  # fmt: skip
    write_csv(folder / f"{name}_tracksMeta.csv", meta)
    write_csv(folder / f"{name}_recordingMeta.csv", [recording])
    return write_csv(
        folder / f"{name}_tracks.csv", highd_rows(cars, rate) if rows is None else rows
    )


def ind_rows(
    track: int,
    x: float,
    y: float,
    vx: float,
    vy: float,
    *,
    first: int = 0,
    n: int = 20,
    **other: object,
) -> list:
    """Rows of NN_tracks.csv of inD: a participant with a constant velocity, 10 frames a second."""
    return [
        {
            "recordingId": 0, "trackId": track, "frame": first + k, "trackLifetime": k,
            "xCenter": x + 0.1 * vx * k,
            "yCenter": y + 0.1 * vy * k, "heading": math.degrees(math.atan2(vy, vx)) % 360.0,
            "width": 2.0, "length": 4.0,
            "xVelocity": vx, "yVelocity": vy, "xAcceleration": 0.0, "yAcceleration": 0.0, **other,
        }
        for k in range(n)
    ]  # fmt: skip


def write_ind(
    folder: Path,
    rows: Sequence[Mapping[str, object]],
    kinds: Mapping[int, str] | None = None,
    **recording: object,
) -> Path:
    """Write the three files of a recording of inD in Aachen; the path of its
    track file. Tracks without a kind are cars.
    """
    meta: dict[object, dict[str, object]] = {}
    for row in rows:
        own = {
            "trackId": row["trackId"],
            "initialFrame": row["frame"],
            "width": row["width"],
            "length": row["length"],
        }
        kind = (kinds or {}).get(int(str(row["trackId"])), "car")
        meta.setdefault(row["trackId"], {"recordingId": 0, **own, "class": kind})["finalFrame"] = (
            row["frame"]
        )
    write_csv(folder / "00_tracksMeta.csv", list(meta.values()))
    place = {
        "latLocation": 50.78,
        "lonLocation": 6.13,
        "xUtmOrigin": 297631.3187,
        "yUtmOrigin": 5629917.3465,
    }
    write_csv(
        folder / "00_recordingMeta.csv",
        [{"recordingId": 0, "locationId": 1, "frameRate": 10.0, **place, **recording}],
    )
    return write_csv(folder / "00_tracks.csv", rows)


def interaction_rows(
    track: object, x: float, y: float, vx: float, vy: float, h: float, n: int = 20, **other: object
) -> list:
    """Rows of a vehicle with a constant velocity."""
    return [
        {
            "track_id": track, "frame_id": k + 1, "timestamp_ms": 100 * (k + 1),
            "agent_type": "car",
            "x": x + 0.1 * vx * k, "y": y + 0.1 * vy * k, "vx": vx, "vy": vy, "psi_rad": h,
            "length": 4.0, "width": 2.0, **other,
        }
        for k in range(n)
    ]  # fmt: skip


def write_csv(path: Path, rows: Sequence[Mapping[str, object]]) -> Path:
    """Write rows below a header of their keys; None is blank."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [",".join(rows[0])] + [
        ",".join("" if value is None else str(value) for value in row.values()) for row in rows
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


def commonroad_state(
    name: str, step: int, x: float, y: float, h: float, speed: float, more: str = ""
) -> str:
    """A state of an obstacle in CommonRoad XML, with exact values; `more` is what else it has."""
    return (
        f"<{name}><position><point><x>{x}</x><y>{y}</y></point></position><orientation><exact>{h}</exact></orientation>"
        f"<time><exact>{step}</exact></time><velocity><exact>{speed}</exact></velocity>{more}</{name}>"
    )


RECTANGLE = "<rectangle><length>4.0</length><width>2.0</width></rectangle>"


def obstacle(
    id: int, x: float, y: float, h: float, speed: float, *, steps: int = 10, kind: str = "car",
    version: str = "2018b",
    shape: str = RECTANGLE, more: str = "",
) -> str:  # fmt: skip
    """A dynamic obstacle that goes straight ahead, at 10 steps a second; `more`
    is what else its states have.
    """
    first, *others = (
        (k, x + 0.1 * k * speed * math.cos(h), y + 0.1 * k * speed * math.sin(h), h, speed, more)
        for k in range(steps)
    )
    trajectory = "".join(commonroad_state("state", *state) for state in others)
    tag, role = (
        ("obstacle", "<role>dynamic</role>") if version == "2018b" else ("dynamicObstacle", "")
    )
    return (
        f'<{tag} id="{id}">{role}<type>{kind}</type><shape>{shape}</shape>{commonroad_state("initialState", *first)}'
        f"<trajectory>{trajectory}</trajectory></{tag}>"
    )


def commonroad(*content: str, version: str = "2018b", step: object = 0.1) -> str:
    """A CommonRoad scenario of lanelets and obstacles, one a line."""
    head = (
        f'<commonRoad commonRoadVersion="{version}" benchmarkID="DEU_Test-1_1_T-1" '
        f'timeStepSize="{step}">'
    )
    return "\n".join(['<?xml version="1.0"?>', head, *content, "</commonRoad>"])


def write_archive(path: Path, members: Mapping[str, str]) -> Path:
    """Pack texts as files into a tar archive, compressed as its name says."""
    with tarfile.open(path, f"w:{path.suffix.removeprefix('.').replace('tar', '')}") as archive:  # type: ignore[call-overload]
        for name, text in members.items():
            entry = tarfile.TarInfo(name)
            entry.size = len(text.encode())
            archive.addfile(entry, io.BytesIO(text.encode()))
    return path


def ngsim_rows(
    vehicle: int, along: float, across: float, speed: float, n: int = 20, **other: object
) -> list[dict[str, object]]:
    """Rows of NGSIM's public layout for a constant speed along the road: lengths
    in feet, front bumper, 10 Hz.
    """
    return [
        {
            "Vehicle_ID": vehicle, "Frame_ID": 100 + k, "Total_Frames": n,
            "Global_Time": 1_118_846_980_000 + 100 * k,
            "Local_X": across, "Local_Y": along + 0.1 * k * speed, "v_Length": 15.0, "v_Width": 6.0,
            "v_Class": 2,
            "v_Vel": speed, "v_Acc": 0.0, "Lane_ID": 3, **other,
        }
        for k in range(n)
    ]  # fmt: skip


def metric_rows(
    vehicle: int, x: float, y: float, heading: float, speed: float, n: int = 20, **other: object
) -> list[dict]:
    """Rows of NGSIM's metric layout for a constant velocity: m, rad, box centres, 10 Hz."""
    return [
        {
            "vehicle_id": vehicle, "sim_time": 7.9 + 0.1 * k,
            "position_x": x + 0.1 * k * speed * math.cos(heading),
            "position_y": y + 0.1 * k * speed * math.sin(heading), "heading_rad": heading,
            "speed": speed, "lane_id": 2,
            "type": 2, "length": 4.0, "width": 2.0, **other,
        }
        for k in range(n)
    ]  # fmt: skip


def write_parquet(path: Path, rows: Sequence[Mapping[str, object]]) -> Path:
    """Write rows as a Parquet table."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.Table.from_pylist(list(rows)), path)
    return path


def read(path: Path) -> tuple[Recording, datasets.Report]:
    """The recording of the only source in a file or folder, and what reading it
    found, possible or not; roads go beside it.
    """
    (source,) = datasets.open(
        path, roads=(path if path.is_dir() else path.parent) / "roads"
    ).sources
    recording = source.examine()
    assert source.report is not None
    return recording, source.report


def total_rows(recording: Recording) -> int:
    """How many rows all tracks have."""
    return sum(len(track.columns["time"]) for track in recording.tracks.values())
