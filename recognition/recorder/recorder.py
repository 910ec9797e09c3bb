"""Records traffic: each recording a simulation of its own, with its own seed, so that any number of them can run at a time."""

from __future__ import annotations

import math
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from recognition.recorder import formats
from recognition.recorder.simulation import VehicleMotion, motion, overlaps, simulate
from recognition.recorder.sites import SITES, Site, View, family
from recognition.recorder.traffic import Vehicle, departures, parked
from schemas.common.errors import ToolchainError, UsageError
from schemas.common.policy import limited
from schemas.common.storage import DRAFT, sync, writing
from xodr.reader import load
from xodr.sumo_net import SumoNet, build

WARM_UP = 60.0
"""Time before the recording in which the roads fill, s."""
_MARGIN = 3.0
"""Simulated time (s) beyond both ends of a recording, for smoothing."""
_FEWEST = 3
"""Recordings of a site at any scale: one each to train with, to validate and to test."""
_SHORTEST = 20.0
"""Length of a recording at any scale, s."""
_ATTEMPTS = 30
"""SUMO's drivers collide now and then, for want of an eye for it. Such traffic is not used, other traffic drawn instead."""
_CLEARANCE = 0.1
"""Boxes that are nearer to each other than this count as colliding, m."""
_VARIATION = (0.75, 1.25)
"""Traffic of a recording over that of an average one."""


@dataclass(frozen=True)
class _Task:
    """A recording to be made: its site, number from 0, length (s), seed and folder."""

    site: Site
    number: int
    length: float
    seed: np.random.SeedSequence
    folder: Path


def record(
    out: Path, *, scale: float = 1.0, seed: int = 0, sites: Sequence[str] | None = None, jobs: int = 1,
    progress: Callable[[int, int], None] | None = None, families: int = 0,
) -> list[Path]:  # fmt: skip
    """Record traffic at our sites, in a folder for each.

    The same arguments give the same bytes, whatever the number of jobs.

    Args:
        out: folder for the sites' folders.
        scale: how much of the full amount (see `SITES`); at least three recordings of each site in any case.
        seed: of everything random.
        sites: names of `SITES`; all by default.
        jobs: number of processes.
        progress: called with how many recordings are done, and of how many.
        families: so many sites drawn from the seed, with one recording each, in place of `SITES`.

    Returns:
        The track files.

    Raises:
        UsageError: there is no such site, an argument makes no sense, a site's folder is not empty or can't be written.
        ToolchainError: SUMO fails.
    """
    known = family(seed, families) if families else SITES
    _verify(scale, seed, sites, jobs, known)
    least = 1 if families else _FEWEST
    tasks = [task for name in dict.fromkeys(sites or known) for task in _tasks(known[name], scale, seed, out, least)]
    found = []
    with _drafted(tasks, out) as drafts:
        for path in _work(drafts, jobs):
            found.append(out / path.parent.name / path.name)
            if progress:
                progress(len(found), len(tasks))
    return found


def record_one(site: Site, out: Path, length: float, seed: int = 0) -> Path:
    """Record traffic at a site of any kind for so long (s), into a folder `out` / its name; the track file.

    Raises:
        UsageError: the folder is not empty or can't be written.
        ToolchainError: SUMO fails.
    """
    task = _Task(site, 0, length, np.random.SeedSequence((seed, *site.name.encode())), out / site.name)
    with _drafted([task], out) as (draft,):
        made = _record(draft)
    return task.folder / made.name


def _verify(scale: float, seed: int, sites: Sequence[str] | None, jobs: int, known: Mapping[str, Site]) -> None:
    if not scale > 0.0 or not math.isfinite(scale):
        raise UsageError(f"scale={scale!r} must be above 0")
    for name, value, least in (("seed", seed, 0), ("jobs", jobs, 1)):
        if value < least:
            raise UsageError(f"{name}={value!r} must be at least {least}")
    unknown = [name for name in sites or () if name not in known]
    if unknown:
        raise UsageError(f"there is no site {unknown[0]!r}; sites: {', '.join(known)}")


@contextmanager
def _drafted(tasks: Sequence[_Task], out: Path) -> Iterator[list[_Task]]:
    """Tasks in hidden folders with the sites' maps, which become the sites' folders at the end; an error leaves nothing."""
    sites = {task.folder: task.site for task in tasks}
    with writing("the recordings", out):
        for folder in sites:
            if folder.is_dir() and any(folder.iterdir()):
                raise UsageError("the folder has something in it already; new recordings need a new one", path=folder)
        hidden = out / f"{DRAFT}{secrets.token_hex(4)}"
        hidden.mkdir(parents=True)
        try:
            for folder, site in sites.items():
                (hidden / folder.name).mkdir()
                if site.layout == "INTERACTION":
                    site.road_map().write(hidden / folder.name / f"{site.name}.xodr")
            yield [replace(task, folder=hidden / task.folder.name) for task in tasks]
            sync(sorted(hidden.rglob("*")))  # contents before names: a power cut leaves no file in part
            for folder in sites:
                if folder.is_dir():
                    folder.rmdir()  # empty; Windows renames to no folder that is there
                (hidden / folder.name).rename(folder)
        finally:
            shutil.rmtree(hidden, ignore_errors=True)


def _tasks(site: Site, scale: float, seed: int, out: Path, least: int) -> Iterator[_Task]:
    total = site.recordings * site.minutes * 60.0 * scale
    count = max(least, round(site.recordings * scale))
    length = float(max(_SHORTEST, round(total / count)))
    for number in range(count):
        yield _Task(site, number, length, np.random.SeedSequence((seed, number, *site.name.encode())), out / site.name)


def _work(tasks: Sequence[_Task], jobs: int) -> Iterator[Path]:
    if jobs == 1:
        yield from map(_record, tasks)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(_record, tasks)


@limited()
def _record(task: _Task) -> Path:
    site = task.site
    rng = np.random.default_rng(task.seed)
    with TemporaryDirectory(prefix="xosc-recorder-") as folder:
        road = site.road_map().write(Path(folder) / f"{site.name}.xodr")
        net, network = build(road), load(road)
    for _ in range(_ATTEMPTS):
        vehicles, seen = _attempt(site, net, task.length, rng)
        length, width = (np.array([getattr(one, side) for one in vehicles])[seen.vehicle] for side in ("length", "width"))
        if not len(overlaps(seen, length + _CLEARANCE, width + _CLEARANCE)[0]):
            break
    else:
        raise ToolchainError(f"SUMO's vehicles run into each other at {site.name} all the time")
    seen = site.sensor.sees(seen, rng)
    if site.layout == "highD":
        frames = round(task.length * formats.HIGHD_RATE)
        return formats.write_highd(task.folder, task.number + 1, network, site.view, vehicles, seen, frames)
    return formats.write_interaction(task.folder, task.number, vehicles, seen)


def _attempt(site: Site, net: SumoNet, length: float, rng: np.random.Generator) -> tuple[list[Vehicle], VehicleMotion]:
    """New traffic, and what is seen of it."""
    busy = rng.uniform(*_VARIATION)
    flows = [flow._replace(rate=flow.rate * busy) for flow in site.flows]
    end = WARM_UP + length + _MARGIN
    departing = parked(site.parking, site.fleet, WARM_UP, end, rng) + departures(flows, site.fleet, end, rng)
    fronts = simulate(departing, net, WARM_UP - _MARGIN, end, int(rng.integers(2**31)))
    vehicles = [departure.vehicle for departure in departing]
    rate = formats.HIGHD_RATE if site.layout == "highD" else formats.INTERACTION_RATE
    return vehicles, _seen(motion(fronts, [one.length for one in vehicles], rate), site.view, rate, length)


def _seen(moving: VehicleMotion, view: View, rate: int, length: float) -> VehicleMotion:
    """Return the vehicles in view during the recording; its frames count from 0."""
    moving = moving._replace(frame=moving.frame - round(WARM_UP * rate))
    inside = (view.left <= moving.x) & (moving.x <= view.right) & (view.bottom <= moving.y) & (moving.y <= view.top)
    return moving.where(inside & (moving.frame >= 0) & (moving.frame < length * rate))
