"""Traffic signal controllers: cycles, delays, states set from outside, and files
that make no sense.
"""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

import xodr
from runner.engine.worlds.surroundings import Phase, SignalController, TrafficSignals
from schemas.common.errors import InvalidFile
from tests.runner.scene import ROADS
from xosc.document.node import Node

GO, CAUTION, STOP = (
    Phase("go", 3.0, {"1": "green"}),
    Phase("caution", 1.0, {"1": "yellow"}),
    Phase("stop", 2.0, {"1": "red"}),
)


def simulation() -> Any:
    lines: list[tuple[str, str, str]] = []
    world = SimpleNamespace(signal=lambda *_: True)
    return SimpleNamespace(
        time=0.0, lines=lines, note=lambda *line: lines.append(line), world=world
    )


@given(st.integers(0, 1000), st.integers(0, 60))
def test_a_cycle_goes_round_from_its_beginning(tenths: int, begin: int) -> None:
    controller = SignalController("c", (GO, CAUTION, STOP), begin / 10)
    elapsed = (tenths - begin) % 60
    expected = "go" if elapsed < 30 else "caution" if elapsed < 40 else "stop"
    phase = controller.at(tenths / 10)
    assert phase is not None and phase.name == expected


def test_an_endless_phase_stays() -> None:
    controller = SignalController("c", (GO, Phase("stop", math.inf, {})))
    assert [controller.at(time).name for time in (0.0, 2.9, 3.0, 1e6)] == [
        "go",
        "go",
        "stop",
        "stop",
    ]  # type: ignore[union-attr]


def test_a_controller_without_phases_has_none() -> None:
    assert SignalController("c", ()).at(1.0) is None


def test_states_follow_the_phases_and_go_to_the_log_once() -> None:
    signals, sim = TrafficSignals((SignalController("c", (GO, CAUTION, STOP)),)), simulation()
    for sim.time in (0.0, 1.0, 3.0, 3.5, 4.0):
        signals.advance(sim)
    assert signals.states == {"1": "red"}
    assert [line for line in sim.lines if line[0] == "trafficSignal"] == [
        ("trafficSignal", "1", "green"),
        ("trafficSignal", "1", "yellow"),
        ("trafficSignal", "1", "red"),
    ]


def test_a_state_set_from_outside_lasts_until_the_next_phase() -> None:
    signals, sim = TrafficSignals((SignalController("c", (GO, CAUTION, STOP)),)), simulation()
    signals.advance(sim)
    signals.set_state(sim, "1", "off")
    sim.time = 2.0
    signals.advance(sim)
    assert signals.states["1"] == "off"
    sim.time = 3.0
    signals.advance(sim)
    assert signals.states["1"] == "yellow"


def test_a_phase_set_from_outside_begins_now_and_the_cycle_goes_on() -> None:
    signals, sim = TrafficSignals((SignalController("c", (GO, CAUTION, STOP)),)), simulation()
    sim.time = 1.0
    signals.set_phase(sim, "c", "stop")
    assert (signals.phases["c"], signals.states["1"]) == ("stop", "red")
    for sim.time, phase in ((2.9, "stop"), (3.0, "go"), (6.0, "caution")):
        signals.advance(sim)
        assert signals.phases["c"] == phase


# from XML -----------------------------------------------------------------------------------


def read(*controllers: str) -> TrafficSignals:
    node = Node(
        etree.fromstring(f"<TrafficSignals>{''.join(controllers)}</TrafficSignals>"),
        Path("test.xosc"),
    )
    return TrafficSignals.from_xml(node, xodr.load(ROADS / "signals.xodr"))


GROUP = '<Phase name="go" duration="3"><TrafficSignalGroupState state="green"/></Phase>'
PHASES = '<Phase name="go" duration="3"/><Phase name="stop" duration="2"/>'


def test_delays_add_up_along_the_references() -> None:
    signals = read(
        f'<TrafficSignalController name="a">{PHASES}</TrafficSignalController>',
        '<TrafficSignalController name="b" delay="1" '
        f'reference="a">{PHASES}</TrafficSignalController>',
        '<TrafficSignalController name="c" delay="2" '
        f'reference="b">{PHASES}</TrafficSignalController>',
    )
    assert [controller.begin for controller in signals.controllers.values()] == [0.0, 1.0, 3.0]


def test_a_group_state_is_that_of_all_signals_of_the_road_network_s_controller() -> None:
    signals, sim = (
        read(f'<TrafficSignalController name="Side">{GROUP}</TrafficSignalController>'),
        simulation(),
    )
    signals.advance(sim)
    assert signals.states == {"2": "green"}


@pytest.mark.parametrize(
    ("controller", "message"),
    [
        ('<TrafficSignalController name="a" delay="-1"/>', "delay"),
        (
            '<TrafficSignalController name="a" delay="1" reference="b"/>',
            "'b' is not a traffic signal controller",
        ),
        ('<TrafficSignalController name="a" delay="1" reference="a"/>', "refers to itself"),
        (
            '<TrafficSignalController name="a"/>' * 2,
            "another traffic signal controller is called 'a'",
        ),
        (
            (
                '<TrafficSignalController name="a"><Phase name="go" '
                'duration="-1"/></TrafficSignalController>'
            ),
            "duration",
        ),
        (
            f'<TrafficSignalController name="a">{GROUP}</TrafficSignalController>',
            "no controller 'a'",
        ),
    ],
)
def test_controllers_that_make_no_sense_are_refused(controller: str, message: str) -> None:
    with pytest.raises(InvalidFile, match=message):
        read(controller)


def at_place(name: str) -> str:
    """The signal that a name of CARLA's stands for, on the road with lights at s
    = 400 m and 500 m.
    """
    network = xodr.load(ROADS / "signals.xodr")
    element = etree.fromstring(f'<TrafficSignalCondition name="{name}"/>')
    return TrafficSignals(network=network).signal(Node(element, Path("carla.xosc")), "name")


@pytest.mark.parametrize(
    ("name", "signal"), [("id=2", "2"), ("2", "2"), ("pos=400.5,8.5", "1"), ("pos=500, 8", "2")]
)
def test_lights_are_named_as_in_files_for_carla(name: str, signal: str) -> None:
    assert at_place(name) == signal


@pytest.mark.parametrize(
    ("name", "reason"),
    [("pos=400,-8", "the nearest is '1'"), ("pos=here", "pos=x,y is expected"), ("id=7", "'7'")],
)
def test_names_of_no_light_are_refused(name: str, reason: str) -> None:
    with pytest.raises(InvalidFile, match=reason):
        at_place(name)
