"""First contacts worked out by hand."""

from __future__ import annotations

import math

import pytest

from runner.judging.measures.contacts import first_impact
from runner.judging.measures.criticality import criticality
from tests.runner.judging.test_criticality import motion


@pytest.mark.parametrize("road", [None, "1"])
@pytest.mark.parametrize(
    ("x", "y", "speed", "sideways", "side", "striking"),
    [
        (20.0, 0.0, 10.0, 0.0, "front", True),  # the ego, at 20 m/s, runs into a slower one
        (-20.0, 0.0, 30.0, 0.0, "rear", False),
        (0.5, 4.0, 20.0, -1.0, "left", False),  # somebody drifts into the ego
        (0.5, -4.0, 20.0, 1.0, "right", False),
        (30.0, 3.0, 10.0, -1.0, "front", True),  # beside it in time, but ahead: cut in, then hit
    ],
)
def test_side_and_striker(
    x: float, y: float, speed: float, sideways: float, side: str, striking: bool, road: str | None
) -> None:
    ego, other = (
        motion("Ego", 0.0, 20.0, road=road),
        motion("Other", x, speed, y=y, sideways=sideways, road=road),
    )
    impact = first_impact(ego, [motion("Far", 500.0, 20.0, road=road), other])
    assert impact is not None
    assert (impact.other, impact.side, impact.striking) == ("Other", side, striking)


def test_an_oncoming_one_that_is_faster_strikes() -> None:
    impact = first_impact(motion("Ego", 0.0, 10.0), [motion("Other", 60.0, 20.0, h=math.pi)])
    assert impact is not None
    assert (impact.side, impact.striking) == ("front", False)
    assert impact.speed == pytest.approx(30.0)


def test_speed_and_time_are_those_of_the_first_contact() -> None:
    ego, wall = motion("Ego", 0.0, 10.0), motion("Wall", 25.05, 0.0)  # 5 m long: a gap of 20.05 m
    impact = first_impact(ego, [wall])
    assert impact is not None
    assert impact.speed == pytest.approx(10.0)
    assert impact.time == pytest.approx(2.1)
    assert criticality(ego, [wall]).conflict == impact.time


def test_without_contact_the_conflict_is_where_the_distance_is_least() -> None:
    ego, other = motion("Ego", 0.0, 20.0), motion("Other", 50.0, 10.0, y=5.0)
    found = criticality(ego, [other])
    assert found.impact is None
    assert found.conflict == pytest.approx(4.5, abs=0.1)  # the boxes are side by side from then on


def test_risk_is_measured_over_a_window_that_is_as_long_for_every_run() -> None:
    long, short = (
        criticality(motion("Ego", 0.0, 20.0, until=end), [motion("Lead", 8.0, 20.0, until=end)])
        for end in (10.0, 1.0)
    )
    assert long.risk("ad-rss") == short.risk("ad-rss") == 1.0
    assert long.risk_before("ad-rss", 10.0, 3.0) == pytest.approx(1.0)
    assert short.risk_before("ad-rss", 1.0, 3.0) == pytest.approx(1.1 / 3.0)
