"""AcmeLaneCondition: true from the moment at which the reference point crosses the line."""

from pathlib import Path

import pytest

import xosc_toolchain as xt

SCENARIO = Path(__file__).with_name("lane.xosc")


def test_it_holds_from_the_middle_of_a_linear_lane_change_on() -> None:
    result = xt.run(SCENARIO, sut="none", world="kinematic", road="auto")
    assert result.end_time == pytest.approx(2.0, abs=0.1)
    assert result.events[-1].text == "There: lane of Car = -1, -1 is asked for"
