"""SUMO simulation of the recorder: motion of vehicles as a sensor would measure it, without
overlaps."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from recognition.recorder.traffic import Departure, write_routes
from recognition.recordings.source import REAR_AXLE
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import ToolchainError
from xodr.formats.sumo_net import SumoNet, sumo_home


def overlaps(
    moving: VehicleMotion, length: FloatArray, width: FloatArray
) -> tuple[IntArray, IntArray]:
    """Pairs of rows of one frame whose boxes overlap.

    Args:
        length, width: of each row's box, m.
    """
    order = np.lexsort((moving.x, moving.frame))
    frame, x, y = moving.frame[order], moving.x[order], moving.y[order]
    reach = 0.5 * np.hypot(length, width)[order]
    found: list[tuple[IntArray, IntArray]] = []
    here = np.arange(len(order) - 1)
    step = 1
    while len(here := here[here + step < len(order)]):
        there = here + step
        # Sorted by x: a row that is too far from the next one is so from all after it.
        near = (frame[there] == frame[here]) & (x[there] - x[here] < reach[here] + reach.max())
        here, there = here[near], there[near]
        touching = np.hypot(x[there] - x[here], y[there] - y[here]) < reach[here] + reach[there]
        a, b = order[here[touching]], order[there[touching]]
        # Rectangles are apart if, and only if, an axis of one of them separates them.
        apart = _separated(moving, length, width, a, b) | _separated(moving, length, width, b, a)
        found.append((a[~apart], b[~apart]))
        step += 1
    first, second = zip(*found, strict=True) if found else ((), ())
    return np.concatenate([np.empty(0, np.int64), *first]), np.concatenate(
        [np.empty(0, np.int64), *second]
    )


def _separated(
    moving: VehicleMotion, length: FloatArray, width: FloatArray, a: IntArray, b: IntArray
) -> BoolArray:
    """Whether one of the two axes of each box `a` separates it from the box `b`."""
    dx, dy = moving.x[b] - moving.x[a], moving.y[b] - moving.y[a]
    cos, sin = np.cos(moving.h[a]), np.sin(moving.h[a])
    turn = moving.h[b] - moving.h[a]
    along, across = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    ahead = np.abs(dx * cos + dy * sin) >= 0.5 * (length[a] + length[b] * along + width[b] * across)
    aside = np.abs(dy * cos - dx * sin) >= 0.5 * (width[a] + length[b] * across + width[b] * along)
    return ahead | aside


_TURN = 0.1
"""Noise of headings over that of positions, rad/m."""
_SPEED = 1.0
"""Noise of velocities over that of positions, 1/s."""
_WAVES = 3
_WAVELENGTHS = 30.0, 120.0
"""Of distortion, m."""


@dataclass(frozen=True)
class Sensor:
    """Errors of a sensor; the default has none.

    Attributes:
        noise: standard deviation of positions, m; velocities and headings are off in proportion.
        distortion: standard deviation of displacements that vary slowly from place to place, m,
            half of them the same for all vehicles, as where map and camera do not agree, and half
            each one's own, as of drivers off the lane's centre.
        dropped: share of the vehicles that are never seen.
        cut: share of the others of which only a part of the way is seen, a quarter of it or more.
    """

    noise: float = 0.0
    distortion: float = 0.0
    dropped: float = 0.0
    cut: float = 0.0

    def sees(self, moving: VehicleMotion, rng: np.random.Generator) -> VehicleMotion:
        """Return the motion of vehicles as observed, with noise."""
        if self == EXACT:
            return moving
        moving = self._distorted(moving.where(self._seen(moving, rng)), rng)
        count = len(moving.x)

        def noisy(values: FloatArray, factor: float) -> FloatArray:
            return values + factor * self.noise * rng.standard_normal(count)

        return moving._replace(
            x=noisy(moving.x, 1.0), y=noisy(moving.y, 1.0), h=noisy(moving.h, _TURN),
            vx=noisy(moving.vx, _SPEED), vy=noisy(moving.vy, _SPEED),
        )  # fmt: skip

    def _distorted(self, moving: VehicleMotion, rng: np.random.Generator) -> VehicleMotion:
        """Places displaced by waves over the map; velocities and headings follow."""
        vehicle = np.unique(moving.vehicle, return_inverse=True)[1]
        along = np.stack([np.cos(moving.h), np.sin(moving.h)])
        place, velocity = np.stack([moving.x, moving.y]), np.stack([moving.vx, moving.vy])
        shift, change, turn = np.zeros_like(place), np.zeros_like(place), np.zeros_like(place)
        for axis in np.repeat([0, 1], _WAVES):
            angle, length = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(*_WAVELENGTHS)
            wave = 2.0 * np.pi / length * np.array([np.cos(angle), np.sin(angle)])
            everybody, own = (
                rng.standard_normal(2),
                rng.standard_normal((vehicle.max(initial=0) + 1, 2)),
            )
            # So that the sum over all waves, common and own, has the deviation `distortion`.
            cosine, sine = self.distortion / np.sqrt(2.0 * _WAVES) * (everybody + own)[vehicle].T
            phase = wave @ place
            # The derivative by the phase: velocities and headings agree with the displaced places.
            slope = sine * np.cos(phase) - cosine * np.sin(phase)
            shift[axis] += cosine * np.cos(phase) + sine * np.sin(phase)
            change[axis] += slope * (wave @ velocity)
            turn[axis] += slope * (wave @ along)
        heading = np.arctan2(*(along + turn)[::-1]) - np.arctan2(*along[::-1])
        return moving._replace(
            x=moving.x + shift[0], y=moving.y + shift[1], vx=moving.vx + change[0],
            vy=moving.vy + change[1],
            h=moving.h + (heading + np.pi) % (2.0 * np.pi) - np.pi,
        )  # fmt: skip

    def _seen(self, moving: VehicleMotion, rng: np.random.Generator) -> NDArray[np.bool_]:
        vehicles, start, vehicle = np.unique(moving.vehicle, return_index=True, return_inverse=True)
        size = np.bincount(vehicle, minlength=len(vehicles))
        missed = rng.random(len(vehicles)) < self.dropped
        part = np.where(
            rng.random(len(vehicles)) < self.cut, rng.uniform(0.25, 1.0, len(vehicles)), 1.0
        )
        begin = rng.uniform(0.0, 1.0, len(vehicles)) * (1.0 - part)
        share = (np.arange(len(vehicle)) - start[vehicle]) / np.maximum(size[vehicle] - 1, 1)
        return ~missed[vehicle] & (share >= begin[vehicle]) & (share <= (begin + part)[vehicle])


EXACT = Sensor()
"""Sees everything as it is."""


SMOOTHING = 0.3
"""Standard deviation of the smoothing, s."""
_REACH = 4
"""Reach of the smoothing in standard deviations."""
_SHORTEST = 1.0
"""Tracks that are shorter are left out, s."""


class VehicleMotion(NamedTuple):
    """Vehicles over time, in the order of vehicles and time.

    Attributes:
        vehicle: number of its departure. frame: time in frames.
        x, y: centre, m. h: heading, rad. vx, vy: m/s. ax, ay: m/s².
    """

    vehicle: IntArray
    frame: IntArray
    x: FloatArray
    y: FloatArray
    h: FloatArray
    vx: FloatArray
    vy: FloatArray
    ax: FloatArray
    ay: FloatArray

    def where(self, chosen: np.ndarray) -> VehicleMotion:
        """The rows for which `chosen` is true."""
        return VehicleMotion(*(column[chosen] for column in self))


def motion(fronts: Fronts, lengths: Sequence[float], rate: int) -> VehicleMotion:
    """The motion of vehicles of the given lengths (m, by departure), `rate` frames a second."""
    starts = np.flatnonzero(np.diff(fronts.vehicle, prepend=-1))
    ends = np.append(starts[1:], len(fronts.vehicle))
    long = ends - starts >= _SHORTEST * STEPS
    starts, ends = starts[long], ends[long]
    vehicle, h = fronts.vehicle[starts], fronts.h[starts]
    length = np.array(lengths)[vehicle]
    # Both axles are equally far from the centre.
    tracks = [
        _axle(fronts, *which, rate)
        for which in zip(
            starts.tolist(), ends.tolist(), ((0.5 - REAR_AXLE) * length).tolist(), strict=True
        )
    ]
    counts = np.array([len(frame) for frame, _ in tracks])
    frame, axle = (np.concatenate(column) for column in zip(*tracks, strict=True))
    x, y = axle.T
    h = _headings(x, y, counts, 2 * REAR_AXLE * length, h)
    owner = np.repeat(np.arange(len(vehicle)), counts)
    behind = REAR_AXLE * length[owner]
    x, y = x - behind * np.cos(h), y - behind * np.sin(h)
    vx, vy = (_rate(values, counts, rate) for values in (x, y))
    ax, ay = (_rate(values, counts, rate) for values in (vx, vy))
    return VehicleMotion(vehicle[owner], frame, x, y, h, vx, vy, ax, ay)


def _axle(
    fronts: Fronts, start: int, end: int, behind: float, rate: int
) -> tuple[IntArray, FloatArray]:
    """Frames and places (n, 2) of one front axle, `behind` the bumper (m)."""
    front, step = (
        np.stack((fronts.x[start:end], fronts.y[start:end]), axis=1),
        fronts.step[start:end],
    )
    h = fronts.h[start]
    way = np.append(0.0, np.cumsum(np.hypot(*np.diff(front, axis=0).T)))
    # Interpolation needs a growing way: a standing vehicle repeats its place.
    known = np.append(True, np.diff(way) > 0.0)
    # Before its first row a vehicle is taken to have come straight on, so that its axle has a
    # place.
    path = np.concatenate(([front[0] - behind * np.array([np.cos(h), np.sin(h)])], front[known]))
    passed = np.append(-behind, way[known])
    axle = np.stack(
        [_smooth(np.interp(way - behind, passed, coordinate)) for coordinate in path.T], axis=1
    )
    # Frames within the track: the first one rounded up, the last one down.
    frame = np.arange(-(-step[0] * rate // STEPS), step[-1] * rate // STEPS + 1)
    return frame, CubicSpline(step / STEPS, axle)(frame / rate)


def _smooth(values: FloatArray) -> FloatArray:
    """Smoothed values; beyond the ends the motion is continued by odd reflection."""
    sd = SMOOTHING * STEPS
    reach = min(round(_REACH * sd), len(values) - 1)
    before, after = (
        2 * values[0] - values[reach:0:-1],
        2 * values[-1] - values[-2 : -reach - 2 : -1],
    )
    padded = np.concatenate((before, values, after))
    return gaussian_filter1d(padded, sd, truncate=_REACH)[reach : reach + len(values)]


def _headings(
    x: FloatArray, y: FloatArray, counts: IntArray, distance: FloatArray, h: FloatArray
) -> FloatArray:
    """Headings of vehicles whose rear axles follow their front axles at a distance, from given
    headings at the start.

    While the front goes straight on, the tangent of half the angle between its direction and the
    heading fades exponentially (the tractrix). All vehicles take their first step, then all their
    second one and so on.
    """
    ahead_x, ahead_y = np.diff(x, prepend=x[:1]), np.diff(y, prepend=y[:1])
    direction, way = np.arctan2(ahead_y, ahead_x), np.hypot(ahead_x, ahead_y)
    # The longest first: tracks that have a step are the first ones.
    order = np.argsort(-counts, kind="stable")
    starts, distance = (np.cumsum(counts) - counts)[order], distance[order]
    headings = np.empty(len(x))
    headings[starts] = h[order]
    left = np.searchsorted(-counts[order], -np.arange(counts.max()), side="left")
    for step, active in enumerate(left[1:], 1):
        here = starts[:active] + step
        angle = direction[here] - headings[here - 1]
        fading = np.exp(-way[here] / distance[:active])
        headings[here] = direction[here] - 2.0 * np.arctan2(
            np.sin(0.5 * angle) * fading, np.cos(0.5 * angle)
        )
    return headings


def _rate(values: FloatArray, counts: IntArray, rate: int) -> FloatArray:
    """Rates of change of each track, per s: central differences, at the ends one-sided ones."""
    ends = np.cumsum(counts)
    after = np.minimum(np.arange(len(values)) + 1, np.repeat(ends - 1, counts))
    before = np.maximum(np.arange(len(values)) - 1, np.repeat(ends - counts, counts))
    return (values[after] - values[before]) * rate / (after - before)


STEPS = 10
"""SUMO's time steps a second."""
_SUBLANE = 4.0
"""Width of the strips in which SUMO's drivers look for leaders, m: whole lanes. Drivers can be
anywhere across them all the same; with narrower strips they swerve where the number of lanes
changes, and squeeze past each other."""
_SLOWEST = 1.0
"""SUMO may take this many times as long as the traffic that it simulates."""


class Fronts(NamedTuple):
    """Middles of front bumpers, in the order of vehicles and time.

    Attributes:
        vehicle: number of its departure. step: time in steps.
        x, y: m. h: SUMO's heading, rad.
    """

    vehicle: IntArray
    step: IntArray
    x: FloatArray
    y: FloatArray
    h: FloatArray


def simulate(
    departing: Sequence[Departure], net: SumoNet, begin: float, end: float, seed: int
) -> Fronts:
    """Return the positions of all vehicles from `begin` to `end`, s.

    Raises:
        ToolchainError: SUMO fails.
    """
    with TemporaryDirectory(prefix="xosc-recorder-") as folder:
        write_routes(departing, net, Path(folder) / "routes.xml")
        # No vehicle is removed from a queue or after a collision: such traffic is drawn anew.
        arguments = [
            str(sumo_home() / "bin" / "sumo"), f"--net-file={net.path}", "--route-files=routes.xml",
            "--fcd-output=fronts.parquet", "--fcd-output.attributes=id,x,y,angle",
            "--fcd-output.skip-empty",
            f"--device.fcd.begin={begin:.2f}", f"--end={end:.2f}", f"--seed={seed}",
            f"--step-length={1 / STEPS}", f"--lateral-resolution={_SUBLANE}",
            "--time-to-teleport=-1", "--collision.action=none",
            "--no-step-log", "--no-warnings", "--xml-validation=never",
        ]  # fmt: skip
        try:
            done = subprocess.run(
                arguments, cwd=folder, env={**os.environ, "SUMO_HOME": str(sumo_home())},
                stdin=subprocess.DEVNULL,
                capture_output=True, timeout=60.0 + _SLOWEST * end, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            raise ToolchainError(
                f"SUMO has not simulated {end:.0f} s of traffic in {60.0 + _SLOWEST * end:.0f} s"
            ) from None
        if done.returncode != 0:
            raise ToolchainError(
                f"SUMO fails: {done.stderr.decode(errors='replace').strip()[-500:]}"
            )
        return _read(Path(folder) / "fronts.parquet")


def _read(path: Path) -> Fronts:
    import pyarrow.parquet as pq

    table = pq.read_table(path)
    vehicle = table["vehicle_id"].to_numpy().astype(np.int64)
    step = np.round(table["timestep_time"].to_numpy() * STEPS).astype(np.int64)
    order = np.lexsort((step, vehicle))
    x, y, angle = (table[f"vehicle_{name}"].to_numpy()[order] for name in ("x", "y", "angle"))
    # SUMO's angles are clockwise from north, degrees.
    return Fronts(vehicle[order], step[order], x, y, np.radians(90.0 - angle))
