"""AddEntityAction, DeleteEntityAction, VisibilityAction, LightStateAction and AnimationAction."""

from __future__ import annotations

import pytest

from tests.conformance.support import events, run, track


def test_an_added_entity_appears_at_its_position_and_stands() -> None:
    result = run("AddEntityAction")
    late = track(result, "Late")
    assert late["time"][0] == pytest.approx(2.0, abs=0.011)
    assert set(late["x"]) == {300.0}
    assert events(result, "startTransition", "Drive")[0].time == pytest.approx(3.0, abs=0.03)


def test_a_deleted_entity_is_gone_and_may_be_added_again() -> None:
    short = track(run("DeleteEntityAction"), "Short")
    gaps = [(a, b) for a, b in zip(short["time"], short["time"][1:], strict=False) if b - a > 0.02]
    assert len(gaps) == 1
    assert gaps[0] == (pytest.approx(2.0, abs=0.011), pytest.approx(4.0, abs=0.011))
    assert short["x"][-1] == pytest.approx(560.0, abs=0.2), "it drives on at its 10 m/s"


def test_a_system_under_test_does_not_see_what_is_hidden_from_sensors() -> None:
    assert run("VisibilityAction", sut="cas").verdict.passed is False
    seen = run("VisibilityAction", sut="cas", parameters={"Sensors": "true"})
    assert events(seen, "interventionStart", "Ego")
    assert not events(run("VisibilityAction", sut="cas"), "interventionStart", "Ego")


def test_lights_switch_at_once_and_the_action_lasts_its_transition_time() -> None:
    result = run("LightStateAction")
    assert [e.text for e in events(result, "light")] == ["indicatorLeft flashing", "brakeLights on"]
    assert events(result, "endTransition", "IndicateAction")[0].time == pytest.approx(
        1.5, abs=0.011
    )
    assert events(result, "endTransition", "BrakeAction")[0].time == pytest.approx(1.0, abs=0.011)


def test_an_animation_lasts_its_duration_and_a_loop_for_ever() -> None:
    result = run("AnimationAction")
    assert events(result, "endTransition", "DoorAction")[0].time == pytest.approx(3.0, abs=0.011)
    assert not events(result, "endTransition", "WipeAction")
    assert [e.text for e in events(result, "animation")] == [
        "ComponentAnimation doorFrontLeft started",
        "UserDefinedAnimation wipers started",
    ]
