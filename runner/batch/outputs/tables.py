"""Results as tables: trajectories as Parquet in long form and as CSV in the columns of esmini, runs
of a batch as Parquet."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runner.judging.measures.measure import measures
from schemas.common.packages import version
from schemas.common.storage import drafted, sync
from schemas.common.terminal.text import csv_text, one_line

if TYPE_CHECKING:
    import numpy as np
    import pyarrow as pa

    from runner.batch.jobs import Outcome
    from runner.judging.result import RunResult
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

_ROWS = 1024
"""Runs that are in memory at a time while their table is written"""


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
        name: pa.array(values, mask=~table[f"{name}_valid"])
        if f"{name}_valid" in table
        else pa.array(values)
        for name, values in table.items()
        if not name.endswith("_valid")
    }
    pq.write_table(pa.table(columns), path, compression="zstd")


def write_csv(result: RunResult, path: Path) -> None:
    """Write six lines of preamble and one line a step with a group of columns for each entity
    present, as esmini does.

    Wheel angles and rotations, which this runner does not model, are 0; collisions are in the event
    log. Entities that join or leave shorten and lengthen the lines, as they do there.
    """
    recording = result.recording.locate()
    tracks = list(recording.tracks.values())
    frames: dict[float, list[str]] = {}
    # Frames are keyed by time: entities join and leave.
    for number, track in enumerate(tracks):
        for time, text in zip(
            track.columns["time"].tolist(), _groups(track, number, recording), strict=True
        ):
            frames.setdefault(time, []).append(text)
    # `backslashreplace`: names of files may hold bytes that are no UTF-8.
    with path.open("w", encoding="utf-8", errors="backslashreplace", newline="\n") as file:
        file.write(
            f"Written by: xosc-toolchain {version()}\nTime step: {result.settings['timestep']}\n"
        )
        file.write(
            f"Ego: {one_line(result.ego or '-')}\nSystem under test: {one_line(str(result.sut))}\n"
        )
        file.write(
            f"Scenario File Name: {one_line(result.scenario.name)}\nNumber of Vehicles: "
            f"{len(tracks)}\n"
        )
        names = [f"#{number} {name}, " for number in range(1, len(tracks) + 1) for name in _GROUP]
        file.write(f"Index [-], TimeStamp [s], {''.join(names)}\n")
        for index, time in enumerate(sorted(frames)):
            file.write(f"{index}, {time:.6f}, {''.join(frames[time])}\n")


def _groups(track: Track, number: int, recording: Recording) -> list[str]:
    """Text of each row of a track; velocities, accelerations and the heading's rate by finite
    differences."""
    import numpy as np

    columns = track.columns
    time = columns["time"]
    velocity = [_rate(columns[axis], time) for axis in ("x", "y", "z")]
    motion = [
        columns["x"],
        columns["y"],
        columns["z"],
        *velocity,
        *(_rate(values, time) for values in velocity),
    ]
    motion += [columns["s"], columns["t"]]
    # Unwrapped, since a jump from π to -π would be a rate.
    heading = np.unwrap(columns["h"])
    turning = _rate(heading, time)
    fixed = f"{csv_text([[track.name]]).rstrip()}, {number}, "
    box = "".join(f"{value:.3f}, " for value in track.box)
    rows = []
    for i, values in enumerate(np.column_stack(motion).tolist()):
        h, lane = float(heading[i]), int(columns["lane_id"][i])
        curvature, relative, driving = _on_road(
            recording, columns["road_id"][i], values[-2], lane, h
        )
        angles = (
            _turn(h),
            turning[i],
            _turn(relative),
            _turn(driving),
            columns["pitch"][i],
            curvature,
        )
        rows.append(
            f"{fixed}{columns['speed'][i]:.6f}, 0.000, 0.000, {box}"
            + "".join(f"{value:.6f}, " for value in values)
            + f"{lane}, {columns['lane_offset'][i]:.6f}, "
            + "".join(f"{value:.6f}, " for value in angles)
            + ", "
        )
    return rows


def _turn(angle: float) -> float:
    """Angle from 0 to 2π, as in esmini's files; rounding errors about 0 are 0."""
    # Rounding first: a tiny negative angle would become 2π.
    return round(angle, 9) % math.tau


def _rate(values: np.ndarray, time: np.ndarray) -> np.ndarray:
    import numpy as np

    return np.gradient(values, time) if len(time) > 1 else np.zeros_like(values)


def _on_road(
    recording: Recording, road_id: str | None, s: float, lane: int, h: float
) -> tuple[float, float, float]:
    """Curvature of the road (1/m), heading relative to it and to the driving direction (rad); zeros
    off the network."""
    if recording.network is None or road_id is None:
        return 0.0, 0.0, 0.0
    road = recording.network.road(road_id)
    relative = h - road.heading(s)
    return (
        road.curvature(s),
        relative,
        relative + (math.pi if lane and road.direction(lane, s) < 0 else 0.0),
    )


CONTACT = ("impact_side", "impact_ahead", "impact_left", "ego_strikes")
"""Columns of a contact: side of the ego, its point (m ahead and left of the middle of the box),
whether the ego hit the other"""


def write_runs(outcomes: Iterable[Outcome], path: Path) -> None:
    """Write the table in the order of the outcomes, atomically, with a group of rows in memory at a
    time.

    Columns: name, file (that the user named), scenario, parameters (a map of texts), seed (null
    unless runs were repeated), state (`passed`, `failed`, `inconclusive`, `error`), verdict (null
    where there was no run), exit_code, content (digest of its files), status, end_time (s),
    message, remarks, causes (names; why a run is inconclusive), evidence (a map of names to
    values), `CONTACT` of a failed run in which
    the ego touches another participant, and the criticality measures: each extreme with `_time` (s)
    and `_other`, and the shares of RSS violations; null where they are not defined. Units as in
    `runner.judging.measures.criticality`.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns, rows = schema(), map(_row, outcomes)
    with (
        drafted(path) as draft,
        draft.open("wb") as file,  # its errors have the system's texts, pyarrow's own have not
        pq.ParquetWriter(file, columns, compression="zstd") as table,
    ):
        while group := [*islice(rows, _ROWS)]:
            table.write_table(pa.Table.from_pylist(group, schema=columns))
    sync([path, path.parent])


def _row(outcome: Outcome) -> dict[str, Any]:
    job = outcome.job
    row: dict[str, Any] = {
        "name": job.name,
        "file": _text(job.source),
        "scenario": _text(job.scenario),
        "parameters": [(name, _text(value)) for name, value in sorted(job.parameters.items())],
        "seed": job.seed,
        "state": outcome.state,
        "verdict": outcome.state if outcome.state != "error" else None,
        "exit_code": outcome.exit_code,
        "content": outcome.content,
        "status": outcome.status or None,
        "end_time": outcome.end_time,
        "message": _text(outcome.message),
        "remarks": [_text(remark) for remark in outcome.remarks],
        "causes": outcome.causes,
        "evidence": [(row["name"], row["value"]) for row in outcome.evidence],
        **_contact(outcome.impact),
    }
    for name, measure in measures().items():
        found = outcome.measures.get(name)
        if measure.is_extreme:
            extreme = found or {}
            row |= {
                name: extreme.get("value"),
                f"{name}_time": extreme.get("time"),
                f"{name}_other": extreme.get("other"),
            }
        else:
            row[name] = found
    return row


def _contact(impact: dict[str, Any] | None) -> dict[str, Any]:
    """Columns of a contact."""
    if impact is None:
        return dict.fromkeys(CONTACT)
    ahead, left = impact["point"]
    return dict(zip(CONTACT, (impact["side"], ahead, left, impact["strikes"]), strict=True))


def _text(value: object) -> str:
    """Text that UTF-8 can hold: bytes of file names that are none are written as JSON would."""
    return str(value).encode("utf-8", "backslashreplace").decode()


def schema() -> pa.Schema:
    """Columns of the table, and their types."""
    import pyarrow as pa

    text, number = pa.string(), pa.float64()
    fields = {
        "name": text,
        "file": text,
        "scenario": text,
        "parameters": pa.map_(text, text),
        "seed": pa.int64(),
        "state": text,
        "verdict": text,
    }
    fields |= {
        "exit_code": pa.int64(),
        "status": text,
        "end_time": number,
        "message": text,
        "remarks": pa.list_(text),
    }
    fields["content"] = text
    fields["causes"] = pa.list_(text)
    fields["evidence"] = pa.map_(text, number)
    fields |= dict(zip(CONTACT, (text, number, number, pa.bool_()), strict=True))
    for name, measure in measures().items():
        fields |= (
            {name: number, f"{name}_time": number, f"{name}_other": text}
            if measure.is_extreme
            else {name: number}
        )
    return pa.schema(list(fields.items()))
