"""The units of whole data sets with the values of their parameters."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from recognition.datasets import Source
from recognition.datasets import open as open_data
from recognition.labels.rules import Rules
from recognition.labels.scene.scene import prepare
from recognition.maneuvers.estimation.estimate import estimate
from recognition.maneuvers.estimation.motion import lane_motion
from recognition.maneuvers.estimation.reconstruction import errors
from recognition.maneuvers.parameters import PARAMETERS
from recognition.maneuvers.units.exposure import Exposure
from recognition.maneuvers.units.samples import Samples
from recognition.maneuvers.units.segmentation import segment
from recognition.sites import site_of
from schemas.errors import UsageError


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
    motion = lane_motion(prepare(recording, site_of(source, recording, Path(roads)), Rules()))
    every = segment(motion)
    found = [(unit, each) for unit in every if (each := estimate(motion, unit)) is not None]
    scene, names = motion.scene, np.array(motion.scene.names, np.str_)
    units = [unit for unit, _ in found]
    theta = np.array([each.values for _, each in found], np.float64).reshape(-1, len(PARAMETERS))
    return Samples(
        theta=theta,
        recordings=np.full(len(units), source.name),
        kinds=np.array([unit.kind for unit in units], np.str_),
        actors=names[[unit.actor for unit in units]],
        others=names[[unit.other for unit in units]],
        times=scene.time[[unit.start for unit in units]],
        ego_speeds=np.array([each.other_speed for _, each in found]),
        jerks=np.array([each.jerk for _, each in found]),
        errors=np.array([errors(motion, unit, row) for unit, row in zip(units, theta, strict=True)]).reshape(-1, 2),
        exposure={source.name: Exposure.of(motion, every)},
    )
