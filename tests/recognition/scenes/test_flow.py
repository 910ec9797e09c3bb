"""Roles of lanes that the traffic contradicts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recognition.scenes.flow import by_traffic
from recognition.scenes.lanes import graph
from recognition.scenes.roles import ROLES, LaneRole
from tests.recognition.driving import site
from xodr import builders

MAIN, ON, OFF = (ROLES.index(role) for role in (LaneRole.MAIN, LaneRole.ON_RAMP, LaneRole.OFF_RAMP))


@pytest.mark.parametrize(("ramp", "ends"), [(ON, "first"), (OFF, "last")])
@pytest.mark.parametrize(("through", "is_main"), [(0, False), (1, False), (3, True), (6, True)])
def test_a_ramp_that_carries_through_traffic_is_a_main_lane(
    tmp_path: Path, ramp: int, ends: str, through: int, is_main: bool
) -> None:
    """Six vehicles on it, some of which come from a main lane (on-ramp) or go back to one (off-ramp)."""
    lanes = graph(site(builders.straight_highway(lanes=2, length=300.0), tmp_path).network)
    strips = [number for number, strip in enumerate(lanes.strips) if strip.kind == "driving"][:2]
    track = np.repeat(np.arange(6), 4)
    on_ramp = np.array([False, True, True, True] * 6)
    if ends == "last":
        on_ramp = on_ramp.reshape(6, 4)[:, ::-1].ravel()
    on_ramp[track >= through] = True
    strip, role = np.where(on_ramp, strips[1], strips[0]), np.where(on_ramp, ramp, MAIN)
    found = by_traffic(lanes, track, strip, role)
    assert (found[on_ramp] == MAIN).all() == is_main
    assert is_main or (found == role).all()


def test_few_vehicles_say_nothing(tmp_path: Path) -> None:
    lanes = graph(site(builders.straight_highway(lanes=2, length=300.0), tmp_path).network)
    strip, role = np.array([1, 2] * 2), np.array([MAIN, ON] * 2)
    assert (by_traffic(lanes, np.repeat([0, 1], 2), strip, role) == role).all()
