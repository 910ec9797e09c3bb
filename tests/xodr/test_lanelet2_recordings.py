"""The Lanelet2 maps of real recordings, which are present in development and CI only."""

from __future__ import annotations

from pathlib import Path

import pytest

import schemas
import xodr
from xodr.lanelet2 import Conversion, convert

ORIGINS = {
    "k729_2022-03-16": (49.01160993928274, 8.43856470258739),
    "k733_2018-05-02": (49.005306, 8.4374089),
    "k733_2020-09-15": (49.005306, 8.4374089),
}


@pytest.fixture(params=ORIGINS)
def conversion(request: pytest.FixtureRequest, recordings: Path, tmp_path: Path) -> Conversion:
    """One of the maps, converted."""
    site = request.param
    return convert(recordings / "taf_bw" / "maps" / f"{site}.osm", ORIGINS[site], tmp_path / f"{site}.xodr")


def test_real_maps_are_valid_roads_within_tolerance(conversion: Conversion) -> None:
    assert schemas.check(conversion.path) == []
    assert conversion.deviation < 0.4
    assert set(conversion.lanelets.values()) <= {
        (road.id, lane) for road in xodr.load(conversion.path).roads.values() for lane in road.lane_ids(0.0)
    }
