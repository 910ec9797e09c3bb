"""Actions that put an entity somewhere show it there at their time, as at time
0, angles included.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import runner
from tests.conformance.support import at, track
from tests.runner.files import car, place, scenario, speed_action, story

TELEPORT = "<PrivateAction><TeleportAction><Position>{}</Position></TeleportAction></PrivateAction>"
TRAJECTORY = (
    "<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>"
    '<Trajectory name="t" closed="false"><Shape><Polyline>'
    '<Vertex time="0"><Position><WorldPosition x="300" y="-1.75"/></Position></Vertex>'
    '<Vertex time="4"><Position><WorldPosition x="340" y="-1.75"/></Position></Vertex>'
    "</Polyline></Shape></Trajectory></TrajectoryRef>"
    '<TimeReference><Timing domainAbsoluteRelative="absolute" offset="0" '
    'scale="1"/></TimeReference>'
    '<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction>'
    "</PrivateAction>"
)


def play(
    folder: Path, events: str = "", init: str = "", entities: tuple[str, ...] = (), **options: float
) -> runner.RunResult:
    path = scenario(
        folder,
        entities=entities or (car("Ego"),),
        init=init or place("Ego", 100, 10),
        stories=events,
        stop=4.0,
    )
    return runner.run(path, world="kinematic", sut=None, **{"timestep": 0.5, **options})


def test_a_teleport_shows_at_its_time(tmp_path: Path) -> None:
    there = '<LanePosition roadId="1" laneId="-2" s="400"/>'
    ego = track(play(tmp_path, story("Ego", [(2.0, TELEPORT.format(there))])), "Ego")
    assert at(ego, 1.5, "x") == pytest.approx(115.0)
    assert at(ego, 2.0, "x") == pytest.approx(400.0)
    assert at(ego, 2.5, "x") == pytest.approx(405.0)
    assert ego["lane_id"][ego["time"] == 2.0] == [-2]
    assert np.array_equal(ego["time"], 0.5 * np.arange(len(ego["time"])))


def test_a_timed_trajectory_in_mode_position_shows_at_its_time(tmp_path: Path) -> None:
    ego = track(play(tmp_path, story("Ego", [(1.0, TRAJECTORY)]), timestep=1.0), "Ego")
    assert ego["x"][:4] == pytest.approx([100.0, 310.0, 320.0, 330.0])


def test_an_added_entity_is_there_at_its_time(tmp_path: Path) -> None:
    added = (
        '<GlobalAction><EntityAction entityRef="Late"><AddEntityAction><Position>'
        '<LanePosition roadId="1" laneId="-1" s="300"/></Position></AddEntityAction></EntityAction>'
        "</GlobalAction>"
    )
    result = play(tmp_path, story("Ego", [(1.0, added)]), entities=(car("Ego"), car("Late")))
    late = track(result, "Late")
    assert (late["time"][0], late["x"][0]) == (1.0, 300.0)


def test_a_contact_where_a_teleport_leads_begins_at_its_time(tmp_path: Path) -> None:
    there = '<LanePosition roadId="1" laneId="-1" s="301"/>'
    result = play(
        tmp_path,
        story("Ego", [(2.0, TELEPORT.format(there))]),
        place("Ego", 100, 10) + place("Other", 300, 0),
        (car("Ego"), car("Other")),
    )
    assert [e.time for e in result.events if e.kind == "collision"] == [2.0]


def test_pitch_and_roll_hold_while_an_entity_stands(tmp_path: Path) -> None:
    tilted = '<WorldPosition x="200" y="-1.75" z="0" h="0" p="0.3" r="-0.2"/>'
    init = f'<Private entityRef="Ego">{TELEPORT.format(tilted)}</Private>'
    result = play(tmp_path, story("Ego", [(2.0, speed_action(10))]), init)
    ego = track(result, "Ego")
    assert ego["pitch"][:5] == pytest.approx([0.3] * 5)
    assert ego["roll"][:5] == pytest.approx([-0.2] * 5)
    assert ego["pitch"][-1] == ego["roll"][-1] == 0.0
    assert any("pitch and roll hold while the entity stands" in each for each in result.remarks)


def test_a_level_position_has_no_remark_on_angles(tmp_path: Path) -> None:
    level = '<WorldPosition x="200" y="-1.75" z="0" h="0" p="0" r="0"/>'
    init = f'<Private entityRef="Ego">{TELEPORT.format(level)}</Private>'
    assert play(tmp_path, story("Ego", [(2.0, speed_action(10))]), init).remarks == ()
