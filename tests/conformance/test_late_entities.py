"""Actors are chosen for each action: entities without a place are brought in by
the action that places them.
"""

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
def test_an_entity_drives_in_the_event_that_brings_it_in(
    placing: tuple[str, str], tmp_path: Path
) -> None:
    path = changed(
        SCENARIOS / "AddEntityAction.xosc",
        tmp_path,
        LATE,
        (ADD[0], placing[0]),
        (ADD[1], placing[1] + SPEED),
    )
    late = track(runner.run(path, sut=None, timestep=0.01), "Late")
    assert late["time"][0] == pytest.approx(2.0, abs=0.011)
    assert at(late, 5.0, "x") == pytest.approx(300.0 + 10.0 * 3.0, abs=0.2)


INIT_SPEED = (
    """        </Private>
      </Actions>""",
    """        </Private>
        <Private entityRef="Late">"""
    + SPEED.replace('              <Action name="SpeedAction">', "").replace("</Action>\n", "", 1)
    + """        </Private>
      </Actions>""",
)
INIT_ADD = (
    "      <Actions>\n",
    """      <Actions>
        <GlobalAction><EntityAction entityRef="Late"><AddEntityAction><Position>
          <RelativeLanePosition entityRef="Ego" dLane="0" ds="50"/>
        </Position></AddEntityAction></EntityAction></GlobalAction>
""",
)


def test_an_entity_that_is_placed_later_has_its_initial_speed(tmp_path: Path) -> None:
    late = track(
        runner.run(
            changed(SCENARIOS / "AddEntityAction.xosc", tmp_path, INIT_SPEED),
            sut=None,
            timestep=0.01,
        ),
        "Late",
    )
    assert late["speed"][0] == 10.0 and at(late, 5.0, "x") == pytest.approx(
        300.0 + 10.0 * 3.0, abs=0.2
    )


def test_an_initial_action_adds_an_entity_beside_another_that_is_placed_after_it(
    tmp_path: Path,
) -> None:
    path = changed(SCENARIOS / "AddEntityAction.xosc", tmp_path, INIT_ADD, INIT_SPEED)
    result = runner.run(path, sut=None, timestep=0.01)
    late = track(result, "Late")
    assert (late["time"][0], late["x"][0], late["speed"][0]) == (0.0, 150.0, 10.0)
    assert not any("never appears" in remark for remark in result.remarks)


def test_a_recording_of_an_entity_that_enters_driving_begins_without_an_acceleration(
    tmp_path: Path,
) -> None:
    result = runner.run(
        changed(SCENARIOS / "AddEntityAction.xosc", tmp_path, INIT_SPEED), sut=None, timestep=0.01
    )
    columns = result.recording.tracks["Late"].columns
    assert abs(columns["acceleration"]).max() == 0.0


def swapped(tmp_path: Path) -> Path:
    """The scenario with a SpeedAction of the entity before the action that adds
    it, in one event.
    """
    path = changed(
        SCENARIOS / "AddEntityAction.xosc",
        tmp_path,
        LATE,
        (ADD[0], SPEED + '<Action name="AddAction">' + ADD[0]),
    )
    path.write_text(path.read_text().replace('<Action name="AddAction">\n' + SPEED, SPEED))
    return path


def test_an_entity_is_added_before_actions_of_its_event_that_stand_before(tmp_path: Path) -> None:
    late = track(runner.run(swapped(tmp_path), sut=None, timestep=0.01), "Late")
    assert at(late, 5.0, "x") == pytest.approx(300.0 + 10.0 * 3.0, abs=0.2)


@pytest.mark.parametrize("drives_at", [2, 1])
def test_an_entity_is_added_before_events_of_the_same_step_that_stand_before(
    drives_at: int, tmp_path: Path
) -> None:
    path = swapped(tmp_path)
    split = (
        SPEED
        + f"""
              <StartTrigger><ConditionGroup><Condition name="C" delay="0" conditionEdge="none"><ByValueCondition>
                <SimulationTimeCondition value="{drives_at}" rule="greaterOrEqual"/>
              </ByValueCondition></Condition></ConditionGroup></StartTrigger>
            </Event>
            <Event name="Added" priority="parallel" maximumExecutionCount="1">"""
    )
    path.write_text(path.read_text().replace(SPEED, split))
    result = runner.run(path, sut=None, timestep=0.01)
    left_out = [e.text for e in events(result, "entity", "Late") if "leaves it out" in e.text]
    assert bool(left_out) == (drives_at < 2), (
        "an event of an earlier step finds no entity, and the log says so"
    )
    assert at(track(result, "Late"), 5.0, "speed") == (10.0 if drives_at == 2 else 0.0)
    assert any("'Late' is not there at 1.0" in remark for remark in result.remarks) == (
        drives_at < 2
    )


def test_a_trailer_has_its_tractors_speed_from_the_beginning() -> None:
    trailer = track(run("DisconnectTrailerAction", world="kinematic"), "Trailer")
    assert trailer["speed"][0] == 10.0
