"""SUMO as the world: what its traffic sees, how its driver drives the ego, and
that it leaves nothing behind.
"""

from __future__ import annotations

import itertools
import math
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import libsumo
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import runner
import xodr
from runner.engine.participants.declaration import BoundingBox
from runner.engine.participants.entity import Entity
from runner.engine.worlds import sumo, sumo_simulation
from runner.engine.worlds.base import DriverRequest
from runner.engine.worlds.sumo_translation import link_state
from schemas.common.errors import Unsupported, UsageError
from tests.conformance.support import at, events, track
from tests.runner.files import ROADS, car, place, scenario, speed_action, story
from tests.runner.scene import vehicle
from xodr.builders import four_way_intersection

LINEAR = 'dynamicsShape="linear" dynamicsDimension="time" value="3"'
LANE_CHANGE = (
    f"<PrivateAction><LateralAction><LaneChangeAction><LaneChangeActionDynamics {LINEAR}/>"
    "<LaneChangeTarget><AbsoluteTargetLane "
    'value="-2"/></LaneChangeTarget></LaneChangeAction></LateralAction></PrivateAction>'
)


def controller(longitudinal: bool, lateral: bool) -> str:
    """A PrivateAction that activates or deactivates the controller in both domains."""
    domains = f'longitudinal="{str(longitudinal).lower()}" lateral="{str(lateral).lower()}"'
    return (
        "<PrivateAction><ControllerAction><ActivateControllerAction "
        f"{domains}/></ControllerAction></PrivateAction>"
    )


def teleport(s: float) -> str:
    """A PrivateAction that puts its actor somewhere in lane -1."""
    where = f'<LanePosition roadId="1" laneId="-1" s="{s}"/>'
    return f"<PrivateAction><TeleportAction><Position>{where}</Position></TeleportAction></PrivateAction>"


def visibility(traffic: str) -> str:
    """A PrivateAction that hides its actor from traffic, or shows it."""
    return (
        '<PrivateAction><VisibilityAction graphics="true" sensors="true" '
        f'traffic="{traffic}"/></PrivateAction>'
    )


def run(
    folder: Path, init: str, events: Any = (), stop: float = 20.0, **options: Any
) -> runner.RunResult:
    """Run Ego and Lead with these initial actions, and events of the Ego, driven by SUMO."""
    path = scenario(
        folder,
        init=init,
        stories=story("Ego", events),
        stop=stop,
        road=options.pop("road", "straight"),
    )
    return runner.run(path, **{"sut": "sumo", "timestep": 0.05, **options})


def steps(columns: dict[str, np.ndarray]) -> np.ndarray:
    """How far a participant moved in each step."""
    return np.hypot(np.diff(columns["x"]), np.diff(columns["y"]))


# the simulator ------------------------------------------------------------------------------


@pytest.fixture
def world() -> Any:
    """SUMO on the straight road of the conformance tests."""
    world = sumo.SumoWorld()
    world.open(xodr.load(ROADS / "straight.xodr"), 0.05, 0)
    yield world
    world.close()


def entity(x: float, y: float, h: float = 0.0, **more: Any) -> Entity:
    """A car at a pose."""
    return vehicle("Car", x=x, y=y, h=h, placed=True, **more)


def seen(world: sumo.SumoWorld, participant: Entity) -> tuple[str, float, float]:
    """Lane, lane position and angle that SUMO has a participant at."""
    vehicle, name = libsumo.vehicle, world.begin()._shown[participant].id
    return vehicle.getLaneID(name), vehicle.getLanePosition(name), vehicle.getAngle(name)


@pytest.mark.parametrize(
    ("x", "y", "h", "lane", "position", "angle"),
    [
        (100.0, -1.75, 0.0, "1/0+_2", 104.0, 90.0),
        (100.0, -5.25, 0.0, "1/0+_1", 104.0, 90.0),
        (100.0, 1.75, math.pi, "1/0-_2", 1000.0 - 96.0, 270.0),
        (100.0, 40.0, 0.0, "", None, 90.0),
        (1e9, -1e9, math.pi / 2, "", None, 0.0),
    ],
)
def test_sumo_sees_a_scripted_participant_by_its_front_bumper(
    world: sumo.SumoWorld,
    x: float,
    y: float,
    h: float,
    lane: str,
    position: float | None,
    angle: float,
) -> None:
    participant = entity(x, y, h)
    world.add(participant)
    world.mirror([participant])
    world.step()
    found = seen(world, participant)
    assert found[0] == lane
    assert position is None or found[1] == pytest.approx(position, abs=1e-6)
    assert found[2] == pytest.approx(angle)


@pytest.mark.parametrize("h", [1e18, -1e308])
def test_an_angle_of_any_number_of_turns_is_taken_at_once(world: sumo.SumoWorld, h: float) -> None:
    participant = entity(100.0, -1.75, h)
    world.add(participant)
    world.mirror([participant])
    world.step()
    assert math.cos(
        math.radians(90.0 - seen(world, participant)[2]) - math.remainder(h, math.tau)
    ) == pytest.approx(1.0)


def test_participants_come_and_go_at_any_time(world: sumo.SumoWorld) -> None:
    first, second = entity(100.0, -1.75), entity(200.0, -1.75)
    for present in ([first], [first, second], [second], [], [second, first]):
        for participant in (first, second):
            (world.add if participant in present else world.remove)(participant)
        world.mirror([first, second])
        world.step()
        world.begin()
        assert len(libsumo.vehicle.getIDList()) == len(present)


def test_names_that_sumo_does_not_take_are_fine(world: sumo.SumoWorld) -> None:
    names = ("a b", "ü", "<&>", "", "a b")
    everyone = [vehicle(name, x=100.0, y=-1.75, placed=True) for name in names]
    for participant in everyone:
        world.add(participant)
    world.mirror(everyone)
    world.step()
    world.begin()
    assert len(libsumo.vehicle.getIDList()) == len(everyone)


@pytest.mark.parametrize(
    "category",
    ["car", "pedestrian", "obstacle", "bicycle", "semitrailer", "tram", "wheelchair", "anything"],
)
def test_every_kind_of_participant_is_shown_where_it_is(
    world: sumo.SumoWorld, category: str
) -> None:
    participant = vehicle(
        "it", BoundingBox(0, 0, 0, 0, 0, 0), category, x=100.0, y=-1.75, placed=True
    )
    world.add(participant)
    world.mirror([participant])
    world.step()
    assert seen(world, participant)[0] == "1/0+_2"


@given(
    st.floats(-1e5, 1e5),
    st.floats(-1e5, 1e5),
    st.floats(-10.0, 10.0),
    st.floats(-3.0, 10.0),
    st.floats(-1.0, 1.0),
)
def test_bumper_and_reference_point_are_converted_both_ways(
    x: float, y: float, h: float, ahead: float, aside: float
) -> None:
    shown = sumo_simulation._Shown("it", ahead, aside)
    back = sumo_simulation._reference(shown, *sumo_simulation._front(shown, x, y, h))
    assert back[:2] == pytest.approx((x, y), abs=1e-6)
    assert math.remainder(back[2] - h, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_an_entity_is_driven_only_where_sumo_has_a_lane_for_it(world: sumo.SumoWorld) -> None:
    assert world.drive(entity(100.0, -1.75))
    assert not world.drive(entity(100.0, -1.75, math.pi))  # against the traffic
    assert not world.drive(entity(100.0, -8.0))  # on the sidewalk
    assert not world.drive(entity(100.0, 30.0))  # off the road


def test_a_driven_participant_that_leaves_is_not_read_any_more(world: sumo.SumoWorld) -> None:
    participant = entity(980.0, -1.75, speed=20.0)
    assert world.drive(participant)
    world.ask(participant, DriverRequest(20.0))
    world.step()
    readings = []
    while (reading := world.read(participant)) is not None:
        readings.append(reading)
        world.step()
    assert readings[0].x == pytest.approx(981.0)
    assert readings[0].speed == pytest.approx(20.0)
    assert readings[-1].x == pytest.approx(996.0, abs=1.1)
    world.remove(participant)


def test_one_that_its_first_step_leads_off_the_road_has_left(world: sumo.SumoWorld) -> None:
    participant = entity(100.0, -1.75, speed=1e6)
    assert world.drive(participant)
    world.step()
    assert world.read(participant) is None
    world.mirror([participant])
    world.step()


# when SUMO begins ---------------------------------------------------------------------------


class Shown(NamedTuple):
    """What two participants and a signal do before one of them is handed over: one tuple a step."""

    there: tuple[bool, bool]
    ways: tuple[float, float]
    visible: bool
    signal: str


@pytest.fixture(scope="module")
def lights(tmp_path_factory: pytest.TempPathFactory) -> xodr.RoadNetwork:
    """Four arms with lights."""
    return xodr.load(
        four_way_intersection(signals=True, arm=120.0).write(
            tmp_path_factory.mktemp("map") / "crossing.xodr"
        )
    )


def handed_over(network: xodr.RoadNetwork, steps: list[Shown], begins: int | None) -> list[Any]:
    """How SUMO drives the first participant after these steps, with SUMO begun
    before one of them, or when it has to.
    """
    poses = [
        network.pose(xodr.RoadPoint("1", s, network.road("1").lane_t(s, 1), 1, 0.0))
        for s in (80.0, 60.0)
    ]
    world, both = (
        sumo.SumoWorld(),
        [entity(pose.x, pose.y, pose.h + math.pi, speed=10.0) for pose in poses],
    )
    world.open(network, 0.05, 0)
    try:
        for number, shown in enumerate(steps):
            if number == begins:
                world.begin()
            for participant, there, way in zip(both, shown.there, shown.ways, strict=True):
                participant.active = there
                (world.add if there else world.remove)(participant)
                participant.x += way * math.cos(participant.h)
                participant.y += way * math.sin(participant.h)
            both[1].visible = {"traffic": shown.visible}
            world.show(both[1], shown.visible)
            world.signal("1", shown.signal)
            world.mirror(both)
            world.step()
        driven = world.drive(both[0])
        readings: list[Any] = [driven]
        for _ in range(200 if driven else 0):
            world.step()
            readings.append(world.read(both[0]))
        vehicle = libsumo.vehicle
        return [
            *readings,
            *(
                (each, vehicle.getPosition(each), vehicle.getSpeed(each))
                for each in sorted(vehicle.getIDList())
            ),
        ]
    finally:
        world.close()


@settings(max_examples=25)
@given(
    st.lists(
        st.builds(
            Shown,
            st.tuples(st.booleans(), st.booleans()),
            st.tuples(st.floats(0.0, 1.5), st.floats(-1.0, 2.5)),
            st.booleans(),
            st.sampled_from(["red", "green", "off"]),
        ),
        min_size=1,
        max_size=40,
    )
)
def test_sumo_that_begins_late_is_where_it_would_have_been(
    lights: xodr.RoadNetwork, steps: list[Shown]
) -> None:
    late = handed_over(lights, steps, None)
    assert late == handed_over(lights, steps, 0)
    assert late == handed_over(lights, steps, len(steps) // 2)


def test_a_long_run_shows_sumo_its_latest_places_at_their_time(
    monkeypatch: pytest.MonkeyPatch, world: sumo.SumoWorld
) -> None:
    monkeypatch.setattr(sumo, "_MOST", 8)
    participant, gone = entity(50.0, 0.0, speed=10.0), entity(80.0, 0.0, speed=10.0)
    world.add(participant)
    world.add(gone)
    for number in range(60):
        participant.x += 1.0
        if number == 5:
            world.remove(gone)
        world.mirror([participant, gone] if number < 5 else [participant])
        world.step()
        assert world.simulation is None
    world.begin()
    import libsumo

    assert libsumo.simulation.getTime() == pytest.approx(60 * libsumo.simulation.getDeltaT())
    assert len(libsumo.vehicle.getIDList()) == 1
    assert seen(world, participant)[1] == pytest.approx(
        110.0 + participant.box.x + participant.box.length / 2, abs=0.1
    )


def test_a_light_that_turned_before_sumo_began_counts(lights: xodr.RoadNetwork) -> None:
    red, green = (
        handed_over(lights, [Shown((True, False), (0.5, 0.0), True, state)], None)
        for state in ("red", "green")
    )
    assert red[-2].speed < 1.0 < green[-2].speed


def test_a_run_is_the_same_whenever_sumo_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    init = place("Ego", 100, 20, more=controller(False, False)) + place("Lead", 200, 5)
    path = scenario(
        tmp_path, init=init, stories=story("Ego", [(2.0, controller(True, True))]), stop=10.0
    )
    result = runner.run(path, sut="sumo", timestep=0.05)
    assert at(track(result, "Ego"), 1.9, "x") == pytest.approx(138.0)
    assert at(track(result, "Ego"), 10.0, "speed") < 10.0  # it brakes as no one has scripted
    opened = sumo.SumoWorld.open

    def at_once(world: sumo.SumoWorld, *arguments: Any) -> str:
        remark = opened(world, *arguments)
        world.begin()
        return remark

    monkeypatch.setattr(sumo.SumoWorld, "open", at_once)
    assert runner.run(path, sut="sumo", timestep=0.05).trajectories.equals(result.trajectories)


def test_sumo_is_not_started_for_a_run_in_which_it_drives_no_one(tmp_path: Path) -> None:
    program = (
        "import sys, runner; result = runner.run(sys.argv[1], sut='cas', timestep=0.05); "
        "print(result.settings['world'], result.status, 'libsumo' in sys.modules)"
    )
    answer = subprocess.run(
        [sys.executable, "-c", program, str(scenario(tmp_path))],
        capture_output=True,
        text=True,
        check=True,
    )
    assert answer.stdout.split() == ["sumo", "completed", "False"]


def test_a_second_run_on_sumo_is_refused_while_one_is_open(tmp_path: Path) -> None:
    path = scenario(tmp_path)
    with runner.Session(path), pytest.raises(UsageError, match="close it"):
        runner.Session(path)
    with runner.Session(path, sut="sumo") as session:
        session.step()


def test_runs_leave_no_trace(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    path = scenario(tmp_path / "in")
    monkeypatch.chdir(tmp_path)
    tables = [runner.run(path, sut="sumo").trajectories for _ in range(3)]
    assert tables[0].equals(tables[1])
    assert tables[0].equals(tables[2])
    assert list(tmp_path.iterdir()) == [tmp_path / "in"]
    captured = capfd.readouterr()
    assert captured.out == captured.err == ""


def test_scripted_motion_is_the_same_in_every_world(tmp_path: Path) -> None:
    path = scenario(
        tmp_path,
        stories=story("Ego", [(0.5, LANE_CHANGE), (1.0, speed_action(5, LINEAR))]),
        stop=5.0,
    )
    tables = [
        runner.run(path, sut=None, timestep=0.05, world=world).trajectories
        for world in ("sumo", "kinematic")
    ]
    assert tables[0].equals(tables[1])


def test_a_scenario_without_roads_runs(tmp_path: Path) -> None:
    path = scenario(tmp_path)
    text = path.read_text().replace('<LogicFile filepath="straight.xodr"/>', "")
    for lane, x in (("100", "100"), ("${100 + $Gap}", "150")):
        text = text.replace(
            f'<LanePosition roadId="1" laneId="-1" s="{lane}"/>', f'<WorldPosition x="{x}" y="0"/>'
        )
    path.write_text(text)
    result = runner.run(path, sut="sumo", timestep=0.05)
    assert at(track(result, "Ego"), 2.0, "x") == pytest.approx(140.0)
    assert "can't be driven" in events(result, "world", "Ego")[0].text


# SUMO's driver as the ego -------------------------------------------------------------------


def test_the_driver_has_the_scripted_speed_also_above_the_limit(tmp_path: Path) -> None:
    ego = track(
        run(tmp_path, place("Ego", 100, 35), [(5.0, speed_action(20, LINEAR))], stop=20.0), "Ego"
    )
    assert at(ego, 4.9, "speed") == pytest.approx(35.0)
    assert at(ego, 15.0, "speed") == pytest.approx(20.0)
    assert np.all(np.abs(np.diff(ego["speed"])) <= 9.0 * 0.05 + 1e-6)


def test_without_a_scripted_speed_the_driver_goes_by_the_limit(tmp_path: Path) -> None:
    init = place("Ego", 100, 0).replace(speed_action(0), "")
    assert at(track(run(tmp_path, init, stop=25.0), "Ego"), 24.0, "speed") == pytest.approx(
        100 / 3.6, abs=0.01
    )


def test_a_scripted_stop_is_kept(tmp_path: Path) -> None:
    ego = track(run(tmp_path, place("Ego", 100, 0), stop=5.0), "Ego")
    assert at(ego, 5.0, "x") == pytest.approx(100.0, abs=0.01)


@pytest.mark.parametrize("speed", [0, 6])
def test_the_driver_neither_runs_into_others_nor_jumps(tmp_path: Path, speed: float) -> None:
    blocked = car("Second").replace('name="Second"', 'name="Lead2"')
    init = place("Ego", 100, 25) + place("Lead", 300, speed) + place("Lead2", 310, speed, lane=-2)
    path = scenario(tmp_path, entities=[car("Ego"), car("Lead"), blocked], init=init, stop=30.0)
    result = runner.run(path, sut="sumo", timestep=0.05)
    ego = track(result, "Ego")
    assert not events(result, "collision")
    assert at(ego, 30.0, "speed") == pytest.approx(speed, abs=0.5)
    assert steps(ego).max() <= 25.0 * 0.05 + 1e-3


def test_the_driver_overtakes_without_sliding(tmp_path: Path) -> None:
    result = run(
        tmp_path, place("Ego", 100, 25, lane=-2) + place("Lead", 200, 8, lane=-2), stop=25.0
    )
    ego = track(result, "Ego")
    assert not events(result, "collision")
    assert at(ego, 25.0, "x") > at(track(result, "Lead"), 25.0, "x")
    assert ego["y"].max() > -2.0  # through the left lane
    assert np.abs(np.diff(ego["y"])).max() < 0.15
    assert np.abs(np.diff(ego["h"])).max() < 0.05


@pytest.mark.parametrize(("traffic", "hit"), [("true", False), ("false", True)])
def test_a_participant_hidden_from_traffic_is_run_into(
    tmp_path: Path, traffic: str, hit: bool
) -> None:
    result = run(
        tmp_path, place("Ego", 100, 20) + place("Lead", 200, 0, more=visibility(traffic)), stop=8.0
    )
    assert bool(events(result, "collision")) == hit


def test_a_participant_can_be_hidden_and_shown_at_any_time(tmp_path: Path) -> None:
    init = place("Ego", 100, 0) + place("Lead", 200, 0)
    stages = [
        (1.0, visibility("false")),
        (2.0, visibility("true")),
        (3.0, visibility("true")),
        (4.0, visibility("false")),
    ]
    path = scenario(tmp_path, init=init, stories=story("Lead", stages), stop=5.0)
    assert runner.run(path, sut="sumo", timestep=0.05).status == "completed"


def test_the_ego_itself_can_not_be_hidden_from_the_traffic_that_drives_it(tmp_path: Path) -> None:
    with pytest.raises(Unsupported, match="can't be hidden"):
        run(tmp_path, place("Ego", 100, 20), [(1.0, visibility("false"))])


def test_a_scripted_lane_change_is_driven_as_scripted_and_then_handed_back(tmp_path: Path) -> None:
    result = run(tmp_path, place("Ego", 100, 20), [(2.0, LANE_CHANGE)], stop=12.0)
    ego = track(result, "Ego")
    assert at(ego, 2.0, "y") == pytest.approx(-1.75, abs=0.01)
    assert at(ego, 3.5, "y") == pytest.approx(-3.5, abs=0.1)
    assert at(ego, 5.1, "y") == pytest.approx(-5.25, abs=0.02)
    assert steps(ego).max() <= 20.0 * 0.05 + 1e-3
    assert np.abs(np.diff(ego["y"])).max() < 0.06
    assert np.all(np.abs(ego["speed"] - 20.0) < 0.01)


def test_controller_activation_hands_the_ego_over_and_back(tmp_path: Path) -> None:
    stages = [(2.0, controller(True, True)), (6.0, controller(False, False))]
    ego = track(
        run(tmp_path, place("Ego", 100, 20) + place("Lead", 200, 5), stages, stop=12.0), "Ego"
    )
    assert np.all(ego["speed"][ego["time"] < 2.0] == 20.0)
    assert np.all(np.abs(np.diff(ego["speed"])) <= 9.0 * 0.05 + 1e-6)
    assert at(ego, 12.0, "speed") == pytest.approx(
        20.0
    )  # scripted again, reached by no more than 3.5 m/s²
    assert steps(ego).max() <= 20.0 * 0.05 + 1e-3


def test_the_longitudinal_domain_alone_keeps_the_lane(tmp_path: Path) -> None:
    init = place("Ego", 100, 25, more=controller(True, False)) + place("Lead", 250, 5)
    result = run(tmp_path, init, stop=25.0)
    ego = track(result, "Ego")
    assert np.all(np.abs(ego["y"] + 1.75) < 0.01)
    assert at(ego, 25.0, "speed") == pytest.approx(5.0, abs=0.5)
    assert not events(result, "collision")


def test_the_lateral_domain_alone_keeps_the_scripted_speed(tmp_path: Path) -> None:
    init = place("Ego", 100, 25, more=controller(False, True)) + place("Lead", 200, 24)
    ego = track(run(tmp_path, init, stop=15.0), "Ego")
    assert np.all(np.abs(ego["speed"] - 25.0) < 1e-6)


def test_a_teleport_moves_the_ego_under_sumo_too(tmp_path: Path) -> None:
    ego = track(run(tmp_path, place("Ego", 100, 20), [(2.0, teleport(500))], stop=4.0), "Ego")
    jumps = np.flatnonzero(steps(ego) > 2.0)
    assert len(jumps) == 1
    assert ego["x"][jumps[0] + 1] == pytest.approx(500.0, abs=0.01)
    assert np.all(np.abs(ego["speed"] - 20.0) < 0.01)


def test_at_the_end_of_the_roads_the_ego_goes_on_as_scripted_and_stands(tmp_path: Path) -> None:
    result = run(tmp_path, place("Ego", 900, 20), stop=10.0)
    ego = track(result, "Ego")
    assert events(result, "left", "Ego")
    assert at(ego, 10.0, "x") == pytest.approx(1000.0)
    assert at(ego, 10.0, "speed") == 0.0
    assert steps(ego).max() <= 20.0 * 0.05 + 1e-3
    assert steps(ego)[ego["x"][1:] < 999.0] == pytest.approx(20.0 * 0.05)


def test_a_scripted_speed_backwards_is_driven_as_scripted(tmp_path: Path) -> None:
    result = run(tmp_path, place("Ego", 500, -5), [(4.0, speed_action(10, LINEAR))], stop=12.0)
    ego = track(result, "Ego")
    assert at(ego, 4.0, "x") == pytest.approx(480.0)
    assert at(ego, 12.0, "speed") == pytest.approx(10.0)
    assert steps(ego).max() <= 10.0 * 0.05 + 1e-3
    assert not events(result, "left")


@pytest.mark.parametrize("road", ["curve", "straight_lht"])
def test_the_driver_keeps_to_its_lane_on_curves_and_in_left_hand_traffic(
    tmp_path: Path, road: str
) -> None:
    lane = 1 if road == "straight_lht" else -1
    ego = track(run(tmp_path, place("Ego", 20, 10, lane=lane), stop=8.0, road=road), "Ego")
    assert set(ego["lane_id"]) == {lane}
    assert np.abs(ego["lane_offset"]).max() < 0.15
    assert at(ego, 8.0, "s") == pytest.approx(
        100.0, rel=0.05
    )  # SUMO gives the lanes of a curve one length


def test_the_driver_drives_at_small_time_steps_but_not_in_fractions_of_a_millisecond(
    tmp_path: Path,
) -> None:
    assert at(
        track(run(tmp_path, place("Ego", 100, 20), stop=1.0, timestep=0.01), "Ego"), 1.0, "x"
    ) == pytest.approx(120.0)
    with pytest.raises(UsageError, match="milliseconds"):
        run(tmp_path, place("Ego", 100, 20), stop=1.0, timestep=0.0125)


def test_a_world_without_drivers_refuses_the_system(tmp_path: Path) -> None:
    with pytest.raises(Unsupported, match=r"\.xosc:\d+: Vehicle: .*no driver of its own for 'Ego'"):
        run(tmp_path, place("Ego", 100, 20), world="kinematic")


# junctions ----------------------------------------------------------------------------------


def crossing(folder: Path, *privates: str, route_to: str = "") -> runner.RunResult:
    """Run on an intersection whose arms 1 to 4 lie east, north, west and south;
    the Ego comes from the east.
    """
    four_way_intersection(arm=150.0).write(folder / "crossing.xodr")
    way = "".join(
        f'<Waypoint routeStrategy="shortest"><Position><LanePosition roadId="{road}" '
        f'laneId="{lane}" s="100"/></Position>'
        "</Waypoint>"
        for road, lane in (("1", 1), (route_to, -1))
    )
    assign = (
        '<PrivateAction><RoutingAction><AssignRouteAction><Route name="way" '
        f'closed="false">{way}</Route></AssignRouteAction>'
        "</RoutingAction></PrivateAction>"
    )
    init = place("Ego", 140, 10, lane=1, more=assign if route_to else "") + "".join(privates)
    entities = [car(name) for name in ("Ego", "Lead")[: 1 + len(privates)]]
    path = scenario(folder, entities=entities, init=init, stop=35.0, road="crossing")
    return runner.run(path, sut="sumo", timestep=0.05)


@pytest.mark.parametrize(("route_to", "arm"), [("", "3"), ("2", "2"), ("3", "3"), ("4", "4")])
def test_the_driver_takes_its_route_or_the_straightest_way(
    tmp_path: Path, route_to: str, arm: str
) -> None:
    ego = track(crossing(tmp_path, route_to=route_to), "Ego")
    assert ego["road_id"][-1] == arm
    assert steps(ego).max() < 10.0 * 0.05 + 0.01
    assert np.abs(np.diff(np.unwrap(ego["h"]))).max() < 0.1


def test_the_driver_yields_to_a_scripted_participant_that_crosses(tmp_path: Path) -> None:
    other = place("Lead", 140, 10, lane=1).replace('roadId="1"', 'roadId="2"')
    result = crossing(tmp_path, other)
    assert not events(result, "collision")
    ego = track(result, "Ego")
    assert ego["speed"][ego["time"] < 20.0].min() < 6.0
    assert ego["road_id"][-1] == "3"


# traffic lights -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("states", "link"),
    [
        (("red", "Red", "TRAFFIC_LIGHT_RED", "on;off;off", "on; off"), "r"),
        (("yellow", "amber", "off;on;off"), "y"),
        (("redYellow", "red-amber", "on;on;off"), "u"),
        (("green", "off;off;on", "off;on "), "g"),
        (("flashing yellow", "off;flashing;off"), "o"),
        (("off", "", "off;off;off"), ""),
        (("go faster", "7", "red green"), None),
    ],
)
def test_states_are_understood_in_the_words_in_use(
    states: tuple[str, ...], link: str | None
) -> None:
    for state in states:
        assert link_state(state) == link


@pytest.mark.parametrize("lamps", list(itertools.product(("on", "off"), repeat=3)))
def test_every_combination_of_three_lamps_says_something_or_nothing(lamps: tuple[str, ...]) -> None:
    assert (link_state(";".join(lamps)) is None) == (
        lamps in [("on", "off", "on"), ("on", "on", "on")]
    )
