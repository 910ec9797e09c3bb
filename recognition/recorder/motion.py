"""From SUMO's front bumpers to the motion of whole vehicles, smooth and consistent in itself.

SUMO moves points along lanes; vehicles are rigid bodies on two axles. The front axle takes the way that SUMO's point takes, which
is smoothed (SUMO's accelerations jump, its lanes have corners), and pulls the rear axle after it without slipping sideways. So
headings follow from the motion, in lane changes as in curves, also while standing. Velocities and accelerations are derivatives
of positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from recognition.datasets.participants import REAR_AXLE
from recognition.recorder.simulation import STEPS, Fronts
from xodr.array_types import FloatArray, IntArray

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
    tracks = [
        _axle(fronts, *which, rate)
        for which in zip(starts.tolist(), ends.tolist(), ((0.5 - REAR_AXLE) * length).tolist(), strict=True)
    ]
    counts = np.array([len(frame) for frame, _ in tracks])
    frame, axle = (np.concatenate(column) for column in zip(*tracks, strict=True))
    x, y = axle.T
    h = _headings(x, y, counts, 2 * REAR_AXLE * length, h)
    each = np.repeat(np.arange(len(vehicle)), counts)
    behind = REAR_AXLE * length[each]
    x, y = x - behind * np.cos(h), y - behind * np.sin(h)
    vx, vy = (_rate(values, counts, rate) for values in (x, y))
    ax, ay = (_rate(values, counts, rate) for values in (vx, vy))
    return VehicleMotion(vehicle[each], frame, x, y, h, vx, vy, ax, ay)


def _axle(fronts: Fronts, start: int, end: int, behind: float, rate: int) -> tuple[IntArray, FloatArray]:
    """Frames and places (n, 2) of one front axle, `behind` the bumper (m)."""
    front, step = np.stack((fronts.x[start:end], fronts.y[start:end]), axis=1), fronts.step[start:end]
    h = fronts.h[start]
    way = np.append(0.0, np.cumsum(np.hypot(*np.diff(front, axis=0).T)))
    known = np.append(True, np.diff(way) > 0.0)
    path = np.concatenate(([front[0] - behind * np.array([np.cos(h), np.sin(h)])], front[known]))
    passed = np.append(-behind, way[known])
    axle = np.stack([_smooth(np.interp(way - behind, passed, coordinate)) for coordinate in path.T], axis=1)
    frame = np.arange(-(-step[0] * rate // STEPS), step[-1] * rate // STEPS + 1)
    return frame, CubicSpline(step / STEPS, axle)(frame / rate)


def _smooth(values: FloatArray) -> FloatArray:
    """Smoothed values; beyond the ends, the motion goes on as it is (odd reflection)."""
    sd = SMOOTHING * STEPS
    reach = min(round(_REACH * sd), len(values) - 1)
    before, after = 2 * values[0] - values[reach:0:-1], 2 * values[-1] - values[-2 : -reach - 2 : -1]
    padded = np.concatenate((before, values, after))
    return gaussian_filter1d(padded, sd, truncate=_REACH)[reach : reach + len(values)]


def _headings(x: FloatArray, y: FloatArray, counts: IntArray, distance: FloatArray, h: FloatArray) -> FloatArray:
    """Headings of vehicles whose rear axles follow their front axles at a distance, from given headings at the start.

    While the front goes straight on, the tangent of half the angle between its direction and the heading fades exponentially
    (the tractrix). All vehicles take their first step, then all their second one and so on.
    """
    ahead_x, ahead_y = np.diff(x, prepend=x[:1]), np.diff(y, prepend=y[:1])
    direction, way = np.arctan2(ahead_y, ahead_x), np.hypot(ahead_x, ahead_y)
    order = np.argsort(-counts, kind="stable")
    starts, distance = (np.cumsum(counts) - counts)[order], distance[order]
    found = np.empty(len(x))
    found[starts] = h[order]
    left = np.searchsorted(-counts[order], -np.arange(counts.max()), side="left")
    for step, active in enumerate(left[1:], 1):
        here = starts[:active] + step
        angle = direction[here] - found[here - 1]
        fading = np.exp(-way[here] / distance[:active])
        found[here] = direction[here] - 2.0 * np.arctan2(np.sin(0.5 * angle) * fading, np.cos(0.5 * angle))
    return found


def _rate(values: FloatArray, counts: IntArray, rate: int) -> FloatArray:
    """Rates of change of each track, per s: central differences, at the ends one-sided ones."""
    ends = np.cumsum(counts)
    after = np.minimum(np.arange(len(values)) + 1, np.repeat(ends - 1, counts))
    before = np.maximum(np.arange(len(values)) - 1, np.repeat(ends - counts, counts))
    return (values[after] - values[before]) * rate / (after - before)
