"""Actions on traffic signals, and that SUMO's traffic obeys them."""

from __future__ import annotations

import functools

import pytest

from schemas.common.errors import InvalidFile
from tests.conformance.support import at, events, track
from tests.conformance.support import run as run_scenario

run = functools.partial(run_scenario, timestep=0.05)
LIGHT = 400.0
FRONT = 4.0
"""From the reference point of the scenarios' vehicles to their front, m."""


@pytest.mark.parametrize(
    ("red", "green"),
    [("red", "green"), ("RED", "Green"), ("on;off;off", "off;off;on"), ("red", "off")],
)
def test_traffic_waits_at_a_red_light_and_goes_when_it_is_green(red: str, green: str) -> None:
    result = run("TrafficSignalStateAction", parameters={"Red": red, "Green": green})
    first = track(result, "Inflow_1")
    assert LIGHT - 5.0 < at(first, 19.9, "x") + FRONT <= LIGHT
    assert at(first, 19.9, "speed") < 0.1
    assert at(first, 30.0, "x") > LIGHT + 20.0
    assert [(event.time, event.text) for event in events(result, "trafficSignal", "1")] == [
        (0.0, red),
        (20.0, green),
    ]


def test_a_state_that_traffic_does_not_understand_is_said_and_holds_nobody() -> None:
    result = run("TrafficSignalStateAction", parameters={"Red": "state 7"})
    assert "not understood" in events(result, "trafficSignal", "1")[0].text
    assert at(track(result, "Inflow_1"), 19.0, "x") > LIGHT


def test_a_signal_that_is_not_there_is_refused() -> None:
    with pytest.raises(InvalidFile, match="not a signal of the road network"):
        run("TrafficSignalStateAction", parameters={"Signal": "99"})


def test_a_controller_goes_on_from_the_phase_that_it_is_sent_to() -> None:
    result = run("TrafficSignalControllerAction")
    first = track(result, "Inflow_1")
    assert at(first, 19.9, "x") + FRONT <= LIGHT
    assert at(first, 30.0, "x") > LIGHT
    assert [(event.time, event.text) for event in events(result, "trafficSignalPhase", "Main")] == [
        (0.0, "stop"),
        (20.0, "go"),
    ]


def test_a_phase_that_the_controller_does_not_have_is_refused() -> None:
    with pytest.raises(InvalidFile, match="not a phase of the traffic signal controller 'Main'"):
        run("TrafficSignalControllerAction", parameters={"Phase": "fly"})
