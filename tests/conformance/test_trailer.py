"""Trailers: coupled, towed along the tractrix of the hitch, and left behind."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.conformance.support import at, run, track

HITCH, COUPLER = -1.0, 3.0


def gap(car: dict[str, np.ndarray], trailer: dict[str, np.ndarray], since: float) -> float:
    """Greatest distance between hitch and coupler from a time on, m."""
    use = car["time"] >= since
    dx = car["x"] + HITCH * np.cos(car["h"]) - trailer["x"] - COUPLER * np.cos(trailer["h"])
    dy = car["y"] + HITCH * np.sin(car["h"]) - trailer["y"] - COUPLER * np.sin(trailer["h"])
    return float(np.hypot(dx, dy)[use].max())


@pytest.mark.parametrize("speed", [10.0, -2.0])
@pytest.mark.parametrize("road", ["straight", "curve"])
def test_a_connected_trailer_stays_on_the_hitch(road: str, speed: float) -> None:
    result = run("ConnectTrailerAction", parameters={"Road": f"../roads/{road}.xodr", "Speed": speed}, world="kinematic")
    car, trailer = track(result, "Car"), track(result, "Trailer")
    assert gap(car, trailer, 1.02) < 1e-9
    assert at(trailer, 5.0, "speed") == pytest.approx(speed)


def test_connecting_moves_the_trailer_to_the_hitch_along_the_line_between_them() -> None:
    result = run("ConnectTrailerAction", world="kinematic")
    trailer = track(result, "Trailer")
    assert (at(trailer, 0.9, "x"), at(trailer, 0.9, "y")) == pytest.approx((190.0, -0.25))
    h = math.atan2(-1.75 - -0.25, 199.0 - 190.0)
    assert at(trailer, 1.5, "h") == pytest.approx(h)
    assert at(trailer, 1.5, "x") == pytest.approx(199.0 - COUPLER * math.cos(h))


def test_a_towed_trailer_lines_up_on_the_straight_and_cuts_the_corner_in_a_curve() -> None:
    straight = track(run("ConnectTrailerAction", world="kinematic"), "Trailer")
    # tractrix: the angle's half tangent decays with exp(−distance / coupler length)
    h = math.atan2(-1.5, 9.0)
    driven = 10.0 * (3.0 - 2.0)
    assert at(straight, 3.0, "h") == pytest.approx(2 * math.atan(math.tan(h / 2) * math.exp(-driven / COUPLER)), abs=2e-4)
    curve = run("ConnectTrailerAction", parameters={"Road": "../roads/curve.xodr"}, world="kinematic")
    car, trailer = track(curve, "Car"), track(curve, "Trailer")
    # steady state on a circle: axle radius² = hitch radius² − coupler², hitch radius² = car radius² + hitch²
    # centre of the road's left arc of curvature 0.01 is at (0, 100); the lane is outside the reference line
    radius = 100.0 + 1.75
    end = [math.hypot(float(columns["x"][-1]), float(columns["y"][-1]) - 100.0) for columns in (car, trailer)]
    assert end[0] == pytest.approx(radius, abs=1e-6)
    assert end[1] == pytest.approx(math.sqrt(radius**2 + HITCH**2 - COUPLER**2), abs=2e-3)


def test_an_inline_trailer_is_an_entity_of_its_own_placed_behind_its_tractor_and_stands_once_disconnected() -> None:
    result = run("DisconnectTrailerAction", world="kinematic")
    car, trailer = track(result, "Car"), track(result, "Trailer")
    assert (trailer["x"][0], trailer["y"][0]) == pytest.approx((200.0 + HITCH - COUPLER, -1.75))
    assert at(trailer, 1.5, "speed") == pytest.approx(10.0)
    assert at(trailer, 3.9, "speed") == 0.0
    assert at(trailer, 3.9, "x") == pytest.approx(216.0, abs=0.11)
    assert at(car, 3.9, "x") == pytest.approx(239.0)
