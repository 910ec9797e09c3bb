"""`cas` drives the ego of public scenarios: no error, plausible motion. A sample
in the kinematic world, for speed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import runner
import xosc
from runner.systems import Control, Observation
from runner.systems.kinds.cas import CollisionAvoidance
from tests.conformance.support import track

SAMPLE = 3
"""Every so many files are run"""
NEEDS_OTHER_FILES = {"car_walk.xosc"}
SCRIPTED_JUMPS = {"follow_reference.xosc", "lane_change_simple.xosc"}
"""Scenarios with a TeleportAction, or a lane change at once, while they run"""


class Watched(CollisionAvoidance):
    """`cas` with a note of when it braked."""

    def __init__(self) -> None:
        super().__init__()
        self.braked: list[float] = []

    def control(self, observation: Observation, dt: float) -> Control:
        control = super().control(observation, dt)
        if control.acceleration is not None:
            self.braked.append(observation.time)
        return control


@pytest.mark.parametrize("part", range(4))
def test_the_ego_moves_plausibly(corpora: Path, part: int) -> None:
    found = sorted(
        p for p in corpora.rglob("*.xosc") if p.name not in NEEDS_OTHER_FILES | SCRIPTED_JUMPS
    )
    scenarios = [path for path in found if xosc.load(path).kind == "scenario"][::SAMPLE]
    assert len(scenarios) > 10
    for path in scenarios[part::4]:
        system = Watched()
        result = runner.run(path, sut=system, world="kinematic", max_time=30.0)
        if result.ego is not None:
            scripted = runner.run(path, sut="none", world="kinematic", max_time=30.0)
            check(path.name, track(result, result.ego), track(scripted, result.ego), system.braked)


def check(
    name: str, ego: dict[str, np.ndarray], scripted: dict[str, np.ndarray], braked: list[float]
) -> None:
    dt, speed = np.diff(ego["time"]), np.abs(ego["speed"])
    way = np.hypot(np.diff(ego["x"]), np.diff(ego["y"]))
    assert np.all(way <= np.maximum(speed[1:], speed[:-1]) * dt + 0.2), f"{name}: the ego jumps"
    assert (
        np.abs(ego["lane_offset"]).max() <= max(np.abs(scripted["lane_offset"]).max(), 0.5) + 0.1
    ), f"{name}: the ego leaves its lane"
    rows = np.searchsorted(ego["time"], np.array(braked) - 1e-9)
    rows = rows[rows + 1 < len(speed)]
    slower = speed[rows + 1] < speed[rows]
    assert np.all(slower | (speed[rows] == 0.0)), f"{name}: the ego does not brake"
