"""A batch of variation files: `xosc-run` as a whole against bare loops of libsumo with as many
steps and participants.

    python benchmarks/ncap_batch.py FOLDER [--jobs N] [--timestep S] [--world NAME]

All parameter value distributions below the folder are run in one call of the command, outputs off,
once without a system under test and once with `cas`. Then as many processes do nothing but libsumo:
the same networks, the same number of steps, and the same number of participants moved by moveToXY
and read back in each. Times are processor times of all processes together, which other work on the
machine changes least.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import libsumo

import xosc
from runner.batch.batch import run_batch
from runner.batch.jobs import Outcome, jobs_of
from runner.judging.execution import prepare
from runner.judging.settings import RunSettings
from xodr.formats import sumo_net

_OK = (0, 1)


class Load(NamedTuple):
    """SUMO's load of one run, and the start of its longest road (m, rad)."""

    net: str
    steps: int
    participants: int
    timestep: float
    x: float
    y: float
    h: float


def main() -> None:
    """Print seconds of each batch, and what they are for each run and step."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--jobs", type=int, default=2)
    arguments.add_argument("--timestep", type=float, default=0.01, help="s")
    arguments.add_argument("--world", default="sumo")
    options = arguments.parse_args()
    files = [
        path
        for path in sorted(options.folder.rglob("*.xosc"))
        if xosc.load(path).kind == "distribution"
    ]
    if not files:
        raise SystemExit("no parameter value distribution there")
    for sut in ("none", "cas"):
        settings = RunSettings(timestep=options.timestep, sut=sut, world=options.world)
        outcomes = list(
            run_batch(jobs_of(files, {}, True), settings, processes=options.jobs)
        )  # fills the cache of networks
        failed = [outcome for outcome in outcomes if outcome.exit_code not in _OK]
        loads = [_load(outcome, settings) for outcome in outcomes if outcome.exit_code in _OK]
        ours, theirs = _command(files, settings, options.jobs), _bare(loads, options.jobs)
        steps = sum(load.steps for load in loads)
        print(
            f"{options.world}, sut {sut}: {len(outcomes)} runs of {len(files)} files, "
            f"{len(failed)} errors, {steps} steps, "
            f"--jobs {options.jobs}"
        )
        for name, seconds in (("xosc-run", ours), ("bare libsumo", theirs)):
            a_run, a_step = seconds / len(loads) * 1e3, seconds / steps * 1e6
            print(f"    {name:<13}{seconds:5.1f} s, {a_run:.0f} ms a run, {a_step:.0f} µs a step")
        print(f"    ratio {ours / theirs:.2f}", flush=True)


def _load(outcome: Outcome, settings: RunSettings) -> Load:
    """Return SUMO's load of a run."""
    scenario = prepare(outcome.job.scenario, outcome.job.parameters).scenario
    assert scenario.network is not None
    net = sumo_net.build(scenario.network.path)
    begin = max(scenario.network.roads.values(), key=lambda road: road.length).pose(0.0)
    steps = round((outcome.end_time or 0.0) / settings.timestep)
    return Load(
        str(net.path), steps, len(scenario.entities), settings.timestep, begin.x, begin.y, begin.h
    )


def _command(files: list[Path], settings: RunSettings, jobs: int) -> float:
    """Seconds of the command, start-up included."""
    command = [
        sys.executable,
        "-m",
        "runner.xosc_run",
        *map(str, files),
        "--sut",
        str(settings.sut),
        "--world",
        settings.world,
    ]
    command += ["--timestep", str(settings.timestep), "--jobs", str(jobs), "--quiet"]
    start = _spent()
    subprocess.run(command, stdout=subprocess.DEVNULL, check=False)
    return _spent() - start


def _spent() -> float:
    """Processor time (s) of all processes that were waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _bare(loads: list[Load], jobs: int) -> float:
    """Seconds of libsumo alone, in as many processes."""
    start = _spent()
    with multiprocessing.Pool(jobs) as pool:
        pool.map(_loop, loads, chunksize=4)
        pool.close()
        pool.join()
    return _spent() - start


def _loop(load: Load) -> None:
    libsumo.start(
        [
            "sumo",
            f"--net-file={load.net}",
            f"--step-length={load.timestep}",
            "--collision.action=none",
            "--no-warnings",
        ]
    )
    vehicle, step = libsumo.vehicle, libsumo.simulationStep
    move, position, angle, speed = (
        vehicle.moveToXY,
        vehicle.getPosition,
        vehicle.getAngle,
        vehicle.getSpeed,
    )
    libsumo.route.add("dock", [sumo_net.DOCK])
    names = list(_added(load.participants))
    cos, sin, degrees = math.cos(load.h), math.sin(load.h), 90.0 - math.degrees(load.h)
    for k in range(load.steps):
        for row, name in enumerate(names):
            way = 10.0 * row + 5.0 * load.timestep * k
            move(name, "", -1, load.x + way * cos, load.y + way * sin, degrees, 6, 3.0)
        step()
        for name in names:
            position(name)
            angle(name)
            speed(name)
    libsumo.close()


def _added(count: int) -> Iterator[str]:
    for number in range(count):
        libsumo.vehicle.add(f"V{number}", "dock", departPos="0", departSpeed="0")
        yield f"V{number}"


if __name__ == "__main__":
    main()
