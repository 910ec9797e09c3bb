"""Our maps as CARLA's own OpenDRIVE parser reads them (the wheel `carla`,
without a server): lanes are where ours are.
"""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import xodr
from tests.readers.conftest import Read

LIBRARY = sorted(
    path
    for path in (Path(xodr.__file__).parent / "library").glob("*.xodr")
    if b'layer="temporary"' not in path.read_bytes()
)
"""Without roads of several lane layers, which CARLA does not know."""

READ = """
import json, sys
import carla
text = open(sys.argv[1], encoding="utf-8").read()
town = carla.Map("map", text[text.find("<OpenDRIVE"):])
rows = [(str(w.road_id), w.lane_id, w.s, w.lane_width, w.transform.location.x, w.transform.location.y, w.transform.rotation.yaw)
        for w in town.generate_waypoints(5.0)]
print(json.dumps(rows))
"""


@pytest.mark.parametrize("path", LIBRARY, ids=lambda path: path.stem)
def test_carla_finds_the_lanes_where_they_are(path: Path, read: Read) -> None:
    network = xodr.load(path)
    rows = read(READ, path)
    for (
        road_id,
        lane_id,
        s,
        width,
        x,
        y,
        yaw,
    ) in rows:  # CARLA's axes are left-handed, its headings those of the traffic
        road = network.road(road_id)
        here = road.pose(s, road.lane_point(s, lane_id).t)
        assert (x, -y) == pytest.approx((here.x, here.y), abs=0.02)
        heading = -math.radians(yaw) - here.h - (0.0 if road.direction(lane_id, s) > 0 else math.pi)
        assert math.cos(heading) > 0.9995
        assert width == pytest.approx(road.lane(s, lane_id).width(s), abs=1e-3)
    driving = {
        (road.id, lane.id) for road in network.roads.values() for section in road.sections for lane in section.lanes.values()
        if lane.type == "driving"
    }  # fmt: skip
    assert driving <= {(road_id, lane_id) for road_id, lane_id, *_ in rows}
