"""Time and memory to find scenarios in many recordings, and to make catalogues of them.

    python benchmarks/many_recordings.py [--counts 200 500 1000 2000] [--command find|catalogue]
    [--cold RECORDING]

Recordings of a motorway, 9 s at 10 Hz with 20 vehicles, are made first, each with its own traffic
and on one of ten days. Each count is a process of its own with an empty cache; printed are its
processor time and greatest memory, in all and for each recording. With --cold instead a recording
with a Lanelet2 map is read by a process with an empty cache and by one that has the converted map.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

_MEASURED = """
import resource, sys
from recognition.xosc_recognize import main
try:
    main()
except SystemExit as ended:
    assert not ended.code, ended.code
used = resource.getrusage(resource.RUSAGE_SELF)
print(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024.0)
"""
_SECONDS, _RATE, _VEHICLES, _DAYS = 9.0, 10.0, 20, 10
_META = (
    "id,frameRate,locationId,speedLimit,month,weekDay,startTime,duration,totalDrivenDistance,"
    "totalDrivenTime,numVehicles,numCars,numTrucks,upperLaneMarkings,lowerLaneMarkings"
)


def write_recording(folder: Path, number: int) -> None:
    """Write a recording in highD's format: vehicles on two carriageways, a third of which change
    lane."""
    random = np.random.default_rng(number)
    name, frames = f"{number:05}", round(_SECONDS * _RATE)
    folder.mkdir(parents=True, exist_ok=True)
    tracks = ["frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration,laneId"]
    about = ["id,width,height,initialFrame,finalFrame,numFrames,class,drivingDirection"]
    time = np.arange(frames) / _RATE
    for vehicle in range(1, _VEHICLES + 1):
        carriageway, lane = vehicle % 2, (vehicle // 2) % 2
        way = 1.0 if carriageway else -1.0
        base = (14.0 if carriageway else 2.0) + 4.0 * lane + 2.0
        # Into the middle of the gaps of the other lane: what overlaps is refused.
        target = base + 4.0 * (lane == 0 and random.random() < 2.0 / 3.0)
        share = np.clip((time - 2.0 - random.random()) / 4.0, 0.0, 1.0)
        y = base + (target - base) * share**2 * (3.0 - 2.0 * share)
        vx = way * (24.0 + random.random())
        x = (
            200.0
            - way * 150.0
            + way * (45.0 * (vehicle // 4) + 22.0 * lane)
            + random.random()
            + vx * time
        )
        vy = np.gradient(y, time)
        for frame in range(frames):
            tracks.append(
                f"{frame + 1},{vehicle},{x[frame] - 2.0:.3f},{y[frame] - 0.9:.3f},4.0,1.8,"
                f"{vx:.3f},{vy[frame]:.3f},0.0,0.0,2"
            )
        about.append(f"{vehicle},4.0,1.8,1,{frames},{frames},Car,{1 if way < 0 else 2}")
    (folder / f"{name}_tracks.csv").write_text("\n".join(tracks) + "\n")
    (folder / f"{name}_tracksMeta.csv").write_text("\n".join(about) + "\n")
    row = f"{number},{_RATE:g},1,-1,9.2017,Mon,12:00,{_SECONDS},0,0,{_VEHICLES},{_VEHICLES},0"
    row += ",2;6;10,14;18;22"
    (folder / f"{name}_recordingMeta.csv").write_text(f"{_META}\n{row}\n")


def measured(arguments: list[str], cache: Path) -> tuple[float, float]:
    """Processor time (s) and greatest memory (MB) of a command in its own process."""
    environment = os.environ | {"XOSC_CACHE_DIR": str(cache)}
    done = subprocess.run(
        [sys.executable, "-c", _MEASURED, *arguments, "--quiet"],
        stdout=subprocess.PIPE, text=True, env=environment,
    )  # fmt: skip
    if done.returncode:
        raise SystemExit(f"{' '.join(arguments)} ended with {done.returncode}")
    seconds, memory = done.stdout.split()[-2:]
    return float(seconds), float(memory)


def main() -> None:
    """Print a line for each count."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--counts", type=int, nargs="+", default=[200, 500, 1000, 2000])
    arguments.add_argument("--command", choices=("find", "catalogue"), default="find")
    arguments.add_argument("--cold", type=Path, metavar="RECORDING", help="with a Lanelet2 map")
    options = arguments.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        root = Path(scratch)
        if options.cold:
            for number, told in enumerate(("converted", "from the cache")):
                out = str(root / f"store{number}")
                seconds, _ = measured(["find", str(options.cold), "--out", out], root / "cache")
                print(f"map {told}: {seconds:.2f} s of processor")
            return
        made = 0
        print(f"{'recordings':>10}{'s':>9}{'s each':>9}{'MB':>8}   {options.command}")
        for count in sorted(options.counts):
            for number in range(made, count):
                write_recording(root / "recordings" / f"2020-01-{number % _DAYS + 1:02}", number)
            made = count
            command = [
                options.command,
                str(root / "recordings"),
                "--out",
                str(root / f"out{count}"),
            ]
            seconds, memory = measured(command, root / f"cache{count}")
            print(f"{count:>10}{seconds:>9.1f}{seconds / count:>9.3f}{memory:>8.0f}", flush=True)


if __name__ == "__main__":
    main()
