"""Lanes that narrow to nothing: who drives on one goes on in the lane beside, along the road."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import runner
from tests.conformance.support import SCENARIOS, changed, track

CLOSING = {"right": ("1", "-2", 100.0, -1, 150.0, -3.5), "left": ("1", "1", 150.0, 2, 50.0, 0.0)}
"""Road, lane and s of the start; the lane beside; where the first one ends: s on
road 1, and t there
"""


def driven(tmp_path: Path, road: str, lane: str, s: float, speed: float = 20.0) -> runner.RunResult:
    """A run of 180 m on the roads with tapers."""
    start = (
        '<LanePosition roadId="1" laneId="-1" s="900" offset="0"/>',
        f'<LanePosition roadId="{road}" laneId="{lane}" s="{s}" offset="0"/>',
    )
    path = changed(
        SCENARIOS / "EndOfRoadCondition.xosc",
        tmp_path,
        start,
        ('TargetSpeed value="20"', f'TargetSpeed value="{speed}"'),
    )
    roads = str(SCENARIOS.parent / "roads" / "tapers.xodr")
    return runner.run(
        path,
        parameters={"Road": roads},
        sut=None,
        timestep=0.01,
        world="kinematic",
        max_time=180.0 / speed,
    )


@pytest.mark.parametrize("side", CLOSING)
def test_an_entity_on_a_lane_that_narrows_to_nothing_follows_the_road_on_the_lane_beside(
    side: str, tmp_path: Path
) -> None:
    road, lane, s, beside, end, t = CLOSING[side]
    result = driven(tmp_path, road, lane, s)
    columns = track(result, "Ego")
    steps = np.hypot(np.diff(columns["x"].astype(float)), np.diff(columns["y"].astype(float)))
    moving = columns["time"][1:] < 7.0  # until the roads end
    assert steps[moving] == pytest.approx(0.2, abs=1e-3), "at its speed, without a jump"
    past = (columns["road_id"] == "1") & (
        (columns["s"] > end) if side == "right" else (columns["s"] < end)
    )
    assert set(columns["lane_id"][past]) == {beside}
    offsets = columns["lane_offset"][past].astype(float)
    assert columns["t"][past].astype(float)[0] == pytest.approx(t, abs=0.02), (
        "from where the lane has ended"
    )
    assert (np.diff(np.abs(offsets)) <= 1e-9).all() and abs(offsets[-1]) < 1.2, "into the lane"
    kinks = np.abs(np.diff(np.unwrap(columns["h"][past].astype(float))))
    assert kinks[:100].max() < 2e-3, "without turning at once"


@pytest.mark.parametrize("side", CLOSING)
def test_it_ends_on_the_centre_of_the_lane_beside(side: str, tmp_path: Path) -> None:
    columns = track(driven(tmp_path, *CLOSING[side][:3], speed=4.0), "Ego")
    assert columns["lane_offset"].astype(float)[-1] == pytest.approx(0.0, abs=1e-9)


def test_it_comes_to_the_end_of_the_road_not_of_the_lane(tmp_path: Path) -> None:
    result = driven(tmp_path, *CLOSING["right"][:3])
    ego = track(result, "Ego")
    assert str(ego["road_id"][-1]) == "2"
    assert [
        event
        for event in result.events
        if event.kind == "startTransition" and "Fired" in event.subject
    ] == []
