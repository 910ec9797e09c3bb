"""Ways off a road between its ends (virtual junctions): routes take them and come back, traffic
without a route drives past.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runner
from tests.conformance.support import SCENARIOS, changed, track

LAY_BY = Path(__file__).parent / "roads" / "lay_by.xodr"


def drive(
    folder: Path, scenario: str, *changes: tuple[str, str], **options: Any
) -> dict[str, np.ndarray]:
    """Track of a car that starts at s=20 of the main road; the lay-by leaves at
    s=60 and comes back at s=137.88.
    """
    start = (
        '<LanePosition roadId="3" laneId="1" s="50"/>',
        '<LanePosition roadId="1" laneId="-1" s="20"/>',
    )
    path = changed(
        SCENARIOS / f"{scenario}.xosc", folder, ("crossing.xodr", LAY_BY.name), start, *changes
    )
    return track(runner.run(path, sut=None, timestep=0.01, max_time=22.0, **options), "Car")


def along(columns: dict[str, np.ndarray]) -> list[str]:
    """The roads in turn."""
    roads = [str(road) for road in columns["road_id"]]
    return [road for index, road in enumerate(roads) if index == 0 or road != roads[index - 1]]


def assert_smooth(columns: dict[str, np.ndarray]) -> None:
    """10 m/s without a jump in place or heading."""
    steps = np.hypot(np.diff(columns["x"]), np.diff(columns["y"]))
    assert steps == pytest.approx(np.full(len(steps), steps[0]), abs=1e-4)
    assert np.abs(np.diff(np.unwrap(columns["h"]))).max() < 0.01


FIRST = '<Route name="Route" closed="$Closed">'
START = (
    f'{FIRST}<Waypoint routeStrategy="shortest"><Position><LanePosition roadId="1" laneId="-1" '
    's="25"/></Position></Waypoint>'
)
ROUTE = (
    ('value="11"', 'value="20"'),
    (FIRST, START),
    (
        '<LanePosition roadId="3" laneId="1" s="80"/>',
        '<LanePosition roadId="2" laneId="-1" s="40"/>',
    ),
    (
        '<LanePosition roadId="$Exit" laneId="-1" s="60"/>',
        '<LanePosition roadId="1" laneId="-1" s="200"/>',
    ),
)


@pytest.mark.parametrize("world", ["kinematic", "sumo"])
def test_an_assigned_route_leaves_the_main_road_and_comes_back(tmp_path: Path, world: str) -> None:
    columns = drive(tmp_path, "AssignRouteAction", *ROUTE, world=world)
    assert along(columns) == ["1", "2", "1"]
    assert float(columns["y"].min()) == pytest.approx(-1.75 - 100.0 * (1.0 - np.cos(0.4)), abs=0.01)
    assert float(columns["x"][-1]) > 200.0 and float(columns["y"][-1]) == pytest.approx(-1.75)
    assert_smooth(columns)


def test_a_route_along_the_main_road_drives_past(tmp_path: Path) -> None:
    main = (ROUTE[2][0], '<LanePosition roadId="1" laneId="-1" s="30"/>')
    columns = drive(tmp_path, "AssignRouteAction", main, ROUTE[3])
    assert along(columns) == ["1"]
    assert columns["y"] == pytest.approx(-1.75)


def test_acquire_position_leads_off_the_main_road(tmp_path: Path) -> None:
    place = (
        '<LanePosition roadId="$Exit" laneId="-1" s="40"/>',
        '<LanePosition roadId="2" laneId="-1" s="60"/>',
    )
    columns = drive(tmp_path, "AcquirePositionAction", place)
    assert along(columns)[:2] == ["1", "2"]
    assert_smooth(columns)


def test_a_random_route_takes_the_way_off_in_some_runs(tmp_path: Path) -> None:
    folders = [tmp_path / str(seed) for seed in range(6)]
    ways = []
    for seed, folder in enumerate(folders):
        folder.mkdir()
        columns = drive(folder, "RandomRouteAction", seed=seed)
        ways.append(tuple(along(columns)[:2]))
    assert set(ways) == {("1",), ("1", "2")}
