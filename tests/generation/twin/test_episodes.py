"""The twin does what the interpreter does, for all drivers and manoeuvres that it can play."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from generation.search.outcomes import REFERENCES, Evaluator
from generation.space.logical.library import SCENARIOS
from generation.space.space import Space
from generation.twin.episodes import Twin
from runner.judging.settings import RunSettings
from schemas.common.array_types import FloatArray
from schemas.common.errors import Unsupported

CUT_IN = SCENARIOS / "cut_in_highway.xosc"
MANEUVERS = (
    "cut_in",
    "cut_out",
    "lane_change_left",
    "lane_change_right",
    "car_following",
    "braking_leader",
    "congestion",
    "free_cruise",
)


def spaced(path: Path) -> Space:
    return Space.of(path, free=["Lead_Jerk_mps3"] if path.stem.startswith("braking_leader") else [])


@pytest.mark.parametrize("name", MANEUVERS)
def test_episodes_are_those_of_the_interpreter(name: str) -> None:
    path = SCENARIOS / f"{name}_highway.xosc"
    space = spaced(path)
    theta = space.draw(6, np.random.default_rng(4))
    with Evaluator(path, space, run=RunSettings(world="kinematic"), processes=1) as evaluate:
        real = evaluate(theta)
    played = Twin(path, space)(theta)
    np.testing.assert_array_equal(played.collision, real.collision)
    np.testing.assert_allclose(played.end_time, real.end_time, atol=1e-6)
    np.testing.assert_allclose(played.max_drac, real.max_drac, rtol=1e-6)
    np.testing.assert_allclose(played.min_ttc, real.min_ttc, rtol=1e-6)
    np.testing.assert_allclose(
        played.clearance, real.clearance, atol=0.2
    )  # boxes that are turned are taken as spans
    np.testing.assert_allclose(played.risk, real.risk, atol=0.05)
    assert not played.error.any()


@pytest.fixture(scope="module")
def close() -> FloatArray:
    """Points where something has to be decided."""
    theta = spaced(CUT_IN).draw(400, np.random.default_rng(7))
    found = theta[Twin(CUT_IN, spaced(CUT_IN))(theta, "none").collision][:8]
    assert len(found) == 8
    return found


def test_several_systems_at_once_do_what_each_does_alone(close: FloatArray) -> None:
    twin, suts = Twin(CUT_IN, spaced(CUT_IN)), ["r157-cc", "aeb", "cas"]
    together = twin.together(suts)
    for points in (close, close[:3]):
        for sut in suts:
            alone, beside = twin(points, sut), together(points, sut)
            for each in fields(alone):
                np.testing.assert_array_equal(
                    getattr(beside, each.name), getattr(alone, each.name), f"{sut}: {each.name}"
                )


@pytest.mark.parametrize("sut", ["none", *REFERENCES.values(), "cas:sensor_range=40,brake=6"])
def test_drivers_decide_as_they_do_alone(sut: str, close: FloatArray) -> None:
    space, twin = spaced(CUT_IN), Twin(CUT_IN, spaced(CUT_IN))
    with Evaluator(CUT_IN, space, run=RunSettings(world="kinematic"), processes=1) as evaluate:
        real = evaluate(close, sut=sut)
    played = twin(close, sut)
    np.testing.assert_array_equal(played.collision, real.collision)
    np.testing.assert_allclose(played.end_time, real.end_time, atol=1e-6)
    np.testing.assert_allclose(played.impact_speed, real.impact_speed, atol=0.3)


def test_outcomes_do_not_depend_on_what_is_played_beside() -> None:
    space = spaced(CUT_IN)
    theta = space.draw(300, np.random.default_rng(2))
    whole, part = Twin(CUT_IN, space)(theta), Twin(CUT_IN, space)(theta[100:110])
    for name in ("collision", "risk", "max_drac", "clearance", "end_time", "conflict"):
        np.testing.assert_array_equal(getattr(whole, name)[100:110], getattr(part, name))


def test_no_points_have_no_outcomes() -> None:
    assert len(Twin(CUT_IN, spaced(CUT_IN))(np.empty((0, len(spaced(CUT_IN).names))))) == 0


@pytest.mark.parametrize(
    "name", ["merging_highway", "cut_in_sharp_curve", "roundabout_entering", "simple_cut_in"]
)
def test_scenarios_that_can_not_be_played_are_refused(name: str) -> None:
    path = SCENARIOS / f"{name}.xosc"
    with pytest.raises(Unsupported):
        Twin(path, Space.of(path))


def test_systems_and_settings_that_can_not_be_played_are_refused() -> None:
    space = spaced(CUT_IN)
    with pytest.raises(Unsupported, match="sumo"):
        Twin(CUT_IN, space, RunSettings(sut="sumo"))
    with pytest.raises(Unsupported, match="no other ego"):
        Twin(CUT_IN, space, RunSettings(ego="CutIn"))
