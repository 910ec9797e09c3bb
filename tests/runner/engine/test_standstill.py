"""Headings of recorded tracks while they stand."""

from __future__ import annotations

import math
import random

import pytest

from runner.engine.motion.paths import Corner, Polyline
from runner.engine.motion.standstill import steadied


def noisy(x: float, count: int, amount: float, seed: int = 1) -> list[Corner]:
    """Corners about (x, 0), each coordinate off by an error (m, standard deviation)."""
    rng = random.Random(seed)
    return [Corner(x + rng.gauss(0.0, amount), rng.gauss(0.0, amount), 0.0) for _ in range(count)]


@pytest.mark.parametrize("amount", [0.001, 0.01, 0.03])
@pytest.mark.parametrize("moving", ["before", "after", "both"])
def test_a_vehicle_keeps_its_heading_while_it_stands(amount: float, moving: str) -> None:
    before = [Corner(float(x), 0.0, 0.0) for x in range(10)] if moving != "after" else []
    after = [Corner(float(x), 0.0, 0.0) for x in range(11, 20)] if moving != "before" else []
    steady = steadied([*before, *noisy(10.0, 30, amount), *after])
    assert steady is not None
    path = Polyline(steady)
    headings = [path.at(0.01 * number * path.length).h for number in range(101)]
    assert max(map(abs, headings)) < 0.12


def test_a_track_that_stands_throughout_has_no_heading() -> None:
    assert steadied(noisy(0.0, 50, 0.01)) is None


@pytest.mark.parametrize("spacing", [0.002, 0.05, 0.15, 1.0])
@pytest.mark.parametrize("radius", [3.0, 10.0, 500.0])
def test_motion_in_short_steps_keeps_its_own_headings(spacing: float, radius: float) -> None:
    angles = [spacing * number / radius for number in range(200)]
    corners = [Corner(radius * math.sin(a), radius * (1.0 - math.cos(a)), 0.0) for a in angles]
    assert steadied(corners) == corners


def test_a_single_short_line_at_a_stop_has_no_heading_of_its_own() -> None:
    corners = [
        Corner(0.0, 0.0, 0.0),
        Corner(10.0, 0.0, 0.0),
        Corner(10.0, 0.003, 0.0),
        Corner(20.0, 0.0, 0.0),
    ]
    steady = steadied(corners)
    assert steady is not None
    assert steady[1].h == pytest.approx(0.0, abs=1e-3)


def test_a_turn_on_the_way_is_followed() -> None:
    corners = [Corner(0.0, 0.0, 0.0), Corner(10.0, 0.0, 0.0), Corner(10.0, 10.0, 0.0)]
    assert steadied(corners) == corners
