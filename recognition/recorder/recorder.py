"""Records traffic, each recording a simulation of its own with its own seed;
writes highD and INTERACTION files.
"""

from __future__ import annotations

import math
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recognition.recorder.simulation import VehicleMotion, motion, overlaps, simulate
from recognition.recorder.sites import SITES, CameraView, SimulatedSite, family
from recognition.recorder.traffic import Vehicle, departures, parked
from runner.batch.pool import Workers, results
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import ToolchainError, UsageError
from schemas.common.policy import limited
from schemas.common.storage import DRAFT, sync, writing
from xodr.formats.sumo_net import SumoNet, build
from xodr.graph.network import RoadNetwork
from xodr.reader import load

# files of highD and INTERACTION -----------------------------------------------------------------


def write_csv(path: Path, columns: Mapping[str, NDArray[Any]]) -> None:
    """Write columns of equal length under their names, numbers in their shortest
    form, text without quotes.
    """
    import pyarrow as pa
    import pyarrow.csv as pacsv

    options = pacsv.WriteOptions(include_header=False, quoting_style="none")
    with path.open("wb") as file:
        file.write(",".join(columns).encode() + b"\n")
        pacsv.write_csv(pa.table(dict(columns)), file, options)


ABSENT = -1
_SPAN = 1e6
"""More than any position along the road, m."""


class Traffic:
    """All participants in every frame.

    Args:
        frame: of each row. lane: number, counted from left to right as the driver sees them, equal
            in no two carriageways.
        along: position in the direction of travel, m. length: m.
    """

    def __init__(
        self, frame: IntArray, lane: IntArray, along: FloatArray, length: FloatArray
    ) -> None:
        self._lane, self._along, self._length = lane, along, length
        # Room for a lane beside the outermost ones, which is none of another frame.
        self._strip = frame * (int(lane.max()) + 3)
        key = self._key(lane)
        self._order = np.argsort(key, kind="stable")
        self._sorted = key[self._order]
        self._group = (self._strip + lane)[self._order]

    def _key(self, lane: IntArray) -> FloatArray:
        return (self._strip + lane) * _SPAN + self._along

    def ahead(self) -> IntArray:
        """Row of the nearest vehicle in front in the own lane, or `ABSENT`."""
        return self._own(1)

    def behind(self) -> IntArray:
        """Row of the nearest vehicle behind in the own lane, or `ABSENT`."""
        return self._own(-1)

    def _own(self, side: int) -> IntArray:
        place = np.empty_like(self._order)
        place[self._order] = np.arange(len(place))
        return self._at(place + side, self._strip + self._lane)

    def beside(self, lanes: int) -> tuple[IntArray, IntArray, IntArray]:
        """Rows of preceding, alongside and following in the lane that lies
        `lanes` to the right (negative: left).
        """
        group = self._strip + self._lane + lanes
        front = np.searchsorted(self._sorted, self._key(self._lane + lanes))
        ahead, alongside_ahead = self._beyond(front, 1, group)
        behind, alongside_behind = self._beyond(front - 1, -1, group)
        both = np.stack((alongside_ahead, alongside_behind))
        # As an index ABSENT is the last row: its distance must not count.
        distance = np.where(both == ABSENT, np.inf, np.abs(self._along[both] - self._along))
        return ahead, both[distance.argmin(axis=0), np.arange(len(front))], behind

    def _beyond(self, place: IntArray, side: int, group: IntArray) -> tuple[IntArray, IntArray]:
        """Return the first place from one on that does not overlap, and the first that does."""
        first = found = self._at(place, group)
        while (overlapping := self._overlaps(found)).any():
            place = place + side * overlapping
            found = self._at(place, group)
        return found, np.where(self._overlaps(first), first, ABSENT)

    def _overlaps(self, other: IntArray) -> BoolArray:
        near = np.abs(self._along[other] - self._along) < 0.5 * (self._length[other] + self._length)
        return near & (other != ABSENT)

    def _at(self, place: IntArray, group: IntArray) -> IntArray:
        """Rows at places in the order, where they are in the asked lane and frame."""
        inside = np.clip(place, 0, len(self._order) - 1)
        there = (place == inside) & (self._group[inside] == group)
        return np.where(there, self._order[inside], ABSENT)


HIGHD_RATE = 25
"""Frames a second."""
_ENDLESS = 1000.0
"""Times to collision or headways beyond this are none, s."""

_Columns = dict[str, NDArray[Any]]


class Sheet:
    """A straight motorway as highD's image has it: x to the right, y downwards,
    from the view's upper left corner.

    Attributes:
        upper, lower: y of the lane markings of each carriageway, ascending, m. limit: m/s.
    """

    def __init__(self, network: RoadNetwork, view: CameraView) -> None:
        road = next(iter(network.roads.values()))
        self.view = view
        self.limit = road.speed_limit(0.0)
        lanes = [
            road.lane(0.0, lane_id)
            for lane_id in road.lane_ids(0.0)
            if road.lane_type(0.0, lane_id) == "driving"
        ]
        self.upper, self.lower = (
            sorted(
                {
                    round(view.top - t, 2)
                    for lane in lanes
                    if lane.id * side > 0
                    for t in (lane.inner(0.0), lane.outer(0.0))
                }
            )
            for side in (1, -1)
        )

    def lanes(self, y: FloatArray) -> IntArray:
        """highD's lane ids: 1 above the first marking, one more at each."""
        return 1 + np.searchsorted([*self.upper, *self.lower], y)


def write_highd(
    folder: Path,
    number: int,
    network: RoadNetwork,
    view: CameraView,
    vehicles: Sequence[Vehicle],
    motion: VehicleMotion,
    frames: int,
) -> Path:
    """Write a recording into a folder; the track file's path.

    Args:
        number: of the recording, from 1.
        vehicles: by departure.
        motion: what is in view, frames from 0.
        frames: length of the recording.
    """
    sheet = Sheet(network, view)
    index, chosen = np.unique(motion.vehicle, return_inverse=True)
    seen = [vehicles[one] for one in index.tolist()]
    tracks = _tracks(motion, chosen, seen, sheet)
    path = folder / f"{number:02d}_tracks.csv"
    meta = _vehicles(tracks, motion.y > 0.0, seen)
    write_csv(path, tracks)
    write_csv(folder / f"{number:02d}_tracksMeta.csv", meta)
    write_csv(folder / f"{number:02d}_recordingMeta.csv", _recording(number, sheet, meta, frames))
    return path


def _tracks(
    motion: VehicleMotion, chosen: IntArray, seen: Sequence[Vehicle], sheet: Sheet
) -> _Columns:
    length, width = (
        np.array([getattr(one, side) for one in seen])[chosen] for side in ("length", "width")
    )
    x, y = motion.x - sheet.view.left, sheet.view.top - motion.y
    upper = motion.y > 0.0
    to_end, to_start = sheet.view.right - motion.x, motion.x - sheet.view.left
    columns = {
        "frame": motion.frame + 1, "id": chosen + 1,
        "x": x - 0.5 * length, "y": y - 0.5 * width, "width": length, "height": width,
        "xVelocity": motion.vx, "yVelocity": -motion.vy, "xAcceleration": motion.ax,
        "yAcceleration": -motion.ay,
        "frontSightDistance": np.where(upper, to_start, to_end),
        "backSightDistance": np.where(upper, to_end, to_start),
    }  # fmt: skip
    columns |= _relations(columns, sheet.lanes(y), upper)
    return {name: np.round(values, 2) + 0 for name, values in columns.items()}  # no negative zeros


def _relations(columns: _Columns, lane: IntArray, upper: BoolArray) -> _Columns:
    """Neighbours and what follows from them."""
    ahead = np.where(upper, -1.0, 1.0)
    length, along = columns["width"], ahead * (columns["x"] + 0.5 * columns["width"])
    rightwards = np.where(
        upper, 2 * lane.max() + 2 - lane, lane
    )  # drivers of the upper carriageway have the lane above on the right
    traffic = Traffic(columns["frame"], rightwards, along, length)
    lead, speed = traffic.ahead(), ahead * columns["xVelocity"]
    led = lead != ABSENT
    gap = np.where(led, along[lead] - along - 0.5 * (length[lead] + length), 0.0)
    left, right = traffic.beside(-1), traffic.beside(1)
    rows = {"precedingId": lead, "followingId": traffic.behind()}
    rows |= {
        f"left{place}Id": found
        for place, found in zip(("Preceding", "Alongside", "Following"), left, strict=True)
    }
    rows |= {
        f"right{place}Id": found
        for place, found in zip(("Preceding", "Alongside", "Following"), right, strict=True)
    }
    return {
        "dhw": gap, "thw": _over(gap, speed),
        "ttc": _over(gap, np.where(led, speed - speed[lead], 0.0)),
        "precedingXVelocity": np.where(led, columns["xVelocity"][lead], 0.0),
        **{name: np.where(row == ABSENT, 0, columns["id"][row]) for name, row in rows.items()},
        "laneId": lane,
    }  # fmt: skip


def _over(gap: FloatArray, speed: FloatArray) -> FloatArray:
    """A gap over a speed, s; 0 where that is no time."""
    time = np.divide(gap, speed, out=np.zeros(len(gap)), where=speed != 0.0)
    return np.where(np.abs(time) < _ENDLESS, time, 0.0)


def _vehicles(tracks: _Columns, upper: BoolArray, seen: Sequence[Vehicle]) -> _Columns:
    starts = np.flatnonzero(np.diff(tracks["id"], prepend=0))
    ends = np.append(starts[1:], len(tracks["id"])) - 1
    first, last = tracks["frame"][starts], tracks["frame"][ends]
    speed = np.abs(tracks["xVelocity"])
    changes = np.diff(tracks["laneId"], prepend=0) != 0
    # From one track to the next no lane is changed.
    changes[starts] = False
    return {
        "id": tracks["id"][starts], "width": tracks["width"][starts],
        "height": tracks["height"][starts],
        "initialFrame": first, "finalFrame": last, "numFrames": last - first + 1,
        "class": np.array(["Truck" if one.kind.agent == "truck" else "Car" for one in seen]),
        "drivingDirection": np.where(upper[starts], 1, 2),
        "traveledDistance": np.round(np.abs(tracks["x"][ends] - tracks["x"][starts]), 2),
        "minXVelocity": np.minimum.reduceat(speed, starts),
        "maxXVelocity": np.maximum.reduceat(speed, starts),
        "meanXVelocity": np.round(np.add.reduceat(speed, starts) / (ends - starts + 1), 2),
        **{f"min{name.upper()}": _least(tracks[name], starts) for name in ("dhw", "thw", "ttc")},
        "numLaneChanges": np.add.reduceat(changes.astype(np.int64), starts),
    }  # fmt: skip


def _least(values: FloatArray, starts: IntArray) -> FloatArray:
    """The least positive value of each track, -1 without any."""
    least = np.minimum.reduceat(np.where(values > 0.0, values, np.inf), starts)
    return np.where(np.isfinite(least), least, -1.0)


def _recording(number: int, sheet: Sheet, meta: _Columns, frames: int) -> _Columns:
    trucks = int((meta["class"] == "Truck").sum())
    values = {
        "id": number, "frameRate": HIGHD_RATE, "locationId": 1,
        "speedLimit": -1.0 if sheet.limit is None else round(sheet.limit, 2),
        "month": "1.2025", "weekDay": "Wed", "startTime": "12:00",
        "duration": round(frames / HIGHD_RATE, 2),
        "totalDrivenDistance": round(float(meta["traveledDistance"].sum()), 2),
        "totalDrivenTime": round(float(meta["numFrames"].sum()) / HIGHD_RATE, 2),
        "numVehicles": len(meta["id"]), "numCars": len(meta["id"]) - trucks, "numTrucks": trucks,
        "upperLaneMarkings": ";".join(f"{y:.2f}" for y in sheet.upper),
        "lowerLaneMarkings": ";".join(f"{y:.2f}" for y in sheet.lower),
    }  # fmt: skip
    return {name: np.array([value]) for name, value in values.items()}


INTERACTION_RATE = 10
"""Frames a second."""


def write_interaction(
    folder: Path, number: int, vehicles: Sequence[Vehicle], motion: VehicleMotion
) -> Path:
    """Write a recording into its site's folder; the track file's path.

    Args:
        number: of the recording, from 0.
        vehicles: by departure.
        motion: what is in view, frames from 0.
    """
    index, chosen = np.unique(motion.vehicle, return_inverse=True)
    seen = [vehicles[one] for one in index.tolist()]
    heading = np.arctan2(np.sin(motion.h), np.cos(motion.h))
    # Adding 0.0 makes 0.0 of −0.0.
    columns = {
        "track_id": chosen + 1, "frame_id": motion.frame + 1,
        "timestamp_ms": (motion.frame + 1) * 1000 // INTERACTION_RATE,
        "agent_type": np.array([one.kind.agent for one in seen])[chosen],
        **{name: np.round(getattr(motion, name), 3) + 0.0 for name in ("x", "y", "vx", "vy")},
        "psi_rad": np.round(heading, 3) + 0.0,
        **{side: np.array([getattr(one, side) for one in seen])[chosen] for side in ("length",
            "width")},
    }  # fmt: skip
    path = folder / f"vehicle_tracks_{number:03d}.csv"
    write_csv(path, columns)
    return path


# recording --------------------------------------------------------------------------------------


WARM_UP = 60.0
"""Time before the recording in which the roads fill, s."""
_MARGIN = 3.0
"""Simulated time (s) beyond both ends of a recording, for smoothing."""
_FEWEST = 3
"""Recordings of a site at any scale: one each to train with, to validate and to test."""
_SHORTEST = 20.0
"""Length of a recording at any scale, s."""
_ATTEMPTS = 30
"""SUMO's drivers collide now and then, for want of an eye for it. Such traffic
is not used, other traffic drawn instead.
"""
_CLEARANCE = 0.1
"""Boxes that are nearer to each other than this count as colliding, m."""
_VARIATION = (0.75, 1.25)
"""Traffic of a recording over that of an average one."""


@dataclass(frozen=True)
class _Task:
    """A recording to be made: its site, number from 0, length (s), seed and folder."""

    site: SimulatedSite
    number: int
    length: float
    seed: np.random.SeedSequence
    folder: Path


def record(
    out: Path, *, scale: float = 1.0, seed: int = 0, sites: Sequence[str] | None = None,
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None, families: int = 0,
) -> list[Path]:  # fmt: skip
    """Record traffic at our sites, in a folder for each.

    The same arguments give the same bytes, whatever the number of jobs.

    Args:
        out: folder for the sites' folders.
        scale: how much of the full amount (see `SITES`); at least three recordings of each site in
            any case.
        seed: of everything random.
        sites: names of `SITES`; all by default.
        jobs: number of processes.
        progress: called with how many recordings are done, and of how many.
        families: so many sites drawn from the seed, with one recording each, in place of `SITES`.

    Returns:
        The track files.

    Raises:
        UsageError: there is no such site, an argument makes no sense, a site's folder is not empty
            or can't be written.
        ToolchainError: SUMO fails.
    """
    known = family(seed, families) if families else SITES
    _verify(scale, seed, sites, jobs, known)
    least = 1 if families else _FEWEST
    tasks = [
        task
        for name in dict.fromkeys(sites or known)
        for task in _tasks(known[name], scale, seed, out, least)
    ]
    found = []
    with _drafted(tasks, out) as drafts, results(_record, drafts, Workers(jobs)) as paths:
        for path in paths:
            found.append(out / path.parent.name / path.name)
            if progress:
                progress(len(found), len(tasks))
    return found


def record_one(site: SimulatedSite, out: Path, length: float, seed: int = 0) -> Path:
    """Record traffic at a site of any kind for so long (s), into a folder `out`
    / its name; the track file.

    Raises:
        UsageError: the folder is not empty or can't be written.
        ToolchainError: SUMO fails.
    """
    task = _Task(
        site, 0, length, np.random.SeedSequence((seed, *site.name.encode())), out / site.name
    )
    with _drafted([task], out) as (draft,):
        made = _record(draft)
    return task.folder / made.name


def _verify(
    scale: float,
    seed: int,
    sites: Sequence[str] | None,
    jobs: int,
    known: Mapping[str, SimulatedSite],
) -> None:
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
    """Tasks in hidden folders with the sites' maps, which become the sites'
    folders at the end; an error leaves nothing.
    """
    sites = {task.folder: task.site for task in tasks}
    with writing("the recordings", out):
        for folder in sites:
            if folder.is_dir() and any(folder.iterdir()):
                raise UsageError(
                    "the folder has something in it already; new recordings need a new one",
                    path=folder,
                )
        hidden = out / f"{DRAFT}{secrets.token_hex(4)}"
        hidden.mkdir(parents=True)
        try:
            for folder, site in sites.items():
                (hidden / folder.name).mkdir()
                if site.layout == "INTERACTION":
                    site.road_map().write(hidden / folder.name / f"{site.name}.xodr")
            yield [replace(task, folder=hidden / task.folder.name) for task in tasks]
            sync(
                sorted(hidden.rglob("*"))
            )  # contents before names: a power cut leaves no file in part
            for folder in sites:
                if folder.is_dir():
                    folder.rmdir()  # empty; Windows renames to no folder that is there
                (hidden / folder.name).rename(folder)
        finally:
            shutil.rmtree(hidden, ignore_errors=True)


def _tasks(site: SimulatedSite, scale: float, seed: int, out: Path, least: int) -> Iterator[_Task]:
    total = site.recordings * site.minutes * 60.0 * scale
    count = max(least, round(site.recordings * scale))
    length = float(max(_SHORTEST, round(total / count)))
    for number in range(count):
        # Seeded by the site's name too: its traffic does not depend on the other sites.
        yield _Task(
            site,
            number,
            length,
            np.random.SeedSequence((seed, number, *site.name.encode())),
            out / site.name,
        )


@limited()
def _record(task: _Task) -> Path:
    site = task.site
    rng = np.random.default_rng(task.seed)
    with TemporaryDirectory(prefix="xosc-recorder-") as folder:
        road = site.road_map().write(Path(folder) / f"{site.name}.xodr")
        net, network = build(road), load(road)
    for _ in range(_ATTEMPTS):
        vehicles, seen = _attempt(site, net, task.length, rng)
        length, width = (
            np.array([getattr(one, side) for one in vehicles])[seen.vehicle]
            for side in ("length", "width")
        )
        if not len(overlaps(seen, length + _CLEARANCE, width + _CLEARANCE)[0]):
            break
    else:
        raise ToolchainError(f"SUMO's vehicles run into each other at {site.name} all the time")
    seen = site.sensor.sees(seen, rng)
    if site.layout == "highD":
        frames = round(task.length * HIGHD_RATE)
        return write_highd(task.folder, task.number + 1, network, site.view, vehicles, seen, frames)
    return write_interaction(task.folder, task.number, vehicles, seen)


def _attempt(
    site: SimulatedSite, net: SumoNet, length: float, rng: np.random.Generator
) -> tuple[list[Vehicle], VehicleMotion]:
    """New traffic, and what is seen of it."""
    busy = rng.uniform(*_VARIATION)
    flows = [flow._replace(rate=flow.rate * busy) for flow in site.flows]
    end = WARM_UP + length + _MARGIN
    departing = parked(site.parking, site.fleet, WARM_UP, end, rng) + departures(
        flows, site.fleet, end, rng
    )
    fronts = simulate(departing, net, WARM_UP - _MARGIN, end, int(rng.integers(2**31)))
    vehicles = [departure.vehicle for departure in departing]
    rate = HIGHD_RATE if site.layout == "highD" else INTERACTION_RATE
    return vehicles, _seen(
        motion(fronts, [one.length for one in vehicles], rate), site.view, rate, length
    )


def _seen(moving: VehicleMotion, view: CameraView, rate: int, length: float) -> VehicleMotion:
    """Return the vehicles in view during the recording; its frames count from 0."""
    moving = moving._replace(frame=moving.frame - round(WARM_UP * rate))
    inside = (
        (view.left <= moving.x)
        & (moving.x <= view.right)
        & (view.bottom <= moving.y)
        & (moving.y <= view.top)
    )
    return moving.where(inside & (moving.frame >= 0) & (moving.frame < length * rate))
