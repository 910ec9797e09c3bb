"""Actors are chosen for each action: entities without a place are brought in by the action that places them."""

from __future__ import annotations

from pathlib import Path

import pytest

import runner
from tests.conformance.support import SCENARIOS, at, changed, events, run, track

SPEED = """
              <Action name="SpeedAction">
                <PrivateAction>
                  <LongitudinalAction>
                    <SpeedAction>
                      <SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>
                      <SpeedActionTarget>
                        <AbsoluteTargetSpeed value="10"/>
                      </SpeedActionTarget>
                    </SpeedAction>
                  </LongitudinalAction>
                </PrivateAction>
              </Action>
"""
ADD = (
    """                <GlobalAction>
                  <EntityAction entityRef="Late">
                    <AddEntityAction>""",
    """                    </AddEntityAction>
                  </EntityAction>
                </GlobalAction>
              </Action>
""",
)
TELEPORT = ("<PrivateAction><TeleportAction>", "</TeleportAction></PrivateAction></Action>")
LATE = ('<EntityRef entityRef="Ego"/>', '<EntityRef entityRef="Late"/>')


@pytest.mark.parametrize("placing", [ADD, TELEPORT])
def test_an_entity_drives_in_the_event_that_brings_it_in(placing: tuple[str, str], tmp_path: Path) -> None:
    path = changed(SCENARIOS / "AddEntityAction.xosc", tmp_path, LATE, (ADD[0], placing[0]), (ADD[1], placing[1] + SPEED))
    late = track(runner.run(path, sut=None, timestep=0.01), "Late")
    assert late["time"][0] == pytest.approx(2.0, abs=0.011)
    assert at(late, 5.0, "x") == pytest.approx(300.0 + 10.0 * 3.0, abs=0.2)


def test_what_an_absent_entity_leaves_out_is_in_the_log(tmp_path: Path) -> None:
    path = changed(SCENARIOS / "AddEntityAction.xosc", tmp_path, LATE, (ADD[0], SPEED + '<Action name="AddAction">' + ADD[0]))
    text = path.read_text().replace('<Action name="AddAction">\n' + SPEED, SPEED)
    path.write_text(text)
    result = runner.run(path, sut=None, timestep=0.01)
    assert [e.text for e in events(result, "entity", "Late") if "leaves it out" in e.text]
    assert at(track(result, "Late"), 5.0, "speed") == 0.0


def test_a_trailer_has_its_tractors_speed_from_the_beginning() -> None:
    trailer = track(run("DisconnectTrailerAction", world="kinematic"), "Trailer")
    assert trailer["speed"][0] == 10.0
