"""Trajectories as files: Parquet in long form, and CSV in the column convention of esmini's csv logger."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from schemas.common.packages import version
from schemas.common.text import csv_text, one_line

if TYPE_CHECKING:
    import numpy as np

    from runner.interpreter.result import RunResult
    from runner.recording import Recording, Track

_GROUP = (
    "Entity_Name [-]",
    "Entity_ID [-]",
    "Current_Speed [m/s]",
    "Wheel_Angle [deg]",
    "Wheel_Rotation [-]",
    "bb_x [m]",
    "bb_y [m]",
    "bb_z [m]",
    "bb_length [m]",
    "bb_width [m]",
    "bb_height [m]",
    "World_Position_X [m]",
    "World_Position_Y [m]",
    "World_Position_Z [m]",
    "Vel_X [m/s]",
    "Vel_Y [m/s]",
    "Vel_Z [m/s]",
    "Acc_X [m/s2]",
    "Acc_Y [m/s2]",
    "Acc_Z [m/s2]",
    "Distance_Travelled_Along_Road_Segment [m]",
    "Lateral_Distance_Lanem [m]",
    "lane_id",
    "lane_offset[m]",
    "World_Heading_Angle [rad]",
    "Heading_Angle_Rate [rad/s]",
    "Relative_Heading_Angle [rad]",
    "Relative_Heading_Angle_Drive_Direction [rad]",
    "World_Pitch_Angle [rad]",
    "Road_Curvature [1/m]",
    "collision_ids",
)
"""Columns of one entity, spelled as readers of esmini's files (since 3.6) expect them."""


def write_parquet(result: RunResult, path: Path) -> None:
    """Write the long table of `RunResult.trajectories`: same run, same bytes."""
    import pyarrow.parquet as pq

    pq.write_table(result.trajectories, path, compression="zstd")


def write_criticality(result: RunResult, path: Path) -> None:
    """Write the criticality measures of every step; null where a measure is not defined."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    measures = result.criticality
    table = measures.table() if measures is not None else {}
    columns = {
        name: pa.array(values, mask=~table[f"{name}_valid"]) if f"{name}_valid" in table else pa.array(values)
        for name, values in table.items()
        if not name.endswith("_valid")
    }
    pq.write_table(pa.table(columns), path, compression="zstd")


def write_csv(result: RunResult, path: Path) -> None:
    """Write six lines of preamble and one line a step with a group of columns for each entity present, as esmini does.

    Wheel angles and rotations, which this runner does not model, are 0; collisions are in the event log. Entities that
    join or leave shorten and lengthen the lines, as they do there.
    """
    recording = result.recording.locate()
    tracks = list(recording.tracks.values())
    frames: dict[float, list[str]] = {}
    for number, track in enumerate(tracks):
        for time, text in zip(track.columns["time"].tolist(), _groups(track, number, recording), strict=True):
            frames.setdefault(time, []).append(text)
    with path.open("w", encoding="utf-8", errors="backslashreplace", newline="\n") as file:
        file.write(f"Written by: xosc-toolchain {version()}\nTime step: {result.settings['timestep']}\n")
        file.write(f"Ego: {one_line(result.ego or '-')}\nSystem under test: {one_line(str(result.sut))}\n")
        file.write(f"Scenario File Name: {one_line(result.scenario.name)}\nNumber of Vehicles: {len(tracks)}\n")
        names = [f"#{number} {name}, " for number in range(1, len(tracks) + 1) for name in _GROUP]
        file.write(f"Index [-], TimeStamp [s], {''.join(names)}\n")
        for index, time in enumerate(sorted(frames)):
            file.write(f"{index}, {time:.6f}, {''.join(frames[time])}\n")


def _groups(track: Track, number: int, recording: Recording) -> list[str]:
    """Text of each row of a track; velocities, accelerations and the heading's rate by finite differences."""
    import numpy as np

    columns = track.columns
    time = columns["time"]
    velocity = [_rate(columns[axis], time) for axis in ("x", "y", "z")]
    motion = [columns["x"], columns["y"], columns["z"], *velocity, *(_rate(values, time) for values in velocity)]
    motion += [columns["s"], columns["t"]]
    heading = np.unwrap(columns["h"])
    turning = _rate(heading, time)
    fixed = f"{csv_text([[track.name]]).rstrip()}, {number}, "
    box = "".join(f"{value:.3f}, " for value in track.box)
    rows = []
    for i, values in enumerate(np.column_stack(motion).tolist()):
        h, lane = float(heading[i]), int(columns["lane_id"][i])
        curvature, relative, driving = _on_road(recording, columns["road_id"][i], values[-2], lane, h)
        angles = (_turn(h), turning[i], _turn(relative), _turn(driving), columns["pitch"][i], curvature)
        rows.append(
            f"{fixed}{columns['speed'][i]:.6f}, 0.000, 0.000, {box}"
            + "".join(f"{value:.6f}, " for value in values)
            + f"{lane}, {columns['lane_offset'][i]:.6f}, "
            + "".join(f"{value:.6f}, " for value in angles)
            + ", "
        )
    return rows


def _turn(angle: float) -> float:
    """An angle from 0 to 2π, as esmini writes them; what is all but 0 is 0."""
    return round(angle, 9) % math.tau


def _rate(values: np.ndarray, time: np.ndarray) -> np.ndarray:
    import numpy as np

    return np.gradient(values, time) if len(time) > 1 else np.zeros_like(values)


def _on_road(recording: Recording, road_id: str | None, s: float, lane: int, h: float) -> tuple[float, float, float]:
    """Curvature of the road (1/m), heading relative to it and to the driving direction (rad); zeros off the network."""
    if recording.network is None or road_id is None:
        return 0.0, 0.0, 0.0
    road = recording.network.road(road_id)
    relative = h - road.heading(s)
    return road.curvature(s), relative, relative + (math.pi if lane and road.direction(lane, s) < 0 else 0.0)
