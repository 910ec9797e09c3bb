"""AcmeCoastAction: v(t) = v₀ − a t, and its refusal."""

from pathlib import Path

import pytest

import xosc_toolchain as xt

SCENARIO = Path(__file__).with_name("coast.xosc")


def played(**parameters: float) -> xt.RunResult:
    return xt.run(SCENARIO, parameters=parameters, sut="none", world="kinematic", road="auto")


def test_the_car_stands_after_speed_over_deceleration() -> None:
    result = played()
    speed = result.recording.tracks["Car"].columns["speed"]
    time = result.recording.tracks["Car"].columns["time"]
    assert speed[time >= 3.0][0] == pytest.approx(20.0 - 4.0 * 2.0, abs=0.3)
    assert result.end_time == pytest.approx(1.0 + 20.0 / 4.0 + 1.0, abs=0.15)


def test_no_deceleration_is_refused_with_its_line() -> None:
    told = r"coast.xosc:\d+: .*AcmeCoastAction: deceleration=0 must be positive"
    with pytest.raises(xt.ToolchainError, match=told):
        played(Deceleration=0)
