"""Trajectories as files: Parquet in long form, and CSV in the column convention of esmini's csv logger."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runner.recording import Recording, Track
    from runner.result import RunResult

_GROUP = (
    "Entitity_Name [-]",
    "Entitity_ID [-]",
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
    "World_Heading_Angle [rad]",
    "Heading_Angle_Driving_Direction [rad]",
    "World_Pitch_Angle [rad]",
    "Road_Curvature [1/m]",
    "collision_ids",
)
"""Columns of one entity, spelled as readers of that format expect them (the misspellings are part of it)."""


def write_parquet(result: RunResult, path: Path) -> None:
    """Write the long table of `RunResult.trajectories`: same run, same bytes."""
    import pyarrow.parquet as pq

    pq.write_table(result.trajectories, path, compression="zstd")


def write_csv(result: RunResult, path: Path) -> None:
    """Write one line a step with a group of columns for each entity present, as esmini's `--csv_logger` does.

    Wheel angles and rotations, which this runner does not model, and collisions, which are in the event log, are 0 and
    empty. Entities that join or leave shorten and lengthen the lines, as they do there.
    """
    recording = result.recording.locate()
    tracks = list(recording.tracks.values())
    frames: dict[float, list[list[object]]] = {}
    for number, track in enumerate(tracks):
        for time, cells in _cells(track, number, recording):
            frames.setdefault(time, []).append(cells)
    with path.open("w", newline="", encoding="utf-8") as file:
        file.write(f"xosc-run trajectories\nOpenSCENARIO: {result.scenario.name}\nentities: {len(tracks)}\n")
        writer = csv.writer(file, lineterminator="\n")
        names = [f"#{number} {name}" for number in range(1, len(tracks) + 1) for name in _GROUP]
        writer.writerow(["Index [-]", "TimeStamp [s]", *names])
        for index, time in enumerate(sorted(frames)):
            writer.writerow([index, f"{time:.3f}", *(cell for cells in frames[time] for cell in cells)])


def _cells(track: Track, number: int, recording: Recording) -> list[tuple[float, list[object]]]:
    """Time and cells of each row of a track; velocities and accelerations by finite differences."""
    import numpy as np

    columns = track.columns
    time = columns["time"]
    velocity = [_rate(columns[axis], time) for axis in ("x", "y", "z")]
    acceleration = [_rate(values, time) for values in velocity]
    numeric = np.column_stack([columns["x"], columns["y"], columns["z"], *velocity, *acceleration])
    box = [f"{value:.3f}" for value in track.box]
    done = []
    for i, moment in enumerate(time):
        h, road = columns["h"][i], columns["road_id"][i]
        curvature, relative = _on_road(recording, road, float(columns["s"][i]), float(h))
        cells: list[object] = [track.name, number, f"{columns['speed'][i]:.3f}", "0.000", "0.000", *box]
        cells += [f"{value:.6f}" for value in numeric[i]]
        cells += [f"{columns['s'][i]:.6f}", f"{columns['t'][i]:.6f}", f"{math.remainder(h, math.tau):.6f}", f"{relative:.6f}"]
        cells += [f"{columns['pitch'][i]:.6f}", f"{curvature:.6f}", ""]
        done.append((float(moment), cells))
    return done


def _rate(values: np.ndarray, time: np.ndarray) -> np.ndarray:
    import numpy as np

    return np.gradient(values, time) if len(time) > 1 else np.zeros_like(values)


def _on_road(recording: Recording, road_id: str | None, s: float, h: float) -> tuple[float, float]:
    """Curvature of the road (1/m) and heading relative to it (rad); zeros off the network."""
    if recording.network is None or road_id is None:
        return 0.0, 0.0
    road = recording.network.road(road_id)
    return road.curvature(s), math.remainder(h - road.heading(s), math.tau)


if TYPE_CHECKING:
    import numpy as np
