"""Public road files: every one loads, and every place on them is found again."""

from __future__ import annotations

import math
from pathlib import Path
from random import Random

import xodr


def test_every_road_file_loads_and_its_points_are_found_again(corpora: Path) -> None:
    files = sorted(corpora.rglob("*.xodr"))
    assert files
    rng = Random(7)
    for path in files:
        network = xodr.load(path)
        for road in network.roads.values():
            for _ in range(10):
                s = rng.uniform(0.0, road.length)
                pose = road.pose(s, rng.uniform(*road.edges(s)))
                found = network.pose(network.locate(pose.x, pose.y, pose.z))
                assert math.dist(pose[:3], found[:3]) < 1e-3, (
                    f"{path.name}, road {road.id}, s = {s}"
                )


def test_driving_never_jumps(corpora: Path) -> None:
    driven = 0
    for path in sorted(corpora.rglob("*.xodr")):
        network = xodr.load(path)
        for road in network.roads.values():
            for lane_id in road.lane_ids(0.0):
                if road.lane_type(0.0, lane_id) == "driving":
                    _drive(network, road.lane_point(0.0, lane_id), 200)
                    driven += 1
    assert driven > 100


def _drive(network: xodr.RoadNetwork, point: xodr.RoadPoint, steps: int) -> None:
    forward = True
    pose = network.pose(point)
    for _ in range(steps):
        point, forward, left = network.travel(point, 2.0, forward)
        after = network.pose(point)
        assert math.dist(pose[:2], after[:2]) < 2.5, f"{network.path.name}: {point}"
        pose = after
        if left:
            break
