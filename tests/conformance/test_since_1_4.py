"""Semantics of traffic signals' phases, and traffic made of catalogue entries
and categories of 1.4.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from schemas.common.errors import InvalidFile
from tests.conformance.support import SCENARIOS, at, changed, events, track
from tests.conformance.support import run as run_scenario

LIGHT, FRONT = 400.0, 4.0
"""x of the signal, and way from the reference point to the front, m."""


@pytest.mark.parametrize(
    ("first", "waits"), [("stop", True), ("attention_go", True), ("go", False), ("fallback", False)]
)
def test_traffic_obeys_what_a_phase_means_whatever_its_states_show(first: str, waits: bool) -> None:
    result = run_scenario("Phase", timestep=0.05, parameters={"First": first, "Speed": 0})
    inflow = track(result, "Inflow_1")
    assert (at(inflow, 29.5, "x") + FRONT <= LIGHT) == waits
    assert at(inflow, 44.9, "x") > LIGHT
    assert [each.text for each in events(result, "trafficSignal", "1")] == ["state 1", "state 2"]


@pytest.mark.parametrize("system", ["idm", "r157-cc", "r157-reg", "fsm"])
@pytest.mark.parametrize("first", ["stop", "go"])
def test_systems_under_test_stop_where_semantics_say_so_and_go_on_afterwards(
    system: str, first: str
) -> None:
    ego = track(
        run_scenario("Phase", timestep=0.05, sut=system, parameters={"First": first}), "Ego"
    )
    before = at(ego, 29.5, "x") + FRONT
    assert (LIGHT - 5.0 < before <= LIGHT and at(ego, 29.5, "speed") < 0.1) == (first == "stop")
    assert at(ego, 44.9, "x") > LIGHT + 50.0


@pytest.mark.parametrize(
    ("system", "first", "ran"), [(None, "stop", True), (None, "go", False), ("idm", "stop", False)]
)
def test_a_red_light_that_the_ego_runs_is_reported(
    system: str | None, first: str, ran: bool
) -> None:
    """At 15 m/s from x = 250 it is at the light at x = 400 after 10 s."""
    remarks = run_scenario("Phase", timestep=0.05, sut=system, parameters={"First": first}).remarks
    assert [remark for remark in remarks if "red light" in remark] == (
        ["Ego ran the red light 1 at 10.00 s; the scenario has no criterion for that"]
        if ran
        else []
    )


def test_a_phase_without_states_shows_the_signals_of_the_others_what_it_means(
    tmp_path: Path,
) -> None:
    text = '<TrafficSignalState trafficSignalId="1" state="state 1"/>'
    path = changed(SCENARIOS / "Phase.xosc", tmp_path, (text, ""))
    result = run_scenario(str(path.with_suffix("")), timestep=0.05)
    assert [each.text for each in events(result, "trafficSignal", "1")] == ["red", "state 2"]


def test_semantics_that_there_are_not_are_refused() -> None:
    with pytest.raises(InvalidFile, match="semantics='halt' is not one of"):
        run_scenario("Phase", parameters={"First": "halt"})


@pytest.mark.parametrize("heavy", [0, 1000])
def test_traffic_is_drawn_from_entries_and_from_references_to_catalogues(heavy: int) -> None:
    result = run_scenario("TrafficDistributionEntry", timestep=0.1, parameters={"Heavy": heavy})
    drawn = Counter(
        each.category for name, each in result.recording.tracks.items() if name.startswith("Inflow")
    )
    assert set(drawn) == ({"heavyTruck"} if heavy else {"motorcycle"})
    assert drawn.total() > 10
    assert result.recording.tracks["Ego"].category == "semitractor"
