"""The seven parameters of units, and those of whole data sets."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from recognition.datasets import Source
from recognition.datasets import open as open_data
from recognition.labels.rules import Rules
from recognition.labels.scene.scene import prepare
from recognition.maneuvers.estimation.motion import LaneMotion, lane_motion
from recognition.maneuvers.estimation.reconstruction import errors
from recognition.maneuvers.estimation.speeds import EVERY, fitted_speeds, ways
from recognition.maneuvers.unit import LANE_CHANGE, Unit
from recognition.maneuvers.units.samples import Samples
from recognition.maneuvers.units.segmentation import segment
from recognition.sites import site_of
from recognition.trfe.samples import Floats
from schemas.errors import UsageError


def parameters_of(motion: LaneMotion, unit: Unit) -> tuple[Floats, float] | None:
    """The seven parameters (7,) of a unit, and the speed (m/s) of the one who is not the actor when the manoeuvre begins.

    The speeds are those with which the reconstruction comes closest to the recorded way and to the speeds recorded at the
    manoeuvre's beginning and end and at the scene's end. None where the two are not one ahead of the other, or the other was
    not recorded then.
    """
    scene = motion.scene
    other = motion.row(unit.other, int(scene.frame[unit.start]))
    if other is None:
        return None
    gap = motion.gap(unit.start, other) if unit.kind == LANE_CHANGE else motion.gap(other, unit.start)
    if gap <= 0.0:
        return None
    times = scene.time[[unit.first, unit.start, unit.end, unit.last]]
    start_time, duration, rest = np.diff(times)
    start, end, final = _speeds(motion, unit, duration, rest)
    return np.array([gap, start, start_time, end, duration, final, rest]), float(scene.speed[other])


def _speeds(motion: LaneMotion, unit: Unit, duration: float, rest: float) -> Floats:
    """Start, end and final speed (3,), m/s."""
    scene = motion.scene
    rows = np.arange(unit.first, unit.last + 1, scene.rows(EVERY))
    way = motion.way[rows] - motion.way[unit.start]
    model = ways(scene.time[rows] - scene.time[unit.start], duration, rest)
    return fitted_speeds(model, way, scene.speed[[unit.start, unit.end, unit.last]])


def extract(path: str | PathLike[str], roads: str | PathLike[str]) -> Samples:
    """The units of all recordings in a folder with their parameters.

    Args:
        roads: folder for roads that recordings don't bring with them.

    Raises:
        UsageError: no recording has any.
        InvalidFile: a recording is malformed.
    """
    found = [extract_from(source, roads) for source in open_data(path, roads).sources]
    if not any(len(each.theta) for each in found):
        raise UsageError("no recording has a manoeuvre that the seven parameters describe", path=path)
    return Samples.joined(found)


def extract_from(source: Source, roads: str | PathLike[str]) -> Samples:
    """The units of one recording; see `extract`."""
    recording = source.load()
    moved = lane_motion(prepare(recording, site_of(source, recording, Path(roads)), Rules()))
    units = [(unit, found) for unit in segment(moved) if (found := parameters_of(moved, unit)) is not None]
    return _samples(source.name, moved, units)


def _samples(name: str, motion: LaneMotion, units: Sequence[tuple[Unit, tuple[Floats, float]]]) -> Samples:
    scene, names = motion.scene, np.array(motion.scene.names, np.str_)
    theta = np.array([row for _, (row, _) in units]).reshape(-1, 7)
    only = [unit for unit, _ in units]
    return Samples(
        theta=theta,
        recordings=np.full(len(only), name),
        kinds=np.array([unit.kind for unit in only], np.str_),
        actors=names[[unit.actor for unit in only]],
        others=names[[unit.other for unit in only]],
        times=scene.time[[unit.start for unit in only]],
        ego_speeds=np.array([speed for _, (_, speed) in units]),
        errors=np.array([errors(motion, unit, row) for unit, (row, _) in units]).reshape(-1, 2),
    )
