"""Roads as arrays."""

from __future__ import annotations

import numpy as np
import pytest

from xodr.lookup.arrays import lane_borders, sample, stations


def test_samples_are_poses(files) -> None:
    road = files.load(files.road(geometry=files.geometry('<arc curvature="0.02"/>', 100.0))).road(
        "1"
    )
    points = sample(road, [0.0, 30.0, 60.0], -2.0)
    assert points.shape == (3, 3)
    assert points[1] == pytest.approx(road.pose(30.0, -2.0)[:3])


def test_stations_cover_the_road_densely_enough(files) -> None:
    road = files.load(files.road(geometry=files.geometry('<arc curvature="0.2"/>', 100.0))).road(
        "1"
    )
    found = stations(road)
    assert (found[0], found[-1]) == (0.0, 100.0)
    assert np.all(np.diff(found) > 0.0)
    assert np.diff(found).max() * 0.2 <= 0.31


def test_neighbouring_lanes_share_their_border(files) -> None:
    road = files.load(files.road()).road("1")
    borders = {lane_id: (inner, outer) for lane_id, inner, outer in lane_borders(road)}
    assert sorted(borders) == [-2, -1, 1, 2]
    assert borders[1][1] == pytest.approx(borders[2][0])
    assert borders[-2][1][0] == pytest.approx([0.0, -7.0, 0.0])
