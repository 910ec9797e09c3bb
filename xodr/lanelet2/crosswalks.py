"""Crosswalks as objects on the roads that they cross."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import accumulate

import numpy as np

from xodr.builders.curves import Pose
from xodr.builders.elements import Object, Road
from xodr.lanelet2.reading.reader import Area


def with_crosswalks(roads: Sequence[Road], crosswalks: Sequence[Area]) -> tuple[Road, ...]:
    """The roads with each crosswalk on the one whose piece begins nearest to it. Only its place matters, not its road."""
    poses = [(number, s, pose) for number, road in enumerate(roads) for s, pose in _poses(road)]
    places = np.array([(pose.x, pose.y) for _, _, pose in poses])
    found: dict[int, list[Object]] = defaultdict(list)
    for identity, area in enumerate(crosswalks, 1):
        centre = area.outline.mean(axis=0)
        number, s, pose = poses[int(np.argmin(np.hypot(*(places - centre).T)))]
        outline = tuple(_local(pose, point) for point in area.outline.tolist())
        found[number].append(Object(identity, area.id, "crosswalk", s, 0.0, outline))
    return tuple(replace(road, objects=tuple(found[number])) for number, road in enumerate(roads))


def _poses(road: Road) -> Iterator[tuple[float, Pose]]:
    """Where the pieces of the reference line begin and end."""
    return zip(accumulate((piece.length for piece in road.plan), initial=0.0), road.poses, strict=True)


def _local(pose: Pose, point: Sequence[float]) -> tuple[float, float]:
    dx, dy = point[0] - pose.x, point[1] - pose.y
    cos, sin = math.cos(pose.heading), math.sin(pose.heading)
    return cos * dx + sin * dy, cos * dy - sin * dx
