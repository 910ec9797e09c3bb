"""Processor time and memory of reading a highD-sized recording, against Arrow doing nothing but
parse the same table.

    python benchmarks/read_recordings.py [--vehicles N] [--recordings N] [--repeat N]

The recording is made up: 17 minutes at 25 Hz, vehicles that cross 420 m at constant speeds, all
columns of highD. Reading it smooths it, and ends with the columns of every track. Then a folder
with many such recordings is opened and read one by one.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from recognition import recordings as datasets

RATE, MINUTES, LENGTH = 25.0, 17.0, 420.0
UPPER, LOWER = "8.51;12.34;16.25", "21.00;24.96;28.80"
LANES = {2: 9.4, 3: 13.3, 5: 22.0, 6: 25.9}
"""Upper edges of boxes in each lane of the data set, m."""
REMAINING = (
    "xAcceleration", "yAcceleration", "frontSightDistance", "backSightDistance", "dhw", "thw",
    "ttc", "precedingXVelocity", "precedingId", "followingId", "leftPrecedingId", "leftAlongsideId",
    "leftFollowingId", "rightPrecedingId", "rightAlongsideId", "rightFollowingId",
)  # fmt: skip


def main() -> None:
    """Print time, ratio and memory."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("--vehicles", type=int, default=1000)
    arguments.add_argument(
        "--recordings", type=int, default=60, help="how many there are in the folder"
    )
    arguments.add_argument(
        "--repeat", type=int, default=5, help="readings, of which the median counts"
    )
    options = arguments.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_recording(folder, options.vehicles, np.random.default_rng(1))
        tracks = folder / "01_tracks.csv"
        rows = _read_all(folder)
        reference = _median(lambda: pacsv.read_csv(tracks), options.repeat)
        reading = _median(lambda: _read_all(folder), options.repeat)
        print(
            f"{options.vehicles} vehicles, {rows} rows, {tracks.stat().st_size / 1e6:.0f} MB; "
            f"median of {options.repeat}"
        )
        print(f"parsed by Arrow alone          {reference:6.2f} s")
        print(
            f"read and smoothed, all columns {reading:6.2f} s  "
            f"{reading / reference:.1f} times Arrow alone"
        )
        _folder_of_many(folder, options.recordings)


def write_recording(folder: Path, vehicles: int, rng: np.random.Generator) -> None:
    """Write the three files of recording 01."""
    lane = rng.choice(list(LANES), vehicles)
    speed = rng.uniform(20.0, 40.0, vehicles)
    frames = (RATE * LENGTH / speed).astype(int)
    first = np.sort(rng.integers(1, int(RATE * 60 * MINUTES) - frames.max(), vehicles))
    length, width = rng.uniform(4.0, 15.0, vehicles), rng.uniform(1.8, 2.5, vehicles)
    east = lane > 3
    vx = np.where(east, speed, -speed)
    which = np.repeat(np.arange(vehicles), frames)
    frame = np.arange(len(which)) - np.repeat(np.cumsum(frames) - frames, frames)
    tracks = {
        "frame": first[which] + frame,
        "id": which + 1,
        "x": (np.where(east, 0.0, LENGTH)[which] + vx[which] * frame / RATE).round(2),
        "y": (np.array([LANES[one] for one in lane])[which] + 0.1 * np.sin(frame / 40.0)).round(2),
        "width": length[which].round(2),
        "height": width[which].round(2),
        "xVelocity": vx[which].round(2),
        "yVelocity": (0.1 * RATE / 40.0 * np.cos(frame / 40.0)).round(2),
        **{name: rng.uniform(0.0, 100.0, len(which)).round(2) for name in REMAINING},
        "laneId": lane[which],
    }
    meta = {
        "id": np.arange(vehicles) + 1, "width": length.round(2), "height": width.round(2),
        "initialFrame": first,
        "finalFrame": first + frames - 1, "numFrames": frames,
        "class": np.where(length > 8.0, "Truck", "Car"),
        "drivingDirection": np.where(east, 2, 1),
    }  # fmt: skip
    recording = {
        "id": 1,
        "frameRate": RATE,
        "speedLimit": -1.0,
        "upperLaneMarkings": UPPER,
        "lowerLaneMarkings": LOWER,
    }
    pacsv.write_csv(pa.table(tracks), folder / "01_tracks.csv")
    pacsv.write_csv(pa.table(meta), folder / "01_tracksMeta.csv")
    pacsv.write_csv(
        pa.table({name: [value] for name, value in recording.items()}),
        folder / "01_recordingMeta.csv",
    )


def _read_all(folder: Path) -> int:
    (source,) = datasets.open(folder, roads=folder / "roads").sources
    return sum(len(track.columns["time"]) for track in source.load().tracks.values())


def _folder_of_many(folder: Path, recordings: int) -> None:
    """Memory for a folder whose recordings are all the same files under other names."""
    for number in range(2, recordings + 1):
        for file in folder.glob("01_*.csv"):
            os.link(file, folder / f"{number:02}{file.name.removeprefix('01')}")
    start = time.perf_counter()
    before = _memory()
    sources = datasets.open(folder, roads=folder / "roads").sources
    print(
        f"folder of {len(sources)} opened in {time.perf_counter() - start:6.2f} s, "
        f"{_memory() - before:+.0f} MB"
    )
    for count, source in enumerate(sources, 1):
        recording = source.load()
        for track in recording.tracks.values():
            _ = track.columns
        if count in (1, 2, len(sources)):
            print(f"recording {count:2} read: {_memory() - before:+.0f} MB")


def _memory() -> float:
    """Memory that this process has, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def _median(work: Callable[[], object], repeat: int) -> float:
    times = []
    for _ in range(repeat):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return statistics.median(times)


if __name__ == "__main__":
    main()
