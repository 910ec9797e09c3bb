"""AssignControllerAction, ActivateControllerAction and
OverrideControllerValueAction, with a system under test.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.conformance.support import at, events, run, track


def test_the_system_drives_from_its_activation_on() -> None:
    result = run("ActivateControllerAction", sut="tests.conformance.test_controllers:Gentle")
    ego = track(result, "Ego")
    assert at(ego, 1.9, "speed") == 15.0
    assert at(ego, 4.0, "speed") == pytest.approx(15.0 - 2.0 * 1.0, abs=0.03)


def test_the_scenario_drives_again_after_deactivation() -> None:
    result = run(
        "ActivateControllerAction",
        sut="tests.conformance.test_controllers:Gentle",
        parameters={"Off": 4},
    )
    assert at(track(result, "Ego"), 6.0, "speed") == 15.0


def test_assigning_a_controller_activates_it_only_where_asked() -> None:
    active = run("AssignControllerAction", sut="tests.conformance.test_controllers:Gentle")
    assert at(track(active, "Ego"), 4.0, "speed") == pytest.approx(13.0, abs=0.03)
    passive = run(
        "AssignControllerAction",
        sut="tests.conformance.test_controllers:Gentle",
        parameters={"Activate": "false"},
    )
    assert at(track(passive, "Ego"), 4.0, "speed") == 15.0


def test_a_brake_override_takes_the_pedal_until_it_is_released() -> None:
    result = run("OverrideControllerValueAction", sut="cas")
    ego = track(result, "Ego")
    braking = (ego["time"] > 1.1) & (ego["time"] < 2.9)
    assert np.allclose(ego["acceleration"][braking], -4.0)
    assert at(ego, 8.0, "speed") == 20.0
    assert [e.text for e in events(result, "override")] == ["Brake 0.5", "Gear 0", "Brake released"]


def test_without_a_system_under_test_overrides_change_nothing() -> None:
    assert set(track(run("OverrideControllerValueAction"), "Ego")["speed"]) == {20.0}


class Gentle:
    """Always brakes with 1 m/s²."""

    def reset(self, ego: object, timestep: float, seed: int) -> None:
        """Nothing to prepare."""

    def control(self, observation: object, dt: float) -> object:
        """A gentle deceleration."""
        from runner.systems import Control

        return Control(acceleration=-1.0, reason="test")
